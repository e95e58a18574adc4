"""A recording on the page: the same pictures and tables as of a running swarm, at the time where the slider stands.

A recording is a `Timeline` here, made by `adapters/recording`. `ReplayBackend` takes the place of a running swarm's
`Backend`: it answers what can be shown, and refuses commands. What was not recorded is found by running again, where
that can be done.
"""

from __future__ import annotations

import asyncio
import struct
from collections.abc import Awaitable, Callable, Iterator, Sequence
from itertools import accumulate
from math import nan
from typing import ClassVar

import msgspec
import numpy as np

from sleepcast.console import outgoing
from sleepcast.console.driver import FRAME_PERIOD, FrameSource
from sleepcast.console.feature import NO_ROBOTS
from sleepcast.console.features.alerts import AlertBoard
from sleepcast.console.features.field import Field, Fielded, field_of
from sleepcast.console.features.plots import ScenarioMeasure
from sleepcast.console.features.sight import SightView
from sleepcast.console.features.why import Why
from sleepcast.console.outgoing import ShownName
from sleepcast.console.past import Past
from sleepcast.console.past_view import ExactMoment
from sleepcast.console.recorded_values import RecordedPlots, RecordedValues
from sleepcast.console.sensing import BodyView
from sleepcast.console.timeline import Timeline, commands_of, frame_of, news_of, values_of
from sleepcast.console.values import Mask
from sleepcast.console.view import Picture, Scene
from sleepcast.core.clock import Clock
from sleepcast.core.errors import MisuseError
from sleepcast.core.tasks import together

MAX_WATCHED = 16
"""Robots that pages look at, at one time: as many as there may be pages."""


class ReplayDriver(FrameSource):
    """Moves through a timeline, as fast as is wanted, and stands still at its end."""

    def __init__(self, timeline: Timeline, clock: Clock, past: Past | None = None) -> None:
        super().__init__()
        self.time = timeline.began
        self._past, self._exact = past, None if past is None else ExactMoment(past, self.draw)
        self._timeline, self.clock = timeline, clock
        self._running, self._factor = True, timeline.speed
        self._wake = asyncio.Event()

    async def run(self) -> None:
        """Let time pass until cancelled."""
        self.draw()
        due = looked = self.clock.now()
        while True:
            if not self._running:
                self._wake.clear()
                await self._wake.wait()
                looked = self.clock.now()
            due = max(due + FRAME_PERIOD, looked)
            await asyncio.sleep(due - self.clock.now())
            now = self.clock.now()
            if self._running:
                self.time = min(self._timeline.seconds, self.time + (now - looked) * self._factor)
                self._running = self.time < self._timeline.seconds
                self.draw()
            looked = now

    def set_pace(self, running: bool | None = None, factor: float | None = None) -> None:
        """Change whether time runs and how fast; from its end, the timeline begins anew."""
        if running is not None:
            self._running = running
            if running and self.time >= self._timeline.seconds:
                self.time = self._timeline.began
        if factor is not None:
            self._factor = factor
        self._wake.set()
        self.draw()

    def seek(self, time: float) -> None:
        """Go to `time` (s), or as near as there is something."""
        self.time = max(self._timeline.began, min(time, self._timeline.seconds))
        self.draw()

    def step(self) -> None:
        """Go to the next picture, and stand still."""
        poses = self._timeline.poses
        following = poses.before(self.time)
        if following < len(poses.times):
            self.time = poses.times[following]
        self.set_pace(running=False)

    @property
    def note(self) -> str:
        """Why only a picture near this moment is shown, "" if all is there or still looked for."""
        return "" if self._exact is None else self._exact.note

    @property
    def stands(self) -> bool:
        """Whether time stands still."""
        return not self._running

    def draw(self) -> None:
        """Show what was at this time; where it stands still, what running again gives."""
        exact = None
        if self._past is not None and self._exact is not None:
            if self._running:
                self._exact.leave()
            else:
                exact = self._exact.of(self._past.tick_of(self.time), -1)
        speeds = (self._factor, self._factor if self._running else 0.0)
        state = (self._running, self._timeline.latched_at(self.time))
        self.show(frame_of(self._timeline, self.number + 1, self.time, speeds, state, exact))


