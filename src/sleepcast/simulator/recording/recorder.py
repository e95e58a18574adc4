"""Recording: a run written to an MCAP file while it goes on.

    /poses                foxglove.PosesInFrame   where every robot is, for viewers
    /points               foxglove.PointCloud     the same as points in the colours of groups, for Rerun as well
    /scene                foxglove.SceneUpdate    for viewers: the world, walls and places, whole whenever walls change
    /groups               foxglove.SceneUpdate    for viewers: the robots of each group, whole with each picture
    /log                  foxglove.Log            for people: commands, their outcomes, what robots say, rules
    /readings             JSON                    sensor values: for each sensor a list in the robots' order
    /accounting           JSON                    the outcome of a command, as counts
    /rules                JSON                    the expressions stored on a robot, whenever they have changed
    /failing              JSON                    the rules that fail, and on which robots, whenever that has changed
    /sleepcast/marks      JSON                    groups and flags of the robots, whenever they may have changed
    /sleepcast/robots     JSON                    robots that come and go, with their rows, and who has hatched them
    /sleepcast/posted     JSON                    every message of the operator, and the tick in which it was sent
    /sleepcast/state      JSON                    the hash of the state, with its tick
    /sleepcast/obstacles  JSON                    solid things added, moved or removed, and before which tick

What is JSON has its schema in the file (`json_messages`), under a name such as `sleepcast.Readings`.

The metadata `sleepcast` hold the version of this format and describe the run; the attachment `scenario` is the
scenario as `packing` writes it. A run depends only on these and the posted messages, so it can be repeated to the
last bit. If the run was resumed from a snapshot, the attachment `snapshot` is the swarm at that time. All times in
the file are simulated, from 0.

A long recording may be split into parts (`Rotation`): run.mcap, run-0002.mcap, run-0003.mcap ... Each can be read on
its own: its metadata give its number and start time, and it begins with everything earlier that still matters: every
posted message, who is there, the solid things, accounts, rules, marks, poses and readings. The metadata `following` at
its end name the next part.

Messages are buffered in memory and written to the file in whole chunks: every `CHUNK` bytes, and every
`FLUSH_PERIOD` of real time by a thread. A process that is killed loses no more than that. If the file cannot be
written any more (a full disk), all whole chunks are kept, the recording ends, and the run goes on.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Sequence
from contextlib import suppress
from io import BytesIO, FileIO
from math import inf
from pathlib import Path
from threading import Event, RLock, Thread
from types import TracebackType

import msgspec
import numpy as np
from mcap.well_known import MessageEncoding, SchemaEncoding
from mcap.writer import CompressionType, Writer
from numpy.typing import NDArray

from sleepcast.channel import Message
from sleepcast.core.errors import MisuseError, SleepcastError, decimal_comma
from sleepcast.core.model import Quantity
from sleepcast.core.records import dataclass
from sleepcast.core.units import UNITS
from sleepcast.simulator.bodies.arrivals import Arrival
from sleepcast.simulator.packing import pack
from sleepcast.simulator.recording import foxglove
from sleepcast.simulator.recording.foxglove import Level
from sleepcast.simulator.recording.json_messages import (
    AccountBody,
    FailuresBody,
    MarksBody,
    ObstaclesBody,
    PostedBody,
    RecordedMessage,
    RobotsBody,
    RulesBody,
    StateBody,
    readings,
    schema_of,
    written,
)
from sleepcast.simulator.recording.scene import SCENE as SCENE_NAME
from sleepcast.simulator.recording.scene import SCENE_SCHEMA
from sleepcast.simulator.recording.scene import scene as scene_update
from sleepcast.simulator.scenario.population import rooms
from sleepcast.simulator.scenario.scenario import Scenario
from sleepcast.simulator.world.world import Shape

FORMAT = 1
"""Version of this format; files of a newer one are refused."""
CHUNK = 1_048_576
"""Bytes of messages written together: enough to compress well, few enough to hold in memory."""
FLUSH_PERIOD = 0.5
"""Seconds of real time after which everything is in the file."""
CHUNKS_PER_PART = 8
"""Least number of chunks per part, so that a part ends close to its limit."""
NANO = 1_000_000_000

POSES, POINTS, SCENE, GROUPS, LOG = "/poses", "/points", "/scene", "/groups", "/log"
READINGS, ACCOUNTING, RULES, FAILING = "/readings", "/accounting", "/rules", "/failing"
MARKS, POSTED, STATE = "/sleepcast/marks", "/sleepcast/posted", "/sleepcast/state"
OBSTACLES, ROBOTS = "/sleepcast/obstacles", "/sleepcast/robots"
ABOUT, FOLLOWING, SCENARIO, SNAPSHOT = "sleepcast", "following", "scenario", "snapshot"
"""The names of the metadata at the start, of those at the end of a part that is not the last, and of attachments."""
MAX_RECORD = 64 * 1_048_576
"""Bytes of one record: ten times a chunk with the readings of the largest swarm."""
MAX_START = MAX_RECORD // 2
"""Bytes of a snapshot that is recorded: that of a hundred thousand robots."""
_GREY = (122, 139, 156, 255)
"""The colour of points before any other is said: red, green, blue, alpha."""

LEAST_BYTES, MAX_BYTES = 1e5, 1e12
"""Size of a part: smaller ones hold little besides their headers, and no disk is larger."""
LEAST_SECONDS, MAX_SECONDS = 1.0, 1e9
MAX_PARTS = 9_999
"""Parts that four digits can number; the last one is not split further."""

_BYTES = {"kb": 1e3, "mb": 1e6, "gb": 1e9}
_TIMES = ("s", "min", "h")
_PIECE = re.compile(r"(\d{1,9}(?:\.\d{1,9})?)([a-z]+)")


@dataclass(frozen=True, slots=True)
class Rotation:
    """When a part is full: at `size` bytes or after `age` simulated s, whichever comes first."""

    size: float = inf
    age: float = inf


ONE_FILE = Rotation()
"""A recording in one file, never full."""


def read_rotation(text: str) -> Rotation:
    """`100MB`, `10min` of simulated time, or both: `100MB,10min`. Raises MisuseError."""
    limits = {"size": inf, "age": inf}
    comma = decimal_comma(text)
    for piece in text.lower().split(","):
        match = _PIECE.fullmatch(piece.strip())
        if match is not None and match[2] in _BYTES:
            kind, value, least, most = "size", float(match[1]) * _BYTES[match[2]], LEAST_BYTES, MAX_BYTES
        elif match is not None and match[2] in _TIMES:
            kind, value = "age", float(match[1]) * UNITS[match[2]].factor
            least, most = LEAST_SECONDS, MAX_SECONDS
        else:
            raise MisuseError(
                f'"{piece[:40]}" says not when to begin another file: write 100MB, 10min, or 100MB,10min{comma}'
            )
        if not least <= value <= most:
            unit = "bytes" if kind == "size" else "s"
            raise MisuseError(f"{piece.strip()}: another file begins after {least:g} to {most:g} {unit}, not {value:g}")
        limits[kind] = min(limits[kind], value)
    return Rotation(**limits)


def part_file(first: Path, number: int) -> Path:
    """The file of part `number`, from 1; `first` is the file of the first part."""
    return first if number == 1 else first.with_name(f"{first.stem}-{number:04}{first.suffix}")


class RecordingError(SleepcastError):
    """A recording that cannot be written or read."""


@dataclass(frozen=True, slots=True)
class WorldChange:
    """A change of the solid things, by their numbers in the world, or of who is there, before anything moved in the
    tick of this number.

    put: those added or moved
    gone: those removed
    own: whether the scenario itself caused it, so that it happens again when the run is repeated
    came: robots that somebody has added
    """

    tick: int
    put: dict[str, Shape]
    gone: tuple[int, ...]
    own: bool = False
    came: tuple[Arrival, ...] = ()


class Recorder:
    """Records a run in `file`, which must not exist yet; see the module for the contents.

    version: of the program
    first: the tick from which the run was resumed, and the swarm at that time, unless it is too large for a record
    complain: called with a sentence when nothing more can be written, or no further part can be started, possibly
        from another thread
    rotation: when a part is full
    sensors: whose readings are recorded

    Raises MisuseError if the file exists, RecordingError if it cannot be created.
    """

    def __init__(
        self,
        file: Path,
        scenario: Scenario,
        seed: int,
        *,
        version: str,
        complain: Callable[[str], None],
        rotation: Rotation = ONE_FILE,
        first: tuple[int, bytes] = (0, b""),
        sensors: Sequence[Quantity] = (),
    ) -> None:
        self.file, self.part, self.failed = file, 1, False
        self._first, self._rotation, self._complain = file, rotation, complain
        tick, self._start = first
        self._about = {"format": str(FORMAT), "version": version, "seed": str(seed), "from_tick": str(tick)}
        self._scenario = pack(scenario)
        self._lock = RLock()
        self._closing = Event()
        count = sum(rooms(scenario))
        self._poses = foxglove.pose_frame(count)
        self._colours = np.full((count, len(_GREY)), _GREY, np.uint8)
        self._schemas = {
            READINGS: ("Readings", readings(sensors)),
            ACCOUNTING: ("Accounting", schema_of(AccountBody)),
            RULES: ("Rules", schema_of(RulesBody)),
            FAILING: ("Failing", schema_of(FailuresBody)),
            MARKS: ("Marks", schema_of(MarksBody)),
            POSTED: ("Posted", schema_of(PostedBody)),
            STATE: ("State", schema_of(StateBody)),
            OBSTACLES: ("Obstacles", schema_of(ObstaclesBody)),
            ROBOTS: ("Robots", schema_of(RobotsBody)),
        }
        if rotation != ONE_FILE and (second := part_file(file, 2)).exists():
            raise MisuseError(f"{second} already exists: choose another name")
        output = _create(file)
        try:
            self._begin(output, 0.0)
        except BaseException:  # who refuses to record leaves no file behind
            output.close()
            file.unlink(missing_ok=True)
            raise
        self._saver = Thread(target=self._keep_saving, name="recording", daemon=True)
        self._saver.start()

    def poses(
        self,
        time: float,
        x: NDArray[np.float64],
        y: NDArray[np.float64],
        heading: NDArray[np.float64],
        z: NDArray[np.float64] | None = None,
    ) -> None:
        """Record the poses of all robots at `time` (s): m and rad in the world's frame, float64, shape (robots,).
        z: None where none flies."""
        stamp = round(time * NANO)
        self._write(POSES, stamp, foxglove.poses(stamp, self._poses, x, y, heading, z))
        self._write(POINTS, stamp, foxglove.points(stamp, x, y, self._colours, z))

    def paint(self, colours: NDArray[np.uint8]) -> None:
        """The points have these colours from now on: red, green, blue and alpha from 0 to 255, shape (robots, 4)."""
        self._colours = colours

    def scene(self, topic: str, time: float, entities: Sequence[bytes], deletions: Sequence[bytes] = ()) -> None:
        """Record what viewers draw besides poses, as `recording.scene` makes it. topic: SCENE or GROUPS. A viewer that
        goes to another time sees only the latest message of a topic, so each holds everything that is drawn then."""
        self._write(topic, round(time * NANO), scene_update(entities, deletions))

    def log(self, time: float, who: str, text: str, level: Level = Level.INFO) -> None:
        """Record a log line."""
        stamp = round(time * NANO)
        self._write(LOG, stamp, foxglove.log(stamp, level, who, text))

    def posted(self, time: float, tick: int, message: Message) -> None:
        """Record that the operator's `message` was sent in this tick."""
        body = msgspec.to_builtins(PostedBody(tick, RecordedMessage.of(message)))
        self._write(POSTED, round(time * NANO), json.dumps(body).encode())

    def note(self, topic: str, time: float, body: object) -> None:
        """Record a message for one of the JSON channels, as msgspec writes it: bytes as base64, NaN as null."""
        self._write(topic, round(time * NANO), msgspec.json.encode(body))

    def obstacles(self, time: float, change: WorldChange) -> None:
        """Record that solid things were added, moved or removed, or robots added."""
        self._write(OBSTACLES, round(time * NANO), pack(change))

    def full(self, time: float) -> bool:
        """Whether it is time to begin the next part."""
        aged = time - self._began >= self._rotation.age
        return (aged or self._buffer.tell() >= self._rotation.size) and self.part < MAX_PARTS and not self.failed

    def turn(self, time: float) -> bool:
        """End this part and begin the next one at `time`; returns whether that worked. If not, this part is not split
        further."""
        file = part_file(self._first, self.part + 1)
        try:
            output = _create(file)
        except SleepcastError as error:
            self._rotation = ONE_FILE
            self._complain(f"{error}. The recording goes on in {self.file}")
            return False
        with self._lock:
            self._writer.add_metadata(FOLLOWING, {"file": file.name})
            self._end()
            if self.failed:
                output.close()
                file.unlink()
                return False
            self.file, self.part = file, self.part + 1
            self._begin(output, time)
        return True

    def close(self) -> None:
        """Write the rest and the index. Nothing can be recorded afterwards."""
        self._closing.set()
        self._saver.join()
        with self._lock:
            self._end()

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self.close()

    # ---- writing the file

    def _begin(self, output: FileIO, time: float) -> None:
        """Write what every part begins with."""
        self._output, self._buffer, self._began = output, _Buffer(), time
        chunk = int(min(CHUNK, self._rotation.size / CHUNKS_PER_PART))
        self._writer = Writer(self._buffer, chunk, CompressionType.LZ4)
        self._writer.start("", f"sleepcast {self._about['version']}")
        self._writer.add_metadata(ABOUT, self._about | {"part": str(self.part), "began": repr(time)})
        if 0 < len(self._start) <= MAX_START:
            self._writer.add_attachment(0, 0, SNAPSHOT, "application/msgpack", self._start)
        self._writer.add_attachment(0, 0, SCENARIO, "application/json", self._scenario)
        self._channels = {
            topic: self._register(topic, name, schema, SchemaEncoding.Protobuf, MessageEncoding.Protobuf)
            for topic, name, schema in (
                (POSES, foxglove.POSES, foxglove.POSES_SCHEMA),
                (POINTS, foxglove.POINTS, foxglove.POINTS_SCHEMA),
                (SCENE, SCENE_NAME, SCENE_SCHEMA),
                (GROUPS, SCENE_NAME, SCENE_SCHEMA),
                (LOG, foxglove.LOG, foxglove.LOG_SCHEMA),
            )
        }
        for topic, (own, fields) in self._schemas.items():
            self._channels[topic] = self._register(
                topic, f"sleepcast.{own}", written(fields), SchemaEncoding.JSONSchema, MessageEncoding.JSON
            )
        self._save()

    def _end(self) -> None:
        """Write what is left, and the index, and close the file."""
        if not self.failed:
            self._writer.finish()  # type: ignore[no-untyped-call]  # the library forgot to say `-> None`
            self._store()
        try:
            self._output.close()
        except OSError as error:  # some disks report only here that they are full
            if not self.failed:
                self.failed = True
                self._complain(f"the end of the recording {self.file} may be missing: {error.strerror or error}")

    def _register(self, topic: str, name: str, schema: bytes, schema_encoding: str, message_encoding: str) -> int:
        """The number of a new channel with this schema."""
        number = self._writer.register_schema(name, schema_encoding, schema)
        return self._writer.register_channel(topic, message_encoding, number)

    def _write(self, topic: str, stamp: int, data: bytes) -> None:
        with self._lock:
            if self.failed:
                return
            self._writer.add_message(self._channels[topic], stamp, data, stamp)
            if self._buffer.waiting:
                self._store()

    def _keep_saving(self) -> None:
        while not self._closing.wait(FLUSH_PERIOD):
            with self._lock:
                if not self.failed:
                    self._save()

    def _save(self) -> None:
        """Write everything recorded so far to the file."""
        self._writer.flush()  # type: ignore[no-untyped-call]  # the library forgot to say `-> None`
        self._store()

    def _store(self) -> None:
        """Append the buffer, which holds whole chunks, to the file; if that fails, the recording ends here."""
        data = self._buffer.take()
        start = self._output.tell()
        try:
            while data:
                data = data[self._output.write(data) :]
        except OSError as error:
            self.failed = True
            with suppress(OSError):  # else readers skip the incomplete chunk at the end
                os.ftruncate(self._output.fileno(), start)
            reason = error.strerror or str(error)
            if not start:
                with suppress(OSError):
                    self.file.unlink()
                self._complain(f"cannot record to {self.file}: {reason}. The run goes on; nothing of it is recorded")
                return
            self._complain(
                f"cannot record any further to {self.file}: {reason}. "
                "The run goes on; the recording holds what came before"
            )


class _Buffer(BytesIO):
    """Output of the MCAP writer that is not in the file yet; positions count from the start of the file."""

    def __init__(self) -> None:
        super().__init__()
        self._stored = 0

    @property
    def waiting(self) -> bool:
        return super().tell() > 0

    def tell(self) -> int:
        return self._stored + super().tell()

    def take(self) -> memoryview:
        data = self.getvalue()
        self._stored += len(data)
        self.seek(0)
        self.truncate()
        return memoryview(data)


def _create(file: Path) -> FileIO:
    try:
        return open(file, "xb", buffering=0)
    except FileExistsError:
        raise MisuseError(f"{file} already exists: choose another name") from None
    except OSError as error:
        raise RecordingError(f"cannot record to {file}: {error.strerror or error}") from None
