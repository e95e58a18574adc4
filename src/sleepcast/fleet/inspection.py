"""Inspection of a fleet: which variables may be read (`ReadSet`), the values that robots reported last and what a test
gives on them (`FleetTelemetry`), and why a robot did what it did (`EvaluationLog`).

Sensors that nothing reads are not measured. The telemetry's columns are copies of the fleet's, each robot's values
as of its latest report. A test is evaluated on them for all robots at once, without side effects; if the columns
cannot decide it, the robot is undecided, with a reason. The contents of buffers and operators come from the robots'
current minds.

A second copy of all variables is small in a small fleet but a quarter of all memory in a large one, where hardly any
is read. So a large fleet reports only the variables that some test has asked for, from the first time on: the robots
that reported last report them at once, and the others with their next telemetry.

The log stores no results. For each command it stores the inputs: the columns that the program can read, the minds,
and the results of the robots' own functions. An explanation evaluates the command again, for one robot, with the
very same values.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import field
from math import isnan, nan
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.message import Kind, Message
from sleepcast.channel.message_batch import ascending
from sleepcast.columns.machine import evaluate
from sleepcast.columns.neighbours import NeighbourLists
from sleepcast.columns.telemetry import BulkTelemetry, Key, KnownSymbols
from sleepcast.columns.values import Column, Index, Mask, Moves, Rows, ValueColumns, distinct
from sleepcast.core.errors import SleepcastError
from sleepcast.core.model import RestState
from sleepcast.core.records import NamedTuple, dataclass
from sleepcast.core.serial import Array
from sleepcast.fleet.bodies import FleetBodies
from sleepcast.fleet.evaluation import FleetEvaluation
from sleepcast.fleet.memory import FleetMemory, HostResult, HostResults
from sleepcast.fleet.messages import Outbox
from sleepcast.fleet.schema import TelemetryState
from sleepcast.fleet.state import FleetState, Mind, MindNames, Minds
from sleepcast.language.acts import ACTS
from sleepcast.language.explain import Recollection
from sleepcast.language.numerics import draw
from sleepcast.language.parts import Part, Storing, walk, written
from sleepcast.language.program import Program
from sleepcast.language.reader import read
from sleepcast.language.rehearsal import Rehearsal
from sleepcast.language.symbols import UserVariable
from sleepcast.language.vocabulary import ACTIVE0, BUFFERS, TICK, TIME_SLOT, Vocabulary

_READING = frozenset({"var", "write", "defvar", "set_user", "host"})
_ANYTHING = "*"
_NOWHERE = -1
"""The slot of a name that was unknown when the program was checked."""


_READS: WeakKeyDictionary[Mind, frozenset[int] | None] = WeakKeyDictionary()
"""What the rules of a mind may read; None stands for everything."""


class ReadSet:
    """What the robots of a memory may read; None stands for everything. It may name too much, never too little."""

    def __init__(self, memory: FleetEvaluation) -> None:
        self._memory = memory

    def slots(self, waiting: Iterable[tuple[Message, Index]]) -> frozenset[int] | None:
        """The slots that any active rule may read, or any waiting message, each given with its robots."""
        memory = self._memory
        slots: set[int] = set()
        one = memory.state.one_mind
        for number in distinct(memory.state.mind)[0].tolist() if one is None else [one]:
            of_rules = self._by_rules(memory.minds[number])
            if of_rules is None:
                return None
            slots |= of_rules
        for message, robots in waiting:
            for number in distinct(memory.state.mind[robots])[0].tolist() if one is None else [one]:
                of_message = self._by_message(message, memory.minds[number])
                if of_message is None:
                    return None
                slots |= of_message
        return frozenset(slots)

    def _by_rules(self, mind: Mind) -> frozenset[int] | None:
        if mind not in _READS:
            programs = [rule.program for rule in mind.running]
            taught = {key for program in programs for key in _own_reads(program).taught}
            # A rule that another one stores anew runs in the same tick, whatever it will then read.
            anew = not taught.isdisjoint({_ANYTHING, *mind.rules})
            _READS[mind] = None if anew else _together(programs, mind)
        return _READS[mind]

    def _by_message(self, message: Message, mind: Mind) -> frozenset[int] | None:
        """The slots that a message may read; None stands for everything: it cannot be compiled yet, or it may add rules
        or names."""
        names = MindNames(self._memory.minds.vocabulary, mind)
        try:
            program = self._memory.minds.library.program(
                message.text, lambda: [read(message.text)], names, asked=message.kind is Kind.ASK
            )
        except SleepcastError:
            return None
        return None if any(map(_teaches, walk(program.root))) else _together([program], mind)


def _together(programs: Iterable[Program], mind: Mind) -> frozenset[int] | None:
    together: set[int] = set()
    for program in programs:
        slots, _ = reads_of(program, [mind])
        if slots is None:
            return None
        together |= slots
    return frozenset(together)


def _teaches(part: Part) -> bool:
    """Whether evaluating a part may add rules or names; programs that it enters existed before."""
    if part.op == "write":
        return ACTIVE0 < part.slot < ACTIVE0 + BUFFERS
    return part.op in ("store", "fetch", "call") or (part.op == "act" and ACTS[part.name].teaches)


def reads_of(program: Program, minds: Iterable[Mind]) -> tuple[set[int] | None, set[str]]:
    """The slots and groups that a program can read, including everything that it can enter in these minds; None for
    any."""
    slots: set[int] = set()
    groups: set[str] = set()
    taught: set[str] = set()
    named: set[str] = set()
    seen: set[Program] = set()
    waiting = [program]
    while waiting:
        inside = waiting.pop()
        if inside in seen:
            continue
        seen.add(inside)
        named |= inside.uses
        own = _own_reads(inside)
        slots, groups, taught = slots | own.slots, groups | own.groups, taught | own.taught
        for mind in minds:
            waiting += [mind.rules[key].program for key in inside.uses if key in mind.rules]
            waiting += [mind.operators[key] for key in inside.uses if key in mind.operators]
    if named and (_ANYTHING in taught or not named.isdisjoint(taught)):
        # It may enter a program that is new, so it may read anything.
        return None, groups
    return slots, groups


class _OwnReads(NamedTuple):
    """What the parts of a program read themselves: slots and groups; and the keys that they store."""

    slots: frozenset[int]
    groups: frozenset[str]
    taught: frozenset[str]


_KNOWN: WeakKeyDictionary[Program, _OwnReads] = WeakKeyDictionary()
"""Those of programs, of which runs have many in common."""


def _own_reads(program: Program) -> _OwnReads:
    found = _KNOWN.get(program)
    if found is None:
        parts = walk(program.root)
        slots = {part.slot for part in parts if part.op in _READING} - {_NOWHERE}
        groups = {part.name for part in parts if part.op == "in"}
        rest = (part for part in parts if part.op not in _READING and part.op != "in")
        taught = {key for part in rest for key in _taught(part)}
        found = _KNOWN[program] = _OwnReads(frozenset(slots), frozenset(groups), frozenset(taught))
    return found


def _taught(part: Part) -> set[str]:
    """The keys that a part stores."""
    if isinstance(part.data, Storing):
        return {part.data.key}
    if part.op == "act" and part.name == "defun":
        return {written(part).casefold()}
    return {_ANYTHING} if part.op == "act" and part.name == "rollback" else set()


# ---- telemetry

MANY = 30_000
"""Number of robots from which on a fleet is large: the variables of fewer take less than ten megabytes."""


class FleetTelemetry(BulkTelemetry):
    """The latest telemetry of a fleet.

    state: of the fleet
    minds: its table
    bodies: of the robots
    """

    def __init__(self, state: FleetState, minds: Minds, bodies: FleetBodies) -> None:
        self._state, self._minds, self._bodies = state, minds, bodies
        self._then = ValueColumns(state.count, [nan] * len(state.slots()))
        self._stopped: Mask = np.zeros(state.count, np.bool_)
        self.tick = nan
        """How long a tick of all robots is, s; NaN where nobody knows."""
        self._large = state.count >= MANY
        self._last = Rows.run(0, 0)
        """The robots that reported last."""
        self._taken = False
        """Whether what `take` records is there already."""
        self._asked: dict[int, Mask] = {}
        """The slots that a large fleet reports, each with the robots that have reported it."""

    def take(self, robots: Index) -> None:
        """Record telemetry of these robots now."""
        if self._taken:
            return
        rows = self._last = Rows.of(robots)
        if self._large or rows.size < self._state.count:
            self._then.copy_from(self._state, rows, list(self._asked) if self._large else self._state.slots())
        else:
            self._then.copy_all(self._state)
        self._then.copy_groups(self._state, rows)
        self._stopped[rows.index] = self._state.stopped[rows.index]
        for those in self._asked.values():
            those[rows.index] = True

    def turn_over(self, changed: Index) -> None:
        """Robots have come to these rows, or gone from there: nothing was told yet."""
        self._then.forget_robots(changed)
        self._stopped[changed] = False
        there = np.ones(self._state.count, np.bool_)
        there[changed] = False
        self._last = self._last.take(there[self._last.index])
        for those in self._asked.values():
            those[changed] = False

    def moves(self) -> Moves | None:
        """What native code has to copy whenever all robots tell of themselves, see `ValueColumns.moves`; None if only
        `take` can do that."""
        return None if self._large else self._then.moves(self._state)

    @contextmanager
    def taken(self, clock: Mapping[int, float]) -> Iterator[None]:
        """All robots have told of themselves, most recently when these slots had these values, and native code has made
        the moves: meanwhile desks are told."""
        self._last = everybody = Rows.run(0, self._state.count)
        self._then.moved(self._state)
        for slot, value in clock.items():
            self._then.assign(slot, everybody, value)
        self._then.copy_groups(self._state, everybody)
        self._stopped[:] = self._state.stopped
        self._taken = True
        try:
            yield
        finally:
            self._taken = False

    def stopped(self, robots: Index) -> Mask:
        """Which of these robots were stopped at their latest telemetry."""
        stopped: Mask = self._stopped[robots]
        return stopped

    def rest_state(self, robot: int) -> RestState | None:
        """Whether the body of a robot has come to rest; None if it does not tell."""
        return self._bodies.rest_state(robot)

    def rest_states(self, robots: Index) -> tuple[Column, Column] | None:
        """How the bodies of these robots, which are telling of themselves, move: see `FleetBodies.rest_states`."""
        return self._bodies.rest_states(robots)

    def state(self) -> TelemetryState:
        """The telemetry as plain data."""
        asked = {slot: Array.of(those) for slot, those in self._asked.items()}
        last = Array.of(self._last.robots.astype(np.int32))
        return TelemetryState(self._then.values(), Array.of(self._stopped), asked, last)

    def restore(self, state: TelemetryState) -> None:
        """Restore saved telemetry. Raises SerialError."""
        self._then.refill(state.values)
        shape = self._stopped.shape
        self._stopped = state.stopped.made(np.bool_, shape, "who was stopped")
        self._last = Rows.of(ascending(state.last, len(self._stopped))) if state.last else Rows.run(0, 0)
        asked = state.asked
        if asked is None:  # in older snapshots, every robot that reported anything reported everything
            self._asked = {slot: np.ones(shape, np.bool_) for slot in state.values.columns} if self._large else {}
        else:
            self._asked = {slot: those.made(np.bool_, shape, f"who reported {slot}") for slot, those in asked.items()}

    def latest(self) -> ValueColumns:
        return self._then

    def clock(self, slot: int, now: float, told: Column) -> Column | float | None:
        """All robots of a run have the clock of the run, as its desk has."""
        if slot == TIME_SLOT:
            return float(now)
        return None if isnan(self.tick) else float(round(now / self.tick))

    def divide(self, rows: Rows, key: Callable[[KnownSymbols], Key]) -> list[tuple[Key, Rows, Mask | None]]:
        """By the robots' current minds."""
        return self._state.divide(rows, lambda number: key(self._minds[number]))

    def ask(self, program: Program, rows: Rows) -> Mask | None:
        """As `TelemetryTable.ask`: the robots of a small fleet tell everything from the first."""
        if not self._large:
            return None
        one = self._state.one_mind
        there = [one] if one is not None else distinct(self._state.mind[rows.index])[0].tolist()
        minds = {self._minds[number] for number in there}
        slots, _ = reads_of(program, minds)
        reported = np.ones(rows.size, np.bool_)
        wanted = {*self._state.slots()} if slots is None else slots & {*self._state.slots()}
        for slot in sorted(wanted - {TIME_SLOT, TICK}):
            if slot not in self._asked:
                self._then.copy_from(self._state, self._last, [slot])
                self._asked[slot] = np.zeros(self._state.count, np.bool_)
                self._asked[slot][self._last.index] = True
            reported &= self._asked[slot][rows.index]
        return reported


