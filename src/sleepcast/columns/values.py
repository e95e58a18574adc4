"""Variables and groups of many robots, as columns: one number a robot, contiguously, so that one vector instruction
serves many robots. A variable gets a column when robots first differ in it; until then one number stands for all. NaN
is unknown. `Rows` says which robots something refers to: a range of indices, whose columns are views without copying,
or a list. `Shared` holds what is no number, and equal for most robots.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from array import array
from collections.abc import Callable, Collection, Hashable, Iterable, Mapping, Sequence
from functools import lru_cache
from itertools import chain
from math import nan
from typing import Generic, TypeAlias, TypeVar

import msgspec
import numpy as np
from numpy.typing import NDArray

from sleepcast.core.arrays import filled
from sleepcast.core.serial import Array, Arrays, SerialError, dump_arrays, within
from sleepcast.language.vocabulary import MAX_USER_VARIABLES

Value = TypeVar("Value")
Column: TypeAlias = NDArray[np.float64]
"""One number for each of some rows, in order."""
Moves: TypeAlias = NDArray[np.int64]
"""What is to be copied: how many pieces, then of each from which address to which one, and how many words."""
Mask: TypeAlias = NDArray[np.bool_]
Index: TypeAlias = NDArray[np.intp]

CHUNK = 16_384
"""Robots walked at once: a few columns of this length stay in the processor's second-level cache."""
STRETCH = 8 * CHUNK
"""Robots that are taken through all their rules before the next ones: their columns stay in the third-level cache."""
SPARE = 16
"""Values that no robot has any more, and that may accumulate."""


class Rows:
    """Some robots of a fleet, in ascending order.

    index: what a column is indexed with
    first: start of their chunk
    """

    __slots__ = ("first", "index", "size")

    def __init__(self, index: slice | Index, size: int, first: int = 0) -> None:
        self.index, self.size, self.first = index, size, first

    @staticmethod
    @lru_cache(maxsize=256, typed=True)
    def run(start: int, stop: int) -> Rows:
        """The robots from `start` to `stop` (exclusive)."""
        return Rows(slice(start, stop), stop - start, start)

    @classmethod
    def of(cls, index: Index) -> Rows:
        """The robots with these indices, ascending; consecutive ones become a range."""
        size = len(index)
        if size and int(index[-1]) - int(index[0]) + 1 == size:
            return Rows.run(int(index[0]), int(index[-1]) + 1)
        return cls(index, size, int(index[0]) if size else 0)

    def take(self, mask: Mask) -> Rows:
        """Those for which `mask` (one truth per robot) holds."""
        if isinstance(self.index, slice):
            index = np.flatnonzero(mask)
            index += self.index.start
        else:
            index = self.index[mask]
        return Rows(index, len(index), self.first)

    def without(self, others: Rows) -> Rows:
        """Those that are not among the others, which are some of them."""
        if others.size == 0:
            return self
        left = np.ones(self.size, np.bool_)
        left[self.indices_of(others.robots)] = False
        return self.take(left)

    def none(self) -> Rows:
        """None of them."""
        return Rows(np.zeros(0, np.intp), 0, self.first)

    @classmethod
    def together(cls, some: Sequence[Rows]) -> Rows:
        """All of several, which have no robot in common."""
        return some[0] if len(some) == 1 else cls.of(np.sort(np.concatenate([rows.robots for rows in some])))

    @property
    def robots(self) -> Index:
        """Their indices."""
        return np.arange(self.index.start, self.index.stop) if isinstance(self.index, slice) else self.index

    @property
    def within(self) -> slice | Index:
        """Their places in the chunk."""
        if isinstance(self.index, slice):
            return slice(self.index.start - self.first, self.index.stop - self.first)
        return self.index - self.first

    @property
    def width(self) -> int:
        """Length of a column of their chunk that holds all of them."""
        if self.size == 0:
            return 0
        last = self.index.stop - 1 if isinstance(self.index, slice) else int(self.index[-1])
        return last - self.first + 1

    def index_of(self, robot: int) -> int | None:
        """The place of a robot among them."""
        if isinstance(self.index, slice):
            return robot - self.index.start if self.index.start <= robot < self.index.stop else None
        place = int(np.searchsorted(self.index, robot))
        return place if place < self.size and self.index[place] == robot else None

    def indices_of(self, robots: Index) -> Index:
        """The places of these robots, which must all be among them."""
        if isinstance(self.index, slice):
            indices: Index = robots - self.index.start
            return indices
        return np.searchsorted(self.index, robots)

    def pieces(self, length: int) -> list[Rows]:
        """The same robots in pieces of at most `length`."""
        if isinstance(self.index, slice):
            start, stop = self.index.start, self.index.stop
            return [Rows.run(i, min(i + length, stop)) for i in range(start, stop, length)]
        return [Rows.of(self.index[i : i + length]) for i in range(0, self.size, length)]

    def chunks(self) -> list[Rows]:
        """The same robots, `CHUNK` at a time."""
        return self.pieces(CHUNK)

    def stretches(self) -> list[Rows]:
        """The same robots, `STRETCH` at a time."""
        return self.pieces(STRETCH)


