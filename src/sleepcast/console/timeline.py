"""What is to be seen of a run at any time: pictures, marks, accounts and what robots reported, each from which time on.

A recording is read into a `Timeline` (`adapters/recording`), and a run that lives adds to one (`adapters/live_past`).
Here it is put into the shapes of the wire, and some of it left out where it takes too many bytes: of pictures every
second one, again and again; of accounts those first that were reported anew later, then the oldest.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from dataclasses import field
from itertools import islice
from typing import Generic, TypeVar

import msgspec

from sleepcast.console import outgoing
from sleepcast.console.account_table import MAX_ROWS, CommandRow
from sleepcast.console.failing import Failures
from sleepcast.console.features.sight import SightView
from sleepcast.console.frames import pack
from sleepcast.console.replay_client import ReplayAnswer
from sleepcast.console.sensing import BodyKind
from sleepcast.console.view import FieldPicture, Picture, Scene, Solids
from sleepcast.core.records import dataclass
from sleepcast.core.units import value_in_words
from sleepcast.fleet.failing import RECENT
from sleepcast.language import Vocabulary

MAX_LINES = 20
"""Lines of the watched robot that a page shows."""
STATES = {1: "stopped", 2: "frozen", 4: "sleeping", 8: "marked", 64: "crashed"}
"""Flags of a frame in words."""
PICTURE_OVERHEAD = 250
"""Bytes of a picture besides its content: of one robot they are most of it."""
NAME_SIZE = 8
"""Bytes of a row in a list of names: most names are in the one before, too."""
CORNER_SIZE = 150
"""Bytes of a corner of an obstacle."""
ROW_OVERHEAD = 700
"""Bytes of an account besides its texts."""
Value = TypeVar("Value")
values_of = msgspec.json.Decoder(dict[str, list[float | None]]).decode
"""What robots sensed, by sensor, as it was recorded. Raises ValueError."""


@dataclass(slots=True)
class Track(Generic[Value]):
    """What was so from which time (s) on, in the order of time."""

    times: list[float] = field(default_factory=list)
    values: list[Value] = field(default_factory=list)

    def add(self, time: float, value: Value) -> None:
        """From `time`, not before the last one, `value` is so."""
        self.times.append(time)
        self.values.append(value)

    def before(self, time: float) -> int:
        """How many had come to be so at `time`."""
        return bisect_right(self.times, time)

    def at(self, time: float) -> Value | None:
        """What was so at `time`; None before the first."""
        number = self.before(time)
        return self.values[number - 1] if number else None

    def until(self, time: float) -> Track[Value]:
        """What there is up to a time, to be added to by another run."""
        count = self.before(time)
        return Track(self.times[:count], self.values[:count])

    def keep(self, indices: list[int]) -> None:
        """Leave out all but these."""
        self.times, self.values = [self.times[at] for at in indices], [self.values[at] for at in indices]

    def keep_seen(self, times: list[float]) -> None:
        """Leave out what was so at none of these times, but not the last, which holds now."""
        needed = {at - 1 for time in times if (at := self.before(time))}
        if self.times:
            needed.add(len(self.times) - 1)
        self.keep(sorted(needed))


@dataclass(frozen=True, slots=True)
class RobotMarks:
    """Groups and flags, and where there are any the second groups and the colours: a byte for each robot, as in a
    frame; names: of the groups by code, from 1."""

    groups: bytes
    flags: bytes
    names: tuple[str, ...]
    second: bytes = b""
    colours: bytes = b""

    @property
    def size(self) -> int:
        """Bytes that they take, about."""
        return PICTURE_OVERHEAD + len(self.groups) + len(self.flags) + len(self.second) + len(self.colours)


@dataclass(slots=True)
class Timeline:
    """A recording as the page shows it.

    scene: what does not change
    began, seconds: when it begins and ends
    speed: at which it is shown at first
    units: of the sensors, as people read them
    vocabulary: what robots know from the start
    kinds: of the bodies, in the order of the scene's sizes
    part: of a recording in several files, 0 if there is one
    poses: as in a frame, with the tick
    rows: every account as it came
    values: JSON, for each sensor a list of all robots, null for unknown
    rules, reports: by robot
    obstacles: what is solid, as in a scene, from the first change on
    failures: the rules that fail
    picture: of the scene
    names: of the robots by row, "" where none is, from the first change on
    numbers: the id of each robot by its name, where robots come and go
    field: gives the picture of one of its fields that does not grow
    sight: gives what a robot (by its index) saw at a time, s
    """

    scene: Scene
    seconds: float
    speed: float
    units: dict[str, str]
    vocabulary: Vocabulary
    kinds: tuple[BodyKind, ...] = ()
    began: float = 0.0
    part: int = 0
    poses: Track[tuple[int, bytes]] = field(default_factory=Track)
    marks: Track[RobotMarks] = field(default_factory=Track)
    rows: Track[CommandRow] = field(default_factory=Track)
    values: Track[bytes] = field(default_factory=Track)
    rules: dict[str, Track[list[outgoing.ShownRule]]] = field(default_factory=dict)
    reports: dict[str, Track[str]] = field(default_factory=dict)
    obstacles: Track[Solids] = field(default_factory=Track)
    failures: Track[Failures] = field(default_factory=Track)
    names: Track[tuple[str, ...]] = field(default_factory=Track)
    numbers: dict[str, int] = field(default_factory=dict)
    picture: Picture | None = None
    field: Callable[[str], FieldPicture] | None = None
    sight: Callable[[float, int], SightView] | None = None

    def marks_at(self, time: float) -> RobotMarks:
        """The marks at `time`; before the first, nobody is in a group."""
        nothing = bytes(len(self.scene.names))
        return self.marks.at(time) or RobotMarks(nothing, nothing, ())

    def names_at(self, time: float) -> tuple[str, ...]:
        """The names of the robots at `time`, by row."""
        return self.names.at(time) or self.scene.names

    def failures_at(self, time: float) -> Failures:
        """The rules that failed at `time`."""
        return self.failures.at(time) or Failures()

    def latched_at(self, time: float) -> bool:
        """Whether STOP held at `time`."""
        for row in reversed(self.rows.values[: self.rows.before(time)]):
            if row.kind in ("stop", "release"):
                return row.kind == "stop"
        return False

    # ---- how many bytes it takes, and what is left out when they are too many

    @property
    def size_of_pictures(self) -> int:
        """Bytes of all pictures, with the marks, failing rules and obstacles on them, but for the obstacles of now:
        these are there in any case."""
        poses = sum(PICTURE_OVERHEAD + len(data) for _, data in self.poses.values)
        failures = sum(PICTURE_OVERHEAD + each.size for each in self.failures.values)
        marks = sum(each.size for each in self.marks.values)
        names = sum(PICTURE_OVERHEAD + NAME_SIZE * len(each) for each in self.names.values)
        return poses + failures + marks + names + sum(map(size_of_obstacles, self.obstacles.values[:-1]))

    def thin(self, every: int) -> None:
        """Leave out all pictures but the first and those of every so many ticks."""
        self.poses.keep([at for at, (tick, _) in enumerate(self.poses.values) if tick % every == 0 or at == 0])
        for track in (self.marks, self.failures, self.obstacles, self.names):
            track.keep_seen(self.poses.times)

    @property
    def size_of_rows(self) -> int:
        """Bytes of all accounts."""
        return sum(map(size_of_row, self.rows.values))

    def forget_accounts(self, most: int) -> None:
        """Leave out accounts until they take half as many bytes as they may: in the older half all but the latest of
        each command, then the oldest; but it stays known whether STOP held."""
        rows = self.rows
        half = len(rows.times) // 2
        latest = {row.id: at for at, row in enumerate(rows.values[:half])}
        rows.keep([*sorted(latest.values()), *range(half, len(rows.times))])
        count, latch, excess = 0, list[int](), self.size_of_rows - most // 2
        while excess > 0 and count < len(rows.values) - 1:
            row = rows.values[count]
            excess -= size_of_row(row)
            latch = [count] if row.kind in ("stop", "release") else latch
            count += 1
        rows.keep([*latch, *range(count, len(rows.times))])


def size_of_obstacles(solid: Solids) -> int:
    """Bytes that obstacles take, about."""
    corners = sum(CORNER_SIZE * (1 + len(corners)) for outlines in solid.obstacles for corners in outlines)
    return PICTURE_OVERHEAD + corners + CORNER_SIZE * len(solid.tall)


def size_of_row(row: CommandRow) -> int:
    """Bytes that an account takes, about."""
    return ROW_OVERHEAD + len(row.text) + len(row.values) + len(row.scope)


# ---- in the shapes of the wire


def frame_of(
    timeline: Timeline,
    number: int,
    time: float,
    speeds: tuple[float, float],
    state: tuple[bool, ...],
    exact: ReplayAnswer | None = None,
) -> bytes:
    """The frame of a time. exact: what running again gave for it."""
    if exact is not None:
        tick, poses, marks = exact.tick, exact.poses, RobotMarks(*exact.marks)
    else:
        (tick, poses), marks = timeline.poses.at(time) or timeline.poses.values[0], timeline.marks_at(time)
    columns = (b"", marks.second, marks.colours)
    return pack(number, tick, time, speeds, state, poses, (marks.groups, marks.flags), columns)


def news_of(
    timeline: Timeline, time: float, watched: int, exact: ReplayAnswer | None = None
) -> Iterator[outgoing.DeskMessage]:
    """Everything that may have changed at a time; see `Backend.news`. exact: what running again gave for it."""
    yield commands_of(timeline, time)
    yield outgoing.Failing(timeline.failures_at(time).rules, RECENT * timeline.speed)
    yield outgoing.Groups(_groups(timeline.marks_at(time), exact))
    if timeline.obstacles.times:
        changed = timeline.obstacles.at(time)
        solid = timeline.scene if changed is None else changed
        yield outgoing.Obstacles(solid.obstacles, tall=solid.tall)
    yield outgoing.Safety(timeline.latched_at(time), "STOP held at this time.")
    names = exact.names if exact is not None and exact.names else timeline.names_at(time)
    if timeline.names.times:
        yield outgoing.Roll(names)
    if 0 <= watched < len(names) and names[watched]:
        yield _robot(timeline, time, watched, names[watched], exact)


def commands_of(timeline: Timeline, time: float, serial: int | None = None) -> outgoing.Commands:
    """The accounts of the latest commands as they were known at a time."""
    return outgoing.Commands(list(rows_at(timeline, time).values())[-MAX_ROWS:], serial)


def rows_at(timeline: Timeline, time: float) -> dict[str, CommandRow]:
    """The account of every command as it was known at a time, by its id."""
    rows = timeline.rows
    return {row.id: row for row in rows.values[: rows.before(time)]}


def _robot(timeline: Timeline, time: float, index: int, name: str, exact: ReplayAnswer | None) -> outgoing.WatchedRobot:
    marks = timeline.marks_at(time)
    reports, rules = timeline.reports.get(name), timeline.rules.get(name)
    lines: list[outgoing.ShownReport] = []
    if reports is not None:
        number = reports.before(time)
        known: Sequence[tuple[float, str]] = list(zip(reports.times[:number], reports.values[:number], strict=True))
        lines = [outgoing.ShownReport(at, text) for at, text in islice(reversed(known), MAX_LINES)]
    if exact is not None and exact.message:
        robot = msgspec.json.decode(exact.message, type=outgoing.WatchedRobot)
        if robot.robot == index:
            return msgspec.structs.replace(robot, reports=lines or robot.reports)
    codes = [each[index] for each in (marks.second, marks.groups) if each]
    states = [word for flag, word in STATES.items() if marks.flags[index] & flag]
    return outgoing.WatchedRobot(
        index,
        [marks.names[each - 1] for each in codes if 0 < each <= len(marks.names)],
        states,
        _values(timeline, time, index),
        (rules.at(time) if rules is not None else None) or [],
        lines,
    )


def _values(timeline: Timeline, time: float, index: int) -> list[outgoing.ShownValue]:
    data = timeline.values.at(time)
    known = {} if data is None else values_of(data)
    return [
        outgoing.ShownValue(name, "unknown" if values[index] is None else value_in_words(values[index], unit), "sensor")
        for name, values in known.items()
        if (unit := timeline.units.get(name)) is not None and index < len(values)
    ]


def _groups(marks: RobotMarks, exact: ReplayAnswer | None) -> list[outgoing.ShownGroup]:
    """The groups; of each, where only marks are known, the robots whose newest or second newest it is."""
    if exact is not None:
        groups = zip(RobotMarks(*exact.marks).names, exact.counts, exact.shown, strict=True)
    else:
        codes = range(1, len(marks.names) + 1)
        shown = [marks.groups.count(code) for code in codes]
        counts = [count + marks.second.count(code) for code, count in zip(codes, shown, strict=True)]
        groups = zip(marks.names, counts, shown, strict=True)
    return [outgoing.ShownGroup(*group) for group in groups]
