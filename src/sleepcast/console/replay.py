"""A recording on the page: the same pictures and tables as of a running swarm, at the time where the slider stands.

`Timeline` is a recording as the page needs it; `adapters/recording` makes it. `ReplayBackend` takes the place of a
running swarm's `Backend`: it answers what can be shown, and refuses commands.
"""

from __future__ import annotations

import asyncio
import struct
from bisect import bisect_right
from collections.abc import Awaitable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import accumulate, islice
from math import nan
from typing import Generic, NoReturn, TypeVar

import msgspec
import numpy as np

from sleepcast.console import outgoing
from sleepcast.console.account_table import MOST_ROWS, CommandRow
from sleepcast.console.alerts import AlertBoard, Alerted
from sleepcast.console.driver import FRAME_PERIOD, FrameSource
from sleepcast.console.frames import pack
from sleepcast.console.incoming import AlertMessage, Sort
from sleepcast.console.picking import Picked, picked
from sleepcast.console.plots import Measure
from sleepcast.console.recorded_values import RecordedPlots, RecordedValues
from sleepcast.console.sensing import BodyKind
from sleepcast.console.view import Outline, Scene
from sleepcast.core.clock import Clock
from sleepcast.core.errors import MisuseError
from sleepcast.core.units import shown_value
from sleepcast.language import Vocabulary

MOST_SAID = 20
"""Lines of the watched robot that a page shows."""
STATES = ("stopped", "frozen", "sleeping", "marked")
"""The flags of a frame by bit, in words."""

Kind = TypeVar("Kind")
values_of = msgspec.json.Decoder(dict[str, list[float | None]]).decode
"""What robots sensed, by sensor, as it was recorded. Raises ValueError."""


@dataclass(slots=True)
class Track(Generic[Kind]):
    """What was so from which time (s) on, in the order of time."""

    times: list[float] = field(default_factory=list)
    values: list[Kind] = field(default_factory=list)

    def add(self, time: float, value: Kind) -> None:
        """From `time`, not before the last one, `value` is so."""
        self.times.append(time)
        self.values.append(value)

    def before(self, time: float) -> int:
        """How many had come to be so at `time`."""
        return bisect_right(self.times, time)

    def at(self, time: float) -> Kind | None:
        """What was so at `time`; None before the first."""
        number = self.before(time)
        return self.values[number - 1] if number else None


@dataclass(frozen=True, slots=True)
class Marks:
    """Groups and flags, and where there are any the second groups and the colours: a byte for each robot, as in a
    frame; names: of the groups by code, from 1."""

    groups: bytes
    flags: bytes
    names: tuple[str, ...]
    second: bytes = b""
    colours: bytes = b""


@dataclass(slots=True)
class Timeline:
    """A recording as the page shows it. began, seconds: when it begins and ends. speed: at which it is shown at first.
    part: of a recording in several files, 0 if there is one. poses: as in a frame, with the tick. rows: every account
    as it came. values: JSON, for each sensor a list of all robots, null for unknown; units: of the sensors, as people
    read them. vocabulary: what robots know from the start. kinds: of the bodies, in the order of the scene's sizes.
    rules, said: by robot. obstacles: what is solid, as in a scene, from the first change on."""

    scene: Scene
    seconds: float
    speed: float
    units: dict[str, str]
    vocabulary: Vocabulary
    kinds: tuple[BodyKind, ...] = ()
    began: float = 0.0
    part: int = 0
    poses: Track[tuple[int, bytes]] = field(default_factory=Track)
    marks: Track[Marks] = field(default_factory=Track)
    rows: Track[CommandRow] = field(default_factory=Track)
    values: Track[bytes] = field(default_factory=Track)
    rules: dict[str, Track[list[outgoing.ShownRule]]] = field(default_factory=dict)
    said: dict[str, Track[str]] = field(default_factory=dict)
    obstacles: Track[tuple[tuple[Outline, ...], ...]] = field(default_factory=Track)

    def marks_at(self, time: float) -> Marks:
        """The marks at `time`; before the first, nobody is in a group."""
        nothing = bytes(len(self.scene.names))
        return self.marks.at(time) or Marks(nothing, nothing, ())

    def latched_at(self, time: float) -> bool:
        """Whether STOP held at `time`."""
        for row in reversed(self.rows.values[: self.rows.before(time)]):
            if row.kind in ("stop", "release"):
                return row.kind == "stop"
        return False


