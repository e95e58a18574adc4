"""What a page and the desk of a swarm say to each other beside what all pages say; that of a recording, too.

A page may look at another time than now: what it asks is answered for that time then.
"""

from __future__ import annotations

from collections.abc import Awaitable, Iterator

import msgspec

from sleepcast.console import incoming, outgoing
from sleepcast.console.backend import Backend
from sleepcast.console.dialogue import Answer, Dialogue
from sleepcast.console.driver import FrameSource
from sleepcast.console.fields import field_of
from sleepcast.console.film import commands_of, rows_at
from sleepcast.console.frames import ghosts
from sleepcast.console.glance import glance
from sleepcast.console.look import PastView
from sleepcast.console.marks import clock_time
from sleepcast.console.mission import NO_MISSION, MissionNews
from sleepcast.console.past import Past
from sleepcast.console.renewal import NOT_HERE, RenewableBackend
from sleepcast.console.replay import ReplayBackend
from sleepcast.console.session_test import NO_TEST, OF_RECORDING
from sleepcast.console.table import RobotTable
from sleepcast.core.errors import MisuseError

OF_THEN = (MissionNews, outgoing.Commands, outgoing.Failing, outgoing.Groups, outgoing.Obstacles, outgoing.WatchedRobot)
"""News that are those of the time at which a page looks; all other news are of now."""
ACTS = (
    *(incoming.Send, incoming.Wink, incoming.Build, incoming.Shift, incoming.Clear, incoming.Undo),
    *(incoming.DraftTest, incoming.CountTrue, incoming.SaveTest, incoming.Play, incoming.SendLine, incoming.SkipLine),
)
"""What changes the run, which can be done only now."""
QUESTIONS = (
    *(incoming.GetPreview, incoming.GetSpread, incoming.Pick, incoming.GetNames, incoming.GetGlance, incoming.Members),
    *(incoming.Sense, incoming.GetRows, incoming.GetRange, incoming.GetCsv),
)
"""What can be asked of any time of a run."""


