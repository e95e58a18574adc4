"""A recorded run as a series of events, in the order of its file: what every format is written from.

Nothing of it is kept, so that a recording may be larger than the memory. A file may come from anywhere: what is in it
is checked here, once for all formats.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import NamedTuple, TypeAlias

import msgspec
import numpy as np
from numpy.typing import NDArray

from sleepcast.channel import Message
from sleepcast.core.errors import MisuseError, did_you_mean
from sleepcast.core.model import Quantity
from sleepcast.core.version import VERSION
from sleepcast.simulator.packing import unpack
from sleepcast.simulator.recording.foxglove import Level, read_colours, read_heights, read_log, read_poses
from sleepcast.simulator.recording.json_messages import (
    AccountBody,
    FailureBody,
    FailuresBody,
    MarksBody,
    RobotsBody,
    RulesBody,
)
from sleepcast.simulator.recording.recorder import (
    ACCOUNTING,
    FAILING,
    LOG,
    MARKS,
    OBSTACLES,
    POINTS,
    POSES,
    POSTED,
    READINGS,
    ROBOTS,
    RULES,
    WorldChange,
)
from sleepcast.simulator.recording.recording import NoRecordingError, RecordedEntry, Recording, decoded, entries
from sleepcast.simulator.recording.roster import names_after, names_at_first
from sleepcast.simulator.scenario.population import comes_and_goes, with_room
from sleepcast.simulator.scenario.robot_settings import RobotSpec
from sleepcast.simulator.scenario.robot_types import slices
from sleepcast.simulator.scenario.sensors import sensors_of, sonar_sensors
from sleepcast.simulator.world.world import Shape, rows_of

MAX_SECONDS = 2**31 - 1
"""Simulated s that an export can name: what a time stamp of ROS 2 holds, and 68 years."""

Numbers: TypeAlias = NDArray[np.float64]


class PosesEvent(NamedTuple):
    """Where all robots are. poses: x, y (m) and heading (rad), float32, shape (robots, 3). z: m, 0 where nothing flies,
    shape (robots,)."""

    time: float
    poses: NDArray[np.float32]
    z: NDArray[np.float64]


class ColoursEvent(NamedTuple):
    """How they look. colours: red, green, blue and alpha from 0 to 255, shape (robots, 4)."""

    time: float
    colours: NDArray[np.uint8]


class ReadingsEvent(NamedTuple):
    """What their sensors show. values: by the name of a sensor, SI, NaN for unknown, shape (robots,)."""

    time: float
    values: dict[str, Numbers]


class MarksEvent(NamedTuple):
    """Their groups and flags, as they are from now on. Each array has the shape (robots,).

    group, second: numbers of the newest and the second newest group in `names`, from 1; 0 for none.
    colour: that a robot shows; 0 for none.
    flags: bit 0 stopped, 1 frozen, 2 sleeping, 3 marked, 5 out of energy, 6 crashed.
    """

    time: float
    names: Sequence[str]
    group: NDArray[np.uint8]
    second: NDArray[np.uint8]
    colour: NDArray[np.uint8]
    flags: NDArray[np.uint8]

    def name_of(self, number: int) -> str:
        """The name of a group, "" for none."""
        return self.names[number - 1] if 0 < number <= len(self.names) else ""


class RobotsEvent(NamedTuple):
    """Robots have come and gone: `RecordedRun.chosen` and `RecordedRun.chosen_names` are those that are there now."""

    time: float
    change: RobotsBody


class LogLineEvent(NamedTuple):
    """Somebody said something."""

    time: float
    level: Level
    name: str
    text: str


class CommandEvent(NamedTuple):
    """The operator sent a message in this tick."""

    time: float
    tick: int
    message: Message


class OutcomeEvent(NamedTuple):
    """What has become of a command until now."""

    time: float
    account: AccountBody


class RulesEvent(NamedTuple):
    """What a robot has stored."""

    time: float
    rules: RulesBody


class FailingEvent(NamedTuple):
    """Which rules fail."""

    time: float
    rules: Sequence[FailureBody]


class SolidsEvent(NamedTuple):
    """Solid things were added, moved or removed; at the start all that there are are added. solids: all by number."""

    time: float
    put: Mapping[int, Shape]
    gone: Sequence[int]
    solids: Mapping[int, Shape]


Event: TypeAlias = (
    PosesEvent
    | ColoursEvent
    | ReadingsEvent
    | MarksEvent
    | RobotsEvent
    | LogLineEvent
    | CommandEvent
    | OutcomeEvent
    | RulesEvent
    | FailingEvent
    | SolidsEvent
)


class RecordedRun:
    """A recorded run, and the robots of it that are wanted.

    only: their names; empty for all
    names: of all robots that are there at the event that is taken, in the order of arrays, "" where there is none
    chosen, chosen_names: which of these are wanted, by index, and their names
    wanted: the index and the number of every robot that is wanted and there at any time, by its name
    changes: whether robots come and go

    Raises MisuseError for a robot that is never there.
    """

    def __init__(self, recording: Recording, only: Sequence[str] = ()) -> None:
        scenario = recording.scenario
        self.recording, self.scenario = recording, scenario
        self.changes = comes_and_goes(scenario)
        self._first = names_at_first(scenario)
        ever = {name: (row, number) for number, (row, name) in enumerate(_present(self._first), 1)}
        ever.update({each.robot: (each.row, each.number) for change in recording.robots for each in change.came})
        for name in only:
            self._check(name, ever)
        self.wanted = {name: ever[name] for name in only} if only else ever
        self._order = {name: place for place, name in enumerate(self.wanted)}
        self._know(self._first)
        sorts = (with_room(scenario) if self.changes else scenario).each_type
        parts = zip(sorts, slices(sorts, len(self._first)), strict=True)
        self._types = [(part.stop, spec) for spec, part in parts]
        ring = scenario.robots.ring
        sonars = sonar_sensors(ring, scenario.length_unit) if ring else ()
        self.sensors: dict[str, Quantity] = {each.name: each for each in (*sensors_of(scenario), *sonars)}
        self.earlier = 0
        """Commands left out so far because they belong to earlier parts of the recording."""

    def spec(self, robot: int) -> RobotSpec:
        """The type of the robot with this index."""
        return next(spec for stop, spec in self._types if robot < stop)

    def wants(self, name: str) -> bool:
        """Whether the robot of this name is wanted."""
        return name in self.wanted

    def _know(self, names: tuple[str, ...]) -> None:
        """These are there from now on. Those that are wanted keep the order in which they are wanted."""
        self.names = names
        rows = {name: row for row, name in enumerate(names) if name in self._order}
        self.chosen_names = sorted(rows, key=self._order.__getitem__)
        self.chosen = np.array([rows[name] for name in self.chosen_names], np.intp)

    def facts(self) -> dict[str, object]:
        """What describes the run, for the metadata of an export."""
        recording, scenario = self.recording, self.scenario
        return {
            "scenario": scenario.name,
            "title": scenario.title,
            "seed": recording.seed,
            "robots": sum(map(bool, self._first)),
            "tick": scenario.tick,
            "began": recording.began,
            "seconds": recording.seconds,
            "part": recording.part,
            "recorded_by": f"sleepcast {recording.version}",
            "exported_by": f"sleepcast {VERSION}",
        }

    def events(self) -> Iterator[Event | None]:
        """All events; None for an entry of the file that holds nothing for any export, so that whoever counts them
        counts all. Raises NoRecordingError."""
        solids = dict(enumerate(self.scenario.shapes, 1))
        self._know(self._first)
        yield SolidsEvent(self.recording.began, solids, (), solids)
        for entry in entries(self.recording.file, self.recording):
            try:
                if not entry.time <= MAX_SECONDS:
                    raise ValueError(f"an export can name times up to {MAX_SECONDS} s")
                maker = _MAKERS.get(entry.topic)
                yield self._changed(entry, solids) if entry.topic == OBSTACLES else maker and maker(self, entry)
            except (ValueError, KeyError, TypeError, RecursionError) as error:
                where = f"{self.recording.file}: {entry.topic} at {entry.time:g} s"
                raise NoRecordingError(f"{where} holds something else: {str(error)[:300]}") from None

    def _check(self, name: str, ever: Mapping[str, object]) -> None:
        if name not in ever:
            known = list(ever)
            raise MisuseError(
                f'no robot "{name}" was recorded{did_you_mean(name, known[:100])}: there are {len(known)}, '
                f"{known[0]} to {known[-1]}"
            )

    # ---- one kind of entry each

    def _changed(self, entry: RecordedEntry, solids: dict[int, Shape]) -> SolidsEvent:
        change = unpack(WorldChange, entry.data)
        put = {int(number): shape for number, shape in change.put.items()}
        for shape in put.values():
            rows_of(shape)
        for number in change.gone:
            solids.pop(number, None)
        solids.update(put)
        return SolidsEvent(entry.time, put, change.gone, solids)

    def _poses(self, entry: RecordedEntry) -> PosesEvent:
        count = len(self.names)
        return PosesEvent(entry.time, read_poses(entry.data, count), read_heights(entry.data, count))

    def _colours(self, entry: RecordedEntry) -> ColoursEvent:
        return ColoursEvent(entry.time, read_colours(entry.data, len(self.names)))

    def _readings(self, entry: RecordedEntry) -> ReadingsEvent:
        told = decoded(dict[str, list[float | None]], entry.data)
        for name, values in told.items():
            if len(values) != len(self.names):
                raise ValueError(f"{len(values)} values of {name[:60]!r}, wanted those of {len(self.names)} robots")
        return ReadingsEvent(entry.time, {name: np.array(values, np.float64) for name, values in told.items()})

    def _marks(self, entry: RecordedEntry) -> MarksEvent:
        body, count = decoded(MarksBody, entry.data), len(self.names)
        parts = (body.groups, body.second or bytes(count), body.colours or bytes(count), body.flags)
        if any(len(part) != count for part in parts):
            raise ValueError(f"marks of {max(map(len, parts))} robots, wanted those of {count}")
        return MarksEvent(entry.time, body.names, *(np.frombuffer(part, np.uint8) for part in parts))

    def _robots(self, entry: RecordedEntry) -> RobotsEvent:
        change = decoded(RobotsBody, entry.data)
        self._know(names_after(self.names, change))
        return RobotsEvent(entry.time, change)

    def _line(self, entry: RecordedEntry) -> LogLineEvent:
        name, text, level = read_log(entry.data)
        return LogLineEvent(entry.time, level, name, text)

    def _command(self, entry: RecordedEntry) -> CommandEvent | None:
        body = msgspec.json.decode(entry.data)
        tick, message = int(body["tick"]), msgspec.convert(body["message"], Message)
        # A part of a recording begins with the commands of those before it, which stand in their exports.
        if self.recording.part > 1 and (tick + 0.5) * self.scenario.tick < self.recording.began:
            self.earlier += 1
            return None
        return CommandEvent(entry.time, tick, message)

    def _outcome(self, entry: RecordedEntry) -> OutcomeEvent:
        return OutcomeEvent(entry.time, decoded(AccountBody, entry.data))

    def _rules(self, entry: RecordedEntry) -> RulesEvent:
        return RulesEvent(entry.time, decoded(RulesBody, entry.data))

    def _failing(self, entry: RecordedEntry) -> FailingEvent:
        return FailingEvent(entry.time, decoded(FailuresBody, entry.data).rules)


def _present(names: Sequence[str]) -> Iterator[tuple[int, str]]:
    """The rows that have a robot, with its name."""
    return ((row, name) for row, name in enumerate(names) if name)


_MAKERS: dict[str, Callable[[RecordedRun, RecordedEntry], Event | None]] = {
    POSES: RecordedRun._poses,
    POINTS: RecordedRun._colours,
    READINGS: RecordedRun._readings,
    MARKS: RecordedRun._marks,
    ROBOTS: RecordedRun._robots,
    LOG: RecordedRun._line,
    POSTED: RecordedRun._command,
    ACCOUNTING: RecordedRun._outcome,
    RULES: RecordedRun._rules,
    FAILING: RecordedRun._failing,
}