class ReplayDriver(FrameSource):
    """Moves through a film, as fast as is wanted, and stands still at its end."""

    def __init__(self, film: Timeline, clock: Clock) -> None:
        super().__init__()
        self.time = film.began
        self._film, self.clock = film, clock
        self._running, self._factor = True, film.speed
        self._wake = asyncio.Event()

    async def run(self) -> None:
        """Let time pass until cancelled."""
        self.draw()
        looked = self.clock.now()
        while True:
            if not self._running:
                self._wake.clear()
                await self._wake.wait()
                looked = self.clock.now()
            await asyncio.sleep(FRAME_PERIOD)
            now = self.clock.now()
            if self._running:
                self.time = min(self._film.seconds, self.time + (now - looked) * self._factor)
                self._running = self.time < self._film.seconds
                self.draw()
            looked = now

    def set_pace(self, running: bool | None = None, factor: float | None = None) -> None:
        """Change whether time runs and how fast; from its end, the film begins anew."""
        if running is not None:
            self._running = running
            if running and self.time >= self._film.seconds:
                self.time = self._film.began
        if factor is not None:
            self._factor = factor
        self._wake.set()
        self.draw()

    def seek(self, time: float) -> None:
        """Go to `time` (s), or as near as there is something."""
        self.time = max(self._film.began, min(time, self._film.seconds))
        self.draw()

    def step(self) -> None:
        """Go to the next picture, and stand still."""
        poses = self._film.poses
        following = poses.before(self.time)
        if following < len(poses.times):
            self.time = poses.times[following]
        self.set_pace(running=False)

    def draw(self) -> None:
        """Show what was at this time."""
        film, time = self._film, self.time
        tick, poses = film.poses.at(time) or film.poses.values[0]
        marks = film.marks_at(time)
        speeds = (self._factor, self._factor if self._running else 0.0)
        state = (self._running, film.latched_at(time))
        columns = (b"", marks.second, marks.colours)
        self.show(pack(self.number + 1, tick, time, speeds, state, poses, (marks.groups, marks.flags), columns))


