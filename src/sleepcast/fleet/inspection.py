"""Inspection of a fleet: which variables anybody will look at (`ReadSet`), the values that robots reported last and
what a test would give by them (`FleetTelemetry`), and why a robot did what it did (`EvaluationLog`).

What nobody reads is not measured. The columns of the telemetry are copies of the fleet's, each robot's as of its latest
report. A test is evaluated on them for all robots at once, and nothing it could do is done; what the columns cannot say
leaves a robot undecided, with the reason. What buffers and operators hold is asked of the robots' minds as they are
now.

A second copy of all variables is little in a small fleet and a quarter of all memory in a large one, where hardly any
is ever looked at. So a large fleet reports the variables that a test has asked for, from the first time on: the robots
that reported last report them at once, and the others with their next telemetry.

The log keeps no results. Of a command it keeps what went into it: the columns that the program can look at, as they
were, what the robots had learned, and what their own functions gave. An explanation evaluates the command again, for
the one robot, which gives the very same values.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from math import nan
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.message import Message
from sleepcast.channel.message_batch import ascending
from sleepcast.core.errors import SleepcastError
from sleepcast.core.serial import Array
from sleepcast.fleet.evaluation import Evaluation, by_the_living, distinct
from sleepcast.fleet.machine import evaluate
from sleepcast.fleet.memory import FleetMemory, Found, Given
from sleepcast.fleet.messages import Outbox
from sleepcast.fleet.schema import TelemetryState
from sleepcast.fleet.state import Column, FleetState, Index, Mask, Mind, MindNames, Minds, Rows, is_true
from sleepcast.language.explain import Recollection
from sleepcast.language.numerics import draw
from sleepcast.language.parts import Part, Storing, acts, walk, written
from sleepcast.language.program import Program
from sleepcast.language.reader import read
from sleepcast.language.rehearsal import CHANCE, DEED, FLAGS, Rehearsal, asks, does
from sleepcast.language.symbols import UserVariable
from sleepcast.language.vocabulary import ACTIVE0, BUFFERS, TICK, TIME_SLOT, Vocabulary

_HARMLESS = frozenset({*FLAGS, "report", "tell", "ping", "join", "leave", "deactivate", "lease"})
"""Acts after which no robot runs or names anything that it did not before."""
_READING = frozenset({"var", "write", "defvar", "set_user"})
_ANYTHING = "*"
_NOWHERE = -1
"""The slot of a name that was unknown when the program was checked."""


class ReadSet:
    """What the robots of a memory look at; None stands for everything. It errs only by naming too much."""

    def __init__(self, memory: Evaluation) -> None:
        self._memory = memory
        self._of_mind: WeakKeyDictionary[Mind, frozenset[int] | None] = WeakKeyDictionary()

    def slots(self, waiting: Iterable[tuple[Message, Index]]) -> frozenset[int] | None:
        """The slots that any active rule may read, or any waiting message, each given with its robots."""
        memory = self._memory
        found: set[int] = set()
        one = memory.state.one_mind
        for number in distinct(memory.state.mind)[0].tolist() if one is None else [one]:
            looked_at = self._by_rules(memory.minds[number])
            if looked_at is None:
                return None
            found |= looked_at
        for message, robots in waiting:
            for number in distinct(memory.state.mind[robots])[0].tolist() if one is None else [one]:
                slots = self._by_message(message, memory.minds[number])
                if slots is None:
                    return None
                found |= slots
        return frozenset(found)

    def _by_rules(self, mind: Mind) -> frozenset[int] | None:
        if mind not in self._of_mind:
            self._of_mind[mind] = _together((kept.program for kept in mind.running), mind)
        return self._of_mind[mind]

    def _by_message(self, message: Message, mind: Mind) -> frozenset[int] | None:
        """What a message looks at, or the rules that it changes; one that cannot be read now may be readable then."""
        names = MindNames(self._memory.minds.vocabulary, mind)
        try:
            program = self._memory.minds.library.program(message.text, lambda: [read(message.text)], names)
        except SleepcastError:
            return None
        return None if any(map(_teaches, walk(program.root))) else _together([program], mind)


def _together(programs: Iterable[Program], mind: Mind) -> frozenset[int] | None:
    found: set[int] = set()
    for program in programs:
        slots, _ = reads_of(program, [mind])
        if slots is None:
            return None
        found |= slots
    return frozenset(found)


def _teaches(part: Part) -> bool:
    """Whether other rules or names may be there after a part was evaluated; what it enters was there before."""
    if part.op == "write":
        return ACTIVE0 < part.slot < ACTIVE0 + BUFFERS
    return part.op in ("store", "fetch", "call") or (part.op == "act" and part.name not in _HARMLESS)


def reads_of(program: Program, minds: Iterable[Mind]) -> tuple[set[int] | None, set[str]]:
    """The slots and groups that a program can look at, with all that it can enter in these minds; None for any."""
    slots: set[int] = set()
    groups: set[str] = set()
    taught: set[str] = set()
    named: set[str] = set()
    seen: set[Program] = set()
    waiting = [program]
    while waiting:
        found = waiting.pop()
        if found in seen:
            continue
        seen.add(found)
        named |= found.uses
        for part in walk(found.root):
            if part.op in _READING:
                slots |= {part.slot} - {_NOWHERE}
            elif part.op == "in":
                groups.add(part.name)
            else:
                taught |= _taught(part)
        for mind in minds:
            waiting += [mind.rules[key].program for key in found.uses if key in mind.rules]
            waiting += [mind.operators[key] for key in found.uses if key in mind.operators]
    if named and (_ANYTHING in taught or not named.isdisjoint(taught)):
        # It may enter what it has only just learned, so it may look at anything.
        return None, groups
    return slots, groups


def _taught(part: Part) -> set[str]:
    """The keys of what a part stores."""
    if isinstance(part.data, Storing):
        return {part.data.key}
    if part.op == "act" and part.name == "defun":
        return {written(part).casefold()}
    return {_ANYTHING} if part.op == "act" and part.name == "rollback" else set()


# ---- telemetry

MAX_REASONS = 200
"""Different reasons told apart in one judgement, so that one fits a byte; the rest counts as the last of them."""
MANY = 30_000
"""Robots from which on a fleet is large: fewer have less than ten megabytes of variables."""
NOT_YET = "its telemetry does not yet hold what the test reads"


class FleetTelemetry:
    """The telemetry of a fleet, and previews on it. state: of the fleet; minds: its table."""

    def __init__(self, state: FleetState, minds: Minds) -> None:
        self._state, self._minds = state, minds
        self._then = state.shadow()
        self._stopped: Mask = np.zeros(state.count, np.bool_)
        self._large = state.count >= MANY
        self._last = Rows.run(0, 0)
        """Those who reported last."""
        self._asked: dict[int, Mask] = {}
        """The slots that a large fleet reports, each with who has reported it."""

    def take(self, robots: Index) -> None:
        """These robots tell of themselves now."""
        rows = self._last = Rows.of(robots)
        self._then.copy_from(self._state, rows, list(self._asked) if self._large else self._state.slots())
        self._then.copy_groups(self._state, rows)
        self._stopped[rows.index] = self._state.stopped[rows.index]
        for those in self._asked.values():
            those[rows.index] = True

    def stopped(self, robots: Index) -> Mask:
        """Which of these robots were stopped at their latest telemetry."""
        found: Mask = self._stopped[robots]
        return found

    def state(self) -> TelemetryState:
        """All of it, as plain data."""
        asked = {slot: Array.of(those) for slot, those in self._asked.items()}
        last = Array.of(self._last.robots.astype(np.int32))
        return TelemetryState(self._then.values(), Array.of(self._stopped), asked, last)

    def restore(self, state: TelemetryState) -> None:
        """Go on with that. Raises SerialError."""
        self._then.refill(state.values)
        shape = self._stopped.shape
        self._stopped = state.stopped.made(np.bool_, shape, "who was stopped")
        self._last = Rows.of(ascending(state.last, len(self._stopped))) if state.last else Rows.run(0, 0)
        asked = state.asked
        if asked is None:  # before it was kept, every robot that reported anything reported everything
            self._asked = {slot: np.ones(shape, np.bool_) for slot in state.values.columns} if self._large else {}
        else:
            self._asked = {slot: those.made(np.bool_, shape, f"who reported {slot}") for slot, those in asked.items()}

    def judge(self, test: Program, robots: Index) -> tuple[Mask, NDArray[np.uint8], list[str]]:
        """What a test says of these robots: where it holds; where that cannot be said, which of the reasons, listed
        last, is why (from 1; 0 where it can be said)."""
        rows = Rows.of(robots)
        memory = QuietMemory(self._then, self._minds)
        if self._large:
            memory.know(rows, self._ask(test, rows))
        values = evaluate(memory, test, rows)
        reason = memory.reason[rows.index]
        return is_true(values) & (reason == 0), reason, memory.reasons

    def _ask(self, test: Program, rows: Rows) -> Mask:
        """From now on these robots report everything that the test reads; gives which of them already have."""
        minds = {self._minds[number] for number in np.unique(self._state.mind[rows.index]).tolist()}
        slots, _ = reads_of(test, minds)
        reported = np.ones(rows.size, np.bool_)
        for slot in self._state.slots() if slots is None else sorted(slots & {*self._state.slots()}):
            if slot not in self._asked:
                self._then.copy_from(self._state, self._last, [slot])
                self._asked[slot] = np.zeros(self._state.count, np.bool_)
                self._asked[slot][self._last.index] = True
            reported &= self._asked[slot][rows.index]
        return reported


class QuietMemory(FleetMemory):
    """A memory to read, in which nothing can be done. reason: by robot, as in `Told.judge`."""

    def __init__(self, state: FleetState, minds: Minds) -> None:
        super().__init__(state, minds, Outbox(state, ()), ())
        self.reason: NDArray[np.uint8] = np.zeros(state.count, np.uint8)
        self.reasons: list[str] = []

    def know(self, rows: Rows, reported: Mask) -> None:
        """Of these robots only the `reported` ones are known."""
        if not reported.all():
            self.reasons.append(NOT_YET)
            self.reason[rows.take(~reported).index] = len(self.reasons)

    def _undecided(self, rows: Rows, reason: str) -> Column:
        """These robots take no further part."""
        if reason not in self.reasons and len(self.reasons) < MAX_REASONS:
            self.reasons.append(reason)
        number = self.reasons.index(reason) + 1 if reason in self.reasons else MAX_REASONS
        before = self.reason[rows.index]
        self.reason[rows.index] = np.where(before == 0, np.uint8(number), before)
        if self.dead is None:
            self.dead = np.zeros(self.state.count, np.bool_)
        self.dead[rows.index] = True
        return np.full(rows.size, nan)

    @by_the_living
    def draw(self, part: Part, rows: Rows) -> Column:
        return self._undecided(rows, CHANCE)

    def fetch(self, part: Part, rows: Rows) -> Found:
        return self._quiet(part, super().fetch(part, rows))

    def operator(self, part: Part, rows: Rows) -> Found:
        return self._quiet(part, super().operator(part, rows))

    def _quiet(self, part: Part, found: Found) -> Found:
        """Programs that do nothing; robots that would enter another one are undecided."""
        quiet: Found = []
        for program, rows, mask in found:
            if program is not None and acts(program.root):
                self._undecided(self._alive(rows), does(part.name))
                quiet.append((None, rows, mask))
            else:
                quiet.append((program, rows, mask))
        return quiet

    def _alive(self, rows: Rows) -> Rows:
        return rows if self.dead is None else rows.take(~self.dead[rows.index])

    @by_the_living
    def host(self, part: Part, rows: Rows, *arguments: Column) -> Column:
        return self._undecided(rows, asks(part.name))

    def defined(self, part: Part, rows: Rows) -> Mask:
        self._undecided(self._alive(rows), DEED)
        return np.zeros(rows.size, np.bool_)

    @by_the_living
    def assign(self, part: Part, rows: Rows, values: Column) -> Column:
        return self._undecided(rows, DEED)

    @by_the_living
    def write(self, part: Part, rows: Rows, values: Column) -> Column:
        return self._undecided(rows, DEED)

    @by_the_living
    def define(self, part: Part, rows: Rows, values: Column) -> Column:
        return self._undecided(rows, DEED)

    @by_the_living
    def store(self, part: Part, rows: Rows, values: Column) -> Column:
        return self._undecided(rows, DEED)

    @by_the_living
    def act(self, part: Part, rows: Rows, *arguments: Column) -> Column:
        return self._undecided(rows, DEED)


# ---- the evaluation log

MAX_ENTRIES = 4_096
"""Commands whose inputs a fleet keeps at most, to explain them later: many are heard by a few robots only, because
robots tell each other. What they take is bounded by `LOG_BYTES`."""
LOG_BYTES = 256
"""Bytes a robot for the inputs of past commands: a quarter of the kilobyte that a robot's mind may take."""
LOG_LEAST = 4 * 1024 * 1024
"""Bytes for them in a small fleet, where nobody counts."""
ENTRY_BYTES = 2_048
"""About what a command's inputs take besides their columns."""


