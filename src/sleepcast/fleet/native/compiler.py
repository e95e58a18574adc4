"""The compiler: several programs in sequence become one loop over robots, through LLVM; the only module that uses
llvmlite.

Machine code is cached for other processes (`code_cache`), since compiling takes a tenth of a second.

The loop processes as many robots at once as a vector has lanes. A robot's variables are read once and written once,
in place, after all programs; so a robot that met anything exceptional is left unchanged, and walked instead.
Everything is computed in 64-bit floats, without contraction and without fast-math, so the results are those of NumPy
and of the one-robot machine, for any number of lanes and threads.
"""

from __future__ import annotations

import ctypes
from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from copy import copy
from enum import IntEnum
from functools import cache, lru_cache
from hashlib import sha256
from operator import is_
from pathlib import Path
from threading import Lock
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from sleepcast.columns.values import Column, Rows
from sleepcast.core.code_cache import CodeCache, processor, target_machine, version_of
from sleepcast.core.errors import SleepcastError
from sleepcast.core.linking import LinkedCode
from sleepcast.core.model import BodyColumn, HostFunction, NativeCall
from sleepcast.core.records import NamedTuple, dataclass
from sleepcast.core.threads import ThreadPool, borders
from sleepcast.fleet.native import libm
from sleepcast.fleet.native.assembly import Assembly
from sleepcast.fleet.native.lowering import ELEMENTS, Addresses, Lowering, enters, kind_of
from sleepcast.fleet.native.symbols import Meaning, Size, constants, is_called, is_ping
from sleepcast.fleet.state import FleetState
from sleepcast.language.acts import FLAGS
from sleepcast.language.parts import host_of, walk
from sleepcast.language.program import Program
from sleepcast.language.vocabulary import TICK, TIME_SLOT

if TYPE_CHECKING:
    from llvmlite.binding import ModuleRef, TargetMachine

LANES = 8
"""Robots at a time: what the widest vectors hold; for narrower ones, LLVM uses several."""
SPLIT = 500_000
"""Robots times parts from which on threads share the work: below, waiting for each other costs more."""
CALLED = 50
"""Parts that take about as long as one call of a function that senses."""
GRAIN = 64
"""Robots whose one-byte values fill a cache line, which two threads should not share."""

ABSENT, THERE, TROUBLED = range(3)
"""States of a robot in `part`: it takes no part; it does; it met something exceptional and has to be walked."""

Entry: TypeAlias = tuple[str, int | str]
"""One entry of the code's address table: a kind of column and which one, such as its slot, or `tick` or `time`."""


class Moment(IntEnum):
    """What a word of the address table says of the time: the tick as a whole number or as a real one, or s."""

    WHOLE, REAL, TIME = range(3)


class ResultColumns(NamedTuple):
    """Where the results of one program go. fresh: incremented where it matched. steps: None if they are not written."""

    value: Column
    fresh: NDArray[np.uint8]
    steps: NDArray[np.uint16] | None


Asked: TypeAlias = tuple[HostFunction, tuple[float | None, ...]]
"""A function of the robots' own software, and its arguments where they are constants."""


class KnownAnswer(NamedTuple):
    """The cells of what a function has come to, and of the lanes that know it."""

    value: str
    known: str


