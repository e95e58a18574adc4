"""Rows: which robots of a table something refers to, and which numbers of a column are theirs."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Column: TypeAlias = NDArray[np.float64]
"""One number for each of some rows, in order."""
Mask: TypeAlias = NDArray[np.bool_]
Index: TypeAlias = NDArray[np.intp]

CHUNK = 16_384
"""Robots walked at once: a few columns of this length stay in the processor's second-level cache."""
STRETCH = 8 * CHUNK
"""Robots that are taken through all their rules before the next ones: their columns stay in the third-level cache."""


class Rows:
    """Some robots of a fleet, in ascending order.

    index: what a column is indexed with
    first: start of their chunk
    """

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