class SwarmDialogue(Dialogue[Backend | ReplayBackend]):
    """See the module."""

    most_waiting = 16
    """Answers of one page that robots have to give first."""

    def __init__(self, desk: Backend | ReplayBackend) -> None:
        super().__init__(desk)
        self._table = RobotTable(desk.values)
        self._look: PastView | None = None
        self._marked = -1
        self._ghosts, self._ghost_tick = True, -1
        """Whether the page is to be shown another future, and the tick of which it was told last."""

    @property
    def source(self) -> FrameSource:
        """Where this page's frames come from."""
        return self._desk.driver if self._look is None else self._look

    def hello(self) -> str:
        self._marked, self._ghost_tick = -1, -1
        return super().hello()

    def _answer(self, message: incoming.Incoming) -> Answer | Awaitable[Answer]:
        desk = self._desk
        if self._look is not None and desk.past is not None:
            found = self._of_then(message, self._look, desk.past)
            if found is not None:
                return found
        match message:
            case incoming.ShowMoment(time):
                self._look_at(time)
            case incoming.Ghosts(on):
                self._ghosts, self._ghost_tick = on, -1
            case incoming.Halt():
                desk.halt()
            case incoming.ChangeLease(serial, deed, group, seconds, to):
                return desk.lease(serial, deed, group, seconds, to)
            case incoming.Watch(robot):
                if self._look is not None:
                    self._look.watched = robot
                return super()._answer(message)
            case incoming.Seek(time):
                desk.seek(time)
            case incoming.GetPreview(serial, text):
                return desk.preview(serial, text)
            case incoming.GetSpread(serial, text, at):
                return desk.spread(serial, text, at)
            case incoming.Pick(serial, marks):
                return desk.pick(serial, marks)
            case incoming.AddAlert() | incoming.MuteAlert() | incoming.RemoveAlert() | incoming.Fired():
                return desk.alert(message)
            case incoming.Wink(serial, robot):
                return desk.wink(serial, robot)
            case incoming.Send(serial, text, everybody, sort, count, confirmed):
                return desk.send(serial, text, everybody, sort, count, confirmed)
            case incoming.Play() | incoming.SendLine() | incoming.SkipLine():
                if not isinstance(desk, Backend):
                    raise MisuseError(NO_MISSION)
                return desk.mission_wish(message)
            case incoming.GetNames(serial):
                return desk.names(serial)
            case incoming.GetGlance(serial):
                return glance(desk.values, serial)
            case incoming.Phrase(serial, text):
                return desk.phrase(serial, text)
            case incoming.Understand(serial, text):
                return desk.understand(serial, text)
            case incoming.Why(serial, robot, command):
                return desk.why(serial, robot, command)
            case incoming.Outcomes(serial, command):
                return desk.outcomes(serial, command)
            case incoming.Field(serial, name):
                return desk.field(serial, name)
            case incoming.Replies(serial, command, robots):
                return desk.replies(serial, command, robots)
            case incoming.Failed(serial, rule):
                return desk.failed(serial, rule)
            case incoming.Members(serial, group):
                return desk.members(serial, group)
            case incoming.GetPicture(serial):
                return desk.picture(serial)
            case incoming.GetCommands(serial):
                return desk.commands(serial)
            case incoming.DraftTest() | incoming.CountTrue() | incoming.SaveTest():
                if not isinstance(desk, RenewableBackend):
                    raise MisuseError(OF_RECORDING if isinstance(desk, ReplayBackend) else NO_TEST)
                return desk.session_test(message)
            case incoming.Scenarios() | incoming.GetSetup() | incoming.Renew() | incoming.Fork():
                if not isinstance(desk, RenewableBackend):
                    raise MisuseError(NOT_HERE)
                return desk.renewal(message)
            case incoming.GetRows():
                return self._table.rows(message)
            case incoming.GetRange():
                return self._table.range(message)
            case incoming.GetCsv():
                return self._table.csv(message)
            case incoming.AddPlot():
                return desk.plots.add(message)
            case incoming.RemovePlot():
                return desk.plots.remove(message)
            case incoming.GetPlot():
                return desk.plots.drawn(message)
            case _:
                return super()._answer(message)
        return None

    def _look_at(self, time: float | None) -> None:
        """Look at another time; None is now."""
        past = self._desk.past
        if past is None or isinstance(self._desk, ReplayBackend):
            raise MisuseError("There is no timeline here: nothing is kept of what was.")
        if time is None:
            self.leave()
            return
        if not past.film.poses.times:
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

    def beside(self) -> Iterator[str | bytes]:
        """Where robots were in another future at what this page shows, unless it knows or there is none. No place is
        told once that future has ended."""
        past = self._desk.past
        if not self._ghosts or past is None or past.other is None:
            return
        time = past.ended if self._look is None else self._look.time
        film = past.other.film
        found = film.poses.at(time) if time <= film.seconds else None
        tick, poses = (past.tick_of(film.seconds) + 1, b"") if found is None else found
        if tick != self._ghost_tick:
            self._ghost_tick = tick
            yield ghosts(poses)

    def _of_then(self, message: incoming.Incoming, look: PastView, past: Past) -> Answer | Awaitable[Answer] | None:
        """The answer of the time at which the page looks; None for what is a matter of now."""
        if isinstance(message, ACTS):
            raise MisuseError(
                f"This page looks at {clock_time(look.time)}, and commands act on the live run. "
                "Go back to live (F8), then do it."
            )
        match message:
            case incoming.Field(_, name):
                return past.answer(look.tick, message) if field_of(past.film.scene, name).grows else None
            case incoming.Why():
                return past.why(look.tick, message)
            case incoming.GetCommands(serial):
                return commands_of(past.film, look.time, serial)
            case incoming.Outcomes(serial, command) if isinstance(self._desk, Backend):
                return self._desk.outcomes(serial, command, look.time)
            case incoming.Replies(serial, command, robots) if isinstance(self._desk, Backend):
                return self._desk.replies(serial, command, robots, look.time)
            case incoming.Failed(serial, rule):
                return past.film.failed(look.time, serial, rule)
        return past.answer(look.tick, message) if isinstance(message, QUESTIONS) else None

    def _news(self) -> Iterator[outgoing.Said]:
        look, past = self._look, self._desk.past
        if look is None:
            yield from self._desk.news(self._watched)
        else:
            yield from look.news()
            yield from (said for said in self._desk.news(-1) if not isinstance(said, OF_THEN))
            if isinstance(self._desk, Backend) and past is not None:
                yield from self._desk.mission(rows_at(past.film, look.time), look.time)
        if past is None:
            return
        if self._marked != past.marks.number:
            self._marked = past.marks.number
            yield outgoing.Marked(list(past.marks.all))
        span = outgoing.Span(past.film.began, past.ended, kept=past.kept)
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
        yield span
