"""Kernels: which programs get native code, and when.

The rules that robots with one mind run at every tick are compiled together, in their order; so is a text that is
evaluated repeatedly. If llvmlite is installed, a background thread compiles. Until the code is ready, and for rules
that native code does not support, rules are walked; only new rules are, while older ones keep their code. This makes
no difference to anything but speed.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor, wait
from functools import cache, cached_property, partial
from typing import TypeAlias
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from sleepcast.columns.values import Column, Rows
from sleepcast.core.arrays import filled
from sleepcast.core.records import NamedTuple
from sleepcast.core.threads import ThreadPool
from sleepcast.fleet.bodies import ManyBodies
from sleepcast.fleet.evaluation import FleetEvaluation
from sleepcast.fleet.native.compiler import (
    LANES,
    THERE,
    TROUBLED,
    Kernel,
    NotKeptError,
    ResultColumns,
    UncompiledError,
    moment,
)
from sleepcast.fleet.native.symbols import Name, Size, meaning, name_of
from sleepcast.fleet.state import FleetState, Mind
from sleepcast.language.parts import walk
from sleepcast.language.program import MAX_STEPS, Program

THREADS = 2
"""Default number of threads that share the work of one piece of native code."""
HOT = 4
"""Walks of the same programs before they are compiled: a command is evaluated once, a rule again and again."""
MANY = 1_000
"""Robots; the rules of fewer are walked twice as often before they are compiled, since that costs little beside it.
Code that is kept is taken as early as for many."""
PATIENCE = 0.05
"""Seconds to wait for the code of rules, if none is being made yet. Code that is kept is there by then, while walking
would take the processor from the thread that fetches it."""
MAX_KERNELS = 512
"""Pieces of native code in memory; when full, all are dropped and compiled again as needed."""
MAX_PARTS = 1_500
"""Parts of one piece at most: the optimiser's time grows faster than the program."""

Rule: TypeAlias = tuple[Program, frozenset[tuple[Name, Program | bool | None]]]
"""A program and the meanings of the names in it."""


class Leg(NamedTuple):
    """Rules of a sequence that are evaluated together: by native code, or walked if there is no kernel."""

    rules: int
    kernel: Kernel | None


class RuleSequence:
    """Rules that are evaluated one after the other.

    steps: upper bound of the steps that they use in a tick
    """

    def __init__(self, keys: tuple[str, ...], rules: tuple[Rule, ...], *, calls: bool) -> None:
        self.keys, self.rules = keys, rules
        self.sizes = [Size(program, dict(names), calls=calls) for program, names in rules]
        self.steps = sum(size.steps for size in self.sizes)
        self.pieces = tuple(self._pieces())
        """The compilable rules, grouped into pieces."""

    def _pieces(self) -> Iterator[tuple[Rule, ...]]:
        piece: list[Rule] = []
        parts = 0
        for rule, size in zip(self.rules, self.sizes, strict=True):
            possible = not size.hopeless and size.parts <= MAX_PARTS and size.steps <= MAX_STEPS
            if piece and (not possible or parts + size.parts > MAX_PARTS):
                yield tuple(piece)
                piece, parts = [], 0
            if possible:
                piece.append(rule)
                parts += size.parts
        if piece:
            yield tuple(piece)


class SequencePlan:
    """How the rules of a sequence are evaluated at present.

    rounds: number of rounds that asked for it
    """

    __slots__ = ("legs", "native", "of", "rounds", "version")

    def __init__(self, of: RuleSequence) -> None:
        self.of, self.rounds, self.version = of, 0, -1
        self.legs: tuple[Leg, ...] = ()
        self.native = False

    @property
    def keys(self) -> tuple[str, ...]:
        """Of the rules."""
        return self.of.keys


class MadeKernels(dict[tuple[tuple[Rule, ...], int], Kernel]):
    """Native code by piece and number of lanes: for all fleets whose vocabularies were made `anew` from one, so that
    the second one has it from its first tick."""

    def __init__(self) -> None:
        super().__init__()
        self._sequences: dict[tuple[tuple[str, ...], tuple[Rule, ...]], RuleSequence] = {}
        self._of_mind: WeakKeyDictionary[Mind, RuleSequence] = WeakKeyDictionary()

    def sequence(self, mind: Mind, *, calls: bool) -> RuleSequence:
        """The rules of a mind, the same object for equal ones."""
        found = self._of_mind.get(mind)
        if found is None:
            rules = tuple((rule.program, frozenset(meaning([rule.program], mind).items())) for rule in mind.running)
            if len(self._sequences) >= MAX_KERNELS:
                self._sequences.clear()
            found = self._sequences.get((mind.sequence, rules))
            if found is None:
                made = RuleSequence(mind.sequence, rules, calls=calls)
                found = self._sequences.setdefault((mind.sequence, rules), made)  # another thread may have made it
            found = self._of_mind.setdefault(mind, found)
        return found

    def keep(self, piece: tuple[Rule, ...], lanes: int, made: Future[Kernel]) -> None:
        """Let other fleets use what was made for one, if anything was."""
        if made.exception():
            return
        if len(self) >= MAX_KERNELS:
            self.clear()
        self[piece, lanes] = made.result().unbound()

    def known(self, mind: Mind) -> RuleSequence | None:
        """The rules of a mind, if anybody has asked for them."""
        return self._of_mind.get(mind)


