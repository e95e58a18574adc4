"""The frames of the Nomads: where they are, as of any robots.

The server lets their time pass; here it is shown, as long as there is a page, and told how fast it is to go.
"""

from __future__ import annotations

import asyncio
import struct
from collections import deque

from sleepcast.console.driver import FrameSource
from sleepcast.console.frames import STOPPED, pack
from sleepcast.console.incoming import MAX_FACTOR
from sleepcast.core.clock import Clock
from sleepcast.nomad.panes.view import Nomads

PICTURE_PERIOD = 0.05
"""Seconds between two frames: robots that are no faster than a person walks need no more."""
MEASURED = 1.5
"""Seconds of which the page says how fast time really goes."""
REAL_TIME = 1.0
TICKS = 1000
"""Of the frames' count of ticks, in a second: it only tells pictures apart."""


class NomadDriver(FrameSource):
    """See the module."""

    def __init__(self, nomads: Nomads, clock: Clock) -> None:
        super().__init__()
        self._pages = 0
        self._nomads, self._clock = nomads, clock
        self._wanted = nomads.speed or REAL_TIME
        self._times = deque([(clock.now(), nomads.time)])

    async def run(self) -> None:
        """Show them until cancelled."""
        while True:
            if self._pages:
                self.draw()
            await asyncio.sleep(PICTURE_PERIOD)

    def enter(self) -> None:
        """A page is open from now on; the first thing that it is shown is how everything is now."""
        self._pages += 1
        self.draw()

    def leave(self) -> None:
        """It is no longer."""
        self._pages -= 1

    def set_pace(self, running: bool | None = None, factor: float | None = None) -> None:
        """Change whether time runs and how fast; None leaves it as it is."""
        if factor is not None:
            self._wanted = float("inf") if factor >= MAX_FACTOR else factor
        runs = self._nomads.speed > 0.0 if running is None else running
        self._nomads.set_speed(self._wanted if runs else 0.0)
        self.draw()

    def step(self) -> None:
        """One tick, and time stands still."""
        self._nomads.step()
        self.set_pace(running=False)

    def draw(self) -> None:
        """Make a new frame of what there is now."""
        nomads, poses = self._nomads, bytearray()
        for robot in range(nomads.count):
            condition = nomads.window(robot).condition
            place = (0.0, 0.0, 0.0) if condition is None else condition.real[:3]
            poses += struct.pack("<3f", *place)
        flags = bytes([STOPPED if nomads.held else 0]) * nomads.count
        frame = pack(
            self.number + 1,
            round(TICKS * nomads.time),
            nomads.time,
            self._speeds(),
            (nomads.speed > 0.0, nomads.held),
            bytes(poses),
            (bytes(nomads.count), flags),
        )
        self.show(frame)

    def _speeds(self) -> tuple[float, float]:
        """Simulated seconds in a second: wanted, and reached in the last moments."""
        now = (self._clock.now(), self._nomads.time)
        while len(self._times) > 1 and now[0] - self._times[1][0] > MEASURED:
            self._times.popleft()
        began = self._times[0]
        if now[0] - self._times[-1][0] > MEASURED / 10:
            self._times.append(now)
        passed = now[0] - began[0]
        return min(self._wanted, MAX_FACTOR), (now[1] - began[1]) / passed if passed > 0.0 else 0.0
