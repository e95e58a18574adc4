"""What the sonars of all robots read: the exact ranges of their cones with noise, losses, limits and age.

Without a firing order every sonar fires in every tick, and readings are made when somebody asks for them. With one, a
robot's sonars fire one after the other (see `firing`). A sonar keeps its reading until it fires again, so a reading is
as old as it would be.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from functools import partial
from math import pi

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.counter_rng import key
from sleepcast.simulator.bodies.neighbours import Neighbours
from sleepcast.simulator.engine import Machine
from sleepcast.simulator.scenario.robot_settings import Ring
from sleepcast.simulator.simd.formulas import wrap
from sleepcast.simulator.sonar.cones import Cones, Ranges, View
from sleepcast.simulator.sonar.crosstalk import Crosstalk, Scene, add_crosstalk
from sleepcast.simulator.sonar.firing import Firing, Tick, fire
from sleepcast.simulator.sonar.noise import Noise, Receiver
from sleepcast.simulator.world.grid import Floats, Whole

AT_ONCE = 65_536
"""Robots that are told what their sonars have kept at a time: what is needed for a moment stays small."""
FRONT = pi / 2
"""Sonars whose axis is at most this far from the heading count as front sonars, rad."""


class Sonars:
    """The sonars of many robots.

    sensed: where the robots find what their sonars read, and in the last row the least of those in front: m, shape
    (sonars + 1, robots); brought up to date by `sense`. firing: which sonar fires when. Where they fire in order,
    readings: what each read when it last fired, m, shape (robots, sonars), float32, NaN for one that has not fired yet.
    turret: what the ring is turned by against each robot's heading, rad; None for not at all. It belongs to whoever
    gives it, who changes it between ticks.

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
        self.radii = radii
        self.firing = Firing(ring, count)
        self.readings: Ranges = np.empty((0, ring.count), np.float32)
        self._make_room()
        self.turret: Floats | None = None
        self.front = np.flatnonzero(np.abs((self.cones.axes + pi) % (2.0 * pi) - pi) <= FRONT + 1e-9)
        """Numbers of the front sonars."""
        self._near, self._machine, self._seed = near, machine, seed
        self.crosstalk = (
            Crosstalk(ring.crosstalk, ring, cones.axes, cones.radius, count, near.grid, seed, self.robots.start)
            if ring.crosstalk
            else None
        )
        self._version = -1
        self._everybody: Whole = np.arange(count)
        self._fresh = np.zeros(count, bool)
        """Whose readings are up to date, of the `_wanted` rows."""
        self._wanted = np.ones(ring.count + 1, bool)

    def arrange(self, robot: int, order: Sequence[int], pause: float) -> None:
        """Let the sonars of the robot with this index fire in this order from now on, each `pause` s after the echo of
        the one before; none for an empty order. The ping that is under way and its pause come first. A sonar that does
        not fire keeps its reading, unknown if it has never fired in order. Raises MisuseError for a sonar that there is
        not, or too long an order or pause, and IndexError for a robot that has not got these sonars."""
        row = robot - self.robots.start
        if not 0 <= row < self.sensed.shape[1]:
            raise IndexError(f"robot {robot} has not got these sonars")
        self.firing.check(order, pause)
        self.part()
        self.firing.arrange(row, order, pause)

    def part(self) -> None:
        """Have room for orders and pauses of each robot's own."""
        if self.crosstalk and not self.firing.arranged:
            self.crosstalk.make_room()
        self.firing.part()
        self._make_room()

    def _make_room(self) -> None:
        """Room for readings, where sonars fire in order."""
        if self.firing.in_order and not len(self.readings):
            self.readings = np.full((self.sensed.shape[1], self.ring.count), np.nan, np.float32)

    def forget(self) -> None:
        """Bodies or obstacles have moved: what was looked at is no longer so."""
        self._fresh[:] = False

    def sense(
        self,
        which: Whole | None,
        tick: int,
        pose: tuple[Floats, Floats, Floats],
        rows: Collection[int] | None = None,
    ) -> None:
        """Bring the readings of the robots with indices `which` (None: all that have these sonars) up to date for this
        tick; those in these `rows` of `sensed` at least (None: all). pose: where all bodies really are: x, y in m and
        heading in rad."""
        if self._version != self._near.world.version:
            self.forget()
            self._version = self._near.world.version
        old = self._old(None if which is None else which - self.robots.start, rows)
        if not len(old):
            return
        self._fresh[slice(None) if which is None else old] = True
        if self.firing.in_order:
            at_once = self.firing.at_once(old)
            old, kept = old[at_once], old[~at_once]
            for begin in range(0, len(kept), AT_ONCE):
                some = kept[begin : begin + AT_ONCE]
                their: slice | Whole = some
                if (np.diff(some) == 1).all():  # side by side: nothing need be copied
                    their = slice(int(some[0]), int(some[-1]) + 1)
                self._machine.tell(self.readings[their], some, self._receiver(None), self.sensed)
        if not len(old):
            return
        receiver = self._receiver(self._noise(tick))
        if self.radii is not None:
            self._machine.tell(
                self._machine.ranges(self._view(pose), old + self.robots.start), old, receiver, self.sensed
            )
        else:
            self._machine.hear(self._view(pose), old, receiver, self.sensed)

    def _old(self, own: Whole | None, rows: Collection[int] | None) -> Whole:
        """Which of these robots (None: all) have not got up to date readings in these rows."""
        wanted = np.full(len(self._wanted), rows is None)
        wanted[list(rows or ())] = True
        if not self._fresh.any():
            self._wanted = wanted
            return self._everybody if own is None else own
        if (wanted & ~self._wanted).any():
            self._wanted = wanted | self._wanted
            self._fresh[:] = False
        return np.flatnonzero(~self._fresh) if own is None else own[~self._fresh[own]]

    def fire(self, tick: int, until: float, pose: tuple[Floats, Floats, Floats]) -> None:
        """Fire the sonars that are due before the time `until` (s), keep what they read, and let robots hear each
        other's."""
        self.shoot(tick, until, pose)
        exchange_crosstalk(tick, pose, [self])

    def shoot(self, tick: int, until: float, pose: tuple[Floats, Floats, Floats]) -> None:
        """The same, but for hearing each other."""
        firing = self.firing
        if not firing.in_order:
            return
        firing.begin(tick, until)
        view = self._view(pose, alone=True)
        now = Tick(view, self.robots.start, until, self.ring.least, self._noise(tick), self.readings)
        if self.crosstalk is None:
            self._machine.fire(firing, now)
        else:
            fire(firing, now, self._machine.look, partial(self.crosstalk.hear, tick))

    def turned(self, heading: Floats) -> Floats:
        """Where the rings of these robots look, whose bodies have this heading, of all bodies, rad; others are as they
        were."""
        if self.turret is None:
            return heading
        heading = heading.copy()
        heading[self.robots] = wrap(heading[self.robots] + self.turret)
        return heading

    def state(self) -> Iterable[NDArray[np.generic]]:
        """What the next ticks depend on."""
        yield from self.arrays().values()

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The arrays that a run changes and that the next ticks depend on, by name."""
        if not self.firing.in_order:
            return {}
        return {
            "readings": self.readings,
            **self.firing.arrays(),
            **(self.crosstalk.columns() if self.crosstalk else {}),
        }

    def _view(self, pose: tuple[Floats, Floats, Floats], alone: bool = False) -> View:
        """What there is to see, for whole rings or for sonars alone."""
        near, (x, y, heading), far = self._near, pose, self.cones.radius + self.cones.most
        heading = self.turned(heading)
        listed = near.solids(far) if alone else near.in_sight(far)
        return View(self.cones, near.grid, near.points(x, y), listed, near.world.solids, (x, y, heading), self.radii)

    def _receiver(self, noise: Noise | None) -> Receiver:
        return Receiver(self.ring.least, self.ring.most, self.front, noise, self._wanted)

    def _noise(self, tick: int) -> Noise | None:
        """What disturbs the echoes of this tick."""
        ring = self.ring
        if not (ring.noise or ring.dropout):
            return None
        sort = (self.robots.start,) if self.robots.start else ()  # each sort of robots has chance of its own
        keys = (key(self._seed, what, tick, *sort) for what in ("echo", "dropout"))
        return Noise(ring.noise, ring.dropout, ring.most, *keys)


def exchange_crosstalk(tick: int, pose: tuple[Floats, Floats, Floats], rings: Sequence[Sonars]) -> None:
    """Let the sonars of these rings, and of no others, that have cross-talk hear each other."""
    talks = [(ring.crosstalk, ring.readings) for ring in rings if ring.crosstalk]
    if not talks:
        return
    x, y, heading = pose
    radii = np.empty(len(x))
    for ring in rings:
        heading = ring.turned(heading)
        radii[:] = ring.cones.radius if ring.radii is None else ring.radii
    add_crosstalk(tick, Scene(x, y, heading, radii), talks)


# The sonars of several sorts of robots: each sort has a ring of its own, and all of them one table of readings.


class SonarGroups:
    """The sonars `rings` of some robots each. sensed: the table of all, shape (sonars + 1, robots), in the last row the
    least of those in front."""

    def __init__(self, rings: Sequence[Sonars], sensed: Floats) -> None:
        self.rings, self.sensed = rings, sensed

    def of(self, robot: int) -> Sonars | None:
        """The sonars of the robot with this index, if it has any."""
        return next((ring for ring in self.rings if ring.robots.start <= robot < ring.robots.stop), None)

    def forget(self) -> None:
        """Bodies or obstacles have moved: what was looked at is no longer so."""
        for ring in self.rings:
            ring.forget()

    def sense(
        self,
        which: Whole | None,
        tick: int,
        pose: tuple[Floats, Floats, Floats],
        rows: Collection[int] | None = None,
    ) -> None:
        """Bring the readings of the robots with indices `which` (None: all) up to date, whatever rows they ask for; see
        `Sonars`."""
        for ring in self.rings:
            first, last = ring.robots.start, ring.robots.stop
            mine = None if which is None else which[(which >= first) & (which < last)]
            ring.sense(mine, tick, pose)
            there = ring.robots if mine is None else mine
            heard = ring.sensed if mine is None else ring.sensed[:, mine - first]
            self.sensed[: len(heard) - 1, there] = heard[:-1]
            self.sensed[-1, there] = heard[-1]

    def fire(self, tick: int, until: float, pose: tuple[Floats, Floats, Floats]) -> None:
        """Fire the sonars that are due before the time `until` (s), and let all of them hear each other."""
        for ring in self.rings:
            ring.shoot(tick, until, pose)
        exchange_crosstalk(tick, pose, self.rings)

    def state(self) -> Iterable[NDArray[np.generic]]:
        """What the next ticks depend on."""
        for ring in self.rings:
            yield from ring.state()
