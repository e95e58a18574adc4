"""All bodies of a simulator: each as a `Robot` of its own when somebody asks for it, and many at once where they all
are to do the same."""

from __future__ import annotations

from collections.abc import Sequence
from typing import overload

from sleepcast.robot import RobotModel
from sleepcast.simulator.bodies import Bodies, Flags, Mode, Whole
from sleepcast.simulator.body import Body


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
        bodies = self._bodies
        moving = robots[~bodies.stopped[robots]]
        bodies.mode[moving] = Mode.DRIVE
        bodies.wanted_speed[moving] = bodies.wanted_turn[moving] = 0.0
        bodies.swing[robots] = 0.0
        bodies.stopped[robots] = True

    def release(self, robots: Whole) -> None:
        """See `Robot.release`."""
        self._bodies.stopped[robots] = False

    def hold(self, robots: Whole, still: Flags) -> None:
        """See `Robot.hold`; still: for each of them."""
        self._bodies.held[robots] = still
