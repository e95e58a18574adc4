"""Which sonar of each robot fires when: an order and a pause for all of them, or for each one its own.

A robot's sonars fire one after the other for ever: the next one `pause` s after the echo of the one before has come
back, or after as long as an echo from the farthest would take.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sleepcast.errors import MisuseError
from sleepcast.simulator.grid import Floats, Whole
from sleepcast.simulator.robot_settings import MAX_ORDER, MAX_PAUSE, Ring

AT_ONCE = -1
"""The length of an order in which every sonar fires in every tick."""


class Firing:
    """The firing of so many robots' sonars.

    A row for each robot. order: numbers of sonars, shape (count, width); length: how many of those, 0 for none at all,
    or AT_ONCE; pause: s; due: when the next one fires, s; turn: its place in the order. arranged: whether robots have
    orders and pauses of their own; else `order`, `length` and `pause` are one row that all of them see, not to be
    written to, and without an order `due` and `turn` are empty.
    """

    def __init__(self, ring: Ring, count: int) -> None:
        in_order = ring.pause is not None
        self._ring, self._count = ring, count
        self.arranged = False
        self.order: NDArray[np.int8] = np.broadcast_to(np.array(ring.order, np.int8), (count, len(ring.order)))
        self.length: Whole = np.broadcast_to(np.int64(len(ring.order) if in_order else AT_ONCE), (count,))
        self.pause: Floats = np.broadcast_to(np.float64(ring.pause or 0.0), (count,))
        self.due: Floats = np.zeros(count if in_order else 0)
        self.turn: Whole = np.zeros(len(self.due), np.int64)

    @property
    def in_order(self) -> bool:
        """Whether any robot's sonars may fire one after the other."""
        return self._ring.pause is not None or self.arranged

    def part(self) -> None:
        """Give each robot an order and a pause of its own, for now those of all."""
        if self.arranged:
            return
        order = np.zeros((self._count, MAX_ORDER), np.int8)
        order[:, : self.order.shape[1]] = self.order
        self.order, self.length, self.pause = order, self.length.copy(), self.pause.copy()
        if not len(self.due):
            self.due, self.turn = np.zeros(self._count), np.zeros(self._count, np.int64)
        self.arranged = True

    def check(self, order: Sequence[int], pause: float) -> None:
        """Raises MisuseError for a sonar that there is not, or too long an order or pause."""
        if len(order) > MAX_ORDER or not all(0 <= sonar < self._ring.count for sonar in order):
            most = self._ring.count - 1
            raise MisuseError(f"a firing order has at most {MAX_ORDER} sonars from 0 to {most}, not {str(order)[:80]}")
        if not 0.0 <= pause <= MAX_PAUSE:
            raise MisuseError(f"the pause of a firing order is 0 to {MAX_PAUSE:g} s, not {pause}")

    def arrange(self, row: int, order: Sequence[int], pause: float) -> None:
        """Let this robot's sonars fire in this order, after `part`."""
        self.order[row] = 0
        self.order[row, : len(order)] = order
        self.length[row], self.pause[row], self.turn[row] = len(order), pause, 0

    def begin(self, tick: int, until: float) -> None:
        """The tick of this number begins, which ends at `until` (s): nobody's turn was before it."""
        np.maximum(self.due, until * (tick - 1) / tick, out=self.due)

    def ready(self, until: float) -> Whole:
        """Rows of the robots that have a sonar which fires before the time `until` (s)."""
        return np.flatnonzero((self.due < until) & (self.length > 0))

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The arrays that a run changes, by name; none without an order."""
        if not self.in_order:
            return {}
        own: dict[str, NDArray[np.generic]] = {"due": self.due, "turn": self.turn}
        return own | ({"order": self.order, "length": self.length, "pause": self.pause} if self.arranged else {})