class TakenCode:
    """Code that was made for another fleet, as a `Future` that is done."""

    __slots__ = ("_code",)

    def __init__(self, code: Kernel | UncompiledError) -> None:
        self._code = code

    def done(self) -> bool:
        return True

    def exception(self) -> UncompiledError | None:
        return self._code if isinstance(self._code, UncompiledError) else None

    def result(self) -> Kernel:
        if isinstance(self._code, UncompiledError):
            raise self._code
        return self._code


class ReadyCount:
    """How many pieces of native code have become ready. Futures keep whom they call: they count here, and know nothing
    of the fleet, which then needs no garbage collector to be gone."""

    __slots__ = ("number",)

    def __init__(self) -> None:
        self.number = 0

    def count(self, made: object) -> None:
        self.number += 1


class Kernels:
    """The native code of a fleet's programs.

    hot: see `HOT`; with 0 nothing that could be native is ever walked, because evaluation waits for the code. pool:
    the threads that share large amounts of work. bodies: of the fleet; if they are `ManyBodies`, rules may call the
    robots' own functions. made: for fleets like this one; None for nothing.
    """

    def __init__(
        self,
        hot: int = HOT,
        pool: ThreadPool | None = None,
        *,
        bodies: object | None = None,
        made: MadeKernels | None = None,
    ) -> None:
        self._made, self._shares = MadeKernels() if made is None else made, made is not None
        self._hot, self._pool = hot, pool or ThreadPool(THREADS)
        self._bodies = bodies if isinstance(bodies, ManyBodies) else None
        self._plans: dict[RuleSequence, SequencePlan] = {}
        self._rules: dict[tuple[Rule, ...], Future[Kernel] | TakenCode] = {}
        self._texts: dict[Program, int | Future[Kernel] | None] = {}
        self._ready = ReadyCount()
        self._part: NDArray[np.uint8] = np.zeros(0, np.uint8)

    @cached_property
    def _maker(self) -> ThreadPoolExecutor:
        """Compiles; a fleet that takes over what was made for another one may never need it."""
        return ThreadPoolExecutor(1, "sleepcast-native")

    # ---- rules

    def plan(self, mind: Mind, state: FleetState) -> SequencePlan | None:
        """How the rules of a mind are evaluated in the round that begins; None if they are all walked."""
        sequence = self._made.sequence(mind, calls=self._bodies is not None)
        plan = self._plans.get(sequence)
        if plan is None:
            if len(self._plans) >= MAX_KERNELS:
                self._plans.clear()
            plan = self._plans[sequence] = SequencePlan(sequence)
            self._take_over(sequence, lanes(state))
        plan.rounds += 1
        if plan.rounds == max(self._hot, 1):
            self._ask_for(sequence, state, kept=self._hot > 0 and state.count < MANY)
        elif plan.rounds == 2 * self._hot and state.count < MANY:
            self._ask_for(sequence, state)
        if plan.version != self.ready:
            plan.version = self.ready
            plan.legs = tuple(self._legs(sequence.rules))
            plan.native = any(leg.kernel is not None for leg in plan.legs)
        return plan if plan.native else None

    @property
    def ready(self) -> int:
        """How many pieces of native code have become ready."""
        return self._ready.number

    def known_plan(self, mind: Mind) -> SequencePlan | None:
        """The plan of a mind if native code evaluates all of its rules, as it is now; None otherwise."""
        sequence = self._made.known(mind)
        plan = None if sequence is None else self._plans.get(sequence)
        if plan is None or plan.version != self.ready or not plan.legs:
            return None
        return plan if all(leg.kernel is not None for leg in plan.legs) else None

    def everybody(self, state: FleetState) -> NDArray[np.uint8]:
        """The marks of the robots that take part in an evaluation: all of them."""
        if len(self._part) != state.count:
            self._part = filled(0, np.uint8, state.count)
        self._part[:] = THERE
        return self._part

    def _take_over(self, sequence: RuleSequence, lanes: int) -> None:
        """Use what was made for other fleets."""
        for piece in sequence.pieces:
            made = self._made.get((piece, lanes))
            if made is not None and piece not in self._rules:
                try:
                    self._rules[piece] = TakenCode(made.of(self._bodies))
                except UncompiledError as error:
                    self._rules[piece] = TakenCode(error)
                self._ready.number += 1

    def _ask_for(self, sequence: RuleSequence, state: FleetState, *, kept: bool = False) -> None:
        """Have the pieces of a sequence made, or only taken from what is kept."""
        if len(self._rules) >= MAX_KERNELS:
            self._rules.clear()
        busy, asked = any(not code.done() for code in self._rules.values()), list[Future[Kernel]]()
        for piece in sequence.pieces:
            if self._is_missing(piece, kept):
                names = {name: meant for _, some in piece for name, meant in some}
                programs = [program for program, _ in piece]
                made = self._maker.submit(Kernel, programs, names, lanes(state), bodies=self._bodies, kept=kept)
                self._rules[piece] = made
                asked.append(made)
                if self._shares:
                    made.add_done_callback(partial(self._made.keep, piece, lanes(state)))
                made.add_done_callback(self._ready.count)
        if self._hot == 0:
            self.settle()
        elif not busy:
            wait(asked, PATIENCE)

    def _is_missing(self, piece: tuple[Rule, ...], kept: bool) -> bool:
        """Whether this piece is to be asked for. What has been asked for may be looked for among what is kept only."""
        known = self._rules.get(piece)
        return known is None or (not kept and (not known.done() or isinstance(known.exception(), NotKeptError)))

    def _legs(self, rules: tuple[Rule, ...]) -> Iterator[Leg]:
        """From each position the longest piece with code; rules in between are walked."""
        ready = {piece: code for piece, code in self._rules.items() if code.done() and not code.exception()}
        lengths = sorted({len(piece) for piece in ready}, reverse=True)
        index = walked = 0
        while index < len(rules):
            count = next((n for n in lengths if rules[index : index + n] in ready and index + n <= len(rules)), 0)
            if count and walked:
                yield Leg(walked, None)
                walked = 0
            if count:
                yield Leg(count, ready[rules[index : index + count]].result())
            walked += not count
            index += count or 1
        if walked:
            yield Leg(walked, None)

    def evaluate(
        self,
        kernel: Kernel,
        state: FleetState,
        rows: Rows,
        when: tuple[float, float] | None,
        sinks: Sequence[ResultColumns],
    ) -> Rows:
        """Let native code evaluate its programs on these robots at a `moment`; returns those that have to be walked."""
        if len(self._part) != state.count:
            self._part = filled(0, np.uint8, state.count)
        part, index = self._part, rows.index
        if isinstance(index, slice):
            start, stop = index.start, index.stop
        else:
            start, stop = int(index[0]), int(index[-1]) + 1
            part[start:stop] = 0
        part[index] = THERE
        if not kernel.run(state, part, range(start, stop), when, sinks, self._pool):
            return Rows.run(start, start)
        return self.troubled(start, stop)

    def troubled(self, start: int, stop: int) -> Rows:
        """Those of the robots from `start` to `stop` (exclusive) that native code has left to be walked."""
        return Rows.of(np.flatnonzero(self._part[start:stop] == TROUBLED) + start)

    # ---- texts

    def run(self, memory: FleetEvaluation, program: Program, rows: Rows) -> tuple[Column, Rows] | None:
        """Evaluate a text natively, if possible; returns the values, and the robots that have to be walked."""
        code = self._texts.get(program, 0)
        if isinstance(code, int):
            self._meet(program, code + 1, memory.state)
            code = self._texts[program]
        if not isinstance(code, Future) or not code.done() or code.exception() or rows.size == 0:
            return None
        state = memory.state
        values, matched = np.empty(state.count), memory.matched
        sinks = [ResultColumns(values, matched.view(np.uint8), None)]
        left = self.evaluate(code.result(), state, rows, moment(state, rows), sinks)
        matched[left.index] = program.for_everybody
        return values[rows.index], left

    def _meet(self, program: Program, times: int, state: FleetState) -> None:
        """Count walks of a text, and request its compilation once it is hot."""
        if len(self._texts) >= MAX_KERNELS and program not in self._texts:
            self._texts.clear()
        if times < self._hot:
            self._texts[program] = times
        elif translatable(program):
            self._texts[program] = made = self._maker.submit(Kernel, [program], {}, lanes(state), counted=False)
            if self._hot == 0:
                made.result()
        else:
            self._texts[program] = None

    def settle(self) -> None:
        """Wait until all requested code is compiled."""
        for code in (*self._rules.values(), *self._texts.values()):
            if isinstance(code, Future | TakenCode) and not isinstance(code.exception(), UncompiledError):
                code.result()


@cache
def available() -> bool:
    """Whether llvmlite is installed."""
    return importlib.util.find_spec("llvmlite") is not None


def lanes(state: FleetState) -> int:
    """Robots that native code processes at once in this fleet."""
    return LANES if state.count >= LANES else 1


def translatable(program: Program) -> bool:
    """Whether a text can be compiled on its own: it uses no names that robots learn, and is short enough."""
    if any(name_of(part) is not None for part in walk(program.root)):
        return False
    size = Size(program, {})
    return not size.hopeless and size.parts <= MAX_PARTS
