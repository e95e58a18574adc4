"""Sync: how a robot without a real-time clock, which wakes in 1970, gets the time from an operator.

It asks with a nonce, and an operator signs nonce and time (Cristian, *Probabilistic clock synchronization*, 1989). The
nonce was never used before, so no recording answers it; the round trip was short, so nobody has kept the answer back:
the time was right within it, and half of it is the most that the robot can be wrong.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from secrets import token_bytes

from sleepcast.channel.admission import Admission
from sleepcast.channel.message import Message
from sleepcast.channel.payload import TIME
from sleepcast.core.clock import MADE

NONCE_BYTES = 16
"""Bytes of a nonce: nobody guesses it, and it never comes again by chance."""
MAX_TRIP = 1.0
"""Seconds from the question to the answer at most: so the time is wrong by half a second, a quarter of the skew."""
SOONEST, SLOWEST = 2.0, 16.0
"""Seconds between two questions at first, and at most: the pause doubles while nobody answers. It is longer than
`MAX_TRIP`, so no answer in time is to a question that is given up."""
HURRIED_PAUSE = 0.25
"""Seconds between two questions where somebody commands us, who may be gone as soon as he has our answer."""


class TimeRequest:
    """The question of one party, until it is answered. door: at which the answer comes in. taken: called with the
    seconds by which our clock is behind, and with whose time it takes; sets all that counts by it."""

    def __init__(self, door: Admission, taken: Callable[[float, str], None]) -> None:
        self.due = -inf
        """When to ask next, s of our clock."""
        self._door, self._taken = door, taken
        self._asked, self._pause = -inf, SOONEST

    def question(self, now: float) -> dict[str, object]:
        """The body of a new question; whatever answers an older one comes too late."""
        self._door.nonce = token_bytes(NONCE_BYTES)
        self._asked, self.due = now, now + self._pause
        self._pause = min(2.0 * self._pause, SLOWEST)
        return {TIME: self._door.nonce}

    def hurry(self) -> None:
        """Somebody is there who commands us: ask as soon as we may."""
        self.due = min(self.due, self._asked + HURRIED_PAUSE)

    def answer(self, message: Message, now: float) -> float:
        """By how many s our clock has moved, now that this has been heard: 0 if it is no answer to be believed."""
        trip = now - self._asked
        if message.body.get(TIME) != self._door.nonce or not 0.0 <= trip <= MAX_TRIP or message.issued < MADE:
            return 0.0
        behind = message.issued + trip / 2.0 - now
        self._door.nonce = b""
        self._door.forget_clocks()
        self._taken(behind, message.sender)
        return behind
