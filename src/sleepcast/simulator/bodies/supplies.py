"""What flies and has used up what it flies with: each is told of once, at the end of the tick in which that happens.

It is not looked for in each tick. However bodies fly, none has used up its store before the tick in which the greatest
use would empty the least full one: until then nobody looks, and ticks may be quiet ones.
"""

from __future__ import annotations

from math import inf

import numpy as np

from sleepcast.robot import hovering
from sleepcast.simulator.bodies.bodies import Bodies, Flags, Floats, Whole
from sleepcast.simulator.bodies.flight import Flight
from sleepcast.simulator.scenario.flight import BATTERY

MARGIN = 1.01
"""How many times as much as the greatest use is reckoned with, so that sums may be rounded."""
LONGEST = 1_000_000
"""Ticks after which it is looked again at the latest."""


class Supplies:
    """The stores of what flies among bodies, where any can be used up.

    refilled: whether something else than flying and time changes them
    due: the tick before which nobody uses up any
    """

    def __init__(self, bodies: Bodies, flight: Flight, *, refilled: bool) -> None:
        self._bodies, self._flight, self._refilled = bodies, flight, refilled
        self._uses = greatest_uses(bodies, flight)
        self.go_on()

    def go_on(self) -> None:
        """Whoever has used up a store in an earlier tick was told of."""
        self._known, self.due = self._exhausted() & (self._bodies.tick > 0), self._bodies.tick + 1

    def turn_over(self, changed: Whole) -> None:
        """Others are in these rows, or nobody, and parents may have given away what they had."""
        self._known[changed] = False
        self.due = self._bodies.tick

    def look(self) -> None:
        """Tell of those who have used up a store, at the end of a tick or a turnover."""
        if self._bodies.tick < self.due:
            return
        exhausted = self._exhausted()
        for robot in np.flatnonzero(exhausted & ~self._known).tolist():
            self._bodies.say_of(robot, self._sentence(robot))
        self._known = exhausted
        self.due = self._bodies.tick + (1 if self._refilled else self._ticks_left())

    def _exhausted(self) -> Flags:
        """Who has used up a store, of those that fly and whose motors are not locked."""
        exhausted = self._bodies.exhausted()
        assert exhausted is not None
        return exhausted & self._flies()

    def _flies(self) -> Flags:
        return self._flight.flies & ~self._flight.locked

    def _sentence(self, robot: int) -> str:
        rows = zip(self._bodies.store_names, self._bodies.stores, self._uses, strict=True)
        store = next((name for name, levels, uses in rows if uses[robot] and levels[robot] <= 0.0), BATTERY)
        return hovering.exhausted(store, in_air=bool(self._flight.z[robot] > self._flight.ground[robot]))

    def _ticks_left(self) -> int:
        """How many ticks it takes at least until somebody has used up a store."""
        least, flies = inf, self._flies()
        for levels, uses in zip(self._bodies.stores, self._uses, strict=True):
            some = flies & (uses > 0.0) & (levels > 0.0)
            least = min(least, float(np.min(levels[some] / uses[some], initial=inf)))
        return max(1, int(min(least, LONGEST)))


def greatest_uses(bodies: Bodies, flight: Flight) -> list[Floats]:
    """The most that a tick takes of each store, shape (count,); 0 of bodies that need not land without it."""
    tick, found = bodies.scenario.tick, [np.zeros(bodies.count) for _ in bodies.stores]
    for laws, power, which in flight.hovering:
        part = bodies.parts[bodies.of_each_type.index(which)]
        flying = (power.per_second + power.per_climb * laws.climb) * tick
        for row, (most, use, drain) in enumerate(zip(found, part.uses, part.drains, strict=True)):
            if power.ends[row]:
                own = flying if row == power.battery else 0.0
                most[which] = MARGIN * (use * flight.longest + drain * tick + own)
    return found
