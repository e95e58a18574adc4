"""The timer of digests, by the Trickle algorithm (RFC 6206): rare while all agree, quick when somebody differs."""

from __future__ import annotations

from math import exp, inf, log1p
from random import Random

SOONEST, LATEST = 0.4, 60.0
"""Seconds of the shortest interval, while there is news, and of the longest."""
ENOUGH = 2
"""Equal digests of others in an interval after which ours is left out."""
_STEEPNESS = 10.0
"""How rarely `mostly_late` draws small numbers: enough for some ten thousand parties."""


def mostly_late(chance: Random) -> float:
    """A random back-off from [0, 1], exponentially biased towards late: of a thousand parties one or two are early, and
    the others hear them and keep quiet. Nobody needs to know how many there are (Nonnenmacher and Biersack, Scalable
    feedback for large groups, IEEE/ACM Transactions on Networking 7, 1999)."""
    return log1p(chance.random() * (exp(_STEEPNESS) - 1.0)) / _STEEPNESS


class DigestTimer:
    """One party's timer. chance: for the moment within each interval. It is idle until the first restart."""

    def __init__(self, chance: Random) -> None:
        self._chance = chance
        self._interval, self._ends, self._speaks, self._alike = SOONEST, inf, inf, 0

    def restart(self, now: float) -> None:
        """Somebody differs: begin the shortest interval, unless it is running."""
        if self._ends == inf or self._interval > SOONEST:
            self._begin(now, SOONEST)

    def agree(self) -> None:
        """Somebody has sent the same digest as ours."""
        self._alike += 1

    def is_due(self, now: float) -> bool:
        """Whether to send a digest now; to be called from `due` on."""
        speak = self._speaks <= now and self._alike < ENOUGH
        if self._speaks <= now:
            self._speaks = inf
        if self._ends <= now:
            self._begin(now, min(2.0 * self._interval, LATEST))
        return speak

    def due(self) -> float:
        """When to call `is_due` next, s."""
        return min(self._speaks, self._ends)

    def _begin(self, now: float, interval: float) -> None:
        self._interval, self._ends, self._alike = interval, now + interval, 0
        self._speaks = now + interval * (1.0 + mostly_late(self._chance)) / 2.0
