"""Rate limits: a token bucket, and a fair one in which chance decides when more comes than can be served."""

from __future__ import annotations

from random import Random

SPAN = 0.05
"""Seconds over which requests are counted, to know their rate."""


class TokenBucket:
    """Tokens that may be spent: `rate` a second, and at most `most` at once. now: s."""

    def __init__(self, rate: float, most: float, now: float) -> None:
        self._rate, self._most = rate, most
        self._left, self._since = most, now

    def left(self, now: float) -> float:
        """Tokens left at `now`; below 0 where more were spent than there were."""
        self._left = min(self._most, self._left + max(0.0, now - self._since) * self._rate)
        self._since = now
        return self._left

    def spend(self, count: float) -> None:
        """Take so many tokens."""
        self._left -= count


class RateLimit:
    """Lets through `rate` requests a second, and at most `most` at once.

    While tokens last, requests are served as they come. When the rest would not last, chance decides, with as many
    winners as there is time for: what counts in a flood is a sender's share of all that comes, and no place in the
    queue is better than another. Nothing that a forger sends can spend what the others would have had.
    """

    def __init__(self, rate: float, most: float, chance: Random, now: float) -> None:
        self._bucket = TokenBucket(rate, most, now)
        self._rate, self._chance = rate, chance
        self._asked, self._asked_since, self._share = 0, now, 1.0

    def take(self, now: float) -> bool:
        """Whether one more request is served."""
        left, passed = self._bucket.left(now), now - self._asked_since
        if not 0.0 <= passed < SPAN:
            self._share = passed * self._rate / self._asked if self._asked and passed > 0.0 else 1.0
            self._asked, self._asked_since = 0, now
        self._asked += 1
        if left < 1.0 or (left < 2.0 * SPAN * self._rate and self._chance.random() >= self._share):
            return False
        self._bucket.spend(1.0)
        return True
