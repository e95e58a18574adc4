"""What one page sees of a moment of the past while its run goes on.

Pictures are shown at once. The very tick is run again as soon as somebody has come to rest there.

What one page looks at is nobody else's matter. STOP, pause and speed are still those of now.
"""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable, Iterator
from typing import Protocol

import msgspec

from sleepcast.console import outgoing
from sleepcast.console.driver import FrameSource
from sleepcast.console.incoming import PageMessage
from sleepcast.console.past import Past
from sleepcast.console.replay_client import ReplayAnswer
from sleepcast.console.timeline import frame_of, news_of
from sleepcast.console.view import PaceControl
from sleepcast.core.errors import SleepcastError

REST = 0.15
"""Seconds for which somebody must stand at a moment before it is run again: those who drag on see the pictures."""
LOOK_AGAIN = 1.0
"""Seconds between two looks whether a moment can be run again by now."""


class ExactMoment:
    """What running again gives of the moment at which somebody stands, as soon as it is there. changed: called then.
    note: why it is not there, for a person."""

    def __init__(self, past: Past, changed: Callable[[], None]) -> None:
        self._past, self._changed = past, changed
        self._key: tuple[int, int, int] | None = None
        self._answer: ReplayAnswer | None = None
        self._running: asyncio.Task[None] | None = None
        self.note = ""

    def of(self, tick: int, robot: int) -> ReplayAnswer | None:
        """What running again gave for a tick, with this robot; None while it is under way."""
        key = (self._past.run, tick, robot)
        if key != self._key:
            before = self._answer
            self.leave()
            self._key = key
            if before is not None and before.tick == tick:  # all but another robot
                self._answer = before
            self._running = asyncio.ensure_future(self._run_again(tick, robot))
        return self._answer

    async def _run_again(self, tick: int, robot: int) -> None:
        await asyncio.sleep(REST)
        while why := self._why_not(tick):
            self.note = why
            self._changed()
            await asyncio.sleep(LOOK_AGAIN)
        self.note = ""
        try:
            self._answer = await self._past.look(tick, robot)
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
        if self._running is not None:
            self._running.cancel()
        self._key = self._answer = self._running = None
        self.note = ""


class LiveDriver(Protocol):
    """What goes on meanwhile."""

    pace: PaceControl


class PastView(FrameSource):
    """See the module. watched: the robot that the page looks at, -1 for none."""

    def __init__(self, past: Past, live: LiveDriver) -> None:
        super().__init__()
        self.time = past.timeline.began
        self.watched = -1
        self._past, self._live = past, live
        self._exact = ExactMoment(past, self.draw)

    @property
    def tick(self) -> int:
        """The tick that is looked at."""
        return self._past.tick_of(self.time)

    @property
    def note(self) -> str:
        """Why only a picture near this moment is shown, "" if all is there or still looked for."""
        return self._exact.note

    @property
    def exact(self) -> bool:
        """Whether what is shown is that of the very tick."""
        return self._exact.of(self.tick, self.watched) is not None

    def again(self, asked: PageMessage) -> Awaitable[msgspec.Raw]:
        """What the desk would have answered at this time. Raises RerunError."""
        return self._past.answer(self.tick, asked)

    def seek(self, time: float) -> None:
        """Look at another time, s."""
        self.time = self._past.tick_of(time) * self._past.tick  # the nearest tick that there was
        self.draw()

    def draw(self) -> None:
        """Show what was then."""
        timeline, pace = self._past.timeline, self._live.pace
        exact = self._exact.of(self.tick, self.watched)
        time = self.time
        if exact is None:
            time = timeline.poses.times[max(0, timeline.poses.before(time) - 1)]
        state = (not pace.paused, timeline.latched_at(self.time))
        self.show(frame_of(timeline, self.number + 1, time, (pace.factor, pace.achieved), state, exact))

    def news(self) -> Iterator[outgoing.DeskMessage]:
        """What was so then."""
        exact = self._exact.of(self.tick, self.watched)
        for message in news_of(self._past.timeline, self.time, self.watched, exact):
            if not isinstance(message, outgoing.Safety):  # STOP is a matter of now
                yield message

    def leave(self) -> None:
        """The page looks elsewhere."""
        self._exact.leave()
