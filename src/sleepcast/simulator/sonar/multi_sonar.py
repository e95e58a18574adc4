"""The sonars of several sorts of robots: each sort has a ring of its own, and all of them one table of readings.

A sort with fewer sonars than others leaves their rows unknown, and one without any leaves all of them so.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from sleepcast.simulator.sonar.sonar import Echoes, hear_all
from sleepcast.simulator.world.grid import Floats, Whole


class Ears:
    """The sonars `rings` of some robots each. sensed: the table of all, shape (sonars + 1, robots), in the last row the
    least of those in front."""

    def __init__(self, rings: Sequence[Echoes], sensed: Floats) -> None:
        self.rings, self.sensed = rings, sensed

    def of(self, robot: int) -> Echoes | None:
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
        `Echoes`."""
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
        hear_all(tick, pose, self.rings)

    def state(self) -> Iterable[NDArray[np.generic]]:
        """What the next ticks depend on."""
        for ring in self.rings:
            yield from ring.state()