def distinct(numbers: NDArray[np.int32]) -> tuple[Index, Index]:
    """The distinct numbers, ascending, and for each number its index among them."""
    lowest, highest = (int(numbers.min()), int(numbers.max())) if len(numbers) else (0, -1)
    if lowest >= highest:
        return np.arange(lowest, highest + 1), np.zeros(len(numbers), np.intp)
    if highest > 4 * len(numbers) + 1_024:
        unique, which = np.unique(numbers, return_inverse=True)
        return unique.astype(np.intp), which
    there = np.zeros(highest + 1, np.bool_)
    there[numbers] = True
    return np.flatnonzero(there), (np.cumsum(there) - 1)[numbers]


class ValuesState(msgspec.Struct):
    """The variables and groups of `ValueColumns`: for each slot one number for all or a column; members by group."""

    same: list[float]
    columns: dict[int, Array]
    groups: Arrays


class Columns(ABC):
    """What a program reads of robots. count: how many there are."""

    count: int

    @abstractmethod
    def members(self, key: str) -> Mask | None:
        """Who is in a group; None if nobody ever was."""

    @abstractmethod
    def read(self, slot: int, rows: Rows) -> Column | float:
        """The values of a variable: a column (for a range of rows a read-only view), or one number for all."""

    def column(self, slot: int, rows: Rows) -> Column:
        """The values of a variable, one for each of the rows."""
        return spread(self.read(slot, rows), rows.size)


class AskedColumns(Columns):
    """Columns that are filled when they are first read.

    count: how many robots there are
    fill: gives the values of a variable, by its slot, on all robots, or one number for all
    groups: gives the members of each group, by its key
    """

    def __init__(
        self, count: int, fill: Callable[[int], Column | float], groups: Callable[[], Mapping[str, Mask]]
    ) -> None:
        self.count = count
        self._fill, self._find_groups = fill, groups
        self._filled: dict[int, Column | float] = {}
        self._groups: Mapping[str, Mask] | None = None

    @property
    def groups(self) -> Mapping[str, Mask]:
        """The members of each group."""
        if self._groups is None:
            self._groups = self._find_groups()
        return self._groups

    def members(self, key: str) -> Mask | None:
        return self.groups.get(key)

    def read(self, slot: int, rows: Rows) -> Column | float:
        values = self._filled.get(slot)
        if values is None:
            values = self._filled[slot] = self._fill(slot)
        return values if isinstance(values, float) else values[rows.index]