@dataclass
class LogEntry:
    """What went into one command on the robots `rows`. minds: by number, those that they had then.

    proven, unproven_since: kept only if it may roll back. held: who was held then, kept only if anybody was.
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
    hosts: list[Given] = field(default_factory=list)

    @property
    def bytes(self) -> int:
        """About how much memory it takes."""
        arrays: Iterable[object] = (
            self.rows.index,
            self.mind,
            self.proven,
            self.unproven_since,
            self.held,
            self.draws,
        )
        kept = (*arrays, *self.columns.values(), *self.groups.values())
        return ENTRY_BYTES + self.host_bytes + sum(array.nbytes for array in kept if isinstance(array, np.ndarray))

    @property
    def host_bytes(self) -> int:
        """As much of it is what the robots' own functions gave."""
        return sum(8 * len(given) for _, given in self.hosts if len(given) and not _alike(given))

    def given(self, robot: int) -> Iterator[float | str]:
        """What a robot's own functions gave it, in their order."""
        for rows, given in self.hosts:
            place = rows.place(robot)
            if place is not None:
                found = given[place]
                yield found if isinstance(found, str) else float(found)

    def place(self, robot: int) -> int | None:
        """Where a robot is among those of the command."""
        return self.rows.place(robot)


class EvaluationLog:
    """The last commands of a fleet, as many as its share of memory allows, the last one always."""

    def __init__(self, memory: FleetMemory) -> None:
        self._memory = memory
        self._entries: deque[LogEntry] = deque(maxlen=MAX_ENTRIES)
        self._bytes = 0
        self.since: float | None = None
        """The time (s) of the snapshot that the fleet goes on from: it holds no inputs of what came before."""

    def remember(self, program: Program, rows: Rows, command: str) -> LogEntry:
        """Keep what goes into a command that these robots are about to evaluate."""
        state, minds = self._memory.state, self._memory.minds
        mind, proven, unproven_since = state.mind[rows.index].copy(), None, None
        there = {number: minds[number] for number, _, _ in self._memory.divide(rows, lambda number: number)}
        slots, groups = reads_of(program, there.values())
        if slots is None:
            slots, groups = set(state.slots()), set(state.groups)
            proven, unproven_since = state.proven[rows.index].copy(), state.unproven_since[rows.index].copy()
            there |= {number: minds[number] for number in np.unique(proven).tolist()}
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
            state.held[rows.index].copy() if state.held.any() else None,
            there,
            state.draws[rows.index].copy(),
            columns,
            {key: state.groups[key][rows.index].copy() for key in groups if key in state.groups},
        )
        self._bytes += entry.bytes
        if len(self._entries) == MAX_ENTRIES:
            self._drop()
        self._entries.append(entry)
        self._bound()
        return entry

    def weigh(self, entry: LogEntry) -> None:
        """Count what the evaluation of the last entry has added to it."""
        self._bytes += entry.host_bytes
        self._bound()

    def _bound(self) -> None:
        while len(self._entries) > 1 and self._bytes > max(LOG_BYTES * self._memory.state.count, LOG_LEAST):
            self._drop()

    def _drop(self) -> None:
        self._bytes -= self._entries.popleft().bytes

    def find(self, robot: int, command: str | None) -> LogEntry | None:
        """The entry of a command (None: the last one) that a robot has evaluated."""
        for entry in reversed(self._entries):
            if (command is None or entry.command == command) and entry.place(robot) is not None:
                return entry
        return None

    def limits(self) -> str:
        """Why a command may not be here, for people."""
        if self.since is None:
            return "its fleet keeps the last commands, as many as have room"
        return f"this run goes on from a snapshot taken at {self.since:g} s, which keeps no explanations of before"


