"""How fast simulated time goes against the clock on the wall."""

from __future__ import annotations

from math import inf

from sleepcast.core.clock import Clock

LONGEST_DEBT = 0.25
"""Seconds on the wall that a server that could not keep up makes up for; what is older is let go."""

STANDSTILL = 0.05
"""Seconds on the wall after which it is looked again whether time goes on."""


class Pace:
    """speed: simulated seconds in a second of `clock`, 0 for none, infinite for as fast as possible; it may be changed.
    let_go: simulated seconds that were not made up for."""

    def __init__(self, clock: Clock, speed: float = 1.0) -> None:
        self.speed = speed
        self.let_go = 0.0
        self._clock = clock
        self._looked = clock.now()
        self._credit = 0.0

    def look(self, tick: float) -> None:
        """Count the time that has passed since the last look. tick: simulated s of one."""
        now = self._clock.now()
        passed, self._looked = now - self._looked, now
        if self.speed == inf:
            self._credit = 0.0
            return
        most = max(LONGEST_DEBT * self.speed, tick)
        self._credit += passed * self.speed
        if self._credit > most:
            self.let_go += self._credit - most
            self._credit = most

    def due(self, tick: float) -> bool:
        """Whether a tick is due; it is then taken as done."""
        if self.speed == inf:
            return True
        if self._credit < tick:
            return False
        self._credit -= tick
        return True

    def wait(self, tick: float) -> float:
        """Seconds on the wall to wait for the next tick, or until speed is to be looked at again."""
        if self.speed == inf or self._credit >= tick:
            return 0.0
        if self.speed <= 0.0:
            return STANDSTILL
        return min(STANDSTILL, (tick - self._credit) / self.speed)
