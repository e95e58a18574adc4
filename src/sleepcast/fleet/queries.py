"""Queries: expressions that are asked for again and again; each is looked up anew only when some robot's mind has
changed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from math import nan

import numpy as np

from sleepcast.columns.evaluation import by_the_living
from sleepcast.columns.machine import Plain, evaluate, is_plain, no_fault, no_local
from sleepcast.columns.neighbours import NeighbourLists
from sleepcast.columns.telemetry import Key, KnownSymbols, QuietMemory
from sleepcast.columns.values import CHUNK, Column, Columns, Mask, Rows, distinct
from sleepcast.core.memory import same
from sleepcast.fleet.inspection import reads_of
from sleepcast.fleet.memory import FleetMemory
from sleepcast.fleet.messages import Outbox
from sleepcast.fleet.state import FleetState, MindNames, Minds
from sleepcast.language.parts import ASKING, Part, host_of, walk
from sleepcast.language.program import Program
from sleepcast.language.reader import read
from sleepcast.language.vocabulary import TIME_SLOT

MAX_QUERIES = 256
"""Expressions that are stored: more than a sweep may measure."""


class FleetQueries:
    """The expressions that have been asked for, by their text. bodies: see `AskedMemory`."""

    def __init__(self, state: FleetState, minds: Minds, bodies: Sequence[object | None]) -> None:
        self._state, self._minds, self._bodies = state, minds, bodies
        self._queries: dict[str, FleetQuery] = {}

    def __getitem__(self, text: str) -> FleetQuery:
        """This expression, looked up. Raises what `FleetQuery` raises."""
        query = self._queries.get(text)
        if query is None or query.turns != self._state.turns or query.refused:
            if len(self._queries) >= MAX_QUERIES:
                self._queries.clear()
            query = self._queries[text] = FleetQuery(text, self._state, self._minds, self._bodies)
        return query


class FleetQuery:
    """One expression on all robots with the minds that they have now. Raises ReadError and CheckError."""

    def __init__(self, text: str, state: FleetState, minds: Minds, bodies: Sequence[object | None]) -> None:
        self.turns = state.turns
        self.rows = state.everybody()
        self._text, self._state, self._minds, self._bodies = text, state, minds, bodies
        self._pieces: list[tuple[Program, Rows, Mask | None]] = state.divide(self.rows, self._program)
        self._plain = len(self._pieces) == 1 and self.rows.size <= CHUNK and is_plain(self._pieces[0][0].root)
        self.reads = self._read()
        """The slots of the variables that it may read; None for any."""

    def values(self, now: float) -> tuple[Column, str]:
        """What it comes to at `now` (s), NaN for unknown, without side effects; and why that cannot be said for an
        expression that would have some, for random numbers, and for a function that makes a body do something, "" if it
        can."""
        if not self._pieces:  # all robots are gone
            return self._of_all(np.empty(0)), ""
        program, some, _ = self._pieces[0]
        if self._plain:  # it can do nothing but compute, and nobody asks for its steps and faults
            with np.errstate(all="ignore"):
                values = Plain(some, PresentColumns(self._state, now).read, no_local, no_fault).column(program.root)
            return self._of_all(values), ""
        memory = self._memory
        memory.state.now = now
        if len(self._pieces) == 1:
            values = evaluate(memory, program, some)
        else:
            values = np.empty(self.rows.size)
            for program, some, mask in self._pieces:
                values[mask] = evaluate(memory, program, some)
        return self._of_all(values), memory.reasons[0] if memory.reasons else ""

    def _of_all(self, values: Column) -> Column:
        """The values of the robots that are there, in a column with unknown ones for rows without a robot."""
        if self._state.present is None:
            return values
        column = np.full(self._state.count, nan)
        column[self.rows.index] = values
        return column

    @cached_property
    def _memory(self) -> AskedMemory:
        return AskedMemory(self._state, self._minds, self._bodies)

    @property
    def refused(self) -> bool:
        """Whether it could not be said for some robot: the memory remembers that."""
        return not self._plain and bool(self._memory.reasons)

    def _program(self, number: int) -> Program:
        names = MindNames(self._minds.vocabulary, self._minds[number])
        return self._minds.library.program(self._text, lambda: [read(self._text)], names)

    def _read(self) -> frozenset[int] | None:
        slots: set[int] = set()
        for program, some, _ in self._pieces:
            numbers = distinct(self._state.mind[some.index])[0]
            read_here = reads_of(program, {self._minds[number] for number in numbers.tolist()})[0]
            if read_here is None or any(part.op in ASKING for part in walk(program.root)):
                return None
            slots |= read_here
        return same(frozenset(slots))


class PresentColumns(Columns):
    """The values of all robots at `now` (s): idle robots have not looked at their clocks, and asking them must not make
    them do so."""

    def __init__(self, state: FleetState, now: float = 0.0) -> None:
        self._state, self.count, self.now = state, state.count, now

    def members(self, key: str) -> Mask | None:
        return self._state.members(key)

    def read(self, slot: int, rows: Rows) -> Column | float:
        return self.now if slot == TIME_SLOT else self._state.read(slot, rows)


class AskedMemory(QuietMemory):
    """What robots hold now, as the language's functions read it. bodies: those whose sensors may be asked; a robot
    without one that would ask it is undecided."""

    state: PresentColumns

    def __init__(self, state: FleetState, minds: Minds, bodies: Sequence[object | None]) -> None:
        super().__init__(PresentColumns(state))
        self._robots, self._minds = state, minds
        self._bodies = FleetMemory(state, minds, Outbox(state, ()), bodies) if bodies else None

    def divide(self, rows: Rows, key: Callable[[KnownSymbols], Key]) -> list[tuple[Key, Rows, Mask | None]]:
        return self._robots.divide(rows, lambda number: key(self._minds[number]))

    @by_the_living
    def host(self, part: Part, rows: Rows, *arguments: Column) -> Column:
        if self._bodies is None or host_of(part).acts:
            return super().host(part, rows, *arguments)
        self._bodies.begin(self.top, rows)
        return self._bodies.host(part, rows, *arguments)

    def sensed(self, part: Part, rows: Rows, *arguments: Column) -> NeighbourLists:
        if self._bodies is None:
            return super().sensed(part, rows, *arguments)
        self._bodies.begin(self.top, rows)
        return self._bodies.sensed(part, rows, *arguments)
