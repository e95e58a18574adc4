"""The telemetry of many robots as one table, slot x robot, and what a text comes to on it.

Of the table only those columns are filled that something asks for. Who fills them is its feeder, a class that is made
from `TelemetryTable`: a simulated fleet (`fleet/inspection`), robots that tell of themselves one by one, as on the air
(`station/telemetry`), or a recording (`console/recorded_values`).

A text is evaluated on the columns of all robots at once, and nothing that it could do is done. A robot is undecided,
with the reason, where its telemetry cannot say what the text comes to: it depends on chance, or on what the robot
itself would say, or on something that the robot has not told. What decides without that still decides: in
`(AND (> fuel 50%) (PROB 0.5))` an empty tank is a certain no.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Hashable
from functools import partial
from math import nan
from typing import Protocol, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from sleepcast.columns.evaluation import Evaluation, Programs, by_the_living
from sleepcast.columns.neighbours import NeighbourLists
from sleepcast.columns.values import Column, Columns, Index, Mask, Rows
from sleepcast.core.errors import MisuseError
from sleepcast.language.parts import Part, acts, walk
from sleepcast.language.program import Program
from sleepcast.language.rehearsal import ACTION, CHANCE, asks, does
from sleepcast.language.symbols import Declared
from sleepcast.language.vocabulary import TICK, TIME_SLOT

MAX_REASONS = 200
"""Different reasons told apart in one answer, so that one fits a byte; the rest counts as the last of them."""
NOT_YET = "its telemetry does not yet hold what the test reads"
IN_ITS_MEMORY = "its test reads a variable that lies in the robot's own memory"

Key = TypeVar("Key", bound=Hashable)

TextValues: TypeAlias = tuple[Column, NDArray[np.uint8], list[str]]
"""What a text comes to on some robots, NaN for unknown; where that cannot be said, which of the reasons, listed last,
is why (from 1; 0 where it can be said)."""


class Undecided(Exception):
    """A text needs something that telemetry does not hold, which this names."""


def validate_reading(text: str, program: Program) -> None:
    """Raises MisuseError for an expression that would do something: its value cannot be said without doing it."""
    if acts(program.root):
        raise MisuseError(f"{text} has side effects and cannot be previewed")


class KnownSymbols(Protocol):
    """What robots have learned alike. Each method raises Undecided where that is not known."""

    def declared(self, key: str) -> Declared | None:
        """What they have learned under this key, or None."""

    def fetch(self, part: Part) -> Program | None:
        """The program in the buffer or rule that a `fetch` part names, None if it is empty."""

    def operator(self, part: Part) -> Program | None:
        """The program of the operator that a `call` part names, None if they have none of that name."""


class QuietMemory(Evaluation):
    """A memory to read, of which nothing changes. reason: why a robot is undecided, by robot, as in `TextValues`."""

    def __init__(self, state: Columns) -> None:
        super().__init__(state)
        self.reason: NDArray[np.uint8] = np.zeros(state.count, np.uint8)
        self.reasons: list[str] = []

    @abstractmethod
    def divide(self, rows: Rows, key: Callable[[KnownSymbols], Key]) -> list[tuple[Key, Rows, Mask | None]]:
        """Group the rows by the result of `key` for what they have learned; each group with its places (None: all)."""

    def know(self, rows: Rows, reported: Mask) -> None:
        """Restrict these robots to the `reported` ones; the others are undecided."""
        if not reported.all():
            self.reasons.append(NOT_YET)
            self.reason[rows.take(~reported).index] = len(self.reasons)

    def look_up(self, key: str, rows: Rows) -> None:
        """Make robots undecided that may have learned something under a key, and have not told it."""

        def doubt(learned: KnownSymbols) -> str:
            try:
                learned.declared(key)
            except Undecided as why:
                return str(why)
            return ""

        for why, some, _ in self.divide(rows, doubt):
            if why:
                self.undecide(some, why)

    def undecide(self, rows: Rows, reason: str) -> Column:
        """Make these robots undecided and exclude them from the rest."""
        if reason not in self.reasons and len(self.reasons) < MAX_REASONS:
            self.reasons.append(reason)
        number = self.reasons.index(reason) + 1 if reason in self.reasons else MAX_REASONS
        before = self.reason[rows.index]
        self.reason[rows.index] = np.where(before == 0, np.uint8(number), before)
        if self.dead is None:
            self.dead = np.zeros(self.state.count, np.bool_)
        self.dead[rows.index] = True
        return np.full(rows.size, nan)

    def fetch(self, part: Part, rows: Rows) -> Programs:
        return self._quiet(part, rows, lambda learned: learned.fetch(part))

    def operator(self, part: Part, rows: Rows) -> Programs:
        def program(learned: KnownSymbols) -> Program | None:
            operator = learned.operator(part)
            return operator if operator is not None and operator.parameters == len(part.parts) else None

        return self._quiet(part, rows, program)

    def _quiet(self, part: Part, rows: Rows, program_of: Callable[[KnownSymbols], Program | None]) -> Programs:
        """Programs without side effects; robots that would enter another one, or an unknown one, become undecided."""

        def quiet(learned: KnownSymbols) -> Program | str | None:
            try:
                program = program_of(learned)
            except Undecided as why:
                return str(why)
            return does(part.name) if program is not None and acts(program.root) else program

        programs: Programs = []
        for program, some, mask in self.divide(rows, quiet):
            if isinstance(program, str):
                self.undecide(some if self.dead is None else some.take(~self.dead[some.index]), program)
            programs.append((None if isinstance(program, str) else program, some, mask))
        return programs

    @by_the_living
    def read(self, part: Part, rows: Rows) -> Column:
        """A linked variable: known only if it is part of the robots' telemetry."""
        values = self.state.column(part.slot, rows).copy()
        unknown = np.isnan(values)
        if unknown.any():
            self.undecide(rows.take(unknown), IN_ITS_MEMORY)
        return values

    @by_the_living
    def draw(self, part: Part, rows: Rows) -> Column:
        return self.undecide(rows, CHANCE)

    @by_the_living
    def host(self, part: Part, rows: Rows, *arguments: Column) -> Column:
        return self.undecide(rows, asks(part.name))

    def sensed(self, part: Part, rows: Rows, *arguments: Column) -> NeighbourLists:
        self.undecide(rows, asks(part.name))
        return NeighbourLists(np.zeros(rows.size + 1, np.intp), np.empty(0), np.zeros(rows.size, np.bool_))

    def defined(self, part: Part, rows: Rows) -> Mask:
        self.undecide(rows if self.dead is None else rows.take(~self.dead[rows.index]), ACTION)
        return np.zeros(rows.size, np.bool_)

    @by_the_living
    def assign(self, part: Part, rows: Rows, values: Column) -> Column:
        return self.undecide(rows, ACTION)

    @by_the_living
    def write(self, part: Part, rows: Rows, values: Column) -> Column:
        return self.undecide(rows, ACTION)

    @by_the_living
    def define(self, part: Part, rows: Rows, values: Column) -> Column:
        return self.undecide(rows, ACTION)

    @by_the_living
    def store(self, part: Part, rows: Rows, values: Column) -> Column:
        return self.undecide(rows, ACTION)

    @by_the_living
    def act(self, part: Part, rows: Rows, *arguments: Column) -> Column:
        return self.undecide(rows, ACTION)


