"""A simulated body with a world of its own, for a mind that is a process of its own.

Its time goes with a clock: whoever asks what it senses lets the world catch up first. In step, each look is one tick.
"""

from __future__ import annotations

from types import TracebackType
from typing import Self

from sleepcast.core.clock import Clock
from sleepcast.robot import Reading
from sleepcast.simulator.bodies.body import Body
from sleepcast.simulator.bodies.safety_limits import Guard
from sleepcast.simulator.simulation import Simulator

MOST_AT_ONCE = 10
"""Ticks that a world makes up for in one look; what is beyond is let go."""


class LoneBody(Body):
    """The first robot of `simulator`. clock: what its time goes with, None in step. guard: of its limits.

    It is a `Robot` that can be let go of, as those behind a bridge.
    """

    __slots__ = ("_clock", "_guard", "_simulator", "_start")

    def __init__(self, simulator: Simulator, clock: Clock | None, guard: Guard | None = None) -> None:
        super().__init__(simulator.bodies, simulator.model, 0)
        self._simulator, self._clock, self._guard = simulator, clock, guard
        self._start = 0.0 if clock is None else clock.now()

    def sense(self) -> Reading:
        for _ in range(self._due()):
            if self._guard is not None:
                self._guard.attend()
            self._simulator.step()
        return super().sense()

    def now(self) -> float:
        """The time of its world."""
        return self._simulator.time

    @property
    def lost(self) -> str:
        """Why it cannot be reached: it always can."""
        return ""

    def complaints(self) -> list[str]:
        """What has gone wrong since the last call: nothing does."""
        return []

    def close(self) -> None:
        """Bring the body to rest and let go of it."""
        self.stop()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _due(self) -> int:
        """Ticks to be made now."""
        if self._clock is None:
            return 1
        tick = self._simulator.scenario.tick
        behind = self._clock.now() - self._start - self._simulator.time
        due = int(behind / tick + 0.5)
        if due > MOST_AT_ONCE:
            self._start += (due - MOST_AT_ONCE) * tick
        return min(due, MOST_AT_ONCE)
