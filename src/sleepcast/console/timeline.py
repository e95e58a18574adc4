"""What is to be seen of a run at any time: pictures, marks, accounts and what robots said, each from which time on.

A recording is read into a `Timeline` (`adapters/recording`), and a run that lives adds to one (`adapters/live_past`).
Here it is put into the shapes of the wire.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Generic, TypeVar

import msgspec

from sleepcast.console import outgoing
from sleepcast.console.account_table import MAX_ROWS, CommandRow
from sleepcast.console.failing import Failures
from sleepcast.console.frames import pack
from sleepcast.console.replay_client import Found
from sleepcast.console.sensing import BodyKind
from sleepcast.console.view import FieldPicture, Outline, Picture, Scene
from sleepcast.core.units import value_in_words
from sleepcast.fleet.failing import RECENT
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
class RobotMarks:
    """Groups and flags, and where there are any the second groups and the colours: a byte for each robot, as in a
    frame; names: of the groups by code, from 1."""

    groups: bytes
    flags: bytes
    names: tuple[str, ...]
    second: bytes = b""
    colours: bytes = b""


@dataclass(slots=True)
class Timeline:
    """A recording as the page shows it. began, seconds: when it begins and ends. speed: at which it is shown at
    first. part: of a recording in several files, 0 if there is one. poses: as in a frame, with the tick. rows:
    every account as it came. failures: the rules that fail. values: JSON, for each sensor a list of all robots,
    null for unknown; units: of the sensors, as people read them. vocabulary: what robots know from the start.
    kinds: of the bodies, in the order of the scene's sizes. rules, said: by robot. obstacles: what is solid, as in
    a scene, from the first change on. picture: of the scene; field: gives that of one of its fields that does not
    grow."""

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
    said: dict[str, Track[str]] = field(default_factory=dict)
    obstacles: Track[tuple[tuple[Outline, ...], ...]] = field(default_factory=Track)
    failures: Track[Failures] = field(default_factory=Track)
    picture: Picture | None = None
    field: Callable[[str], FieldPicture] | None = None

    def marks_at(self, time: float) -> RobotMarks:
        """The marks at `time`; before the first, nobody is in a group."""
        nothing = bytes(len(self.scene.names))
        return self.marks.at(time) or RobotMarks(nothing, nothing, ())

    def failures_at(self, time: float) -> Failures:
        """The rules that failed at `time`."""
        return self.failures.at(time) or Failures()

    def latched_at(self, time: float) -> bool:
        """Whether STOP held at `time`."""
        for row in reversed(self.rows.values[: self.rows.before(time)]):
            if row.kind in ("stop", "release"):
                return row.kind == "stop"
        return False


def frame_of(
    timeline: Timeline,
    number: int,
    time: float,
    speeds: tuple[float, float],
    state: tuple[bool, ...],
    found: Found | None = None,
) -> bytes:
    """The frame of a time. found: what running again gave for it."""
    if found is not None:
        tick, poses, marks = found.tick, found.poses, RobotMarks(*found.marks)
    else:
        (tick, poses), marks = timeline.poses.at(time) or timeline.poses.values[0], timeline.marks_at(time)
    columns = (b"", marks.second, marks.colours)
    return pack(number, tick, time, speeds, state, poses, (marks.groups, marks.flags), columns)


def news_of(
    timeline: Timeline, time: float, watched: int, found: Found | None = None
) -> Iterator[outgoing.DeskMessage]:
    """Everything that may have changed at a time; see `Backend.news`."""
    yield commands_of(timeline, time)
    yield outgoing.Failing(timeline.failures_at(time).rules, RECENT * timeline.speed)
    yield outgoing.Groups(_counted(timeline.marks_at(time)) if found is None else _groups_in(found))
    if timeline.obstacles.times:
        changed = timeline.obstacles.at(time)
        yield outgoing.Obstacles(timeline.scene.obstacles if changed is None else changed)
    yield outgoing.Safety(timeline.latched_at(time), "STOP held at this time.")
    if 0 <= watched < len(timeline.scene.names):
        yield _robot(timeline, time, watched, found)


def commands_of(timeline: Timeline, time: float, serial: int | None = None) -> outgoing.Commands:
    """The accounts of the latest commands as they were known at a time."""
    return outgoing.Commands(list(rows_at(timeline, time).values())[-MAX_ROWS:], serial)


def rows_at(timeline: Timeline, time: float) -> dict[str, CommandRow]:
    """The account of every command as it was known at a time, by its id."""
    rows = timeline.rows
    return {row.id: row for row in rows.values[: rows.before(time)]}


def _robot(timeline: Timeline, time: float, index: int, found: Found | None) -> outgoing.WatchedRobot:
    name, marks = timeline.scene.names[index], timeline.marks_at(time)
    said = timeline.said.get(name)
    lines = _lines(said, time) if said is not None else []
    if found is not None and found.said:
        robot = msgspec.json.decode(found.said, type=outgoing.WatchedRobot)
        if robot.robot == index:
            return msgspec.structs.replace(robot, said=lines or robot.said)
    codes = [each[index] for each in (marks.second, marks.groups) if each]
    states = [word for bit, word in enumerate(STATES) if marks.flags[index] & 1 << bit]
    rules = timeline.rules.get(name)
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


def _counted(marks: RobotMarks) -> list[outgoing.ShownGroup]:
    """The groups; of each, the robots whose newest or second newest it is."""
    codes = range(1, len(marks.names) + 1)
    shown = [marks.groups.count(code) for code in codes]
    counts = [count + marks.second.count(code) for code, count in zip(codes, shown, strict=True)]
    return [outgoing.ShownGroup(*group) for group in zip(marks.names, counts, shown, strict=True)]


def _groups_in(found: Found) -> list[outgoing.ShownGroup]:
    groups = zip(RobotMarks(*found.marks).names, found.counts, found.shown, strict=True)
    return [outgoing.ShownGroup(*group) for group in groups]


def _lines(said: Track[str], time: float) -> list[outgoing.ShownReport]:
    """The latest lines, the youngest first."""
    number = said.before(time)
    known: Sequence[tuple[float, str]] = list(zip(said.times[:number], said.values[:number], strict=True))
    return [outgoing.ShownReport(at, text) for at, text in islice(reversed(known), MOST_SAID)]
