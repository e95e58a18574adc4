"""Contact of what flies: whoever touches another one or something solid crashes. Its motors stop, it falls and stays.

Bodies are balls, which move straight within a tick; two have touched if they came nearer than their radii at any moment
of it. On the ground and on roofs they may stand as near to each other as they like. Whether something solid is touched
is a matter of the ground plan: a body has touched it if it came nearer than its radius while it was not above it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sleepcast.simulator.bodies.bodies import Bodies, Flags, Floats, Whole
from sleepcast.simulator.bodies.closeness import Closeness
from sleepcast.simulator.bodies.flight import CRASHED_INTO, Flight
from sleepcast.simulator.world.grid import spread

A_WALL = "a wall"


def crash(bodies: Bodies, flight: Flight, closeness: Closeness, names: Sequence[str]) -> None:
    """Let those crash that have touched in the tick that is over, and say what they have hit. names: of all bodies."""
    z = np.nan_to_num(flight.z)
    first = np.flatnonzero(flight.flies & (z > flight.ground))
    if not first.size:
        return
    one, other = _touching(bodies, flight.way, z, closeness.of(first))
    hit: dict[int, str] = {}
    for pair in sorted({*zip(one.tolist(), other.tolist(), strict=True)}):
        for robot, whom in (pair, pair[::-1]):
            if flight.flies[robot] and not flight.locked[robot]:
                hit.setdefault(robot, names[whom])
    at_walls, shares = _at_walls(bodies, flight, z, first[~flight.locked[first]])
    _stay(bodies, flight, at_walls, shares)
    for robot in at_walls.tolist():
        hit.setdefault(robot, A_WALL)
    for robot in sorted(hit):
        bodies.say_of(robot, CRASHED_INTO + hit[robot])
    if hit:
        flight.crash(np.array(sorted(hit)))


def _stay(bodies: Bodies, flight: Flight, which: Whole, shares: Floats) -> None:
    """Let these bodies be where they were after these shares of their ways in the tick that is over."""
    if which.size:
        back_x, back_y, back_z = flight.way[:, which] * (shares - 1.0)
        bodies.displace(which, back_x, back_y)
        flight.z[which] += back_z
        bodies.moved()


def _at_walls(bodies: Bodies, flight: Flight, z: Floats, which: Whole) -> tuple[Whole, Floats]:
    """Those of these bodies that have touched something solid, and on which shares of their ways they first did."""
    near, lines = bodies.near, bodies.near.lines
    if not len(lines) or not which.size:
        return np.empty(0, np.intp), np.empty(0)
    listed = near.solids(float(bodies.radii.max()) + flight.longest)
    images = near.images(bodies.x, bodies.y)
    cell = near.grid.cells_of(images.x[which], images.y[which])
    body, index = spread(which, listed.start[cell], listed.start[cell + 1])
    item = listed.items[index]
    way = flight.way[:, body]
    x, y = images.x[body] - way[0], images.y[body] - way[1]
    begin, end = near_solids(x, y, way[0], way[1], lines[item], bodies.radii[body] + lines[item, 4])
    before = z[body] - way[2]
    lowest = np.minimum(before + begin * way[2], before + end * way[2])
    touched = (begin < end) & (lowest < near.tops[item])
    shares = np.ones(bodies.count)
    np.minimum.at(shares, body[touched], begin[touched])
    hit = np.unique(body[touched])
    return hit, shares[hit]


def near_solids(
    x: Floats, y: Floats, way_x: Floats, way_y: Floats, solids: Floats, near: Floats
) -> tuple[Floats, Floats]:
    """From which share of its straight way on, 0 to 1, each point x, y is nearer than `near` to the segment of its
    solid, m, and up to which; the first is not below the second if it never is."""
    x0, y0, x1, y1, _ = solids.T
    length = np.hypot(x1 - x0, y1 - y0)
    size = np.where(length > 0.0, length, 1.0)
    along_x, along_y = (x1 - x0) / size, (y1 - y0) / size
    dx, dy = x - x0, y - y0
    beside = _between(dx * along_x + dy * along_y, way_x * along_x + way_y * along_y, np.zeros(len(x)), length)
    within = _between(dx * along_y - dy * along_x, way_x * along_y - way_y * along_x, -near, near)
    pieces = [(np.maximum(beside[0], within[0]), np.minimum(beside[1], within[1]))]
    pieces += [_in_disc(x - end_x, y - end_y, way_x, way_y, near) for end_x, end_y in ((x0, y0), (x1, y1))]
    begin = np.min([np.where(first < last, first, np.inf) for first, last in pieces], axis=0)
    end = np.max([np.where(first < last, last, -np.inf) for first, last in pieces], axis=0)
    return np.clip(begin, 0.0, 1.0), np.clip(end, 0.0, 1.0)


def _between(place: Floats, way: Floats, low: Floats, high: Floats) -> tuple[Floats, Floats]:
    """From which share of its way on a number lies between these, and up to which."""
    still = way == 0.0
    shares = [(each - place) / np.where(still, 1.0, way) for each in (low, high)]
    outside = (place <= low) | (place >= high)
    first = np.where(still, np.where(outside, np.inf, -np.inf), np.minimum(*shares))
    return first, np.where(still, -first, np.maximum(*shares))


def _in_disc(x: Floats, y: Floats, way_x: Floats, way_y: Floats, radius: Floats) -> tuple[Floats, Floats]:
    """From which share of its way on each point x, y lies in a disc around 0, 0, and up to which."""
    square, ahead = way_x * way_x + way_y * way_y, x * way_x + y * way_y
    outside = x * x + y * y - radius * radius
    still, root = square == 0.0, ahead * ahead - square * outside
    size, half = np.where(still, 1.0, square), np.sqrt(np.maximum(root, 0.0))
    missed = np.where(still, outside >= 0.0, root <= 0.0)
    first = np.where(missed, np.inf, np.where(still, -np.inf, (-ahead - half) / size))
    last = np.where(missed, -np.inf, np.where(still, np.inf, (half - ahead) / size))
    return first, last


def _touching(bodies: Bodies, way: Floats, z: Floats, first: Whole) -> tuple[Whole, Whole]:
    """Pairs that have touched, of these bodies and any others. way: of all in this tick, m, shape (3, count)."""
    if not first.size:
        return first, first
    near, radii = bodies.near, bodies.radii
    images = near.images(bodies.x, bodies.y)
    longest = float(np.sqrt(np.max(way[0] * way[0] + way[1] * way[1], initial=0.0)))
    reach = 2.0 * (float(radii.max()) + longest)
    one, image = bodies.machine.pairs(
        near.grid, near.points(bodies.x, bodies.y), images.x, images.y, reach, first.astype(np.int64)
    )
    other = images.whose(image)
    gap = np.stack((images.x[image] - images.x[one], images.y[image] - images.y[one], z[other] - z[one]))
    touched: Flags = _nearest(gap, way[:, other] - way[:, one]) < (radii[one] + radii[other]) ** 2
    return one[touched], other[touched]


def _nearest(gap: Floats, drift: Floats) -> Floats:
    """The least square of a distance in a tick, at whose end it is `gap`, and has changed by `drift`; shape (3, n)."""
    size = (drift * drift).sum(axis=0)
    back = np.clip((gap * drift).sum(axis=0) / np.where(size > 0.0, size, 1.0), 0.0, 1.0)
    rest = gap - drift * back
    squares: Floats = (rest * rest).sum(axis=0)
    return squares