class ValueColumns(Columns):
    """The values of `count` robots by slot, at first the same on all of them, and who is in which group, by its key."""

    def __init__(self, count: int, same: Sequence[float]) -> None:
        self.count = count
        self.groups: dict[str, Mask] = {}
        self._same = [*same]
        self._columns: dict[int, Column] = {}
        self._table = np.empty((0, count))
        """Columns that lie together, a row each: an array for each of them would take as much memory again."""
        self._rows = array("h")
        """The row of each slot in the table, -1 for none; slots beyond the end have none."""
        self._borrowed = False
        """Whether the table is stored elsewhere."""
        self._copied: tuple[ValueColumns, int, int] | None = None
        """The columns that were copied last in one go, whose they are, and the layouts there and here since."""
        self._moves: Moves | None = None
        """How they are copied, see `moves`."""
        self.layouts = 0
        """How often columns or groups have come or gone: as long as it stays the same, each lies where it did."""

    def members(self, key: str) -> Mask | None:
        return self.groups.get(key)

    def read(self, slot: int, rows: Rows) -> Column | float:
        if slot >= len(self._same):
            return nan
        column = self._columns.get(slot)
        if column is not None:
            return column[rows.index]
        row = self._rows[slot] if slot < len(self._rows) else -1
        return self._same[slot] if row < 0 else self._table[row, rows.index]

    def _column(self, slot: int) -> Column | None:
        """The column of a variable; None where one number stands for all."""
        column = self._columns.get(slot)
        if column is None and slot < len(self._rows) and self._rows[slot] >= 0:
            column = self._table[self._rows[slot]]
        return column

    def assign(self, slot: int, rows: Rows, values: Column | float) -> None:
        """Set a variable of these robots."""
        if isinstance(values, float) and rows.size == self.count and slot < len(self._same):
            if self._column(slot) is not None:
                self.layouts += 1
                self._columns.pop(slot, None)
                self._rows[slot : slot + 1] = array("h", [-1] * len(self._rows[slot : slot + 1]))
            self._same[slot] = values
            return
        self.own(slot)[rows.index] = values

    def own(self, slot: int) -> Column:
        """The variable's own column, allocated now if one number stood for all until now."""
        while slot >= len(self._same):
            self._same.append(nan)
        column = self._column(slot)
        if column is None:
            self.layouts += 1
            column = self._columns[slot] = filled(self._same[slot], np.float64, self.count)
        return column

    def share(self, first: int, table: Column, but: Collection[int] = ()) -> None:
        """Read the variables from slot `first` on from the rows of a table stored elsewhere, always with their current
        values. but: the slots of those that are not."""
        self._table, self._borrowed = table, True
        self._rows = array("h", [-1] * first)
        self._rows.extend(-1 if first + row in but else row for row in range(len(table)))
        self.layouts += 1

    def copy_from(self, other: ValueColumns, rows: Rows, slots: Iterable[int]) -> None:
        """Copy some variables of these robots."""
        for slot in slots:
            values = other.read(slot, rows)
            if isinstance(values, float) and slot < len(self._same) and self._column(slot) is None:
                same = self._same[slot]
                if same == values or (same != same and values != values):
                    continue  # all robots have this value already
            self.assign(slot, rows, values)

    def copy_all(self, other: ValueColumns) -> None:
        """Copy every variable of all robots, in one go."""
        if not self._has_room_for(other):
            self._make_room_for(other)
        self._same[:] = other._same
        known = len(other._table)
        self._table[:known] = other._table
        if other._columns:
            np.concatenate([*other._columns.values()], out=self._table[known:].reshape(-1))

    def _has_room_for(self, other: ValueColumns) -> bool:
        return self._copied is not None and self._copied == (other, other.layouts, self.layouts)

    def moves(self, other: ValueColumns) -> Moves | None:
        """How somebody else may copy every column of all robots, the same object as long as that holds; None if it
        takes more, since columns have come or gone."""
        if not self._has_room_for(other):
            return None
        if self._moves is None:
            moves = list[list[int]]()
            for column, into in zip((*other._table, *other._columns.values()), self._table, strict=True):
                begin = column.ctypes.data
                if moves and moves[-1][0] + 8 * moves[-1][2] == begin:
                    moves[-1][2] += self.count
                else:
                    moves.append([begin, into.ctypes.data, self.count])
            self._moves = np.array([len(moves), *chain.from_iterable(moves)], np.int64)
        return self._moves

    def moved(self, other: ValueColumns) -> None:
        """Somebody else has made these `moves`: copy what is the same on all robots."""
        self._same[:] = other._same

    def _make_room_for(self, other: ValueColumns) -> None:
        """Let all columns be rows of the table: those of the other's table, then the others."""
        known, alone = len(other._table), [*other._columns]
        if self._table.shape != (known + len(alone), self.count):
            self._table = np.empty((known + len(alone), self.count))
        self._same, self._columns, self._rows = [*other._same], {}, other._rows[:]
        self._rows.extend([-1] * (max(alone, default=-1) + 1 - len(self._rows)))
        for row, slot in enumerate(alone, known):
            self._rows[slot] = row
        self.layouts += 1
        self._copied, self._moves = (other, other.layouts, self.layouts), None

    def copy_groups(self, other: ValueColumns, rows: Rows) -> None:
        """Copy the group memberships of these robots."""
        for key, members in other.groups.items():
            self.group(key)[rows.index] = members[rows.index]

    def copy_robots(self, robots: Index, into: Index) -> None:
        """Give each robot of `into` all variables and groups of the one of `robots` in its place, but for what is
        stored elsewhere."""
        for slot in self.slots():
            column = None if self._elsewhere(slot) else self._column(slot)
            if column is not None:
                column[into] = column[robots]
        for members in self.groups.values():
            members[into] = members[robots]

    def forget_robots(self, robots: Index) -> None:
        """These robots are in no group, and nothing is known of their variables."""
        for slot in self.slots():
            column = None if self._elsewhere(slot) else self._column(slot)
            if column is not None:
                column[robots] = nan
        for members in self.groups.values():
            members[robots] = False

    def begin_robots(self, robots: Index, values: Sequence[float]) -> None:
        """These robots are in no group, and have these values by slot; of all others nothing is known."""
        for slot in self.slots():
            value = values[slot] if slot < len(values) else nan
            same = self._same[slot]
            lasts = self._column(slot) is None and (same == value or (same != same and value != value))
            if not lasts and not self._elsewhere(slot):
                self.own(slot)[robots] = value
        for members in self.groups.values():
            members[robots] = False

    def slots(self) -> range:
        """Every slot that has ever been used."""
        return range(len(self._same))

    def row(self, robot: int) -> list[float]:
        """The values of one robot, by slot."""
        columns = map(self._column, self.slots())
        return [
            same if column is None else float(column[robot]) for same, column in zip(self._same, columns, strict=True)
        ]

    def group(self, key: str) -> Mask:
        """The members of a group; an unknown group is created."""
        members = self.groups.get(key)
        if members is None:
            self.layouts += 1
            members = self.groups[key] = filled(0, np.bool_, self.count)
        return members

    def groups_of(self, robot: int) -> frozenset[str]:
        """The keys of the groups that one robot is in."""
        return frozenset(key for key, members in self.groups.items() if members[robot])

    # ---- saving and restoring

    def _elsewhere(self, slot: int) -> bool:
        """Whether a variable is stored elsewhere."""
        return self._borrowed and slot < len(self._rows) and self._rows[slot] >= 0

    def values(self) -> ValuesState:
        """The variables that are not stored elsewhere, and the groups. Equal values give equal states, whether native
        code has needed a column of them or not."""
        same, columns = list(self._same), dict[int, Array]()
        for slot in self.slots():
            column = None if self._elsewhere(slot) else self._column(slot)
            if column is None:
                continue
            bits = column.view(np.int64)
            alike = bool((bits == bits[0]).all())
            same[slot] = float(column[0]) if alike else nan
            if not alike:
                columns[slot] = Array.of(column)
        return ValuesState(same, columns, dump_arrays(self.groups))

    def refill(self, state: ValuesState) -> None:
        """Restore saved values. Raises SerialError if they are of another fleet."""
        length, shape = len(state.same), (self.count,)
        if not len(self._same) <= length <= len(self._same) + MAX_USER_VARIABLES:
            raise SerialError(f"robots with {length} variables, wanted {len(self._same)} and those that they made")
        if not all(0 <= slot < length and not self._elsewhere(slot) for slot in state.columns):
            raise SerialError(f"a column of a variable that is none of the {length}, or one that others keep")
        self.layouts += 1
        if not self._borrowed:
            self._table, self._rows = np.empty((0, self.count)), array("h")
        self._same = list(state.same)
        self._columns = {
            slot: column.made(np.float64, shape, f"variable {slot}") for slot, column in state.columns.items()
        }
        self.groups = {key: members.made(np.bool_, shape, f"group {key}") for key, members in state.groups.items()}