class ReplayBackend:
    """See the module; the questions are those that a session asks."""

    def __init__(self, film: Timeline, driver: ReplayDriver, measures: Sequence[Measure] = ()) -> None:
        self.driver = driver
        self._film = film
        self.values = RecordedValues(film, lambda: driver.time)
        self.plots = RecordedPlots(film, lambda: driver.time, driver.clock, measures)
        self.alerts = AlertBoard(self.values, driver.clock)
        driver.watchers.append(self.alerts.look)

    def hello(self) -> outgoing.Hello:
        """What a page needs first."""
        film = self._film
        return outgoing.Hello(film.scene, len(film.scene.names), [], film.seconds, film.began, film.part)

    def seek(self, time: float) -> None:
        """Go to `time`, s."""
        self.driver.seek(time)

    def commands(self, serial: int | None = None) -> outgoing.Commands:
        """The account of every command as it was known at this time."""
        rows = self._film.rows
        known = {row.id: row for row in rows.values[: rows.before(self.driver.time)]}
        return outgoing.Commands(list(known.values())[-MOST_ROWS:], serial)

    def names(self, serial: int) -> outgoing.Named:
        """No names: nothing can be typed."""
        return outgoing.Named(serial, [])

    def preview(self, serial: int, text: str) -> NoReturn:
        """Refused."""
        self._refuse()

    def spread(self, serial: int, text: str, at: int) -> NoReturn:
        """Refused."""
        self._refuse()

    def pick(self, serial: int, marks: bytes) -> Picked | Awaitable[Picked]:
        """The test that holds for exactly the marked robots at this time."""
        return picked(self.values, serial, marks, len(self.values.names))

    def wink(self, serial: int, robot: int) -> NoReturn:
        """Refused."""
        self._refuse()

    def alert(self, wish: AlertMessage) -> Alerted:
        """Add, mute or remove an alert, or tell whom one was about."""
        return self.alerts.answer(wish)

    def phrase(self, serial: int, text: str) -> NoReturn:
        """Refused."""
        self._refuse()

    def understand(self, serial: int, text: str) -> NoReturn:
        """Refused."""
        self._refuse()

    def send(self, serial: int, text: str, everybody: bool, sort: Sort, count: int | None, confirmed: bool) -> NoReturn:
        """Refused."""
        self._refuse()

    def halt(self) -> NoReturn:
        """Refused."""
        self._refuse()

    def lease(self, serial: int, deed: str, group: str, seconds: float, to: str) -> NoReturn:
        """Refused."""
        self._refuse()

    def why(self, serial: int, robot: int, command: str) -> NoReturn:
        """Refused: explanations are made by living minds."""
        raise MisuseError("A recording stores each command's outcome, not its explanation.")

    def members(self, serial: int, group: int) -> outgoing.Joined:
        """Who is in a group, of those whose newest or second newest group it is."""
        marks = self._film.marks_at(self.driver.time)
        newest, second = (np.frombuffer(codes, np.uint8) == group for codes in (marks.groups, marks.second))
        return outgoing.Joined(serial, (newest | second if marks.second else newest).tobytes())

    def build(self, serial: int, corners: Sequence[tuple[float, float]]) -> NoReturn:
        """Refused."""
        self._refuse()

    def shift(self, serial: int, version: int, place: int, across: float, up: float) -> NoReturn:
        """Refused."""
        self._refuse()

    def clear(self, serial: int, version: int, place: int) -> NoReturn:
        """Refused."""
        self._refuse()

    def sense(self, serial: int, robot: int) -> outgoing.Sensed:
        """What the body of a robot sensed when that was recorded last."""
        film = self._film
        number = film.values.before(self.driver.time)
        if not 0 <= robot < len(film.scene.names) or not number:
            raise MisuseError("The recording does not hold what this robot's body sensed at this time.")
        values = values_of(film.values.values[number - 1])
        poses = film.poses.at(film.values.times[number - 1]) or film.poses.values[0]

        def read(name: str) -> float:
            found = values.get(name, [])
            value = found[robot] if robot < len(found) else None
            return nan if value is None else value

        ends = accumulate(count for count, _ in film.scene.sizes)
        kind = next(kind for kind, end in zip(film.kinds, ends, strict=True) if robot < end)
        x, y, heading = struct.unpack_from("<3f", poses[1], 12 * robot)
        believed = (read("x"), read("y"), read("heading"))
        ranges = [read(f"sonar{number}") for number in range(kind.sonars)]
        return outgoing.Sensed(serial, robot, kind.sensing((x, y, heading), believed, ranges))

    def failed(self, serial: int, rule: str) -> NoReturn:
        """Refused: faults of rules are not recorded."""
        raise MisuseError("A recording stores the rules of robots, not which of them fail.")

    def outcomes(self, serial: int, command: str) -> NoReturn:
        """Refused: answers are recorded as counts."""
        raise MisuseError("A recording stores how many robots obeyed a command, not which ones.")

    def stop(self) -> None:
        """Nothing moves in a recording that could be stopped, so time is."""
        self.driver.set_pace(running=False)

    def release(self) -> None:
        """Time goes on."""
        self.driver.set_pace(running=True)

    def news(self, watched: int) -> Iterator[outgoing.Said]:
        """Everything that may have changed; `watched`: the index of the robot that the page looks at, or -1."""
        film, time = self._film, self.driver.time
        yield self.commands()
        yield outgoing.Groups(_counted(film.marks_at(time)))
        if film.obstacles.times:
            changed = film.obstacles.at(time)
            yield outgoing.Obstacles(film.scene.obstacles if changed is None else changed)
        yield self.plots.shown()
        self.alerts.look()  # while time stands still there are no pictures
        yield self.alerts.shown()
        yield outgoing.Safety(film.latched_at(time), "STOP held at this time of the recording.")
        if 0 <= watched < len(film.scene.names):
            yield self._robot(watched)

    def _robot(self, index: int) -> outgoing.Robot:
        film, time = self._film, self.driver.time
        name, marks = film.scene.names[index], film.marks_at(time)
        codes = [each[index] for each in (marks.second, marks.groups) if each]
        states = [word for bit, word in enumerate(STATES) if marks.flags[index] & 1 << bit]
        rules, said = film.rules.get(name), film.said.get(name)
        return outgoing.Robot(
            index,
            [marks.names[each - 1] for each in codes if 0 < each <= len(marks.names)],
            states,
            self._values(index),
            (rules.at(time) if rules is not None else None) or [],
            _lines(said, time) if said is not None else [],
        )

    def _values(self, index: int) -> list[outgoing.ShownValue]:
        data = self._film.values.at(self.driver.time)
        found = {} if data is None else values_of(data)
        units = self._film.units
        return [
            outgoing.ShownValue(
                name, "unknown" if values[index] is None else shown_value(values[index], unit), "sensor"
            )
            for name, values in found.items()
            if (unit := units.get(name)) is not None and index < len(values)
        ]

    def _refuse(self) -> NoReturn:
        raise MisuseError("This is a recording: it has no robots that could receive a command.")


def _counted(marks: Marks) -> list[outgoing.ShownGroup]:
    """The groups; of each, the robots whose newest or second newest it is."""
    codes = range(1, len(marks.names) + 1)
    shown = [marks.groups.count(code) for code in codes]
    counts = [count + marks.second.count(code) for code, count in zip(codes, shown, strict=True)]
    return [outgoing.ShownGroup(*group) for group in zip(marks.names, counts, shown, strict=True)]


def _lines(said: Track[str], time: float) -> list[outgoing.ShownReport]:
    """The latest lines, the youngest first."""
    number = said.before(time)
    known: Sequence[tuple[float, str]] = list(zip(said.times[:number], said.values[:number], strict=True))
    return [outgoing.ShownReport(at, text) for at, text in islice(reversed(known), MOST_SAID)]