class Writer:
    """Writes the text of one loop. counted: whether the steps of each program are stored. calls: see `is_native`.

    bodies: the columns of bodies that the code uses, by name. own: the robots' own functions in it. called: those that
    it calls, each with the constants among its arguments. sensing: in how many places. pings: whether
    some of it is a PING.
    """

    def __init__(self, programs: Sequence[Program], names: Meaning, lanes: int, counted: bool, calls: bool) -> None:
        self.a = Assembly(lanes)
        self.entries: dict[Entry, int] = {}
        self.called: list[Asked] = []
        self.sensing = 0
        self._programs, self._names, self._counted, self._calls = programs, names, counted, calls
        self.pings = any(is_ping(part, calls) for each in _all(programs, names) for part in walk(each.root))
        self.own = _own(programs, names) if calls else []
        written = {each.into.name: each.into for function in self.own for each in function.writes}
        flags = [each.unless for function in self.own for each in function.writes if each.unless is not None]
        self._written_bodies = written
        self.bodies: dict[str, BodyColumn] = written | {flag.name: flag for flag in flags}
        self._base = ""
        self._answers: dict[Asked, KnownAnswer] = {}

    def text(self) -> str:
        """The module's text; afterwards `entries` says what the address table holds."""
        a = self.a
        place, bad = a.cell("i64", "%start"), a.cell("i64", "0")
        head, body, done = a.label(), a.label(), a.label()
        a.do(f"br label %{head}")
        a.begin(head)
        here = a.get(place, "i64")
        a.do(f"br i1 {a.emit(f'icmp slt i64 {here}, %stop')}, label %{body}, label %{done}")
        a.begin(body)
        lanes = self._lanes(here)
        with a.when(a.any(lanes)):
            self._body(lanes, bad)
        a.put(place, "i64", a.binary("add", "i64", here, str(a.lanes)))
        a.do(f"br label %{head}")
        a.begin(done)
        a.do(f"ret i64 {a.get(bad, 'i64')}")
        pointers = []
        for (column, which), number in self.entries.items():
            kind = {("tick", ""): "i64", ("time", TICK): "double", ("time", TIME_SLOT): "double"}.get(
                (column, which), "ptr"
            )
            pointers += [f"%q{number} = getelementptr i64, ptr %table, i64 {number}"]
            pointers += [f"%p{number} = load {kind}, ptr %q{number}"]
        start = "define i64 @round(i64 %start, i64 %stop, i64 %count, ptr %table) {\nentry:"
        return "\n".join([*a.outside.values(), start, *a.cells, *pointers, *a.lines, "}", ""])

    def _lanes(self, here: str) -> str:
        """The lanes that take part; the last vector reaches back to robots already processed, which take no part
        again."""
        a = self.a
        room = a.binary("sub", "i64", "%count", str(a.lanes))
        late = a.emit(f"icmp sgt i64 {here}, {room}")
        self._base = a.emit(f"select i1 {late}, i64 {room}, i64 {here}")
        steps = a.each_lane("i64", [str(lane) for lane in range(a.lanes)])
        index = a.binary("add", a.long, a.splat("i64", self._base), steps)
        since = a.emit(f"icmp sge {a.long} {index}, {a.splat('i64', here)}")
        until = a.emit(f"icmp slt {a.long} {index}, {a.splat('i64', '%stop')}")
        there = a.emit(f"icmp eq {a.byte} {self._read('part', '', a.byte)}, {a.integer('i8', THERE)}")
        return a.both(a.both(since, until), there)

    def _body(self, lanes: str, bad: str) -> None:
        a = self.a
        columns = Addresses(a, self._read, self._call)
        for slot in _written(self._programs, self._names):
            columns.written[slot] = (a.cell(a.real, self._read("slot", slot, a.real)), a.cell(a.truth, a.no))
        for name, column in self._written_bodies.items():
            kind = self._vector(kind_of(column))
            columns.moved[name] = (a.cell(kind, self._read(kind_of(column), name, kind)), a.cell(a.truth, a.no))
        if self.pings:
            columns.pinged = (a.cell(a.real, self._read("ping", "", a.real)), a.cell(a.truth, a.no))
        low = Lowering(a, columns, self._names, calls=self._calls)
        for asked in self._asked_again():
            self._answers[asked] = KnownAnswer(a.cell(a.real, a.zero), a.cell(a.truth, a.no))
        chancy = any(program.chancy for program in _all(self._programs, self._names))
        if chancy:
            low.drawn = a.cell(a.whole, self._read("draws", "", a.whole))
        results = []
        for program in self._programs:
            value = a.cell(a.real, low.program(program, lanes))
            results.append((value, low.matched, low.steps))
        trouble = a.both(lanes, a.get(low.trouble, a.truth))
        well = a.both(lanes, a.neither(trouble))
        with a.when(a.any(trouble)):
            part = self._read("part", "", a.byte)
            a.put(self._at("part", ""), a.byte, a.select(trouble, a.integer("i8", TROUBLED), part, a.byte))
            a.put(bad, "i64", "1")
        for slot, (value, where) in columns.written.items():
            self._keep("slot", slot, a.get(value, a.real), a.both(well, a.get(where, a.truth)))
            if slot in columns.actuators:
                self._keep("acted", slot, a.integer("i8", 1), a.both(well, a.get(where, a.truth)))
        for name, (value, where) in columns.moved.items():
            kind = kind_of(self.bodies[name])
            self._keep(kind, name, a.get(value, self._vector(kind)), a.both(well, a.get(where, a.truth)))
        if self.pings:
            caste, where = columns.pinged
            self._keep("ping", "", a.get(caste, a.real), a.both(well, a.get(where, a.truth)))
        if chancy:
            self._keep("draws", "", a.get(low.drawn, a.whole), well)
        for number, (value, matched, steps) in enumerate(results):
            if not self._counted:
                self._give("value", a.get(value, a.real), well)
                self._give("fresh", a.convert("zext", a.truth, a.get(matched, a.truth), a.byte), well)
                continue
            self._keep("value", number, a.get(value, a.real), well)
            self._count(number, a.both(well, a.get(matched, a.truth)))
            if steps:
                self._keep("steps", number, a.convert("trunc", a.whole, a.get(steps, a.whole), a.short), well)

    def _call(
        self, function: HostFunction, constants: tuple[float | None, ...], numbers: Sequence[str], mask: str
    ) -> str:
        """The results of a function of the robots' own software that only senses, called lane by lane; what is asked in
        several places, only in those lanes that do not know it yet."""
        if (function, constants) not in self.called:
            self.called.append((function, constants))
        self.sensing += 1
        which, a = self.called.index((function, constants)), self.a
        function_at, context = self._pointer("function", which), self._pointer("context", which)
        answer = self._answers.get((function, constants))
        if answer is None:
            return a.call_each(function_at, context, self._base, numbers, mask)
        known = a.get(answer.known, a.truth)
        new = a.both(mask, a.neither(known))
        with a.when(a.any(new)):
            found = a.call_each(function_at, context, self._base, numbers, new)
            a.put(answer.value, a.real, a.select(new, found, a.get(answer.value, a.real)))
            a.put(answer.known, a.truth, a.either(known, new))
        return a.get(answer.value, a.real)

    def _asked_again(self) -> list[Asked]:
        """What is asked in several places: it comes to the same all through a round, see `symbols.is_called`."""
        asked: Counter[Asked] = Counter()
        for program in _all(self._programs, self._names) if self._calls else ():
            senses = [part for part in walk(program.root) if part.op == "host" and not host_of(part).acts]
            asked.update((host_of(part), constants(part)) for part in senses if part.slot < 0)
        return [each for each, times in asked.items() if times > 1 and None not in each[1]]

    def _give(self, column: str, value: str, mask: str) -> None:
        """Write a column that has not been written yet."""
        a = self.a
        kind = self._vector(column)
        address = self._at(column, 0)
        some = a.cell(kind, value)
        with a.when(a.any(a.neither(mask))):
            a.put(some, kind, a.select(mask, value, a.get(address, kind), kind))
        a.put(address, kind, a.get(some, kind))

    def _count(self, number: int, matched: str) -> None:
        a = self.a
        with a.when(a.any(matched)):
            more = a.convert("zext", a.truth, matched, a.byte)
            a.put(self._at("fresh", number), a.byte, a.binary("add", a.byte, self._read("fresh", number, a.byte), more))

    def _keep(self, column: str, which: int | str, value: str, mask: str) -> None:
        """Write the new values of a column; skips unchanged ones."""
        a = self.a
        kind = self._vector(column)
        old = self._read(column, which, kind)
        new, was = value, old
        if kind == a.real:
            new, was = (a.convert("bitcast", a.real, x, a.long) for x in (value, old))
        whole = a.long if kind == a.real else kind
        with a.when(a.any(a.both(mask, a.emit(f"icmp ne {whole} {new}, {was}")))):
            a.put(self._at(column, which), kind, a.select(mask, value, old, kind))

    def _vector(self, column: str) -> str:
        return self.a.vector(ELEMENTS[column][0])

    def _read(self, column: str, which: int | str, kind: str) -> str:
        """The lanes of a column, or one number in all of them."""
        a = self.a
        if column == "tick":
            return a.splat("i64", self._pointer(column, which))
        if column == "slot" and which in (TICK, TIME_SLOT):
            return a.splat("double", self._pointer("time", which))
        return a.get(self._at(column, which), kind)

    def _at(self, column: str, which: int | str) -> str:
        return self.a.at(self._pointer(column, which), ELEMENTS[column][0], self._base)

    def _pointer(self, column: str, which: int | str) -> str:
        return f"%p{self.entries.setdefault((column, which), len(self.entries))}"


