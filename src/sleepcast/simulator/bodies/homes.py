"""Homes: where what flies has taken off, for those whose failsafe is to return there (`flight.failsafe = "rtl"`).

A copter flies home at the height of its take-off, or higher if that is where it is, and lands there. Where a ground map
is higher on its way, it rises over that before it sets out. A plane circles there. Whatever it is told on the way ends
that.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sleepcast.simulator.bodies.moved import Grounded, Returning
from sleepcast.simulator.motion.driving import GOTO
from sleepcast.simulator.motion.flying import LANDS
from sleepcast.simulator.simd.formulas import shortest

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Whole = NDArray[np.intp]
NEAR = 0.1
"""m from its home at which a copter begins to land, and from the height over the ground at which it sets out."""
MAX_PLACES = 4_096
"""Places on a way home of which it is found how high the ground is there: of a ground map each pixel more than once."""
TOO_HIGH = "the ground on its way home is higher than its ceiling: it lands"


class Homes:
    """The homes of the bodies that fly; arrays of shape (count,).

    x, y, z: where each has taken off, and the height of that take-off, m
    returns: who is on the way home
    """

    def __init__(self, bodies: Grounded, flight: Returning) -> None:
        self._bodies, self._flight = bodies, flight
        self.x, self.y, self.z = np.zeros((3, bodies.count))
        self.returns: Flags = np.zeros(bodies.count, bool)

    @property
    def columns(self) -> dict[str, NDArray[np.generic]]:
        """The arrays that a run changes, by name."""
        return {"home_x": self.x, "home_y": self.y, "home_z": self.z, "returns": self.returns}

    def set(self, which: Whole, z: Floats) -> None:
        """Let the homes of these be where they are now; z: to which they rise, m."""
        self.x[which], self.y[which], self.z[which] = self._bodies.x[which], self._bodies.y[which], z

    def go(self, which: Whole) -> None:
        """Send these, which are in the air, home."""
        bodies, flight = self._bodies, self._flight
        flight.rest(which)
        least = self._least_heights(which)
        barred = least > flight.laws_of(which).ceiling
        for robot in which[barred].tolist():
            bodies.say_of(robot, TOO_HIGH)
        flight.rest(which[barred], LANDS)
        which, least = which[~barred], least[~barred]
        x, y = self.x[which], self.y[which]
        if flight.wings is not None:
            x, y = flight.wings.roomy(which, x, y)
        low = flight.z[which] < least
        bodies.go_to(which, np.where(low, bodies.x[which], x), np.where(low, bodies.y[which], y))
        flight.target_z[which] = np.maximum(np.maximum(self.z[which], least), flight.z[which])
        self.returns[which] = True

    def step(self) -> None:
        """Let those land that have come home, and those set out that are high enough."""
        bodies, flight = self._bodies, self._flight
        which = np.flatnonzero(self.returns & (bodies.mode == GOTO))
        if flight.wings is not None:
            which = which[~flight.wings.planes[which]]
        there = self._is_at_home(which, bodies.x, bodies.y)
        waits = ~there & ~self._is_at_home(which, bodies.target_x, bodies.target_y)
        out = which[waits & (flight.z[which] >= flight.target_z[which] - NEAR)]
        bodies.go_to(out, self.x[out], self.y[out])
        flight.rest(which[there], LANDS)

    def _is_at_home(self, which: Whole, x: Floats, y: Floats) -> Flags:
        """Whether these places of these bodies are their homes. x, y: of all bodies, m"""
        around_x, around_y = self._bodies.scenario.around
        dx, dy = shortest(self.x[which] - x[which], around_x), shortest(self.y[which] - y[which], around_y)
        at_home: Flags = dx * dx + dy * dy <= NEAR * NEAR
        return at_home

    def _least_heights(self, which: Whole) -> Floats:
        """z at which each of these passes over a ground map on its straight way home, m; minus infinity without one."""
        bodies, flight, found = self._bodies, self._flight, np.full(len(which), -np.inf)
        ground = bodies.scenario.ground
        if ground is None:
            return found
        pixel = min(bodies.scenario.width / ground.columns, bodies.scenario.height / ground.rows)
        around_x, around_y = bodies.scenario.around
        for number, robot in enumerate(which.tolist()):
            x, y = float(bodies.x[robot]), float(bodies.y[robot])
            dx, dy = shortest(self.x[robot] - x, around_x), shortest(self.y[robot] - y, around_y)
            places = min(MAX_PLACES, 2 + int(4.0 * np.hypot(dx, dy) / pixel))
            shares = np.linspace(0.0, 1.0, places)
            found[number] = float(flight.ground_at(x + shares * dx, y + shares * dy).max())
        return found + flight.laws_of(which).floor + 2.0 * bodies.radii[which]