def spread(values: Column | float, size: int) -> Column:
    """A column, also if given one number."""
    return np.full(size, values) if isinstance(values, float) else values


def _itself(value: object) -> Hashable:
    return value


class Shared(Generic[Value]):
    """The values of `count` robots, `first` at first. key: is equal for equal values.

    Values never change; `change` gives robots others. While all robots have the same value there is no array.
    """

    def __init__(self, count: int, first: Value, key: Callable[[Value], Hashable] = _itself) -> None:
        self._count, self._key = count, key
        self._used = 1
        """Values in use when last counted."""
        self._all_have(first)

    def _all_have(self, value: Value) -> None:
        self.values = [value]
        """Those that robots have, and perhaps some that none has any more."""
        self._numbers: dict[Hashable, int] = {}
        """The index of each value, by its key, where they differ."""
        self._column: NDArray[np.int32] | None = None
        """Index of each robot's value; None: all have the only one."""

    def of(self, robot: int) -> Value:
        """The value of one robot."""
        return self.values[0 if self._column is None else int(self._column[robot])]

    @property
    def common(self) -> Value | None:
        """The value that all robots have; None where they may differ."""
        return self.values[0] if self._column is None else None

    def divide(self, rows: Rows) -> list[tuple[Value, Rows, Mask | None]]:
        """Group the rows by their values; each group with its places (None: all)."""
        if rows.size == 0:
            return []
        if self._column is None:
            return [(self.values[0], rows, None)]
        numbers = self._column[rows.index]
        present = distinct(numbers)[0].tolist()
        if len(present) == 1:
            return [(self.values[present[0]], rows, None)]
        masks = [numbers == number for number in present]
        return [(self.values[number], rows.take(mask), mask) for number, mask in zip(present, masks, strict=True)]

    def where(self, rows: Rows, holds: Callable[[Value], bool]) -> Rows:
        """Those of the rows for whose values `holds` is true."""
        if self._column is None:
            return rows if holds(self.values[0]) else rows.none()
        truths = np.array([holds(value) for value in self.values])
        return rows.take(truths[self._column[rows.index]])

    def change(self, rows: Rows, how: Callable[[Value], Value]) -> None:
        """Replace the values of these robots."""
        for value, some, _ in self.divide(rows):
            changed = how(value)
            if changed is not value:
                self.set(some, changed)

    def set(self, rows: Rows, value: Value) -> None:
        """Give these robots this value."""
        if rows.size == 0:
            return
        if rows.size == self._count:
            self._all_have(value)
            return
        if not self._numbers:
            self._number()
        number = self._numbers.setdefault(self._key(value), len(self.values))
        if number == len(self.values):
            self.values.append(value)
        if self._column is None:
            if number == 0:
                return
            self._column = filled(0, np.int32, self._count)
        self._column[rows.index] = number
        if len(self.values) > 2 * self._used + SPARE:  # forget those that no robot has any more
            numbers, self._column[:] = np.unique(self._column, return_inverse=True)
            self.values = [self.values[number] for number in numbers.tolist()]
            self._number()
            self._used = len(self.values)

    def copy(self, robots: Index, into: Index) -> None:
        """Give each robot of `into` the value of the one of `robots` in its place."""
        if self._column is not None:
            self._column[into] = self._column[robots]

    @property
    def column(self) -> NDArray[np.int32]:
        """The index of each robot's value in `values`."""
        return np.zeros(self._count, np.int32) if self._column is None else self._column

    def restore(self, values: Sequence[Value], column: NDArray[np.int32]) -> None:
        """Restore values, and the index of each robot's. Raises SerialError for an index of none."""
        if not values:
            raise SerialError("robots without a value that each of them has")
        within(column, 0, len(values) - 1, "the values of robots")
        self._all_have(values[0])
        if len(values) == 1:
            return
        self.values, self._column = list(values), column
        self._number()

    def _number(self) -> None:
        self._numbers = {self._key(value): number for number, value in reversed([*enumerate(self.values)])}
