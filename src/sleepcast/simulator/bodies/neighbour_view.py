"""Robots as their neighbours see them: as they are, or, with a delay, as they were some ticks ago.

A delay line is a ring of ticks, so its memory is bounded, and where it reads and writes follows from the number of the
tick: a snapshot, a fork and a run that is repeated go on with its arrays alone.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.ticks import nearest_ticks
from sleepcast.simulator.bodies.bodies import Bodies, Floats, Whole


class NeighbourView:
    """All `bodies` as their neighbours see them in this tick. shared: what they show in this tick, shape (rows,
    robots); delay: how old that is what is seen, s. Until so much time has passed they are seen as they are now."""

    def __init__(self, bodies: Bodies, shared: Floats, delay: float) -> None:
        self._bodies, self._shared = bodies, shared
        z = None if bodies.flight is None else bodies.flight.z
        self._poses = 3 if z is None else 4
        self.pitch = None if bodies.flight is None else bodies.flight.pitch
        self.x, self.y, self.heading, self.z, self.shared = bodies.x, bodies.y, bodies.heading, z, shared
        """Of each robot, m and rad, z None on the plane, pitch where all look level; and what it shows. The arrays stay
        the same ones."""
        ticks = nearest_ticks(delay, bodies.scenario.tick)
        self.delayed = ticks > 0
        """Whether they are others than the true ones."""
        self._line: Floats = np.empty((0, 0, 0))
        if self.delayed:
            now = self._now()
            self._line, self._out = np.repeat(now[None], ticks, axis=0), now
            self.x, self.y, self.heading = now[:3]
            self.z, self.pitch = None if z is None else now[3], None if self.pitch is None else now[self._poses]
            self.shared = now[len(now) - len(shared) :]

    @property
    def poses(self) -> tuple[Floats, ...]:
        """x, y, heading, and z where something flies."""
        return (self.x, self.y, self.heading, *(() if self.z is None else (self.z,)))

    def step(self) -> None:
        """Bodies have moved, and show what they have set in the last tick."""
        if self.delayed:
            slot = self._bodies.tick % len(self._line)
            self._out[:] = self._line[slot]
            self._line[slot] = self._now()

    def begin(self, robots: Whole) -> None:
        """Let these robots, which have just come or gone, have been all the time as they are now."""
        if self.delayed:
            now = self._now()[:, robots]
            self._line[:, :, robots] = now
            self._out[:, robots] = now

    def arrays(self) -> dict[str, NDArray[np.generic]]:
        """The arrays that the next ticks depend on, none without a delay."""
        return {"seen": self._out, "seen later": self._line} if self.delayed else {}

    def all_poses(self) -> Iterator[tuple[Floats, ...]]:
        """`poses`, of this tick and of those in which something else is seen; none without a delay."""
        if self.delayed:
            yield self.poses
            yield from (tuple(each[: self._poses]) for each in self._line)

    def _now(self) -> Floats:
        """All that there is to see of robots, shape (rows, robots): their poses and pitches, then what they show."""
        bodies, flight = self._bodies, self._bodies.flight
        above = () if flight is None else (flight.z,) if flight.pitch is None else (flight.z, flight.pitch)
        return np.vstack((bodies.x, bodies.y, bodies.heading, *above, self._shared))