# ---- the evaluation log

MAX_ENTRIES = 4_096
"""Commands whose inputs a fleet keeps for explanations, at most: few robots receive most of them, because robots send
messages to each other. `LOG_BYTES` bounds their memory."""
LOG_BYTES = 256
"""Bytes per robot for the inputs of past commands: a quarter of the kilobyte that a robot's mind may take."""
LOG_LEAST = 4 * 1024 * 1024
"""Bytes for the inputs in a small fleet, where memory does not matter."""
ENTRY_BYTES = 2_048
"""Approximate bytes of a command's inputs besides their columns."""


@dataclass
class LogEntry:
    """The inputs of one command on the robots `rows`.

    minds: by number, as they were then
    proven, unproven_since: stored only if it may roll back
    number: counts up from the first command of the fleet
    held: robots whose functions were refused then
    stopped: those that were stopped; each stored only if there were any
    """

    program: Program
    command: str
    rows: Rows
    mind: NDArray[np.int32]
    proven: NDArray[np.int32] | None
    unproven_since: NDArray[np.int64] | None
    held: Mask | None
    minds: dict[int, Mind]
    draws: NDArray[np.int32]
    columns: dict[int, Column | float]
    groups: dict[str, Mask]
    stopped: Mask | None
    number: int = 0
    hosts: list[HostResults] = field(default_factory=list)

    @property
    def bytes(self) -> int:
        """Approximate bytes of memory."""
        arrays: Iterable[object] = (
            self.rows.index,
            self.mind,
            self.proven,
            self.unproven_since,
            self.held,
            self.stopped,
            self.draws,
        )
        values = (*arrays, *self.columns.values(), *self.groups.values())
        return ENTRY_BYTES + self.host_bytes + sum(array.nbytes for array in values if isinstance(array, np.ndarray))

    @property
    def host_bytes(self) -> int:
        """Approximate bytes of the results of the robots' own functions."""
        total = 0
        for _, results in self.hosts:
            one_for_all = isinstance(results, np.ndarray) and results.strides == (0,)
            several = results.first.size + results.ids.size if isinstance(results, NeighbourLists) else len(results)
            total += 0 if one_for_all else 8 * several
        return total

    def given(self, robot: int) -> Iterator[HostResult]:
        """The results of a robot's own functions, in order."""
        for rows, results in self.hosts:
            index = rows.index_of(robot)
            if index is not None:
                result = results.of(index) or () if isinstance(results, NeighbourLists) else results[index]
                yield result if isinstance(result, str | tuple) else float(result)

    def index_of(self, robot: int) -> int | None:
        """The index of a robot among those of the command; None if it is not there."""
        return self.rows.index_of(robot)


