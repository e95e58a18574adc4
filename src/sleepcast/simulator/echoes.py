"""What the sonars of all robots read: the exact ranges of their cones with noise, losses, limits and age.

Without a firing order every sonar fires in every tick, and readings are made when somebody asks for them. With one, a
robot's sonars fire one after the other for ever: the next one `pause` s after the echo of the one before has come
back, or after as long as an echo from the farthest would take. A sonar keeps its reading until it fires again, so a
reading is as old as it would be.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import pi

import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.chance import key
from sleepcast.simulator.cones import Cones, Ranges, View
from sleepcast.simulator.crosstalk import QUICKEST, SOUND, Crosstalk
from sleepcast.simulator.engine import Machine
from sleepcast.simulator.grid import Floats, Whole
from sleepcast.simulator.neighbours import Neighbours
from sleepcast.simulator.noise import Ear, Noise
from sleepcast.simulator.robot_settings import Ring

FRONT = pi / 2
"""Sonars whose axis is at most this far from the heading count as front sonars, rad."""


class Echoes:
    """The sonars of many robots.

    sensed: where the robots find what their sonars read, and in the last row the least of those in front: m, shape
    (sonars + 1, robots); brought up to date by `sense`. Where sonars fire in order, readings: what each read when it
    last fired, m, shape (robots, sonars), float32, NaN for one that has not fired yet; due: when each robot's next
    sonar fires, s; turn: its place in the firing order.

    Where there are other sorts of robots, robots: which of all have these sonars; radii: of all bodies, m. Then the
    arrays have only these robots, and indices are still those of all.
    """

    def __init__(
        self,
        ring: Ring,
        cones: Cones,
        sensed: Floats,
        near: Neighbours,
        seed: int,
        machine: Machine,
        robots: slice | None = None,
        radii: Floats | None = None,
    ) -> None:
        self.ring, self.cones, self.sensed = ring, cones, sensed
        count = sensed.shape[1]
        self.robots = robots or slice(0, count)
        self._radii = radii
        self.readings: Ranges = np.full((count if self.fires_in_order else 0, ring.count), np.nan, np.float32)
        self.due: Floats = np.zeros(count)
        self.turn: Whole = np.zeros(count, np.int64)
        self.front = np.flatnonzero(np.abs((self.cones.axes + pi) % (2.0 * pi) - pi) <= FRONT + 1e-9)
        """Numbers of the front sonars."""
        self._near, self._machine, self._seed = near, machine, seed
        self.crosstalk = (
            Crosstalk(ring.crosstalk, ring, cones.axes, cones.radius, count, near.grid, seed)
            if ring.crosstalk
            else None
        )
        self._version = -1
        self._fresh = np.zeros(count, bool)

    @property
    def fires_in_order(self) -> bool:
        return self.ring.pause is not None

    def forget(self) -> None:
        """Bodies or obstacles have moved: what was looked at is no longer so."""
        self._fresh[:] = False

    def sense(self, which: Whole | None, tick: int, pose: tuple[Floats, Floats, Floats]) -> None:
        """Bring the readings of the robots with indices `which` (None: all that have these sonars) up to date for this
        tick. pose: where all bodies really are: x, y in m and heading in rad."""
        if not self.fires_in_order and self._version != self._near.world.version:
            self.forget()
            self._version = self._near.world.version
        own = None if which is None else which - self.robots.start
        old = np.flatnonzero(~self._fresh) if own is None else own[~self._fresh[own]]
        if not len(old):
            return
        self._fresh[old] = True
        ear = Ear(self.ring.least, self.ring.most, self.front, None if self.fires_in_order else self._noise(tick))
        if self.fires_in_order:
            self._machine.tell(self.readings[old], old, ear, self.sensed)
        elif self._radii is not None:
            self._machine.tell(self._machine.ranges(self._view(pose), old + self.robots.start), old, ear, self.sensed)
        else:
            self._machine.hear(self._view(pose), old, ear, self.sensed)

    def fire(self, tick: int, until: float, pose: tuple[Floats, Floats, Floats]) -> None:
        """Fire the sonars that are due before the time `until` (s) and keep what they read."""
        pause = self.ring.pause
        if pause is None:
            return
        order, every, noise = np.array(self.ring.order), np.arange(len(self.due)), self._noise(tick)
        seen = self._machine.ranges(self._view(pose), every + self.robots.start)
        if noise is not None:
            self._machine.disturb(seen, every, noise)
        np.clip(seen, self.ring.least, self.ring.most, out=seen)
        while len(due := np.flatnonzero(self.due < until)):
            sonar = order[self.turn[due]]
            heard = seen[due, sonar]
            if self.crosstalk:
                heard = self.crosstalk.hear(tick, due, sonar, self.due[due], heard)
            self.readings[due, sonar] = heard
            self.due[due] += np.maximum(pause + 2.0 * heard.astype(np.float64) / SOUND, QUICKEST)
            self.turn[due] = (self.turn[due] + 1) % len(order)
        if self.crosstalk:
            x, y, heading = (each[self.robots] for each in pose)
            self.crosstalk.end(tick, (x, y, heading), self.readings)

    def state(self) -> Iterable[NDArray[np.generic]]:
        """What the next ticks depend on."""
        if self.fires_in_order:
            yield from (self.readings, self.due, self.turn)
        if self.crosstalk:
            yield from self.crosstalk.columns().values()

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The arrays that a run changes and that the next ticks depend on, by name."""
        if not self.fires_in_order:
            return {}
        own: dict[str, NDArray[np.generic]] = {"readings": self.readings, "due": self.due, "turn": self.turn}
        return own | (self.crosstalk.columns() if self.crosstalk else {})

    def _view(self, pose: tuple[Floats, Floats, Floats]) -> View:
        near = self._near
        listed = near.solids(self.cones.radius + self.cones.most)
        return View(self.cones, near.grid, near.points(pose[0], pose[1]), listed, near.world.solids, pose, self._radii)

    def _noise(self, tick: int) -> Noise | None:
        """What disturbs the echoes of this tick."""
        ring = self.ring
        if not (ring.noise or ring.dropout):
            return None
        sort = (self.robots.start,) if self.robots.start else ()  # each sort of robots has chance of its own
        keys = (key(self._seed, what, tick, *sort) for what in ("echo", "dropout"))
        return Noise(ring.noise, ring.dropout, ring.most, *keys)