class TelemetryTable(ABC):
    """See the module."""

    @abstractmethod
    def latest(self) -> Columns:
        """What robots told last, which stays as it is; of those that have told nothing all is unknown."""

    @abstractmethod
    def divide(self, rows: Rows, key: Callable[[KnownSymbols], Key]) -> list[tuple[Key, Rows, Mask | None]]:
        """As `QuietMemory.divide`."""

    def ask(self, program: Program, rows: Rows) -> Mask | None:
        """A program is about to be evaluated on these robots: let them tell, from now on, whatever it may read. Gives
        which of them already do, None for all."""
        return None

    def clock(self, slot: int, now: float, told: Column) -> Column | float | None:
        """What `time` or `tick` (the slot) is on all robots at `now`, or on one for all; None: what they told. Both go
        on while nobody tells anything.

        now: s of the desk's clock
        told: when each robot told of itself last, s of the same clock
        """
        return None

    def values(self, program: Program, robots: Index, now: float = nan, told: Column | None = None) -> TextValues:
        """What a program comes to on these robots, ascending, all of which have sent telemetry.

        now, told: see `clock`; None: the table is of this very moment
        """
        from sleepcast.columns.machine import evaluate  # who only stops robots, or watches them, does not wait for it

        rows = Rows.of(robots)
        reported = self.ask(program, rows)
        columns = self.latest()
        if told is not None:
            columns = _ClockedColumns(columns, partial(self.clock, now=now, told=told))
        memory = _TableMemory(self, columns)
        if reported is not None:
            memory.know(rows, reported)
        nameless = (part.name.casefold() for part in walk(program.root) if part.op in ("absent", "missing"))
        for key in dict.fromkeys(nameless):
            memory.look_up(key, rows)
        values = evaluate(memory, program, rows)
        reason = memory.reason[rows.index]
        return np.where(reason == 0, values, nan), reason, memory.reasons

    def stopped(self, robots: Index) -> Mask:
        """Which of these robots were stopped at their latest telemetry, as far as that is known."""
        return np.zeros(len(robots), np.bool_)


class BulkTelemetry(TelemetryTable):
    """Telemetry of minds that answer for many robots at once."""

    @abstractmethod
    def take(self, robots: Index) -> None:
        """These robots tell of themselves now."""

    @abstractmethod
    def stopped(self, robots: Index) -> Mask:
        """Which of these robots were stopped at their latest telemetry."""

    @abstractmethod
    def rest_states(self, robots: Index) -> tuple[Column, Column] | None:
        """How these robots move, which are telling of themselves: see `RestState`. None if they do not tell that."""


class _ClockedColumns(Columns):
    """What robots told, with clocks that have gone on since. clock: see `TelemetryTable.clock`."""

    def __init__(self, columns: Columns, clock: Callable[[int], Column | float | None]) -> None:
        self.count = columns.count
        self._columns, self._clock = columns, clock

    def members(self, key: str) -> Mask | None:
        return self._columns.members(key)

    def read(self, slot: int, rows: Rows) -> Column | float:
        values = self._clock(slot) if slot in (TIME_SLOT, TICK) else None
        if values is None:
            return self._columns.read(slot, rows)
        return values if isinstance(values, float) else values[rows.index]


class _TableMemory(QuietMemory):
    """The memories of robots as their telemetry describes them."""

    def __init__(self, table: TelemetryTable, columns: Columns) -> None:
        super().__init__(columns)
        self._table = table

    def divide(self, rows: Rows, key: Callable[[KnownSymbols], Key]) -> list[tuple[Key, Rows, Mask | None]]:
        return self._table.divide(rows, key)
