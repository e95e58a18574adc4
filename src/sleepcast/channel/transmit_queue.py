"""Turns: how soon each party's transmitter gets to a message, where it can send only so many in a second.

A transmitter sends one message after the other, each for 1 / rate s, whether one or a million hear it. What comes in
between waits; what finds the queue full is dropped. Nothing here depends on chance. What must not wait goes before all
that does, and takes its time from it.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Seconds = NDArray[np.float64]


class TransmitQueue:
    """The transmitters of `parties`, each for `rate` messages a second and with room for `queue` that wait. free: when
    each has sent all that it was given, s, shape (parties,)."""

    def __init__(self, parties: int, rate: float, queue: int) -> None:
        self.free: Seconds = np.full(parties, -np.inf)
        self._each, self._queue = 1.0 / rate, queue

    def take(self, senders: NDArray[np.intp], now: float, *, urgent: bool = False) -> tuple[Seconds, NDArray[np.bool_]]:
        """When each of these parties (each once) gets to what it sends at `now`, s, and whether it finds room."""
        begin = np.maximum(self.free[senders], now)
        # As many wait as are not begun; what is being sent waits no more. A thousandth of one is rounding.
        waiting = np.ceil((begin - now) / self._each - 1e-3)
        room = np.full(len(senders), True) if urgent else waiting <= self._queue
        self.free[senders[room]] = begin[room] + self._each
        return (np.full(len(senders), now) if urgent else begin), room
