"""Which points lie inside a disc, a polygon or a solid area.

A point is inside an area if a ray from it to the east crosses the outlines an odd number of times. The sides of an
area are listed by horizontal strips, so that each point is compared only with the sides of its own strip.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sleepcast.simulator.world.grid import Floats, Whole, spread
from sleepcast.simulator.world.world import Area, Circle, Polygon, World, is_solid_throughout, rows_of

LISTED_PER_SIDE = 4
"""Strips that a side is listed in, on average; this bounds the list for areas with long sides."""
MAX_STRIPS = 16_384
MAX_PAIRS = 4_194_304
"""Pairs of points and sides processed at once: some hundred megabytes of arrays."""


def barred(world: World, x: Floats, y: Floats, lands: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Whether something solid keeps a body from standing at each point x, y (m, shape (n,)); who `lands` may stand on
    its roof, if it has one."""
    within = np.zeros(len(x), bool)
    for shape in world.shapes.values():
        if is_solid_throughout(shape):
            within |= inside(shape, x, y) & ~(lands & (shape.tall is not None))
    return within


def inside(area: Area | Circle | Polygon, x: Floats, y: Floats) -> NDArray[np.bool_]:
    """Whether each point x, y (m, shape (n,)) lies inside the area. Points on a lower or left side do, points on others
    do not."""
    if isinstance(area, Circle):
        in_disc: NDArray[np.bool_] = (x - area.x) ** 2 + (y - area.y) ** 2 < area.radius**2
        return in_disc
    within = np.zeros(len(x), bool)
    sides = np.array(rows_of(area), np.float64).reshape(-1, 5)[:, :4]
    sides = sides[sides[:, 1] != sides[:, 3]]
    if not len(sides):
        return within
    low, high = sides[:, [1, 3]].min(), sides[:, [1, 3]].max()
    left, right = sides[:, [0, 2]].min(), sides[:, [0, 2]].max()
    near = np.flatnonzero((x >= left) & (x <= right) & (y >= low) & (y < high))
    long = np.abs(sides[:, 3] - sides[:, 1]).sum() / (high - low)
    strips = int(np.clip(LISTED_PER_SIDE * len(sides) / max(long, 1.0), 1, MAX_STRIPS))

    def strip_of(level: Floats) -> Whole:
        strip: Whole = np.clip((level - low) / (high - low) * strips, 0, strips - 1).astype(np.int64)
        return strip

    bottom, top = strip_of(sides[:, [1, 3]].min(axis=1)), strip_of(sides[:, [1, 3]].max(axis=1))
    side, strip = spread(np.arange(len(sides)), bottom, top + 1)
    order = np.argsort(strip, kind="stable")
    side = side[order]
    start = np.searchsorted(strip[order], np.arange(strips + 1))
    step = max(1, MAX_PAIRS // int(np.diff(start).max()))
    for first in range(0, len(near), step):
        some = near[first : first + step]
        mine = strip_of(y[some])
        point, index = spread(np.arange(len(some)), start[mine], start[mine + 1])
        crossed = _crosses(sides[side[index]], x[some][point], y[some][point])
        within[some] = np.bincount(point[crossed], minlength=len(some)) % 2 == 1
    return within


def _crosses(sides: Floats, x: Floats, y: Floats) -> NDArray[np.bool_]:
    """Whether a ray from each point x, y to the east crosses its side, shape (n, 4)."""
    x0, y0, x1, y1 = sides.T
    between = (y0 <= y) != (y1 <= y)
    met: NDArray[np.bool_] = between & (x < x0 + (y - y0) / (y1 - y0) * (x1 - x0))
    return met
