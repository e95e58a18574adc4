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
from sleepcast.simulator.cones import Cones, Ranges
from sleepcast.simulator.engine import Machine
from sleepcast.simulator.grid import Floats, Grid, Listed, Sorted, Whole, grid_over, list_solids
from sleepcast.simulator.noise import Noise
from sleepcast.simulator.robot_settings import Ring
from sleepcast.simulator.world import World

SOUND = 343.0
"""m/s in air at 20 degrees Celsius."""
CELLS_IN_REACH = 1.7
"""Cells of the grid that a sonar reaches across: smaller ones hold too few robots, larger ones too many in vain."""
FRONT = pi / 2
"""Sonars whose axis is at most this far from the heading count as front sonars, rad."""


class Echoes:
    """The sonars of many robots in a world of `size` (width and height, m).

    sensed: where the robots find what their sonars read, and in the last row the least of those in front: m, shape
    (sonars + 1, robots); brought up to date by `sense`. readings: the same without that row, shape (robots, sonars),
    float32; NaN for a sonar that has not fired yet. due: when each robot's next sonar fires, s; turn: its place in the
    firing order.
    """

    def __init__(
        self,
        ring: Ring,
        radius: float,
        sensed: Floats,
        size: tuple[float, float],
        world: World,
        seed: int,
        machine: Machine,
    ) -> None:
        self.ring, self.world, self.machine, self.sensed = ring, world, machine, sensed
        count = sensed.shape[1]
        self.cones = Cones(ring.count, ring.beam / 2.0, ring.most, ring.incidence, radius)
        self.readings: Ranges = np.full((count, ring.count), np.nan, np.float32)
        self.due: Floats = np.zeros(count)
        self.turn: Whole = np.zeros(count, np.int64)
        self.front = np.flatnonzero(np.abs((self.cones.axes + pi) % (2.0 * pi) - pi) <= FRONT + 1e-9)
        """Numbers of the front sonars."""
        self._seed = seed
        self._grid: Grid = grid_over(*size, self.cones.reach / CELLS_IN_REACH, count)
        self._listed: Listed | None = None
        self._version = -1
        self._points: Sorted | None = None
        self._fresh = np.zeros(count, bool)

    @property
    def fires_in_order(self) -> bool:
        return self.ring.pause is not None

    def forget(self) -> None:
        """Bodies or obstacles have moved: what was looked at is no longer so."""
        self._fresh[:] = False
        self._points = None

    def sense(self, which: Whole | None, tick: int, pose: tuple[Floats, Floats, Floats]) -> None:
        """Bring the readings of the robots with indices `which` (None: all) up to date for this tick. pose: where all
        bodies really are: x, y in m and heading in rad."""
        if not self.fires_in_order and self._version != self.world.version:
            self.forget()
        old = np.flatnonzero(~self._fresh) if which is None else which[~self._fresh[which]]
        if not len(old):
            return
        if not self.fires_in_order:
            self.readings[old] = self._look(old, tick, pose)
        self._fresh[old] = True
        self._tell(old)

    def _tell(self, which: Whole) -> None:
        """Put readings into the table. The limits come back as they were written, whatever became of them in single
        precision."""
        least, most = self.ring.least, self.ring.most
        read = self.readings[which].T
        told = np.where(read <= np.float32(least), least, np.minimum(read.astype(np.float64), most))
        self.sensed[:-1, which] = told
        self.sensed[-1, which] = told[self.front].min(axis=0)

    def fire(self, tick: int, until: float, pose: tuple[Floats, Floats, Floats]) -> None:
        """Fire the sonars that are due before the time `until` (s) and keep what they read."""
        pause = self.ring.pause
        if pause is None:
            return
        order = np.array(self.ring.order)
        seen = self._look(np.arange(len(self.due)), tick, pose)
        while len(due := np.flatnonzero(self.due < until)):
            sonar = order[self.turn[due]]
            heard = seen[due, sonar]
            self.readings[due, sonar] = heard
            self.due[due] += np.maximum(pause + 2.0 * heard.astype(np.float64) / SOUND, 1e-3)
            self.turn[due] = (self.turn[due] + 1) % len(order)

    def state(self) -> Iterable[NDArray[np.generic]]:
        """What the next ticks depend on."""
        if self.fires_in_order:
            yield from (self.readings, self.due, self.turn)

    def _look(self, which: Whole, tick: int, pose: tuple[Floats, Floats, Floats]) -> Ranges:
        x, y, _ = pose
        if self._listed is None or self._version != self.world.version:
            self._listed = list_solids(self._grid, self.world, self.cones.radius + self.cones.most)
            self._version = self.world.version
        if self._points is None:
            self._points = self.machine.sort(self._grid, x, y)
        solids = self.world.solids
        seen = self.machine.ranges(self.cones, self._grid, self._points, self._listed, solids, pose, which)
        if self.ring.noise or self.ring.dropout:
            keys = key(self._seed, "echo", tick), key(self._seed, "dropout", tick)
            self.machine.disturb(seen, which, Noise(self.ring.noise, self.ring.dropout, self.ring.most, *keys))
        return np.clip(seen, self.ring.least, self.ring.most, out=seen)
