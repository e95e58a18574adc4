"""All bodies of a simulator: each as a `Robot` of its own when somebody asks for it, and many at once where they all
are to do the same."""

from __future__ import annotations

from collections.abc import Sequence
from typing import overload

import numpy as np

from sleepcast.robot import RobotModel
from sleepcast.simulator.bodies.bodies import TURN, Bodies, Flags, Floats, Mode, Whole
from sleepcast.simulator.bodies.body import TUMBLE, Body
from sleepcast.simulator.scenario.robot_settings import TENTH
from sleepcast.simulator.sonar.sonar import Echoes


class Robots(Sequence[Body]):
    """The bodies by index. Whatever is asked of many of them means the same as asked of each."""

    def __init__(self, bodies: Bodies, model: RobotModel) -> None:
        self._bodies, self._model = bodies, model

    def __len__(self) -> int:
        return self._bodies.count

    @overload
    def __getitem__(self, number: int) -> Body: ...

    @overload
    def __getitem__(self, number: slice) -> list[Body]: ...

    def __getitem__(self, number: int | slice) -> Body | list[Body]:
        if isinstance(number, slice):
            return [self[i] for i in range(*number.indices(len(self)))]
        return Body(self._bodies, self._model, range(len(self))[number])

    def stop(self, robots: Whole) -> None:
        """See `Robot.stop`."""
        self.halt(robots)
        self._bodies.stopped[robots] = True

    def release(self, robots: Whole) -> None:
        """See `Robot.release`."""
        self._bodies.stopped[robots] = False

    def hold(self, robots: Whole, still: Flags) -> None:
        """See `Robot.hold`; still: for each of them."""
        self._bodies.held[robots] = still

    # ---- what expressions may ask, as of `Body`; a column for each argument

    def drive(self, robots: Whole, speed: Floats, turn_rate: Floats) -> None:
        bodies, free = self._bodies, ~self._bodies.stopped[robots]
        moving = robots[free]
        bodies.mode[moving] = Mode.DRIVE
        bodies.wanted_speed[moving], bodies.wanted_turn[moving] = speed[free], turn_rate[free]

    def go_to(self, robots: Whole, x: Floats, y: Floats) -> None:
        bodies, free = self._bodies, ~self._bodies.stopped[robots]
        moving = robots[free]
        left, bottom, right, top = bodies.fence
        bodies.mode[moving] = Mode.GOTO
        bodies.target_x[moving] = np.clip(x[free], left, right)
        bodies.target_y[moving] = np.clip(y[free], bottom, top)

    def wander(self, robots: Whole) -> None:
        self._bodies.mode[robots[~self._bodies.stopped[robots]]] = Mode.WANDER

    def halt(self, robots: Whole) -> None:
        at_rest = np.zeros(len(robots))
        self.drive(robots, at_rest, at_rest)
        self._bodies.swing[robots] = 0.0

    def tumble(self, robots: Whole) -> Floats:
        bodies = self._bodies
        drawn = bodies.drawn(f"tumble {bodies.tick}", bodies.numbers[robots])
        sides = np.where(drawn < 0.5, 1.0, -1.0)
        free = ~bodies.stopped[robots]
        bodies.swing[robots[free]] = sides[free] * TUMBLE
        return sides

    def turn_wheels(self, robots: Whole, right: Floats, left: Floats) -> None:
        wheels = self._bodies.scenario.robots.wheels
        assert wheels
        self.drive(robots, (right + left) / 2.0, (right - left) / wheels.track)

    def turn_wheels_nomad(self, robots: Whole, right: Floats, left: Floats) -> None:
        self.turn_wheels(robots, right * TENTH, left * TENTH)

    def sonar(self, robots: Whole, which: Floats) -> Floats:
        if not isinstance(self._bodies.echoes, Echoes):
            return np.array([self[i].sonar(one) for i, one in zip(robots.tolist(), which.tolist(), strict=True)])
        ranges = self._bodies.echo(robots.tolist())
        found: Floats = ranges[np.arange(len(robots)), np.mod(np.trunc(which), ranges.shape[1]).astype(np.int64)]
        return found

    def nearest(self, robots: Whole, first: Floats, last: Floats) -> Floats:
        echoes = self._bodies.echoes
        if not isinstance(echoes, Echoes):
            ends = zip(robots.tolist(), first.tolist(), last.tolist(), strict=True)
            return np.array([self[i].nearest(*angles) for i, *angles in ends])
        wide = np.where(last - first >= TURN, last - first, np.mod(last - first, TURN))
        there = np.mod(echoes.cones.axes - first[:, None], TURN) <= wide[:, None]
        found: Floats = np.where(there, self._bodies.echo(robots.tolist()), echoes.ring.most).min(axis=1)
        return found
