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
        x, y = self._places(which)
        waits_x, waits_y = self._here(which)
        low = flight.z[which] < least
        bodies.go_to(which, np.where(low, waits_x, x), np.where(low, waits_y, y))
        flight.target_z[which] = np.maximum(np.maximum(self.z[which], least), flight.z[which])
        self.returns[which] = True

    def step(self) -> None:
        """Let those land that have come home, and those set out that are high enough."""
        bodies, flight = self._bodies, self._flight
        which = np.flatnonzero(self.returns & (bodies.mode == GOTO))
        waits = ~self._are_at_home(which, bodies.target_x, bodies.target_y)
        out = which[waits & (flight.z[which] >= flight.target_z[which] - NEAR)]
        bodies.go_to(out, *self._places(out))
        there = which[self._are_at_home(which, bodies.x, bodies.y)]
        flight.rest(there if flight.wings is None else there[~flight.wings.planes[there]], LANDS)

    def _places(self, which: Whole) -> tuple[Floats, Floats]:
        """Where these go that return: home, or, planes, to the nearest place with room for their circles."""
        x, y, wings = self.x[which], self.y[which], self._flight.wings
        return (x, y) if wings is None else wings.roomy(which, x, y)

    def _here(self, which: Whole) -> tuple[Floats, Floats]:
        """Where these rest that have just come to rest: where they are, or, planes, in the middle of their circles."""
        bodies, wings = self._bodies, self._flight.wings
        if wings is None:
            return bodies.x[which], bodies.y[which]
        circles = wings.planes[which]
        return (
            np.where(circles, bodies.target_x[which], bodies.x[which]),
            np.where(circles, bodies.target_y[which], bodies.y[which]),
        )

    def _are_at_home(self, which: Whole, x: Floats, y: Floats) -> Flags:
        """Whether these places of these bodies are where they return to. x, y: of all bodies, m"""
        (around_x, around_y), (home_x, home_y) = self._bodies.scenario.around, self._places(which)
        dx, dy = shortest(home_x - x[which], around_x), shortest(home_y - y[which], around_y)
        at_home: Flags = dx * dx + dy * dy <= NEAR * NEAR
        return at_home

    def _least_heights(self, which: Whole) -> Floats:
        """z at which each of these passes over a ground map on its straight way home, m; minus infinity without one.
        Planes pass so over the circles at its ends, too."""
        bodies, flight, found = self._bodies, self._flight, np.full(len(which), -np.inf)
        if bodies.scenario.ground is None:
            return found
        wings = flight.wings
        for number, robot in enumerate(which.tolist()):
            one = which[number : number + 1]
            circle = float(wings.circle[robot]) if wings is not None and wings.planes[robot] else 0.0
            found[number] = float(flight.ground_at(*self._way(self._here(one), self._places(one), circle)).max())
        return found + flight.laws_of(which).floor + 2.0 * bodies.radii[which]

    def _way(self, start: tuple[Floats, Floats], end: tuple[Floats, Floats], circle: float) -> tuple[Floats, Floats]:
        """Places along the shortest way from one place to another, several in each pixel of a ground map, and on the
        circles of this radius, m, around both."""
        scenario = self._bodies.scenario
        assert scenario.ground is not None
        pixel = min(scenario.width / scenario.ground.columns, scenario.height / scenario.ground.rows)
        dx, dy = (shortest(b - a, size) for a, b, size in zip(start, end, scenario.around, strict=True))
        shares = np.linspace(0.0, 1.0, min(MAX_PLACES, 2 + int(4.0 * np.hypot(dx, dy)[0] / pixel)))
        angles = np.linspace(0.0, 2.0 * np.pi, min(MAX_PLACES, 8 + int(16.0 * circle / pixel)))
        axes = ((start[0] + shares * dx, circle * np.cos(angles)), (start[1] + shares * dy, circle * np.sin(angles)))
        x, y = (np.concatenate((at, at[0] + ring, at[-1] + ring)) for at, ring in axes)
        return x, y
