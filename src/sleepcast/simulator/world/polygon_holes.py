"""Solid areas as polygons without holes, to be shown by whoever knows polygons alone.

An outline that lies in an odd number of others is a hole. It is joined to the one round it by a cut, there and back, so
that one closed line goes round what is solid: outside counter-clockwise, holes clockwise, as the usual rules of filling
want it. The cut begins at the hole's first corner and goes to the nearest corner outside.
"""

from __future__ import annotations

import numpy as np

from sleepcast.simulator.world.areas import inside
from sleepcast.simulator.world.world import Area, Point

MAX_OUTLINES = 2_000
"""Of one area: each is compared with every other one. The outlines of an area with more stay as they are."""

Outline = tuple[Point, ...]


def without_holes(area: Area) -> list[Outline]:
    """What is solid, as polygons."""
    if len(area.outlines) == 1 or len(area.outlines) > MAX_OUTLINES:
        return list(area.outlines)
    lines = [_counter_clockwise(outline) for outline in area.outlines]
    # The middle of a side, because lines may touch at their corners.
    x, y = np.array([[(a + b) / 2.0 for a, b in zip(*line[:2], strict=True)] for line in lines]).T
    within = np.array([inside(Area((line,)), x, y) for line in lines])
    np.fill_diagonal(within, False)
    depth = within.sum(axis=0)
    holes: dict[int, list[Outline]] = {number: [] for number in np.flatnonzero(depth % 2 == 0).tolist()}
    for number in np.flatnonzero(depth % 2 == 1).tolist():
        around = np.flatnonzero(within[:, number] & (depth == depth[number] - 1))
        if len(around):
            holes[int(around[0])].append(lines[number][::-1])
    return [_joined(lines[number], inner) for number, inner in holes.items()]


def _counter_clockwise(outline: Outline) -> Outline:
    x, y = np.array(outline).T
    twice = float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)))
    return outline if twice >= 0.0 else outline[::-1]


def _joined(outside: Outline, holes: list[Outline]) -> Outline:
    """The nearest hole first, so that the cut of another one may begin at it."""
    line = list(outside)
    for hole in sorted(holes, key=lambda each: _nearest(outside, each[0])[1]):
        place, _ = _nearest(line, hole[0])
        line[place + 1 : place + 1] = [*hole, hole[0], line[place]]
    return tuple(line)


def _nearest(line: Outline | list[Point], point: Point) -> tuple[int, float]:
    """The place of the corner that is nearest to a point, and how far away it is."""
    x, y = np.array(line).T
    away = np.hypot(x - point[0], y - point[1])
    place = int(np.argmin(away))
    return place, float(away[place])
