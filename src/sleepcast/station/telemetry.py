"""The telemetry of robots that tell of themselves one by one, as on the air: a feeder of the desk's table.

What each robot told lies here as it came: numbers in the order of its type, in bytes. A column of the table is made
when a text first reads it, for all robots at once, and is good until one of them tells something newer.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import copy
from math import inf, nan
from struct import unpack_from

import numpy as np

from sleepcast.columns.telemetry import Key, KnownSymbols, TelemetryTable, Undecided
from sleepcast.columns.values import AskedColumns, Column, Index, Mask, Rows
from sleepcast.language.parts import Part
from sleepcast.language.program import Program
from sleepcast.language.rehearsal import holds
from sleepcast.language.symbols import Declared
from sleepcast.language.vocabulary import ACTIVE0, BUFFERS, TIME_SLOT
from sleepcast.mind.telemetry import TelemetryRecord
from sleepcast.station.schema_merge import SlotMap
from sleepcast.station.validation import Minds, SlotValues, Telemetry

NUMBER = 8
"""Bytes of a number in telemetry."""


class PlacedRow:
    """What a robot told, by the slots of the fleet's vocabulary: its numbers are looked up when they are asked for.

    record: what it told
    slots: where the numbers of its type belong
    own: variables that it made itself, by slot
    """

    __slots__ = ("own", "record", "slots", "told")

    def __init__(self, record: TelemetryRecord, slots: SlotMap, own: Mapping[int, float]) -> None:
        self.record, self.slots, self.own = record, slots, own
        self.told = record.values

    def __getitem__(self, slot: int) -> float:
        if (place := self.slots.places.get(slot)) is not None:
            value: float = unpack_from("<d", self.record.values, NUMBER * place)[0]
        elif ACTIVE0 < slot < ACTIVE0 + BUFFERS:
            value = float(self.record.active >> (slot - ACTIVE0 - 1) & 1)
        else:
            value = self.own.get(slot, self.slots.fixed.get(slot, nan))
        return value if -inf < value < inf else nan

    @property
    def groups(self) -> frozenset[str]:
        """Keys of the groups that it is in."""
        return self.record.group_keys


class CopiedRow:
    """What a robot of this process told: its numbers by slot, which are copied, and the keys of its groups."""

    __slots__ = ("groups", "numbers")
    slots = None
    told = b""

    def __init__(self, numbers: SlotValues, groups: frozenset[str]) -> None:
        self.numbers, self.groups = copy(numbers), groups

    def __getitem__(self, slot: int) -> float:
        try:
            return self.numbers[slot]
        except IndexError:  # a variable that another robot has made since
            return nan


class RobotsOfType:
    """Robots whose numbers stand in one order, with their places.

    slots: where these numbers belong, None for robots of this process
    """

    def __init__(self, slots: SlotMap | None) -> None:
        self._slots = slots
        self.places: list[int] = []
        self.rows: list[PlacedRow | CopiedRow] = []

    def column(self, slot: int) -> Column | list[float]:
        """A variable of these robots."""
        place = None if self._slots is None else self._slots.places.get(slot)
        if place is None:
            return [row[slot] for row in self.rows]
        first, last = NUMBER * place, NUMBER * (place + 1)
        told = b"".join([row.told[first:last] for row in self.rows])
        numbers = np.frombuffer(told, "<f8")
        return np.where(np.isfinite(numbers), numbers, nan)


class ToldRows:
    """What robots had told at a moment, by place, None for who had told nothing; as columns."""

    def __init__(self, rows: Sequence[PlacedRow | CopiedRow | None]) -> None:
        self._rows = rows
        self._types: list[RobotsOfType] | None = None

    def column(self, slot: int) -> Column:
        """A variable of all robots."""
        if self._types is None:
            self._types = self._by_type()
        values = np.full(len(self._rows), nan)
        for robots in self._types:
            values[robots.places] = robots.column(slot)
        return values

    def _by_type(self) -> list[RobotsOfType]:
        types: dict[SlotMap | None, RobotsOfType] = {}
        for place, row in enumerate(self._rows):
            if row is not None:
                robots = types.get(row.slots)
                if robots is None:
                    robots = types[row.slots] = RobotsOfType(row.slots)
                robots.places.append(place)
                robots.rows.append(row)
        return list(types.values())

    def groups(self) -> dict[str, Mask]:
        """The members of each group, by its key."""
        groups: dict[str, Mask] = {}
        for place, row in enumerate(self._rows):
            for key in () if row is None else row.groups:
                if key not in groups:
                    groups[key] = np.zeros(len(self._rows), np.bool_)
                groups[key][place] = True
        return groups


class SharesSymbols(ABC):
    """A mind whose symbols are one object for all robots that have learned the same."""

    @property
    @abstractmethod
    def symbols(self) -> KnownSymbols:
        """What it has learned."""


class Stranger:
    """What a robot has learned of which only telemetry is known (a `KnownSymbols`)."""

    def declared(self, key: str) -> Declared | None:
        """What is unknown is not looked for."""
        return None

    def fetch(self, part: Part) -> Program | None:
        raise Undecided(holds(part.name))

    def operator(self, part: Part) -> Program | None:
        raise Undecided(holds(part.name))


STRANGER = Stranger()


class ToldTelemetry(TelemetryTable):
    """See the module. minds: of the robots, as far as they can be asked."""

    def __init__(self, minds: Minds) -> None:
        self._minds = minds
        self._names: list[str] = []
        self._rows: list[PlacedRow | CopiedRow | None] = []
        self._told = 0
        """How often robots have told anything."""
        self._latest: tuple[int, AskedColumns] | None = None
        """The table, and after how many tellings it was made."""

    def take(self, place: int, news: Telemetry) -> None:
        """Take in what the robot at a place tells now."""
        missing = place + 1 - len(self._rows)
        self._names += [""] * missing
        self._rows += [None] * missing
        row = news.values
        self._rows[place] = row if isinstance(row, PlacedRow) else CopiedRow(row, news.groups)
        self._names[place] = news.name
        self._told += 1

    def forget(self, places: Iterable[int]) -> None:
        """What the robots at these places told says nothing about them any more."""
        for place in places:
            if place < len(self._rows):
                self._rows[place] = None
        self._told += 1

    def stopped(self, robots: Index) -> Mask:
        minds = (self._minds.get(self._names[place]) for place in robots.tolist())
        return np.array([mind is not None and mind.stopped for mind in minds], np.bool_)

    def latest(self) -> AskedColumns:
        told, latest = self._told, self._latest
        if latest is None or latest[0] != told:
            rows = tuple(self._rows)
            columns = ToldRows(rows)
            latest = self._latest = told, AskedColumns(len(rows), columns.column, columns.groups)
        return latest[1]

    def clock(self, slot: int, now: float, told: Column) -> Column | float | None:
        """How long its ticks are, no robot tells."""
        if slot != TIME_SLOT:
            return None
        columns = self.latest()
        return columns.column(slot, Rows.run(0, columns.count)) + (now - told[: columns.count])

    def divide(self, rows: Rows, key: Callable[[KnownSymbols], Key]) -> list[tuple[Key, Rows, Mask | None]]:
        symbols = [self._symbols(self._names[place]) for place in rows.robots.tolist()]
        each = {id(one): one for one in symbols}
        sorts: dict[Key, int] = {}
        code_of = {number: sorts.setdefault(key(one), len(sorts)) for number, one in each.items()}
        if len(sorts) == 1:
            return [(next(iter(sorts)), rows, None)]
        codes = np.array([code_of[id(one)] for one in symbols], np.intp)
        return [(value, rows.take(codes == code), codes == code) for value, code in sorts.items()]

    def _symbols(self, name: str) -> KnownSymbols:
        mind = self._minds.get(name)
        if mind is None:
            return STRANGER
        shared: object = mind
        return shared.symbols if isinstance(shared, SharesSymbols) else mind