class Kernel:
    """The native code of some programs in sequence, for robots on which their names have the same meaning.

    bodies: those of the fleet, if it may call the robots' own functions, or do what they do
    kept: whether code that has to be compiled is not wanted

    Raises NotKeptError, or UncompiledError.
    """

    def __init__(
        self,
        programs: Sequence[Program],
        names: Meaning,
        lanes: int,
        *,
        counted: bool = True,
        bodies: object | None = None,
        kept: bool = False,
    ) -> None:
        calls = bodies is not None
        writer = Writer(programs, names, lanes, counted, calls)
        text = writer.text()
        self._columns, self._calls = writer.bodies, writer.called
        self.pings = writer.pings
        """Whether there are pings to be taken after it."""
        self.functions = {each.name for each in writer.own}
        """The names of the robots' own functions in it."""
        self._entries, self._count = list(writer.entries), len(programs)
        sizes = [Size(program, names, calls=calls) for program in programs]
        self.lanes, self.parts = lanes, sum(size.parts for size in sizes) + CALLED * writer.sensing
        self.steps = [size.steps for size in sizes]
        """Largest number of steps of each program."""
        self.entering = [enters(program, names) for program in programs]
        """Whether each program enters others: if not, its number of steps is constant."""
        self._written = frozenset(_written(programs, names))
        self._slots = [which for column, which in self._entries if column == "slot" and isinstance(which, int)]
        self._acted = [which for column, which in self._entries if column == "acted" and isinstance(which, int)]
        self.code = _compiled(text, kept)
        self._begin(bodies, [_bound(bodies, *each) for each in self._calls])

    def _begin(self, bodies: object | None, called: list[NativeCall]) -> None:
        """Be the code of the fleet with these bodies. called: how its functions are called."""
        self._bodies, self.called = bodies, called
        self.prepared = sorted({(each.prepare, each.senses) for each in called})
        """The functions to be called before it, each with the address of its only argument."""
        self._conditions = {each.usable for each in called if each.usable is not None}
        """What has to hold for it to be called."""
        self._bound: tuple[object, ...] = ()
        self._layout = -1
        """`FleetState.layouts` when the table was filled."""
        self._kept: list[NDArray[np.generic]] = []
        """What the table has the addresses of, and nobody else keeps."""
        self.bindings = 0
        """How often the table has been filled: as long as it stays the same, so do the addresses in it."""
        self._table = np.zeros(len(self._entries) + 1, np.int64)
        self.table = self._table.ctypes.data
        """The address of the table that the code gets."""
        for number, (column, which) in enumerate(self._entries):
            if called and column in ("function", "context") and isinstance(which, int):
                call = called[which]
                self._table[number] = call.call if column == "function" else call.context

    def of(self, bodies: object | None) -> Kernel:
        """The same code for another fleet, with these bodies. Raises UncompiledError."""
        other = copy(self)
        other._begin(bodies, [_bound(bodies, *each) for each in self._calls])
        return other

    def unbound(self) -> Kernel:
        """The same code for nobody yet: it holds nothing of this fleet, and can only be made one `of` another."""
        other = copy(self)
        other._begin(None, [])
        return other

    def run(
        self,
        state: FleetState,
        part: NDArray[np.uint8],
        where: range,
        when: tuple[float, float] | None,
        sinks: Sequence[ResultColumns],
        pool: ThreadPool,
    ) -> bool:
        """Evaluate the programs on those of the robots `where` whose `part` is `THERE`.

        when: see `moment`. sinks: one for each program. Robots that have to be walked become `TROUBLED`; returns
        whether there are any.
        """
        start, stop = where.start, where.stop
        possible = state.count >= self.lanes and all(usable() for usable in self._conditions)
        if when is None or not possible or not self.bind(state, part, sinks):
            present = part[start:stop]
            present[present == THERE] = TROUBLED
            return True
        reals = self._table.view(np.float64)
        for number, (column, which) in enumerate(self._entries):
            if column == "time":
                reals[number] = when[which == TIME_SLOT]
            elif column == "tick":
                self._table[number] = int(when[0])
        for prepare, senses in self.prepared:
            PREPARE(prepare)(senses)
        if (stop - start) * self.parts < SPLIT:
            return bool(self.code(start, stop, state.count, self.table))

        def work(first: int, last: int) -> int:
            return self.code(start + first, start + last, state.count, self.table)

        return any(pool.share(work, borders(stop - start, pool.threads, grain=GRAIN)))

    @property
    def actuators(self) -> dict[int, tuple[int, int]]:
        """The actuators that the programs may assign, by slot: the addresses of their values, and of who has assigned
        them. After `bind`."""
        places = {entry: int(self._table[number]) for number, entry in enumerate(self._entries)}
        return {slot: (places["slot", slot], places["acted", slot]) for slot in self._acted}

    @property
    def moments(self) -> list[tuple[int, Moment]]:
        """The addresses of the words of the table that are of the time, each with what it holds."""
        held = {("tick", ""): Moment.WHOLE, ("time", TICK): Moment.REAL, ("time", TIME_SLOT): Moment.TIME}
        return [(self.table + 8 * i, held[entry]) for i, entry in enumerate(self._entries) if entry in held]

    def writes(self, slots: Iterable[int]) -> bool:
        """Whether the programs may assign any of these variables."""
        return not self._written.isdisjoint(slots)

    def bind(self, state: FleetState, part: NDArray[np.uint8], sinks: Sequence[ResultColumns]) -> bool:
        """Fill the address table with the current columns; False if a column has an unexpected type."""
        now = state, part, *sinks
        if self._layout == state.layouts and len(now) == len(self._bound) and all(map(is_, now, self._bound)):
            return True
        for slot in self._slots:
            state.own(slot)
        for slot in self._acted:
            state.assigned(slot)
        nobody = np.zeros(state.count, np.bool_)
        kept: list[NDArray[np.generic]] = [nobody]
        for number, (column, which) in enumerate(self._entries):
            if column in ("tick", "time", "function", "context"):
                continue
            body = column in ("body", "body_real") and isinstance(which, str)
            array = self._columns[str(which)].of(self._bodies) if body else _array(state, part, sinks, column, which)
            array = nobody if array is None else array
            if not array.flags.c_contiguous or array.itemsize != ELEMENTS[column][1] or array.size != state.count:
                return False
            self._table[number] = array.ctypes.data
            kept += [array] if body else []
        self._bound, self._kept, self._layout = now, kept, state.layouts
        self.bindings += 1
        return True


