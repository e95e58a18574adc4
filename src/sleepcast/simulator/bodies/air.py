"""The air as it pushes bodies that fly: how wind and downwash change their velocities.

A body is moved by its motors through the air, up to its speed, and with the air. Wind that changes takes it along at
once, and then it steers back as far as its acceleration allows; a steady wind that is slower than itself does not move
it. Who is to be at rest comes back to where it was (`anchor`). Downwash only pushes down.
"""

from __future__ import annotations

from math import nan

import numpy as np
from numpy.typing import NDArray

from sleepcast.simulator.bodies.proximity import Neighbours
from sleepcast.simulator.engine import Machine
from sleepcast.simulator.motion import downwash, flying
from sleepcast.simulator.motion.flying import VectorLaws
from sleepcast.simulator.motion.wind import wind_at
from sleepcast.simulator.scenario.scenario import Scenario
from sleepcast.simulator.scenario.wind import WindSpec

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Whole = NDArray[np.intp]


class Air:
    """The wind around bodies; arrays of shape (count,).

    east, north: of the wind at each body in the last tick, m/s
    anchor_x, anchor_y: where a body stays while it is to be at rest, m; NaN while it is not
    carried: whether the wind is faster than the body
    """

    def __init__(self, spec: WindSpec, scenario: Scenario, seed: int, count: int) -> None:
        self._spec, self._scenario, self._seed = spec, scenario, seed
        self.east, self.north = np.zeros(count), np.zeros(count)
        self.anchor_x, self.anchor_y = np.full(count, nan), np.full(count, nan)
        self.carried = np.zeros(count, bool)

    @property
    def washes(self) -> bool:
        """Whether bodies push down who is below them."""
        return self._spec.downwash

    @property
    def columns(self) -> dict[str, NDArray[np.generic]]:
        """The arrays that a run changes, by name."""
        return {
            "wind_east": self.east,
            "wind_north": self.north,
            "anchor_x": self.anchor_x,
            "anchor_y": self.anchor_y,
            "carried": self.carried,
        }

    def blow(self, time: float, rows: Whole | slice, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """By how much the wind at these bodies, who are at x, y, has changed since the last tick, m/s."""
        east, north = wind_at(self._spec, self._seed, time, x, y, self._scenario.around)
        change = east - self.east[rows], north - self.north[rows]
        self.east[rows], self.north[rows] = east, north
        return change

    def reached(self, laws: VectorLaws, rows: Whole | slice, east: Floats, north: Floats) -> tuple[Floats, Floats]:
        """See `flying.reached`."""
        return flying.reached(laws, (self.east[rows], self.north[rows]), east, north)

    def hold(self, rows: Whole | slice, rests: Flags, x: Floats, y: Floats) -> Flags:
        """Let those of these bodies that are to be at rest have an anchor where they are, and all others none; gives
        who has one from before."""
        held: Flags = rests & np.isfinite(self.anchor_x[rows])
        for anchor, place in ((self.anchor_x, x), (self.anchor_y, y)):
            anchor[rows] = np.where(held, anchor[rows], np.where(rests, place, nan))
        return held

    def newly_carried(self, laws: VectorLaws, rows: Whole | slice, up: Flags) -> Flags:
        """Which of these bodies the wind has begun to carry away in this tick."""
        east, north = self.east[rows], self.north[rows]
        carried = up & (np.sqrt(east * east + north * north) > laws.speed)
        new: Flags = carried & ~self.carried[rows]
        self.carried[rows] = carried
        return new


def pushed_down(
    machine: Machine, near: Neighbours, place: tuple[Floats, Floats, Floats], radii: Floats, blowing: Flags
) -> Floats:
    """The acceleration downwards of each body in the downwash of all that are `blowing`, m/s2. place: x, y, z, m

    Bodies are added up from above in the order of their numbers, so that the sum has the same bits on every machine.
    """
    x, y, z = place
    found, above = np.zeros(len(x)), np.flatnonzero(blowing)
    if not above.size:
        return found
    images = near.images(x, y)
    reach = downwash.widest(float(radii[above].max()))
    upper, image = machine.pairs(near.grid, near.points(x, y), images.x, images.y, reach, above.astype(np.int64))
    lower = images.whose(image)
    aside = np.hypot(images.x[image] - images.x[upper], images.y[image] - images.y[upper])
    push = downwash.push(z[upper] - z[lower], aside, radii[upper])
    order = np.lexsort((upper, lower))
    found += np.bincount(lower[order], push[order], len(x))
    return found
