"""Room for robots: whether one fits somewhere, and where so many may start."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import atan2, hypot, pi

import numpy as np

from sleepcast.core.errors import MisuseError
from sleepcast.simulator.bodies.bodies import Bodies
from sleepcast.simulator.nomads.paths import already, discs
from sleepcast.simulator.world.areas import inside
from sleepcast.simulator.world.world import Area, Circle, Point, Polygon

TURN = 2.0 * pi
MAX_RINGS = 100
"""Of places that are tried round the first one, if those before it are taken."""


def has_room(bodies: Bodies, x: float, y: float, robot: int, among: Sequence[int] | None = None) -> bool:
    """Whether body `robot` would be free at x, y (m): within the world, in nothing solid, and clear of other bodies
    (None: of all; otherwise only `among` these)."""
    radius = float(bodies.radii[robot])
    _, _, width, height = bodies.fence
    if not (radius < x < width - radius and radius < y < height - radius):
        return False
    others = [other for other in (range(bodies.count) if among is None else among) if other != robot]
    things = np.concatenate((bodies.world.solids, discs(bodies.x, bodies.y, bodies.radii)[others]))
    if already(things, radius, (x, y)):
        return False
    areas = (shape for shape in bodies.world.shapes.values() if isinstance(shape, Area | Circle))
    return not any(_within(area, (x, y)) for area in areas)


def _within(area: Area | Circle, point: Point) -> bool:
    return bool(inside(area, np.array([point[0]]), np.array([point[1]]))[0])


def spots(middle: Point, apart: float) -> Iterator[Point]:
    """Places `apart` m from each other in a square lattice: the `middle`, then ring by ring those round it, the nearest
    of a ring first and counter-clockwise from the east."""
    yield middle
    for ring in range(1, MAX_RINGS + 1):
        steps = range(-ring, ring + 1)
        border = [(i, j) for i in steps for j in steps if max(abs(i), abs(j)) == ring]
        border.sort(key=lambda at: (hypot(*at), atan2(at[1], at[0]) % TURN))
        yield from ((middle[0] + i * apart, middle[1] + j * apart) for i, j in border)


def spread(bodies: Bodies, placed: Sequence[int], middle: Point, apart: Sequence[float]) -> None:
    """Put all bodies that are not `placed` yet round the `middle` (m), heading east, where there is room on its side of
    every polygon; as far `apart` (m) as the first of these distances that leaves room for all. Raises MisuseError if
    none does."""
    polygons = [Area((each.corners,)) for each in bodies.world.shapes.values() if isinstance(each, Polygon)]
    side = [_within(polygon, middle) for polygon in polygons]
    for distance in apart:
        free = (at for at in spots(middle, distance) if [_within(each, at) for each in polygons] == side)
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
