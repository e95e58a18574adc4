"""Variables and groups of many robots, as columns: one number a robot, contiguously, so that one vector instruction
serves many robots. A variable gets a column when robots first differ in it; until then one number stands for all. NaN
is unknown. `Rows` says which robots something refers to: a range of indices, whose columns are views without copying,
or a list.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Mapping, Sequence
from math import nan

import msgspec
import numpy as np

from sleepcast.columns.rows import Column, Mask, Rows
from sleepcast.core.arrays import filled
from sleepcast.core.serial import Array, Arrays, SerialError, dump_arrays
from sleepcast.language.vocabulary import MAX_USER_VARIABLES


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
        self._columns: list[Column | None] = [None] * len(self._same)
        self._shared: set[int] = set()
        """Slots of variables whose columns are stored elsewhere."""

    def members(self, key: str) -> Mask | None:
        return self.groups.get(key)

    def read(self, slot: int, rows: Rows) -> Column | float:
        if slot >= len(self._same):
            return nan
        column = self._columns[slot]
        return self._same[slot] if column is None else column[rows.index]

    def assign(self, slot: int, rows: Rows, values: Column | float) -> None:
        """Set a variable of these robots."""
        if isinstance(values, float) and rows.size == self.count and slot < len(self._same):
            self._same[slot], self._columns[slot] = values, None
            return
        self.own(slot)[rows.index] = values

    def own(self, slot: int) -> Column:
        """The variable's own column, allocated now if one number stood for all until now."""
        while slot >= len(self._same):
            self._same.append(nan)
            self._columns.append(None)
        column = self._columns[slot]
        if column is None:
            column = self._columns[slot] = filled(self._same[slot], np.float64, self.count)
        return column

    def share(self, slot: int, column: Column) -> None:
        """Read a variable from a column stored elsewhere, always with its current values."""
        self._columns[slot] = column
        self._shared.add(slot)

    def copy_from(self, other: ValueColumns, rows: Rows, slots: Iterable[int]) -> None:
        """Copy some variables of these robots."""
        for slot in slots:
            values = other.read(slot, rows)
            if isinstance(values, float) and slot < len(self._same) and self._columns[slot] is None:
                same = self._same[slot]
                if same == values or (same != same and values != values):
                    continue  # all robots have this value already
            self.assign(slot, rows, values)

    def copy_groups(self, other: ValueColumns, rows: Rows) -> None:
        """Copy the group memberships of these robots."""
        for key, members in other.groups.items():
            self.group(key)[rows.index] = members[rows.index]

    def slots(self) -> range:
        """Every slot that has ever been used."""
        return range(len(self._same))

    def row(self, robot: int) -> list[float]:
        """The values of one robot, by slot."""
        return [
            same if column is None else float(column[robot])
            for same, column in zip(self._same, self._columns, strict=True)
        ]

    def group(self, key: str) -> Mask:
        """The members of a group; an unknown group is created."""
        members = self.groups.get(key)
        if members is None:
            members = self.groups[key] = filled(0, np.bool_, self.count)
        return members

    def groups_of(self, robot: int) -> frozenset[str]:
        """The keys of the groups that one robot is in."""
        return frozenset(key for key, members in self.groups.items() if members[robot])

    # ---- saving and restoring

    def values(self) -> ValuesState:
        """The variables that are not stored elsewhere, and the groups."""
        columns = {
            slot: Array.of(column)
            for slot, column in enumerate(self._columns)
            if column is not None and slot not in self._shared
        }
        return ValuesState(list(self._same), columns, dump_arrays(self.groups))

    def refill(self, state: ValuesState) -> None:
        """Restore saved values. Raises SerialError if they are of another fleet."""
        length, shape = len(state.same), (self.count,)
        if not len(self._same) <= length <= len(self._same) + MAX_USER_VARIABLES:
            raise SerialError(f"robots with {length} variables, wanted {len(self._same)} and those that they made")
        if not all(0 <= slot < length and slot not in self._shared for slot in state.columns):
            raise SerialError(f"a column of a variable that is none of the {length}, or one that others keep")
        shared = [(slot, self._columns[slot]) for slot in self._shared]
        self._same, self._columns = list(state.same), [None] * length
        for slot, theirs in shared:
            self._columns[slot] = theirs
        for slot, column in state.columns.items():
            self._columns[slot] = column.made(np.float64, shape, f"variable {slot}")
        self.groups = {key: members.made(np.bool_, shape, f"group {key}") for key, members in state.groups.items()}


def spread(values: Column | float, size: int) -> Column:
    """A column, also if given one number."""
    return np.full(size, values) if isinstance(values, float) else values
