"""What running again gives of the moment at which somebody stands: asked for when he has come to rest there."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from sleepcast.console.past import Past
from sleepcast.console.replay_client import Found
from sleepcast.core.errors import SleepcastError

REST = 0.15
"""Seconds for which somebody must stand at a moment before it is run again: those who drag on see the pictures."""
AGAIN = 1.0
"""Seconds between two looks whether a moment can be run again by now."""


class Exact:
    """What running again gives of the moment at which somebody stands, as soon as it is there. changed: called then.
    note: why it is not there, for a person."""

    def __init__(self, past: Past, changed: Callable[[], None]) -> None:
        self._past, self._changed = past, changed
        self._key: tuple[int, int, int] | None = None
        self._found: Found | None = None
        self._finding: asyncio.Task[None] | None = None
        self.note = ""

    def of(self, tick: int, robot: int) -> Found | None:
        """What was found for a tick, with this robot; None while it is looked for."""
        key = (self._past.run, tick, robot)
        if key != self._key:
            before = self._found
            self.leave()
            self._key = key
            if before is not None and before.tick == tick:  # all but another robot
                self._found = before
            self._finding = asyncio.ensure_future(self._find(tick, robot))
        return self._found

    async def _find(self, tick: int, robot: int) -> None:
        await asyncio.sleep(REST)
        while why := self._why_not(tick):
            self.note = why
            self._changed()
            await asyncio.sleep(AGAIN)
        self.note = ""
        try:
            self._found = await self._past.look(tick, robot)
        except SleepcastError as error:
            self.note = str(error)
        self._changed()

    def _why_not(self, tick: int) -> str:
        """Why a tick cannot be run again, or not yet; "" if it can."""
        try:
            self._past.check(tick)
        except SleepcastError as error:
            return str(error)
        return ""

    def leave(self) -> None:
        """Nobody stands there any more."""
        if self._finding is not None:
            self._finding.cancel()
        self._key = self._found = self._finding = None
        self.note = ""
