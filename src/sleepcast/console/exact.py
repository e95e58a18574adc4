"""What running again gives of the moment at which somebody stands: asked for when he has come to rest there."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from sleepcast.console.past import Past
from sleepcast.console.rerunner import Found
from sleepcast.core.errors import SleepcastError

REST = 0.15
"""Seconds for which somebody must stand at a moment before it is run again: those who drag on see the pictures."""


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
        try:
            self._found = await self._past.look(tick, robot)
        except SleepcastError as error:
            self.note = str(error)
        self._changed()

    def leave(self) -> None:
        """Nobody stands there any more."""
        if self._finding is not None:
            self._finding.cancel()
        self._key = self._found = self._finding = None
        self.note = ""
