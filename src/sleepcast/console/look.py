"""One page that looks at the past of a run while that goes on: its pictures and its news are those of then.

What one page looks at is nobody else's matter. STOP, pause and speed are still those of now.
"""

from __future__ import annotations

from collections.abc import Awaitable, Iterator
from typing import Protocol

import msgspec

from sleepcast.console import outgoing
from sleepcast.console.driver import FrameSource
from sleepcast.console.exact import Exact
from sleepcast.console.incoming import PageMessage
from sleepcast.console.past import Past
from sleepcast.console.timeline import frame_of, news_of
from sleepcast.console.view import PaceControl


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
        self._exact = Exact(past, self.draw)

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
        self.time = self.tick_time(time)
        self.draw()

    def tick_time(self, time: float) -> float:
        """The time of the nearest tick that there was."""
        return self._past.tick_of(time) * self._past.tick

    def draw(self) -> None:
        """Show what was then."""
        timeline, pace = self._past.timeline, self._live.pace
        found = self._exact.of(self.tick, self.watched)
        time = self.time
        if found is None:
            time = timeline.poses.times[max(0, timeline.poses.before(time) - 1)]
        state = (not pace.paused, timeline.latched_at(self.time))
        self.show(frame_of(timeline, self.number + 1, time, (pace.factor, pace.achieved), state, found))

    def news(self) -> Iterator[outgoing.DeskMessage]:
        """What was so then."""
        for said in news_of(self._past.timeline, self.time, self.watched, self._exact.of(self.tick, self.watched)):
            if not isinstance(said, outgoing.Safety):  # STOP is a matter of now
                yield said

    def leave(self) -> None:
        """The page looks elsewhere."""
        self._exact.leave()
