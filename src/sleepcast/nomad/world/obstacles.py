"""Polygons that are added, moved and removed by their corners, for programs that know no numbers for them.

Two lists of corners mean the same polygon even if they start at different corners or have the opposite orientation,
and if they agree to within the resolution of tenths of an inch.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import cos, isfinite, pi, sin

import numpy as np

from sleepcast.nomad.world.paths import encloses
from sleepcast.robot import Corners
from sleepcast.simulator.scenario.robot_settings import MAX_WORLD
from sleepcast.simulator.world.areas import inside
from sleepcast.simulator.world.world import Area, Circle, Point, Polygon, Shape, Wall, World

MAX_OBSTACLES = 1_000
"""Polygons added during a run: all of them are searched for one."""
MAX_CORNERS = 1_000
"""Corners of one added polygon: the Nomad protocol allows ten."""
MAX_SIDES = 20_000
"""Sides of all added polygons together: a change of the world rebuilds its lists of solids, some ten milliseconds."""
SAME = 0.0013
"""Distance up to which two corners count as equal, m: half a tenth of an inch, and rounding."""
FLAT = 1e-4
"""Distance from a line, m, within which corners enclose no area."""
ROUND = 24
"""Corners of a circle that is shown as a polygon."""


class PlacedObstacles:
    """The things in a world, identified by corners in a frame whose 0, 0 lies at `origin` of the world's own, m. edge:
    the number of the thing that is the world's edge and stays."""

    def __init__(self, world: World, origin: Point, edge: int) -> None:
        self._world, self._origin, self._edge = world, origin, edge
        self._put_up: dict[int, int] = {}
        """Number of sides of each polygon added during the run."""
        self._shown: dict[int, tuple[Shape, list[Corners]]] = {}

    def shown(self) -> list[Corners]:
        """All things except the edge, as polygons, in the order in which they were added."""
        things = {number: shape for number, shape in self._world.shapes.items() if number != self._edge}
        for number in [*self._shown]:
            if things.get(number) is not self._shown[number][0]:
                del self._shown[number]
        x, y = self._origin
        for number, shape in things.items():
            if number not in self._shown:
                lines: list[Corners] = [tuple((at - x, up - y) for at, up in corners) for corners in _outlines(shape)]
                self._shown[number] = shape, lines
        return [corners for number in things for corners in self._shown[number][1]]

    def add(self, corners: Corners) -> bool:
        """Add a polygon; False if it is invalid or there are too many."""
        points = self._points(corners)
        full = len(self._put_up) >= MAX_OBSTACLES or sum(self._put_up.values()) + len(points) > MAX_SIDES
        if full or not _is_polygon(points):
            return False
        self._put_up[self._world.add(Polygon(points))] = len(points)
        return True

    def fill(self, polygons: Sequence[Corners]) -> bool:
        """Replace all things except the edge by these polygons; False, without a change, if one is invalid or there are
        too many."""
        outlines = [self._points(corners) for corners in polygons]
        if len(outlines) > MAX_OBSTACLES or sum(map(len, outlines)) > MAX_SIDES or not all(map(_is_polygon, outlines)):
            return False
        begin = self._world.following
        shapes: dict[int, Shape] = {self._edge: self._world.shapes[self._edge]}
        shapes |= {number: Polygon(points) for number, points in enumerate(outlines, begin)}
        self._world.fill(shapes, begin + len(outlines))
        self._put_up = {number: len(points) for number, points in enumerate(outlines, begin)}
        return True

    def remove(self, corners: Corners) -> bool:
        """Remove the polygon with these corners; False if there is none."""
        number = self._named(corners)
        if number is None:
            return False
        self._world.remove(number)
        self._put_up.pop(number, None)
        return True

    def move(self, corners: Corners, across: float, up: float) -> bool:
        """Move the polygon with these corners by this vector (m); False if there is none, or the result is invalid."""
        number = self._named(corners)
        if number is None or not _lies_in_bounds([(x + across, y + up) for x, y in corners]):
            return False
        self._world.move(number, across, up)
        return True

    def clear(self) -> None:
        """Remove everything except the edge."""
        self.fill(())

    def _points(self, corners: Corners) -> tuple[Point, ...]:
        """The corners in the world's frame, without repeats; empty if they form no polygon."""
        if not _lies_in_bounds(corners):
            return ()
        x, y = self._origin
        moved = [(float(at) + x, float(up) + y) for at, up in corners]
        return tuple(here for here, before in zip(moved, [*moved[-1:], *moved[:-1]], strict=True) if here != before)

    def _named(self, corners: Corners) -> int | None:
        """The number of the polygon with these corners, the latest one if there are several."""
        wanted = self._points(corners)
        if len(wanted) < 3:
            return None
        for number, shape in reversed([*self._world.shapes.items()]):
            if isinstance(shape, Polygon) and len(shape.corners) == len(wanted) and _same(shape.corners, wanted):
                return number
        return None


