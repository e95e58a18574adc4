"""Homes: where what flies has taken off, for those whose failsafe is to return there (`flight.failsafe = "rtl"`).

A copter flies home at the height of its take-off, or higher if that is where it is, and lands there. A plane circles
there. Whatever it is told on the way ends that.
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
"""m from its home at which a copter begins to land."""


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
        x, y = self.x[which], self.y[which]
        if flight.wings is not None:
            x, y = flight.wings.roomy(which, x, y)
        bodies.go_to(which, x, y)
        flight.target_z[which] = np.maximum(self.z[which], flight.z[which])
        self.returns[which] = True

    def step(self) -> None:
        """Let those land that have come home."""
        bodies, flight = self._bodies, self._flight
        which = np.flatnonzero(self.returns & (bodies.mode == GOTO))
        if flight.wings is not None:
            which = which[~flight.wings.planes[which]]
        around_x, around_y = bodies.scenario.around
        dx = shortest(self.x[which] - bodies.x[which], around_x)
        dy = shortest(self.y[which] - bodies.y[which], around_y)
        flight.rest(which[dx * dx + dy * dy <= NEAR * NEAR], LANDS)