class EvaluationLog:
    """The last commands of a fleet, as many as its share of memory allows, but at least the last one."""

    def __init__(self, memory: FleetMemory) -> None:
        self._memory = memory
        self._entries: list[LogEntry] = []
        self._bytes = 0
        self.since: float | None = None
        """The time (s) of the snapshot that the fleet was resumed from: inputs of earlier commands are not
        available."""
        self._following = 0
        """The number of the next entry."""
        self._first: NDArray[np.int64] | None = None
        """The first entry that is of the robot in each row; None where robots do not come and go."""
        self._earlier: Callable[[], EvaluationLog] | None = None
        """What gives those of earlier commands, once somebody asks."""

    def begin_after(self, earlier: Callable[[], EvaluationLog]) -> None:
        """Have only what another log has until now, which `earlier` gives once somebody asks."""
        self._entries.clear()
        self._bytes, self.since, self._earlier = 0, None, earlier

    def remember(self, program: Program, rows: Rows, command: str) -> LogEntry:
        """Store the inputs of a command that these robots are about to evaluate."""
        state, minds = self._memory.state, self._memory.minds
        mind, proven, unproven_since = state.mind[rows.index].copy(), None, None
        present = {number: minds[number] for number, _, _ in self._memory.divide(rows, lambda number: number)}
        slots, groups = reads_of(program, present.values())
        if slots is None:
            slots, groups = set(state.slots()), set(state.groups)
            proven, unproven_since = state.proven[rows.index].copy(), state.unproven_since[rows.index].copy()
            present |= {number: minds[number] for number in np.unique(proven).tolist()}
        columns = {}
        for slot in {*slots, TICK, TIME_SLOT}:
            values = state.read(slot, rows)
            columns[slot] = values if isinstance(values, float) else values.copy()
        entry = LogEntry(
            program,
            command,
            rows,
            mind,
            proven,
            unproven_since,
            _marked(state.held, rows),
            present,
            state.draws[rows.index].copy(),
            columns,
            {key: state.groups[key][rows.index].copy() for key in groups if key in state.groups},
            _marked(state.stopped, rows),
            self._following,
        )
        self._following += 1
        self._bytes += entry.bytes
        if len(self._entries) == MAX_ENTRIES:
            self._drop()
        self._entries.append(entry)
        self._bound()
        return entry

    def weigh(self, entry: LogEntry) -> None:
        """Account for the memory that the evaluation of the last entry has added to it."""
        self._bytes += entry.host_bytes
        self._bound()

    def _bound(self) -> None:
        while len(self._entries) > 1 and self._bytes > max(LOG_BYTES * self._memory.state.count, LOG_LEAST):
            self._drop()

    def _drop(self) -> None:
        self._bytes -= self._entries.pop(0).bytes

    def find(self, robot: int, command: str | None) -> LogEntry | None:
        """The entry of a command (None: the last one) that a robot has evaluated."""
        if self._earlier is not None:
            earlier, self._earlier = self._earlier(), None
            self._entries[:0] = earlier._entries
            self._bytes += earlier._bytes
            while len(self._entries) > MAX_ENTRIES:
                self._drop()
            self._bound()
        for entry in reversed(self._entries):
            if (command is None or entry.command == command) and entry.index_of(robot) is not None:
                own = self._first is None or entry.number >= self._first[robot]
                return entry if own else None
        return None

    def turn_over(self, changed: Index) -> None:
        """Other robots, or none, are in these rows from now on: earlier commands were not theirs."""
        if self._first is None:
            self._first = np.zeros(self._memory.state.count, np.int64)
        self._first[changed] = self._following

    def limits(self) -> str:
        """Why a command may be missing here, as text for people."""
        if self.since is None:
            return "its fleet keeps the last commands, as many as have room"
        return f"this run goes on from a snapshot taken at {self.since:g} s, which keeps no explanations of before"