def _array(
    state: FleetState, part: NDArray[np.uint8], sinks: Sequence[ResultColumns], column: str, which: int | str
) -> NDArray[np.generic] | None:
    """A column of the table, None for a group without members."""
    if column == "ping":
        return state.castes()
    if isinstance(which, str):
        by_name: dict[str, NDArray[np.generic] | None]
        by_name = {
            "part": part,
            "keys": state.keys,
            "draws": state.draws,
            "held": state.held,
            "group": state.groups.get(which),
        }
        return by_name[column]
    if column == "slot":
        return state.own(which)
    if column == "acted":
        return state.assigned(which)
    sink = sinks[which]
    return sink.value if column == "value" else sink.fresh if column == "fresh" else sink.steps


PREPARE = ctypes.CFUNCTYPE(None, ctypes.c_void_p)
"""The type of what prepares the robots' senses for calls."""


class UncompiledError(SleepcastError):
    """A function that native code was to call cannot be compiled on this computer, so that its rules are walked."""


class NotKeptError(UncompiledError):
    """Only code that is kept was wanted, and there is none."""


def _bound(bodies: object, function: HostFunction, constants: tuple[float | None, ...]) -> NativeCall:
    """How a function of these bodies is called. Raises UncompiledError."""
    call = None if function.native is None else function.native.bound(bodies, constants)
    if call is None:
        raise UncompiledError(f"{function.name} has no native code here")
    return call


