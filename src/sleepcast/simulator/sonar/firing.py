"""Which sonar of each robot fires when: one order and pause for all robots, or one for each.

A robot's sonars fire one after the other in a loop: the next one `pause` s after the previous echo has come back, or
after the time that an echo from the greatest range would take. Only sonars that fire are computed; `kernels_firing`
has the compiled version of `fire`, bit-identical.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.errors import MisuseError
from sleepcast.core.records import NamedTuple
from sleepcast.simulator.scenario.robot_settings import MAX_ORDER, MAX_PAUSE, Ring
from sleepcast.simulator.sonar.cones import Ranges, VisibleScene
from sleepcast.simulator.sonar.crosstalk import QUICKEST, SOUND
from sleepcast.simulator.sonar.noise import Noise, disturb_each
from sleepcast.simulator.world.grid import Floats, Whole

Look = Callable[[VisibleScene, Whole, Whole], Ranges]
Hear = Callable[[Whole, Whole, Floats, Ranges], Ranges]

AT_ONCE = -1
"""Length of an order in which every sonar fires in every tick."""


class Firing:
    """The firing state of the sonars of `count` robots.

    order: numbers of sonars, shape (1 or count, width), int8
    length: how many of them are used, 0 for none, or AT_ONCE
    pause: s, shape (1 or count,): one for all robots, or one for each
    due: time at which each robot's next sonar fires, s, and turn: its position in the order, shape (count,); empty if
        no sonars fire in order
    """

    def __init__(self, ring: Ring, count: int) -> None:
        self._ring, self._count = ring, count
        in_order = self.in_order = ring.pause is not None
        """Whether any robot's sonars may fire one after the other."""
        self.order = np.array([ring.order], np.int8)
        self.length = np.array([len(ring.order) if in_order else AT_ONCE])
        self.pause = np.array([ring.pause or 0.0])
        self.due: Floats = np.zeros(count if in_order else 0)
        self.turn: Whole = np.zeros(len(self.due), np.int64)
        self.arranged = False
        """Whether each robot has its own order and pause."""

    def part(self) -> None:
        """Give each robot its own order and pause, at first a copy of the common ones."""
        if self.arranged:
            return
        order = np.zeros((self._count, MAX_ORDER), np.int8)
        order[:, : self.order.shape[1]] = self.order
        self.order, self.length, self.pause = order, self.length.repeat(self._count), self.pause.repeat(self._count)
        if not len(self.due):
            self.due, self.turn = np.zeros(self._count), np.zeros(self._count, np.int64)
        self.arranged = self.in_order = True

    def check(self, order: Sequence[int], pause: float) -> None:
        """Raises MisuseError for an unknown sonar, or too long an order or pause."""
        if len(order) > MAX_ORDER or not all(0 <= sonar < self._ring.count for sonar in order):
            most = self._ring.count - 1
            raise MisuseError(f"a firing order has at most {MAX_ORDER} sonars from 0 to {most}, not {str(order)[:80]}")
        if not 0.0 <= pause <= MAX_PAUSE:
            raise MisuseError(f"the pause of a firing order is 0 to {MAX_PAUSE:g} s, not {pause}")

    def arrange(self, row: int, order: Sequence[int], pause: float) -> None:
        """Set the firing order of this robot, after `part`."""
        self.order[row] = 0
        self.order[row, : len(order)] = order
        self.length[row], self.pause[row], self.turn[row] = len(order), pause, 0

    def begin(self, tick: int, until: float) -> None:
        """Begin this tick, which ends at `until` (s): no sonar fires before it begins."""
        np.maximum(self.due, until * (tick - 1) / tick, out=self.due)

    def at_once(self, rows: Whole) -> NDArray[np.bool_]:
        """Whether all sonars of these robots fire in every tick."""
        all_fire: NDArray[np.bool_] = self.length[rows * self.arranged] == AT_ONCE
        return all_fire

    def ready(self, until: float) -> Whole:
        """Rows of the robots with a sonar that fires before the time `until` (s)."""
        return np.flatnonzero((self.due < until) & (self.length > 0))

    def next(self, rows: Whole) -> Whole:
        """The next sonar to fire of each of these robots."""
        return self.order[rows * self.arranged, self.turn[rows]].astype(np.int64)

    def go_on(self, rows: Whole, read: Ranges) -> None:
        """Advance after these robots' sonars have fired and read these ranges (m)."""
        pause, length = (each[rows * self.arranged] for each in (self.pause, self.length))
        self.due[rows] += np.maximum(pause + 2.0 * read.astype(np.float64) / SOUND, QUICKEST)
        self.turn[rows] = (self.turn[rows] + 1) % length

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The arrays that a run changes, by name; none without a firing order."""
        if not self.in_order:
            return {}
        own: dict[str, NDArray[np.generic]] = {"due": self.due, "turn": self.turn}
        return own | ({"order": self.order, "length": self.length, "pause": self.pause} if self.arranged else {})


class Tick(NamedTuple):
    """A tick in which sonars fire.

    view: the visible scene
    first: index of the robot in row 0 of all arrays
    until: end of the tick, s
    least: least reading, m
    noise: noise of the echoes
    readings: shape (robots, sonars), m, changed in place
    """

    view: VisibleScene
    first: int
    until: float
    least: float
    noise: Noise | None
    readings: Ranges


def fire(firing: Firing, tick: Tick, look: Look, hear: Hear | None = None) -> None:
    """Fire all sonars that are due in this tick, one sonar of each robot at a time. look: see `cones.look`; hear:
    applies cross-talk: takes robots, sonars, times of their pings and their own readings (m), and returns the
    readings."""
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
