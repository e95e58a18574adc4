"""What hovers and is driven against its fence: each is told of in the tick in which the fence holds it, with the words
of the bridges.

Who is sent to a place needs none of this: a place beyond the fence is a fault. Compiled code looks who may have come to
the fence, see `kernels_flying.at_fence`; whom it really holds is found here.
"""

from __future__ import annotations

from math import inf

import numpy as np

from sleepcast.robot import FENCE_AHEAD, STANDING, TELL_AGAIN, brought_to_rest
from sleepcast.simulator.bodies.bodies import Bodies, Flags, Floats, Whole
from sleepcast.simulator.bodies.flight import Flight
from sleepcast.simulator.motion import flying
from sleepcast.simulator.motion.driving import DRIVE
from sleepcast.simulator.motion.flying import AT_FENCE

HELD_BACK = f"it goes along its fence: {FENCE_AHEAD}"
SLOW = 0.05
"""m/s along the fence up to which a body counts as at rest there."""


class Fences:
    """Of a world without a torus. told: which bodies are driven at the fence and were told of; shape (count,)."""

    def __init__(self, bodies: Bodies, flight: Flight) -> None:
        self._bodies, self._flight = bodies, flight
        self.told: Flags = np.zeros(bodies.count, bool)
        self._told_at: Floats = np.full(bodies.count, -inf)
        """Seconds at which each was told of."""
        left, bottom, right, top = flight.edges
        west, south = (float(each.max()) + 2.0 * AT_FENCE for each in (left, bottom))
        east, north = (float(each.min()) - 2.0 * AT_FENCE for each in (right, top))
        self._far_from_all = west, south, east, north
        """Left, bottom, right and top of where nobody is at any edge, m."""

    @property
    def state(self) -> list[tuple[int, float, bool]]:
        """Of each body that was told of the second, and whether it is at the fence still."""
        which = np.flatnonzero(self._told_at > -inf)
        return list(zip(which.tolist(), self._told_at[which].tolist(), self.told[which].tolist(), strict=True))

    def go_on(self, state: list[tuple[int, float, bool]]) -> None:
        """Have this `state`."""
        for robot, time, told in state:
            self._told_at[robot], self.told[robot] = time, told

    def turn_over(self, changed: Whole) -> None:
        """Others are in these rows, or nobody."""
        self.told[changed], self._told_at[changed] = False, -inf

    def look(self) -> None:
        """Tell of those whom the fence holds since the tick that is over; again only after `TELL_AGAIN` s."""
        there = self._driven_there()
        told = self.told[there]
        self.told[:] = False
        self.told[there] = told
        new = there[~told]
        if not new.size:
            return
        held, rests = self._held(new)
        now = self._bodies.time
        self.told[new[held]] = True
        for robot, rest in zip(new[held].tolist(), rests[held].tolist(), strict=True):
            if now - self._told_at[robot] > TELL_AGAIN:
                self._bodies.say_of(robot, brought_to_rest(FENCE_AHEAD) if rest else HELD_BACK)
                self._told_at[robot] = now

    def _driven_there(self) -> Whole:
        """Who is at the edge of its fence while it is driven, in whatever direction."""
        bodies, flight, near = self._bodies, self._flight, self._near_an_edge()
        left, bottom, right, top = (edge[near] for edge in flight.edges)
        x, y = bodies.x[near], bodies.y[near]
        room = np.minimum(np.minimum(x - left, right - x), np.minimum(y - bottom, top - y))
        driven = (bodies.wanted_speed[near] != 0.0) | (flight.wanted_side[near] != 0.0)
        flown = (bodies.mode[near] == DRIVE) & (flight.armed[near] > 0.0) & flight.hovers[near] & ~bodies.still[near]
        there: Whole = near[(room <= AT_FENCE) & driven & flown]
        return there

    def _near_an_edge(self) -> Whole:
        """Whoever may be at the edge of a fence: few of all."""
        x, y = self._bodies.x, self._bodies.y
        west, south, east, north = self._far_from_all
        return np.flatnonzero((x <= west) | (x >= east) | (y <= south) | (y >= north))

    def _held(self, which: Whole) -> tuple[Flags, Flags]:
        """Whom of these the fence holds, and who goes along it no faster than `SLOW`."""
        bodies, flight, laws = self._bodies, self._flight, self._flight.laws_of(which)
        asked = bodies.wanted_speed[which], flight.wanted_side[which]
        east, north = flying.driven(laws, bodies.heading[which], *asked)
        to_east, to_north = flying.within_edges(laws, bodies.x[which], bodies.y[which], east, north)
        held = np.hypot(east - to_east, north - to_north) > STANDING
        return held, np.hypot(to_east, to_north) <= SLOW
