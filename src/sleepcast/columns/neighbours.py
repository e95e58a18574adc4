"""Going through the neighbours of many robots: of all robots at once, one neighbour after the other, or of all pairs.

What becomes of the values is what `language.evaluate.reduced` says: sums are taken in the order of the ids, so that
they have the same bits.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import nan

import numpy as np

from sleepcast.columns.values import Column, Index, Mask, Rows
from sleepcast.core.neighbours import NearIds
from sleepcast.core.records import NamedTuple

MAX_PAIRS = 1 << 16
"""Pairs of robots and neighbours looked at together: a few columns of them stay in the processor's caches."""


class PairRows(Rows):
    """Robots, each as often as it has neighbours: a row is a pair.

    asked: the place of each pair's robot among those that these are the pairs of
    places: of the pairs among all of them
    most: how many there were at first
    """

    __slots__ = ("asked", "most", "places")

    def __init__(
        self, index: Index, asked: Index, first: int, places: slice | Index = slice(None), most: int | None = None
    ) -> None:
        super().__init__(index, len(index), first)
        self.asked, self.places, self.most = asked, places, len(index) if most is None else most

    def take(self, mask: Mask) -> PairRows:
        chosen = np.flatnonzero(mask)
        places = chosen if isinstance(self.places, slice) else self.places[chosen]
        return PairRows(self.robots[chosen], self.asked[chosen], self.first, places, self.most)


class NeighbourLists(NamedTuple):
    """The neighbours of some robots.

    first: where those of each robot begin, and after the last one of all
    ids: ascending for each robot
    known: of which robots they are known, None for all
    totals: of how many neighbours of each robot these are the nearest, None if they are all
    """

    first: Index
    ids: Column
    known: Mask | None = None
    totals: Index | None = None

    def of(self, index: int) -> NearIds | None:
        """Those of one robot, None if they are not known."""
        if self.known is not None and not self.known[index]:
            return None
        ids = self.ids[self.first[index] : self.first[index + 1]].tolist()
        return NearIds.of(ids, len(ids) if self.totals is None else int(self.totals[index]))

    def pieces(self) -> Iterator[tuple[int, int]]:
        """The robots in pieces, from one to another (exclusive), that have a bearable number of neighbours together."""
        start = 0
        while start < len(self.first) - 1:
            most = int(np.searchsorted(self.first, self.first[start] + MAX_PAIRS, "right")) - 1
            stop = max(start + 1, most)
            yield start, stop
            start = stop

    def pairs(self, rows: Rows, start: int, stop: int) -> tuple[PairRows, Column]:
        """Each of these robots with each of its neighbours, and those."""
        asked = np.repeat(np.arange(stop - start), np.diff(self.first[start : stop + 1]))
        index = asked + (rows.index.start + start) if isinstance(rows.index, slice) else rows.index[start:stop][asked]
        return PairRows(index, asked, rows.first), self.ids[self.first[start] : self.first[stop]]

    def turns(self, rows: Rows) -> Iterator[tuple[Rows, slice | Index, Column]]:
        """The first neighbour of all robots that have one, the second of those that have another, and so on: the
        robots, their places among the rows, and the ids."""
        counts = np.diff(self.first)
        for turn in range(int(counts.max(initial=0))):
            left = counts > turn
            if left.all():
                yield rows, slice(None), self.ids[self.first[:-1] + turn]
            else:
                places = np.flatnonzero(left)
                yield rows.take(left), places, self.ids[self.first[places] + turn]

    @classmethod
    def listed(cls, lists: Sequence[Sequence[float] | None]) -> NeighbourLists:
        """The same from a list for each robot, None where they are not known."""
        first = np.cumsum([0, *(len(each or ()) for each in lists)])
        ids = np.array([neighbour for each in lists for neighbour in each or ()], np.float64)
        totals = np.array([each.total if isinstance(each, NearIds) else len(each or ()) for each in lists])
        known = np.array([each is not None for each in lists]) if None in lists else None
        return cls(first, ids, known, totals if (totals > np.diff(first)).any() else None)

    def spread(self, known: Mask) -> NeighbourLists:
        """The same for more robots: these are the `known` ones, and of the others they are not known."""
        counts = np.zeros(known.size, np.intp)
        counts[known] = np.diff(self.first)
        everywhere, totals = known.copy(), None if self.totals is None else counts.copy()
        if self.known is not None:
            everywhere[known] = self.known
        if self.totals is not None and totals is not None:
            totals[known] = self.totals
        return NeighbourLists(np.concatenate(([0], np.cumsum(counts))), self.ids, everywhere, totals)


class Fold:
    """What `language.evaluate.reduced` makes of the values of neighbours, for some robots at once."""

    def __init__(self, name: str, size: int) -> None:
        self._name = name
        self._total, self._best, self._who = np.zeros(size), np.zeros(size), np.zeros(size)
        self._count = np.zeros(size)

    def take(self, places: slice | Index, ids: Column, values: Column) -> None:
        """Take the next neighbour of the robots at these places."""
        known = ~np.isnan(values)
        if self._name == "COUNT-OVER":
            self._count[places] += known & (values != 0.0)
            return
        if self._name in ("SUM-OVER", "MEAN-OVER"):
            self._total[places] += np.where(known, values, 0.0)  # no sum is -0, so that this changes none
        else:
            best = self._best[places]
            better = values > best if self._name == "MAX-OVER" else values < best
            better |= known & (self._count[places] == 0.0)
            self._best[places] = np.where(better, values, best)
            self._who[places] = np.where(better, ids, self._who[places])
        self._count[places] += known

    def value(self) -> Column:
        """The values, NaN where they are unknown."""
        if self._name == "COUNT-OVER":
            return self._count
        if self._name == "SUM-OVER":
            return self._total
        none = self._count == 0.0
        values = {"MEAN-OVER": self._total / np.where(none, 1.0, self._count), "BEST-OVER": self._who}
        return np.where(none, nan, values.get(self._name, self._best))

    @property
    def overflowed(self) -> Mask:
        """Where a sum is too large."""
        return ~np.isfinite(self._total)


def reduced(name: str, asked: Index, ids: Column, values: Column, size: int) -> Column | None:
    """What `Fold` comes to, from all pairs at once, in the order of robots and ids; None if a sum is too large. asked:
    the robot of each pair, of as many as `size`."""
    if name in ("SUM-OVER", "COUNT-OVER"):
        weights = np.where(np.isnan(values), 0.0, values if name == "SUM-OVER" else values != 0.0)
        return _summed(asked, weights, size)
    known = ~np.isnan(values)
    if not known.all():
        asked, ids, values = asked[known], ids[known], values[known]
    found = np.full(size, nan)
    if name == "MEAN-OVER":
        count = np.bincount(asked, minlength=size)
        total = _summed(asked, values, size)
        return None if total is None else np.divide(total, count, out=found, where=count > 0)
    begin = np.flatnonzero(np.diff(asked, prepend=-1))
    best = np.full(size, nan)
    fold = np.maximum if name == "MAX-OVER" else np.minimum
    if begin.size:
        best[asked[begin]] = fold.reduceat(values, begin)
    first = np.flatnonzero(values == best[asked])[::-1]  # the first of equal ones stays
    found[asked[first]] = (ids if name == "BEST-OVER" else values)[first]
    return found


def _summed(asked: Index, values: Column, size: int) -> Column | None:
    """The sum of the values of each robot, one after the other; None if one is no number."""
    total: Column = np.bincount(asked, values, size).astype(np.float64, copy=False)
    return total if np.isfinite(total).all() else None