class ReplayBackend:
    """See the module."""

    recorded: ClassVar[bool] = True
    lacks: ClassVar[str] = NO_ROBOTS
    at_once = False

    def __init__(
        self,
        timeline: Timeline,
        driver: ReplayDriver,
        measures: Sequence[ScenarioMeasure] = (),
        past: Past | None = None,
    ) -> None:
        self.driver, self.past = driver, past
        self._timeline = timeline
        self._exact: dict[int, ExactMoment] = {}
        """By the robot that a page looks at."""
        self.values = RecordedValues(timeline, lambda: driver.time)
        self.plots = RecordedPlots(timeline, lambda: driver.time, driver.clock, measures, past)
        self.alerts = AlertBoard(self.values, driver.clock)
        driver.watchers.append(self.alerts.look)

    def hello(self) -> outgoing.Hello:
        """What a page needs first."""
        timeline = self._timeline
        return outgoing.Hello(
            timeline.scene, len(timeline.scene.names), [], timeline.seconds, timeline.began, timeline.part
        )

    async def live(self) -> None:
        """Let time pass, and do what is to be done aside, until cancelled."""
        if self.past is None:
            await self.driver.run()
        else:
            await together(self.driver.run(), self.past.live())

    def seek(self, time: float) -> None:
        """Go to `time`, s."""
        self.driver.seek(time)

    # ---- what features need

    @property
    def scene(self) -> Scene:
        """What does not change."""
        return self._timeline.scene

    @property
    def facts(self) -> RecordedValues:
        """What was recorded of this time."""
        return self.values

    @property
    def picture(self) -> Picture | None:
        """The picture of the map, None if there is none."""
        return self._timeline.picture

    def latest_reports(self, most: int) -> list[tuple[str, outgoing.ShownReport]]:
        """A recording tells reports with each robot."""
        return []

    def known_names(self) -> list[ShownName]:
        """The names that an expression may use, with the ranges of their values now."""
        return self.values.known()

    def commands(self, serial: int | None = None, time: float = nan) -> outgoing.Commands:
        """The account of every command as it was known at this time."""
        return commands_of(self._timeline, self.driver.time, serial)

    def explain(self, asked: Why) -> Awaitable[msgspec.Raw]:
        """How a robot evaluated a command, by running again. Raises MisuseError where that cannot be done."""
        if self.past is None:
            raise MisuseError("A recording stores each command's outcome, not its explanation.")
        return self.past.why(self.past.tick_of(self.driver.time), asked)

    def members(self, group: int) -> bytes:
        """Who is in a group, of those whose newest or second newest group it is."""
        marks = self._timeline.marks_at(self.driver.time)
        newest, second = (np.frombuffer(codes, np.uint8) == group for codes in (marks.groups, marks.second))
        members: Mask = newest | second if marks.second else newest
        return members.tobytes()

    def field(self, asked: Field) -> Fielded | Awaitable[msgspec.Raw]:
        """A field at this time; of one that grows, by running again. Raises MisuseError where that cannot be done."""
        timeline, name = self._timeline, asked.name
        grows = field_of(timeline.scene, name).grows
        if not grows and timeline.field is not None:
            return Fielded(asked.serial, name, 0, timeline.field(name))
        if self.past is None:
            raise MisuseError(f"The recording does not hold how {name} was at this time.")
        tick = self.past.tick_of(self.driver.time)
        self.past.check(tick)
        return self.past.answer(tick, asked)

    def sense(self, robot: int) -> BodyView:
        """What the body of a robot sensed when that was recorded last."""
        timeline = self._timeline
        number = timeline.values.before(self.driver.time)
        if not 0 <= robot < len(timeline.scene.names) or not number:
            raise MisuseError("The recording does not hold what this robot's body sensed at this time.")
        values = values_of(timeline.values.values[number - 1])
        poses = timeline.poses.at(timeline.values.times[number - 1]) or timeline.poses.values[0]

        def read(name: str) -> float:
            column = values.get(name, [])
            value = column[robot] if robot < len(column) else None
            return nan if value is None else value

        ends = accumulate(count for count, _ in timeline.scene.sizes)
        kind = next(kind for kind, end in zip(timeline.kinds, ends, strict=True) if robot < end)
        x, y, heading = struct.unpack_from("<3f", poses[1], 12 * robot)
        believed = (read("x"), read("y"), read("heading"))
        ranges = [read(f"sonar{number}") for number in range(kind.sonars)]
        return kind.sensing((x, y, heading), believed, ranges)

    @property
    def sight(self) -> Callable[[int], SightView] | None:
        """Tells what the robot with this index saw at this time; None where nobody can."""
        told = self._timeline.sight
        return None if told is None else lambda robot: told(self.driver.time, robot)

    def failed(self, rule: str, time: float = nan) -> bytes:
        """On which robots a rule ("": any rule) failed at this time."""
        return self._timeline.failures_at(self.driver.time).robots(rule, len(self.scene.names))

    def stop(self, by: str = "") -> None:
        """Nothing moves in a recording that could be stopped, so time is."""
        self.driver.set_pace(running=False)

    def release(self, by: str = "") -> None:
        """Time goes on."""
        self.driver.set_pace(running=True)

    def news(self, watched: int) -> Iterator[outgoing.DeskMessage]:
        """Everything that may have changed; `watched`: the index of the robot that the page looks at, or -1."""
        time, exact = self.driver.time, None
        if self.past is not None and watched >= 0 and self.driver.stands:
            exact = self._exact_of(self.past, watched).of(self.past.tick_of(time), watched)
        yield from news_of(self._timeline, time, watched, exact)
        yield self.plots.shown()
        self.alerts.look()  # while time stands still there are no pictures
        yield self.alerts.shown()

    def _exact_of(self, past: Past, robot: int) -> ExactMoment:
        """The one of the robot that a page looks at; of too many, who was looked at longest ago is left."""
        exact = self._exact.pop(robot, None) or ExactMoment(past, lambda: None)
        self._exact[robot] = exact
        if len(self._exact) > MAX_WATCHED:
            self._exact.pop(next(iter(self._exact))).leave()
        return exact
