"""The evaluation log: why a robot did what it did, without having kept what it did.

Of a command the fleet keeps what went into it: the columns that the program can look at, as they were, what the
robots had learned, and what their own functions gave. An explanation evaluates the command again, for the one robot,
which gives the very same values.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from sleepcast.fleet.columns import Column, FleetState, Mask, Rows
from sleepcast.fleet.machine import evaluate
from sleepcast.fleet.memory import FleetMemory, Given
from sleepcast.fleet.messages import Outbox
from sleepcast.fleet.minds import Mind, Minds
from sleepcast.fleet.read_set import reads_of
from sleepcast.language.explain import Recollection
from sleepcast.language.numerics import draw
from sleepcast.language.program import Program
from sleepcast.language.rehearsal import Rehearsal
from sleepcast.language.symbols import UserVariable
from sleepcast.language.vocabulary import TICK, TIME_SLOT, Vocabulary

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