def _is_polygon(points: tuple[Point, ...]) -> bool:
    return 3 <= len(points) <= MAX_CORNERS and encloses(np.array(points), FLAT)


def _same(one: tuple[Point, ...], other: tuple[Point, ...]) -> bool:
    if not _close((_middle(one),), (_middle(other),)):
        return False
    return any(
        _close(one[:1], (corner,)) and _close(one, (*way[first:], *way[:first]))
        for way in (other, other[::-1])
        for first, corner in enumerate(way)
    )


def _middle(corners: tuple[Point, ...]) -> Point:
    return sum(x for x, _ in corners) / len(corners), sum(y for _, y in corners) / len(corners)


def _close(one: tuple[Point, ...], other: tuple[Point, ...]) -> bool:
    return all(abs(a - c) <= SAME and abs(b - d) <= SAME for (a, b), (c, d) in zip(one, other, strict=True))


def _lies_in_bounds(corners: Corners) -> bool:
    return all(isfinite(value) and abs(value) <= MAX_WORLD for corner in corners for value in corner)


def _outlines(shape: Shape) -> Iterator[tuple[Point, ...]]:
    """The closed lines that show a shape; an open wall is traced there and back."""
    if isinstance(shape, Polygon):
        yield shape.corners
    elif isinstance(shape, Area):
        yield from without_holes(shape)
    elif isinstance(shape, Circle):
        angles = [2.0 * pi * step / ROUND for step in range(ROUND)]
        yield tuple((shape.x + shape.radius * cos(each), shape.y + shape.radius * sin(each)) for each in angles)
    elif isinstance(shape, Wall):
        yield (*shape.points, *shape.points[-2:0:-1])


# Solid areas as polygons without holes, for displays that know polygons only.

MAX_OUTLINES = 2_000
"""Outlines of one area: each is compared with every other one. An area with more keeps its outlines as they are."""

Outline = tuple[Point, ...]


def without_holes(area: Area) -> list[Outline]:
    """The solid parts of the area, as polygons."""
    if len(area.outlines) == 1 or len(area.outlines) > MAX_OUTLINES:
        return list(area.outlines)
    lines = [_counter_clockwise(outline) for outline in area.outlines]
    # The middle of a side, because outlines may touch at their corners.
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
    """Nearest hole first, so that the cut of another one may begin at it."""
    line = list(outside)
    for hole in sorted(holes, key=lambda each: _nearest(outside, each[0])[1]):
        place, _ = _nearest(line, hole[0])
        line[place + 1 : place + 1] = [*hole, hole[0], line[place]]
    return tuple(line)


def _nearest(line: Outline | list[Point], point: Point) -> tuple[int, float]:
    """The index of the corner nearest to a point, and its distance."""
    x, y = np.array(line).T
    away = np.hypot(x - point[0], y - point[1])
    place = int(np.argmin(away))
    return place, float(away[place])