def _marked(marks: Mask, rows: Rows) -> Mask | None:
    """The marks of these robots, None if no robot at all is marked."""
    return marks[rows.index].copy() if marks.any() else None


def recollect(entry: LogEntry, robot: int, vocabulary: Vocabulary, keys: NDArray[np.uint64]) -> Recollection:
    """Evaluate a command again as one robot did, recording what its memory answered. keys: of random streams, by
    robot."""
    index = entry.index_of(robot)
    if index is None:
        raise KeyError(robot)
    state = FleetState(vocabulary, [0], 0)
    state.keys[0] = keys[robot]
    state.draws[0] = entry.draws[index]
    alone = Rows.run(0, 1)
    for slot, values in entry.columns.items():
        state.assign(slot, alone, values if isinstance(values, float) else float(values[index]))
    for key, members in entry.groups.items():
        state.group(key)[0] = members[index]
    minds = Minds(vocabulary)
    state.turn(alone, minds.add(entry.minds[int(entry.mind[index])]))
    if entry.proven is not None and entry.unproven_since is not None:
        state.proven[0] = minds.add(entry.minds[int(entry.proven[index])])
        state.unproven_since[0] = entry.unproven_since[index]
    if entry.held is not None:
        state.held[0] = entry.held[index]
    memory = FleetMemory(state, minds, Outbox(state, ["again"]), [None])
    memory.answers, memory.script = [], entry.given(robot)
    before, groups = state.row(0), state.groups_of(0)
    evaluate(memory, entry.program, alone)
    time, tick = before[TIME_SLOT], int(before[TICK])
    stopped = entry.stopped is not None and bool(entry.stopped[index])
    return Recollection(entry.program, before, groups, memory.answers, time, tick, entry.command, stopped)


def rehearsal(memory: FleetMemory, robot: int) -> Rehearsal:
    """A memory that starts from the robot's current state, for asking what it would do now; changes in it affect
    nothing else."""
    state, mind = memory.state, memory.mind_of(robot)
    values = state.row(robot)
    key, tick = int(state.keys[robot]), int(values[TICK])
    drawn = iter(range(int(state.draws[robot]), 1 << 62))
    return Rehearsal(
        values,
        state.groups_of(robot),
        fetch=lambda part: mind.rules[part.name].program if part.name in mind.rules else None,
        operator=lambda part: mind.operators.get(part.name),
        has=lambda key: isinstance(mind.symbols.get(key), UserVariable),
        draw=lambda: draw(key, tick, next(drawn)),
    )
