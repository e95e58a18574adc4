"""Contact of what flies: whoever touches another one crashes, with it. Its motors stop, and it falls and stays.

Bodies are balls, which move straight within a tick; two have touched if they came nearer than their radii at any moment
of it. On the ground they may stand as near to each other as they like.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from sleepcast.simulator.bodies.bodies import Bodies, Flags, Floats, Saying, Whole
from sleepcast.simulator.bodies.flight import GROUND, Flight


def crash(bodies: Bodies, flight: Flight, names: Sequence[str]) -> None:
    """Let those crash that have touched in the tick that is over, and say whom they have hit. names: of all bodies."""
    z = np.nan_to_num(flight.z)
    first = np.flatnonzero(flight.flies & (z > GROUND))
    if not first.size:
        return
    one, other = _touching(bodies, flight.way, z, first)
    hit: dict[int, int] = {}
    for pair in sorted({*zip(one.tolist(), other.tolist(), strict=True)}):
        for robot, whom in (pair, pair[::-1]):
            if flight.flies[robot] and not flight.locked[robot]:
                hit.setdefault(robot, whom)
    for robot in sorted(hit):
        bodies.say(Saying(bodies.time, robot, f"has crashed into {names[hit[robot]]}"))
    if hit:
        flight.crash(np.array(sorted(hit)))


def _touching(bodies: Bodies, way: Floats, z: Floats, first: Whole) -> tuple[Whole, Whole]:
    """Pairs that have touched, of these bodies and any others. way: of all in this tick, m, shape (3, count)."""
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
