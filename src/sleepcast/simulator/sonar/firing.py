"""Which sonar of each robot fires when: an order and a pause for all of them, or for each one its own.

A robot's sonars fire one after the other for ever: the next one `pause` s after the echo of the one before has come
back, or after as long as an echo from the farthest would take. Only those that fire look; `kernels_firing` has the
compiled form of `fire`, with the same bits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.errors import MisuseError
from sleepcast.simulator.scenario.robot_settings import MAX_ORDER, MAX_PAUSE, Ring
from sleepcast.simulator.sonar.cones import Ranges, View
from sleepcast.simulator.sonar.crosstalk import QUICKEST, SOUND
from sleepcast.simulator.sonar.noise import Noise, disturb_each
from sleepcast.simulator.world.grid import Floats, Whole

Look = Callable[[View, Whole, Whole], Ranges]
Hear = Callable[[Whole, Whole, Floats, Ranges], Ranges]

AT_ONCE = -1
"""The length of an order in which every sonar fires in every tick."""


class Firing:
    """The firing of the sonars of `count` robots.

    order: numbers of sonars, shape (1 or count, width), int8; length: how many of those, 0 for none at all, or AT_ONCE;
    pause: s, of the same shape (1 or count,): one for all robots, or one for each of them. due: when each robot's next
    sonar fires, s, and turn: its place in the order, shape (count,); empty where none fires in order.
    """

    def __init__(self, ring: Ring, count: int) -> None:
        self._ring, self._count = ring, count
        in_order = ring.pause is not None
        self.order = np.array([ring.order], np.int8)
        self.length = np.array([len(ring.order) if in_order else AT_ONCE])
        self.pause = np.array([ring.pause or 0.0])
        self.due: Floats = np.zeros(count if in_order else 0)
        self.turn: Whole = np.zeros(len(self.due), np.int64)
        self.arranged = False
        """Whether each robot has an order and a pause of its own."""

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
        self.order, self.length, self.pause = order, self.length.repeat(self._count), self.pause.repeat(self._count)
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

    def at_once(self, rows: Whole) -> NDArray[np.bool_]:
        """Whether all sonars of these robots fire in every tick."""
        found: NDArray[np.bool_] = self.length[rows * self.arranged] == AT_ONCE
        return found

    def ready(self, until: float) -> Whole:
        """Rows of the robots that have a sonar which fires before the time `until` (s)."""
        return np.flatnonzero((self.due < until) & (self.length > 0))

    def next(self, rows: Whole) -> Whole:
        """The sonars of these robots whose turn it is."""
        return self.order[rows * self.arranged, self.turn[rows]].astype(np.int64)

    def go_on(self, rows: Whole, read: Ranges) -> None:
        """These robots' sonars have fired, and read so much (m): the next ones are to come."""
        pause, length = (each[rows * self.arranged] for each in (self.pause, self.length))
        self.due[rows] += np.maximum(pause + 2.0 * read.astype(np.float64) / SOUND, QUICKEST)
        self.turn[rows] = (self.turn[rows] + 1) % length

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The arrays that a run changes, by name; none without an order."""
        if not self.in_order:
            return {}
        own: dict[str, NDArray[np.generic]] = {"due": self.due, "turn": self.turn}
        return own | ({"order": self.order, "length": self.length, "pause": self.pause} if self.arranged else {})


class Tick(NamedTuple):
    """A tick in which sonars fire. view: what there is to see; first: index of the robot in row 0 of all arrays; until:
    when it ends, s; least: m, what is nearer reads as this; noise: what disturbs echoes; readings: what the sonars
    read, m, shape (robots, sonars), changed in place."""

    view: View
    first: int
    until: float
    least: float
    noise: Noise | None
    readings: Ranges


def fire(firing: Firing, tick: Tick, look: Look, hear: Hear | None = None) -> None:
    """Fire all sonars that are due in this tick, one of each robot at a time. look: see `cones.look`; hear: what they
    read (m) that are given to robots, sonars, times of their pings and what they would read of themselves."""
    count, most = tick.readings.shape[1], tick.view.cones.most
    while len(rows := firing.ready(tick.until)):
        sonars = firing.next(rows)
        seen = look(tick.view, rows + tick.first, sonars)
        if tick.noise is not None:
            disturb_each(seen, rows.astype(np.uint64) * np.uint64(count) + sonars.astype(np.uint64), tick.noise)
        np.clip(seen, tick.least, most, out=seen)
        if hear is not None:
            seen = hear(rows, sonars, firing.due[rows], seen)
        tick.readings[rows, sonars] = seen
        firing.go_on(rows, seen)