def moment(state: FleetState, rows: Rows) -> tuple[float, float] | None:
    """The tick and the time (s) of these robots, None if they differ."""
    moments = []
    for slot in (TICK, TIME_SLOT):
        values = state.read(slot, rows)
        if not isinstance(values, float):
            if not (values == values[0]).all():
                return None
            values = float(values[0])
        moments.append(values)
    return moments[0], moments[1]


def _all(programs: Sequence[Program], names: Meaning) -> list[Program]:
    """The programs, and those that they enter."""
    return [*programs, *(meant for meant in names.values() if isinstance(meant, Program))]


def _own(programs: Sequence[Program], names: Meaning) -> list[HostFunction]:
    """The robots' own functions that native code of programs calls, or does itself."""
    parts = [part for program in _all(programs, names) for part in walk(program.root) if part.op == "host"]
    return [host_of(part) for part in parts if is_called(part)]


def _written(programs: Sequence[Program], names: Meaning) -> list[int]:
    """The slots that programs may assign."""
    slots = set()
    for program in _all(programs, names):
        for part in walk(program.root):
            if part.op in ("write", "set_user") and part.slot >= 0:
                slots.add(part.slot)
            elif part.op == "act" and part.name in FLAGS:
                slots.add(FLAGS[part.name][0])
    return sorted(slots)


