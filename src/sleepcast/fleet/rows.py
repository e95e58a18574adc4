"""Rows: which robots of a fleet something refers to, and what each of them has: a number of its own, in an array, or a
value that is stored once for all robots that have equal ones (`Shared`), such as whose orders count on them."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from typing import Generic, TypeAlias, TypeVar

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.arrays import filled
from sleepcast.core.serial import SerialError, within

Column: TypeAlias = NDArray[np.float64]
"""One number for each of some rows, in order."""
Mask: TypeAlias = NDArray[np.bool_]
Index: TypeAlias = NDArray[np.intp]

CHUNK = 16_384
"""Robots walked at once: a few columns of this length stay in the processor's second-level cache."""
STRETCH = 8 * CHUNK
"""Robots that are taken through all their rules before the next ones: their columns stay in the third-level cache."""

Value = TypeVar("Value")
SPARE = 16
"""Values that no robot has any more, and that may accumulate."""


class Rows:
    """Some robots of a fleet, in ascending order. index: what a column is indexed with. first: start of their chunk."""

    __slots__ = ("first", "index", "size")

    def __init__(self, index: slice | Index, size: int, first: int = 0) -> None:
        self.index, self.size, self.first = index, size, first

    @classmethod
    def run(cls, start: int, stop: int) -> Rows:
        """The robots from `start` to `stop` (exclusive)."""
        return cls(slice(start, stop), stop - start, start)

    @classmethod
    def of(cls, index: Index) -> Rows:
        """The robots with these indices, ascending; consecutive ones become a range."""
        size = len(index)
        if size and int(index[-1]) - int(index[0]) + 1 == size:
            return cls.run(int(index[0]), int(index[-1]) + 1)
        return cls(index, size, int(index[0]) if size else 0)

    def take(self, mask: Mask) -> Rows:
        """Those for which `mask` (one truth per robot) holds."""
        if isinstance(self.index, slice):
            found = np.flatnonzero(mask)
            found += self.index.start
        else:
            found = self.index[mask]
        return Rows(found, len(found), self.first)

    def without(self, others: Rows) -> Rows:
        """Those that are not among the others, which are some of them."""
        if others.size == 0:
            return self
        left = np.ones(self.size, np.bool_)
        left[self.places(others.robots)] = False
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

    def place(self, robot: int) -> int | None:
        """The place of a robot among them."""
        if isinstance(self.index, slice):
            return robot - self.index.start if self.index.start <= robot < self.index.stop else None
        place = int(np.searchsorted(self.index, robot))
        return place if place < self.size and self.index[place] == robot else None

    def places(self, robots: Index) -> Index:
        """The places of these robots, which must all be among them."""
        if isinstance(self.index, slice):
            found: Index = robots - self.index.start
            return found
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
        self._numbers = {self._key(value): 0}
        self._column: NDArray[np.int32] | None = None
        """Index of each robot's value; None: all have the only one."""

    def of(self, robot: int) -> Value:
        """The value of one robot."""
        return self.values[0 if self._column is None else int(self._column[robot])]

    def divide(self, rows: Rows) -> list[tuple[Value, Rows, Mask | None]]:
        """Group the rows by their values; each group with its places (None: all)."""
        if rows.size == 0:
            return []
        if self._column is None:
            return [(self.values[0], rows, None)]
        numbers = self._column[rows.index]
        there = distinct(numbers)[0].tolist()
        if len(there) == 1:
            return [(self.values[there[0]], rows, None)]
        masks = [numbers == number for number in there]
        return [(self.values[number], rows.take(mask), mask) for number, mask in zip(there, masks, strict=True)]

    def where(self, rows: Rows, holds: Callable[[Value], bool]) -> Rows:
        """Those of the rows for whose values `holds` is true."""
        if self._column is None:
            return rows if holds(self.values[0]) else rows.none()
        truths = np.array([holds(value) for value in self.values])
        return rows.take(truths[self._column[rows.index]])

    def change(self, rows: Rows, how: Callable[[Value], Value]) -> None:
        """Replace the values of these robots."""
        for value, some, _ in self.divide(rows):
            found = how(value)
            if found is not value:
                self.set(some, found)

    def set(self, rows: Rows, value: Value) -> None:
        """Give these robots this value."""
        if rows.size == 0:
            return
        if rows.size == self._count:
            self._all_have(value)
            return
        number = self._numbers.setdefault(self._key(value), len(self.values))
        if number == len(self.values):
            self.values.append(value)
        if self._column is None:
            if number == 0:
                return
            self._column = filled(0, np.int32, self._count)
        self._column[rows.index] = number
        if len(self.values) > 2 * self._used + SPARE:
            self._tidy(self._column)

    def _tidy(self, column: NDArray[np.int32]) -> None:
        """Forget the values that no robot has any more."""
        numbers, column[:] = np.unique(column, return_inverse=True)
        self.values = [self.values[number] for number in numbers.tolist()]
        self._numbers = {self._key(value): number for number, value in enumerate(self.values)}
        self._used = len(self.values)

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
        self._numbers = {self._key(value): number for number, value in reversed(list(enumerate(values)))}


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