def _alike(given: Column | list[float | str]) -> bool:
    """Whether one number stands for all."""
    return isinstance(given, np.ndarray) and given.strides == (0,)


def recollect(entry: LogEntry, robot: int, vocabulary: Vocabulary, keys: NDArray[np.uint64]) -> Recollection:
    """Evaluate a command again as one robot did, writing down what its memory answered. keys: of chance, by robot."""
    place = entry.place(robot)
    if place is None:
        raise KeyError(robot)
    state = FleetState(vocabulary, [0], 0)
    state.keys[0] = keys[robot]
    state.draws[0] = entry.draws[place]
    alone = Rows.run(0, 1)
    for slot, values in entry.columns.items():
        state.assign(slot, alone, values if isinstance(values, float) else float(values[place]))
    for key, members in entry.groups.items():
        state.group(key)[0] = members[place]
    minds = Minds(vocabulary)
    state.turn(alone, minds.add(entry.minds[int(entry.mind[place])]))
    if entry.proven is not None and entry.unproven_since is not None:
        state.proven[0] = minds.add(entry.minds[int(entry.proven[place])])
        state.unproven_since[0] = entry.unproven_since[place]
    if entry.held is not None:
        state.held[0] = entry.held[place]
    memory = FleetMemory(state, minds, Outbox(state, ["again"]), [None])
    memory.answers, memory.script = [], entry.given(robot)
    before, groups = state.row(0), state.groups_of(0)
    evaluate(memory, entry.program, alone)
    time, tick = before[TIME_SLOT], int(before[TICK])
    return Recollection(entry.program, before, groups, memory.answers, time, tick, entry.command)


def rehearsal(memory: FleetMemory, robot: int) -> Rehearsal:
    """A memory for asking what a robot would do now: it starts where the robot is, and nothing in it happens."""
    state, mind = memory.state, memory.kept(robot)
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
