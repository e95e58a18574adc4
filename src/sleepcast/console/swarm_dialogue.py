"""What one page of a swarm, or of a recording, has for itself: its table, and the time at which it looks.

A page may look at another time than now: what it asks is answered for that time then.
"""

from __future__ import annotations

from collections.abc import Iterator

import msgspec

from sleepcast.console import outgoing
from sleepcast.console.backend import Backend
from sleepcast.console.dialogue import Dialogue
from sleepcast.console.driver import FrameSource
from sleepcast.console.feature import Then
from sleepcast.console.features.mission import MissionNews
from sleepcast.console.features.table import RobotTable
from sleepcast.console.features.time import NO_TIMELINE
from sleepcast.console.frames import alternate_frame
from sleepcast.console.past import Past
from sleepcast.console.past_view import PastView
from sleepcast.console.renewal import RenewableBackend
from sleepcast.console.replay import ReplayBackend
from sleepcast.console.timeline import rows_at
from sleepcast.core.errors import MisuseError

OF_THEN = (
    MissionNews,
    outgoing.Commands,
    outgoing.Failing,
    outgoing.Groups,
    outgoing.Obstacles,
    outgoing.Roll,
    outgoing.WatchedRobot,
)
"""News that are those of the time at which a page looks; all other news are of now."""


class SwarmDialogue(Dialogue[Backend | ReplayBackend]):
    """See the module."""

    max_waiting = 16
    """Answers of one page that robots have to give first."""

    def __init__(self, desk: Backend | ReplayBackend) -> None:
        super().__init__(desk)
        self.table = RobotTable(desk.values)
        self._look: PastView | None = None
        self._looks = 0
        """The number of the page's last request to look elsewhere."""
        self._marked = -1
        self._shows_alternate, self._alternate_tick = True, -1
        """Whether the page is to be shown the alternate run, and the tick of it that it was told last."""

    @property
    def source(self) -> FrameSource:
        """Where this page's frames come from."""
        return self._desk.driver if self._look is None else self._look

    def hello(self) -> str:
        self._marked, self._alternate_tick, self._looks = -1, -1, 0
        return super().hello()

    @property
    def _then(self) -> Then | None:
        return self._look

    def watch(self, robot: int) -> None:
        if self._look is not None:
            self._look.watched = robot
        super().watch(robot)

    def show_alternate(self, on: bool) -> None:
        """Whether to show the alternate run."""
        self._shows_alternate, self._alternate_tick = on, -1

    def look_at(self, time: float | None, number: int) -> None:
        """Look at another time; None is now. Raises MisuseError."""
        self._looks = number
        past = self._desk.past
        if past is None or isinstance(self._desk, ReplayBackend):
            raise MisuseError(NO_TIMELINE)
        if time is None:
            self.leave()
            return
        if not past.timeline.poses.times:
            raise MisuseError("Nothing is kept yet: the run has not started.")
        if self._look is None:
            self._look = PastView(past, self._desk.driver)
            self._look.watched = self._watched
            self.turned.set()
        self._look.seek(time)

    def leave(self) -> None:
        """Look at now, as at the start."""
        if self._look is not None:
            self._look.leave()
            self._look = None
            self.turned.set()

    def with_frame(self) -> Iterator[str | bytes]:
        """Where the robots of an alternate run were at what this page shows, unless it knows or there is none; nothing
        once that run has ended."""
        past = self._desk.past
        if not self._shows_alternate or past is None or past.other is None:
            return
        time = past.ended if self._look is None else self._look.time
        timeline = past.other.timeline
        picture = timeline.poses.at(time) if time <= timeline.seconds else None
        tick, poses = (past.tick_of(timeline.seconds) + 1, b"") if picture is None else picture
        if tick != self._alternate_tick:
            self._alternate_tick = tick
            yield alternate_frame(poses, len(timeline.scene.names))

    def _news(self) -> Iterator[outgoing.DeskMessage]:
        look, past = self._look, self._desk.past
        if look is None:
            yield from self._desk.news(self._watched)
        else:
            yield from look.news()
            yield from (message for message in self._desk.news(-1) if not isinstance(message, OF_THEN))
            if isinstance(self._desk, Backend) and past is not None:
                yield from self._desk.mission_news(rows_at(past.timeline, look.time), look.time)
        if past is None:
            return
        if self._marked != past.marks.number:
            self._marked = past.marks.number
            yield outgoing.Marked(list(past.marks.all))
        yield self._span(past)

    def _span(self, past: Past) -> outgoing.Span:
        """The part of the run that can be looked at, and what this page looks at."""
        look = self._look
        span = outgoing.Span(past.timeline.began, past.ended, number=self._looks, kept=past.kept)
        other = past.other
        if other is not None:
            differs = None if other.differs is None else other.differs * past.tick
            span = msgspec.structs.replace(
                span, forked=other.tick * past.tick, differs=differs, difference=other.difference
            )
        if isinstance(self._desk, RenewableBackend):
            span = msgspec.structs.replace(span, may_fork=True)
        if look is not None:
            span = msgspec.structs.replace(span, at=look.time, exact=look.exact, note=look.note)
        elif isinstance(self._desk, ReplayBackend):
            span = msgspec.structs.replace(span, note=self._desk.driver.note)
        return span
