"""Pairs of robots and the neighbours that they sense, as arrays, and what becomes of them."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.records import NamedTuple, dataclass
from sleepcast.simulator.simd.formulas import TURN, arc_tangent, wrap
from sleepcast.simulator.world.grid import Floats, Whole

Flags: TypeAlias = NDArray[np.bool_]


class NeighbourQuery(NamedTuple):
    """Which neighbours were asked for.

    robots: indices
    radius: m
    colour: NaN for any; one for each robot
    """

    robots: Whole
    radius: Floats
    colour: Floats

    def part(self, some: slice) -> NeighbourQuery:
        return NeighbourQuery(self.robots[some], self.radius[some], self.colour[some])

    def same(self, other: NeighbourQuery) -> bool:
        return all(np.array_equal(*each, equal_nan=True) for each in zip(self, other, strict=True))


@dataclass(frozen=True, slots=True)
class Pairs:
    """Robots that asked, each with what it senses of every neighbour: one entry for each pair.

    asked: indices of the robots
    robot: the index among them of the one that senses
    other: index of its neighbour
    dx, dy: vector to the neighbour in the robot's frame of reference, m
    away: its length, m
    within: the radius that each robot asked for, m
    dz: how much higher the neighbour is, m, a part of `away`; None where nothing flies
    """

    asked: Whole
    within: Floats
    robot: Whole
    other: Whole
    dx: Floats
    dy: Floats
    away: Floats
    dz: Floats | None = None

    def count(self) -> Floats:
        """Number of neighbours of each robot that asked; so does every method return one value for each of them."""
        return np.bincount(self.robot, minlength=self.asked.size).astype(np.float64)

    def total(self, values: Floats) -> Floats:
        """Sum of `values`, one for each pair; 0 without neighbours."""
        return np.bincount(self.robot, values, self.asked.size).astype(np.float64, copy=False)

    def mean(self, values: Floats) -> Floats:
        """Mean of `values`, one for each pair; NaN without neighbours."""
        count = self.count()
        mean: Floats = np.where(count > 0.0, self.total(values), np.nan) / np.maximum(count, 1.0)
        return mean

    def most(self, values: Floats) -> Floats:
        """Largest of `values`, one for each pair; NaN without neighbours."""
        greatest = np.full(self.asked.size, -np.inf)
        np.maximum.at(greatest, self.robot, values)
        return np.where(greatest == -np.inf, np.nan, greatest)

    def least(self, values: Floats) -> Floats:
        """Smallest of `values`, one for each pair; NaN without neighbours."""
        return -self.most(-values)

    def nearest(self, values: Floats) -> Floats:
        """The one of `values` that belongs to the nearest neighbour; NaN without neighbours."""
        values_of_nearest = np.full(self.asked.size, np.nan)
        first = np.flatnonzero(self.away == self.least(self.away)[self.robot])[::-1]
        values_of_nearest[self.robot[first]] = values[first]
        return values_of_nearest

    def outlier(self, values: Floats) -> Floats:
        """The one of `values` that belongs to the neighbour farthest from the mean position of all; NaN without
        neighbours."""
        dx, dy = self.dx - self.mean(self.dx)[self.robot], self.dy - self.mean(self.dy)[self.robot]
        away = np.sqrt(dx * dx + dy * dy)
        return Pairs(self.asked, self.within, self.robot, self.other, dx, dy, -away).nearest(values)

    def distance_of(self, rank: Floats) -> Floats:
        """Distance of the neighbour with this rank by distance, 1 for the nearest, m; rank: one for each robot that
        asked. Of the farthest if there are fewer neighbours; NaN without neighbours, and for a rank below 1."""
        count = self.count()
        distances = np.full(self.asked.size, np.nan)
        known = np.flatnonzero((count > 0.0) & (rank >= 1.0))
        first = np.cumsum(count) - count
        index = (first + np.minimum(np.floor(rank), count) - 1.0)[known].astype(np.int64)
        distances[known] = self.away[np.lexsort((self.away, self.robot))][index]
        return distances

    def widest_gap(self) -> tuple[Floats, Floats]:
        """The widest angle that contains no neighbour, rad, and the direction of its middle, rad in -pi..pi; both NaN
        without neighbours. Those at the robot's own place are in no direction."""
        beside = (self.dx == 0.0) & (self.dy == 0.0)
        if beside.any():
            return self.where(~beside).widest_gap()
        direction = arc_tangent(self.dy, self.dx)
        order = np.lexsort((direction, self.robot))
        robot, direction = self.robot[order], direction[order]
        last = np.append(robot[1:] != robot[:-1], True)[: robot.size]
        first = np.roll(last, 1)
        following = np.roll(direction, -1)
        following[last] = direction[first] + TURN
        gap = following - direction
        widest = Pairs(self.asked, self.within, robot, robot, gap, gap, -gap)
        return widest.most(gap), widest.nearest(wrap(direction + gap / 2.0))

    def listed(self, most: int) -> tuple[Whole, Whole]:
        """Where the neighbours of each robot that asked begin, and after the last one of all; and the neighbours,
        ascending for each robot: the nearest `most`, and of equally near ones those with the smallest numbers."""
        pair, near = self, self.count() <= most
        if not near.all():
            order = np.lexsort((self.other, self.away, self.robot))
            robot = self.robot[order]
            begin = np.searchsorted(robot, np.arange(self.asked.size))
            few = np.zeros(robot.size, np.bool_)
            few[order] = np.arange(robot.size) - begin[robot] < most
            pair = self.where(few)
        keys = (pair.robot << np.int64(32)) | pair.other
        return in_order(np.bincount(pair.robot, minlength=self.asked.size), keys)

    def nearest_one(self) -> Floats:
        """The nearest neighbour of each robot, of equally near ones the one with the smallest number; NaN without."""
        nearest = self.away == self.least(self.away)[self.robot]
        return -Pairs.most(self.where(nearest), -self.other[nearest].astype(np.float64))

    def known_as(self, other: Whole) -> Pairs:
        """The same pairs, with other numbers of the neighbours."""
        return Pairs(self.asked, self.within, self.robot, other, self.dx, self.dy, self.away, self.dz)

    def where(self, chosen: Flags) -> Pairs:
        """Some of the pairs."""
        dx, dy, away = (each[chosen] for each in (self.dx, self.dy, self.away))
        dz = None if self.dz is None else self.dz[chosen]
        return Pairs(self.asked, self.within, self.robot[chosen], self.other[chosen], dx, dy, away, dz)


def length(dx: Floats, dy: Floats, dz: Floats | None) -> Floats:
    """The length of vectors, m; dz: None on the plane."""
    squares = dx * dx + dy * dy
    found: Floats = np.sqrt(squares if dz is None else squares + dz * dz)
    return found


def in_order(counts: Whole, keys: Whole) -> tuple[Whole, Whole]:
    """See `Pairs.listed`. counts: of the neighbours of each robot; keys: robots, in the upper half of their bits, and
    below their neighbours."""
    keys.sort()
    keys &= np.int64(0xFFFFFFFF)
    return np.append(0, np.cumsum(counts)), keys
