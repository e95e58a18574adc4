"""Trickle (RFC 6206): who tells how things stand, and when, so that a quiet fleet is quiet and news are quick."""

from __future__ import annotations

from math import exp, inf, log1p
from random import Random

SOONEST, LATEST = 0.4, 60.0
"""Seconds of an interval: at least, while there is news, and at most."""
ENOUGH = 2
"""Times that somebody else has said the same in an interval, from which on we need not."""
STEEPNESS = 10.0
"""How seldom small numbers are drawn by `mostly_late`: enough for some ten thousand parties."""


def mostly_late(chance: Random) -> float:
    """A number from [0, 1] that is small for few only: of a thousand who wait for such a share of some time, one or two
    are early, whoever hears them keeps quiet, and nobody need know how many there are (Nonnenmacher and Biersack,
    Scalable feedback for large groups, IEEE/ACM Transactions on Networking 7, 1999)."""
    return log1p(chance.random() * (exp(STEEPNESS) - 1.0)) / STEEPNESS


class DigestTimer:
    """One party's timer. chance: for the moment within each interval. It rests until it is first restarted."""

    def __init__(self, chance: Random) -> None:
        self._chance = chance
        self._interval, self._ends, self._speaks, self._alike = SOONEST, inf, inf, 0

    def restart(self, now: float) -> None:
        """Things do not agree: begin anew with the shortest interval, unless that has just begun."""
        if self._ends == inf or self._interval > SOONEST:
            self._begin(now, SOONEST)

    def agree(self) -> None:
        """Somebody says what we should have said."""
        self._alike += 1

    def is_due(self, now: float) -> bool:
        """Whether it is time to speak; asked at any time from `due` on."""
        speak = self._speaks <= now and self._alike < ENOUGH
        if self._speaks <= now:
            self._speaks = inf
        if self._ends <= now:
            self._begin(now, min(2.0 * self._interval, LATEST))
        return speak

    def due(self) -> float:
        """When to ask next, s."""
        return min(self._speaks, self._ends)

    def _begin(self, now: float, interval: float) -> None:
        self._interval, self._ends, self._alike = interval, now + interval, 0
        self._speaks = now + interval * (1.0 + mostly_late(self._chance)) / 2.0
