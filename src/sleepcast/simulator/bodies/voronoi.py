"""Voronoi cells as robots sense them: the centroid of the points that are nearer to a robot than to its neighbours.

A cell is star-shaped around its robot, so it is measured along DIRECTIONS rays from there, in equal steps: each ray
ends half-way to the first neighbour, at the border of a disc, or at the edge of the world. A ray of length l stands
for the sector around it, with an area proportional to l^2 and a centroid at 2/3 l; their mean, weighted by area, is the
result. It is off by about a thousandth of the radius of the disc.
"""

from __future__ import annotations

from math import pi

import numpy as np

from sleepcast.simulator.bodies.bodies import Floats
from sleepcast.simulator.simd.formulas import sine_cosine
from sleepcast.simulator.world.grid import Whole

DIRECTIONS = 120
"""Rays around a robot."""
MAX_LENGTHS = 1 << 22
"""Lengths of rays that are computed at once: some hundred megabytes."""

_SINES, _COSINES = sine_cosine(np.array([(ray + 0.5) * (2.0 * pi / DIRECTIONS) - pi for ray in range(DIRECTIONS)]))


def centroids(
    robot: Whole, dx: Floats, dy: Floats, radius: Floats, x: Floats, y: Floats, size: tuple[float, float]
) -> tuple[Floats, Floats]:
    """Centroid x, y (m) of the cell of each robot, within a disc of `radius` (m) around it and a world of this size (m,
    infinite without edges).

    x, y: where the robots are, m. robot, dx, dy: for each pair the index of the robot that senses a neighbour, and
    the vector to it, m.
    """
    order = np.argsort(robot, kind="stable")
    robot, dx, dy = robot[order], dx[order], dy[order]
    start = np.searchsorted(robot, np.arange(x.size + 1))
    centres = np.empty((2, x.size))
    first = 0
    while first < x.size:
        last = int(np.searchsorted(start, start[first] + MAX_LENGTHS // DIRECTIONS, side="right")) - 1
        last = min(max(last, first + 1), first + MAX_LENGTHS // DIRECTIONS, x.size)
        own = slice(first, last)
        rays = _to_edge(x[own], y[own], size)
        np.minimum(rays, radius[own, None], out=rays)
        pairs = slice(start[first], start[last])
        _cut(rays, robot[pairs] - first, dx[pairs], dy[pairs])
        centres[:, own] = x[own], y[own]
        centres[:, own] += _middle(rays)
        first = last
    return centres[0], centres[1]


def _to_edge(x: Floats, y: Floats, size: tuple[float, float]) -> Floats:
    """Length of each ray, m, up to the edge of the world; 0 from outside towards farther outside."""
    rays = np.full((x.size, DIRECTIONS), np.inf)
    for along, position, most in ((_COSINES, x, size[0]), (_SINES, y, size[1])):
        for towards, away in (
            (along > 0.0, most - position),
            (along < 0.0, position if most < np.inf else most - position),
        ):
            lengths = np.maximum(away, 0.0)[:, None] / np.abs(along[towards])
            rays[:, towards] = np.minimum(rays[:, towards], lengths)
    return rays


def _cut(rays: Floats, robot: Whole, dx: Floats, dy: Floats) -> None:
    """Shorten rays in place to what is nearer to their robot than to its neighbours. robot: in ascending order."""
    if not robot.size:
        return
    along = dx[:, None] * _COSINES + dy[:, None] * _SINES
    half = (dx * dx + dy * dy)[:, None] / 2.0
    with np.errstate(divide="ignore", invalid="ignore"):
        lengths = np.where(along > 0.0, half / along, np.inf)
    first = np.flatnonzero(np.append(True, robot[1:] != robot[:-1]))
    some = robot[first]
    rays[some] = np.minimum(rays[some], np.minimum.reduceat(lengths, first, axis=0))


def _middle(rays: Floats) -> Floats:
    """Vector from each robot to the centroid of what its rays reach, m, shape (2, robots)."""
    squares = rays * rays
    # Running sums add one ray after the other, for one robot as for many.
    area, *moments = (np.cumsum(each, axis=1)[:, -1] for each in (squares, *(squares * rays * a for a in _ALONG)))
    return 2.0 / 3.0 * np.array(moments) / np.where(area > 0.0, area, 1.0)


_ALONG = (_COSINES, _SINES)
