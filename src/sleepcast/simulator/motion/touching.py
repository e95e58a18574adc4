"""What compiled code needs to look which bodies in the air may have touched: see `kernels_touching`."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.records import NamedTuple
from sleepcast.simulator.world.grid import Floats

Flags = NDArray[np.bool_]
Short = NDArray[np.int32]

ROUNDING = 1e-6
"""m by which the look goes farther than anything can be that touches."""
AHEAD = 16.0
"""How many times the longest way of a tick pairs are listed ahead, so that a list serves for about eight ticks."""
SPARSE = 0.5
"""Share of the mean distance between bodies by which they are listed ahead at most: else most are near each other."""
EACH = 4
"""Pairs for each body for which there is room at first."""
OVERFLOWED = -1
COUNT = 0
"""Which of `NearPairs.numbers` is how many there are."""
REACH, ROOM = range(2)
"""Which of `NearPairs.lengths` is the reach, m, within which pairs are listed, below 0 before any are; and by how much
they are listed ahead at most."""


class Airborne(NamedTuple):
    """Bodies, those in the air among them: where they are, and what lies below, m; their ways in the tick that is over;
    their radii, and the greatest of these; see `torus` for `around`."""

    x: Floats
    y: Floats
    z: Floats
    ground: Floats
    way_x: Floats
    way_y: Floats
    way_z: Floats
    radii: Floats
    widest: float
    around_x: float
    around_y: float


class NearPairs(NamedTuple):
    """Bodies that are near enough to each other to touch soon.

    near: the numbers of both of each pair, shape (2, room)
    old_x, old_y, old_z: where bodies were when pairs were listed, m
    touched: which bodies may have touched
    numbers, lengths: see COUNT and REACH
    points: room for bodies and their images: x, y and z, unsorted and sorted by cell, shape (6, points)
    start, order, cell: for these, see `kernels_touching.sort_points`
    """

    near: Short
    old_x: Floats
    old_y: Floats
    old_z: Floats
    touched: Flags
    numbers: NDArray[np.int64]
    lengths: Floats
    points: Floats
    start: Short
    order: Short
    cell: Short


def pairs_of(count: int, room: int, size: tuple[float, float, float], around: tuple[float, float]) -> NearPairs:
    """No pairs yet, of so many bodies, with room for so many, in a world of this width, depth and height, m.
    around: of a torus, infinite without one."""
    points = 4 * count if around[0] < np.inf else count
    lengths = np.array([-1.0, SPARSE * float(np.cbrt(np.prod(size) / count))])
    old_x, old_y, old_z = np.zeros((3, count))
    near, touched, numbers = np.zeros((2, room), np.int32), np.zeros(count, np.bool_), np.zeros(1, np.int64)
    start, order, cell = (np.zeros(length, np.int32) for length in (2 * count + 66, points, 2 * points))
    sorted_ = np.zeros((6, points)), start, order, cell
    return NearPairs(near, old_x, old_y, old_z, touched, numbers, lengths, *sorted_)
