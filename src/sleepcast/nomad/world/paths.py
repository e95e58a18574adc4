"""Where a disc that follows a path first touches something, and what a disc at rest touches.

Things are stadiums, rows as in `World.solids`: all points within a radius of a line segment. The centre of a disc
that touches one lies on its outline, widened by the disc's radius: two sides and two circles around the ends. So a
straight path is intersected with these (see `steps.touch`), and so is a circular one: it meets a side at up to two
points with the right distance from the line, and an end where two circles cross.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import atan2, cos, hypot, pi, sin

import numpy as np

from sleepcast.core.errors import MisuseError
from sleepcast.robot import Contact
from sleepcast.simulator.bodies.bodies import Bodies
from sleepcast.simulator.motion.steps import SKIN, touch
from sleepcast.simulator.world.areas import inside
from sleepcast.simulator.world.grid import Floats, distance, nearest_point
from sleepcast.simulator.world.world import Area, Circle, Point, Polygon

TURN = 2.0 * pi
CLOSE = 1e-9
"""Rounding error, m, by which a point of contact may be off the outline."""


def first_along(things: Floats, radius: float, start: Point, end: Point) -> Contact | None:
    """Where a disc of `radius` m on the straight path from `start` to `end` first touches one of the `things`; None if
    the path is free. Things that it overlaps at the start are touched there."""
    at_start = contact_at_rest(things, radius, start)
    if at_start or not len(things):
        return at_start
    apart = radius + things[:, 4] + SKIN
    across, up = np.full(len(things), end[0] - start[0]), np.full(len(things), end[1] - start[1])
    x, y = np.full(len(things), start[0]), np.full(len(things), start[1])
    stop, to_x, to_y = touch(x, y, across, up, things[:, :4].T, apart)
    first = int(np.argmin(stop))
    if stop[first] > 1.0:
        return None
    way = float(stop[first])
    return Contact(
        start[0] + way * (end[0] - start[0]),
        start[1] + way * (end[1] - start[1]),
        _back(float(to_x[first]), float(to_y[first])),
    )


def first_round(things: Floats, radius: float, centre: Point, orbit: float, begin: float, end: float) -> Contact | None:
    """Where a disc of `radius` m first touches one of the `things` on the circle of radius `orbit` m around `centre`,
    from the angle `begin` to `end`, rad; longer paths count as one full turn."""
    start = centre[0] + orbit * cos(begin), centre[1] + orbit * sin(begin)
    at_start = contact_at_rest(things, radius, start)
    if at_start or not len(things) or orbit <= 0.0 or begin == end:
        return at_start
    apart = radius + things[:, 4] + SKIN
    sense = 1.0 if end > begin else -1.0
    angles = _crossings(things, apart, centre, orbit)
    on_the_way = np.mod((angles - begin) * sense, TURN)
    x, y = centre[0] + orbit * np.cos(angles), centre[1] + orbit * np.sin(angles)
    touched = np.abs(distance(x, y, *things[:, :4].T) - apart) <= CLOSE * (1.0 + orbit + apart)
    on_the_way = np.where(touched & (on_the_way <= abs(end - begin)), on_the_way, np.inf)
    row, first = np.unravel_index(int(np.argmin(on_the_way)), on_the_way.shape)
    if np.isinf(on_the_way[row, first]):
        return None
    return _at(things[first], (float(x[row, first]), float(y[row, first])))


def _crossings(things: Floats, apart: Floats, centre: Point, orbit: float) -> Floats:
    """Angles at which the circle is `apart` from the line or an end of each thing, shape (8, things), NaN where there
    is no such point."""
    x0, y0, x1, y1, _ = things.T
    ex, ey = x1 - x0, y1 - y0
    length = np.hypot(ex, ey)
    angles = []
    with np.errstate(divide="ignore", invalid="ignore"):
        # Along the normal of the line, the centre lies `height` from it.
        normal = np.arctan2(ex, -ey)
        height = ((centre[1] - y0) * ex - (centre[0] - x0) * ey) / length
        for side in (apart, -apart):
            half = np.arccos((side - height) / orbit)
            angles += [normal + half, normal - half]
        for x, y in ((x0, y0), (x1, y1)):
            across, up = x - centre[0], y - centre[1]
            away = np.hypot(across, up)
            half = np.arccos((orbit * orbit + away * away - apart * apart) / (2.0 * orbit * away))
            towards = np.arctan2(up, across)
            angles += [towards + half, towards - half]
    return np.array(angles)


def contact_at_rest(things: Floats, radius: float, place: Point) -> Contact | None:
    """The thing that a disc at `place` overlaps most; None if it is free."""
    if not len(things):
        return None
    gap = distance(np.array(place[0]), np.array(place[1]), *things[:, :4].T) - things[:, 4] - radius
    deepest = int(np.argmin(gap))
    return _at(things[deepest], place) if gap[deepest] < 0.0 else None


def _at(thing: Floats, place: Point) -> Contact:
    across, up = nearest_point(np.array(place[0]), np.array(place[1]), *thing[:4])
    return Contact(*place, _back(float(across), float(up)))


def _back(across: float, up: float) -> float:
    """The direction back from the point at `across` and `up`, rad."""
    return atan2(0.0 - up, 0.0 - across)  # with minus zero, west would be -pi


def discs(x: Floats, y: Floats, radii: Floats) -> Floats:
    """Discs as rows of things."""
    return np.stack((x, y, x, y, radii), axis=1)


def encloses(points: Floats, least: float) -> bool:
    """Whether corners, shape (n, 2), enclose an area: they do not all lie within `least` m of one line."""
    away = points - points[0]
    farthest = away[int(np.argmax(np.hypot(away[:, 0], away[:, 1])))]
    length = hypot(*farthest)
    return bool(length > least and np.abs(away @ np.array((-farthest[1], farthest[0]))).max() > least * length)


# Room for robots: whether one fits somewhere, and where several may start.

MAX_RINGS = 100
"""Rings of positions that are tried around the first one."""


def has_room(bodies: Bodies, x: float, y: float, robot: int, among: Sequence[int] | None = None) -> bool:
    """Whether body `robot` would be free at x, y (m): inside the world, outside of everything solid, and clear of other
    bodies (None: of all; otherwise only `among` these)."""
    radius = float(bodies.radii[robot])
    _, _, width, height = bodies.fence
    if not (radius < x < width - radius and radius < y < height - radius):
        return False
    others = [other for other in (range(bodies.count) if among is None else among) if other != robot]
    things = np.concatenate((bodies.world.solids, discs(bodies.x, bodies.y, bodies.radii)[others]))
    if contact_at_rest(things, radius, (x, y)):
        return False
    areas = (shape for shape in bodies.world.shapes.values() if isinstance(shape, Area | Circle))
    return not any(_within(area, (x, y)) for area in areas)


def _within(area: Area | Circle, point: Point) -> bool:
    return bool(inside(area, np.array([point[0]]), np.array([point[1]]))[0])


def lattice(middle: Point, apart: float) -> Iterator[Point]:
    """Points `apart` m from each other in a square lattice: the `middle`, then ring by ring, the nearest of a ring
    first and counter-clockwise from the east."""
    yield middle
    for ring in range(1, MAX_RINGS + 1):
        steps = range(-ring, ring + 1)
        border = [(i, j) for i in steps for j in steps if max(abs(i), abs(j)) == ring]
        border.sort(key=lambda at: (hypot(*at), atan2(at[1], at[0]) % TURN))
        yield from ((middle[0] + i * apart, middle[1] + j * apart) for i, j in border)


def spread(bodies: Bodies, placed: Sequence[int], middle: Point, apart: Sequence[float]) -> None:
    """Place all bodies that are not `placed` yet around the `middle` (m), heading east, where there is room on the same
    side of every polygon; with the first of the distances `apart` (m) that leaves room for all. Raises MisuseError if
    none does."""
    polygons = [Area((each.corners,)) for each in bodies.world.shapes.values() if isinstance(each, Polygon)]
    side = [_within(polygon, middle) for polygon in polygons]
    for width in apart:
        free = (at for at in lattice(middle, width) if [_within(each, at) for each in polygons] == side)
        done = list(placed)
        for robot in (each for each in range(bodies.count) if each not in placed):
            spot = next((at for at in free if has_room(bodies, *at, robot, done)), None)
            if spot is None:
                break
            bodies.place(robot, *spot, 0.0)
            done.append(robot)
        else:
            return
    raise MisuseError(f"{bodies.count} robots do not fit into this world: ask for fewer, or give them more room")