CACHE = CodeCache("rules")
MAX_CODES = 512
"""Functions in memory that fleets of one process share."""
_ONE_AT_A_TIME = Lock()


@dataclass(frozen=True, slots=True)
class NativeCode:
    """A compiled function. address: in memory; owner: keeps it alive."""

    address: int
    function: Callable[[int, int, int, int], int]
    owner: object

    def __call__(self, start: int, stop: int, count: int, table: int) -> int:
        return self.function(start, stop, count, table)


@lru_cache(MAX_CODES)
def _compiled(text: str, kept: bool) -> NativeCode:
    """The function in a module's text, optimised for this processor, or from the cache. kept: only from there. Raises
    NotKeptError."""
    with _ONE_AT_A_TIME:
        name = _name(text, processor())
        code = CACHE.load(name)
        if code is None:
            if kept:
                raise NotKeptError("nobody has compiled this yet")
            code = _object_of(text)
            CACHE.save(name, code)
        called = {symbol: libm.address(each) or 0 for each in libm.NAMES if (symbol := libm.symbol(each)) in text}
        loop = LinkedCode((code,), called)
    address = loop.address("round")
    types = ctypes.c_int64, ctypes.c_int64, ctypes.c_int64, ctypes.c_void_p
    return NativeCode(address, ctypes.CFUNCTYPE(ctypes.c_int64, *types)(address), loop)


def _name(*depends: str) -> str:
    """The cache key of code that depends on these texts, on llvmlite, and on this module."""
    return sha256(b"\0".join([_compiler(), *(each.encode() for each in depends)])).hexdigest()


@cache
def _compiler() -> bytes:
    """What tells this compiler from others."""
    return Path(__file__).read_bytes() + version_of("llvmlite")


def _object_of(text: str) -> bytes:
    """The object file of a module's text."""
    from llvmlite import binding

    return _optimised(binding.parse_assembly(text), target_machine())


PASSES = "sroa", "instruction_combine", "simplify_cfg", "new_gvn", "dead_code_elimination"
"""They make the code as fast as all passes of LLVM's second level, in a third of the time: the text holds one function
with one loop, whose vectors are written out."""


def _optimised(module: ModuleRef, target: TargetMachine) -> bytes:
    """The object file of a module."""
    from llvmlite import binding

    builder = binding.create_pass_builder(target, binding.PipelineTuningOptions())
    passes = binding.create_new_function_pass_manager()
    for name in PASSES:
        getattr(passes, f"add_{name}_pass")()
    passes.run(module.get_function("round"), builder)
    return bytes(target.emit_object(module))
