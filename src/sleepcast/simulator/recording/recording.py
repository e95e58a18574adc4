"""Reading recordings: what `recorder` wrote, even if the writing process was killed or the disk was full.

A file that ends early is read up to its last whole chunk. Recordings come from anywhere, so everything in them is
bounded and checked before it is used.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import field, replace
from io import BufferedReader
from pathlib import Path
from typing import TypeVar

import msgspec
from lz4.frame import LZ4FrameDecompressor
from mcap.exceptions import McapError
from mcap.records import Attachment, Channel, Chunk, Footer, McapRecord, Metadata
from mcap.records import Message as Record
from mcap.stream_reader import StreamReader, breakup_chunk
from zstandard import ZstdDecompressor, ZstdError

from sleepcast.channel import Message
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.core.files import open_file
from sleepcast.core.records import dataclass
from sleepcast.core.serial import SerialError
from sleepcast.simulator.packing import unpack
from sleepcast.simulator.recording.json_messages import RobotsBody
from sleepcast.simulator.recording.recorder import (
    ABOUT,
    ACCOUNTING,
    FOLLOWING,
    FORMAT,
    MAX_RECORD,
    NANO,
    OBSTACLES,
    POSTED,
    ROBOTS,
    SCENARIO,
    SNAPSHOT,
    STATE,
    RecordingError,
    WorldChange,
)
from sleepcast.simulator.scenario.robot_settings import MAX_TICKS
from sleepcast.simulator.scenario.scenario import Scenario
from sleepcast.simulator.snapshot import scenario_of

MAX_MESSAGES = 1_000_000
"""Messages of an operator, repeats included: one per second for eleven days."""

MAX_KEPT = 268_435_456
"""Bytes of what is kept of a recording while it is read: messages, accounts, states and obstacles. A file of a megabyte
may hold gigabytes of them, and a long run of a thousand commands holds a hundredth of this."""

LEAST_RECORDS = 10_000
"""Records that any chunk may have; a larger one may have as many as it has compressed bytes, since each record has its
own time, which takes more than a byte. So reading time grows with file size, even for compression bombs."""
RECORD_HEAD = 9
"""Bytes of a record's type and length."""

_BROKEN = (McapError, struct.error, ValueError, RuntimeError, EOFError, OverflowError, ZstdError)
"""Exceptions that a truncated or malformed file may cause."""


class UnreadableRecordingError(RecordingError):
    """A file that is not there, or cannot be read: its name is a mistake of the person who gave it."""

    exit_status = MisuseError.exit_status


class NoRecordingError(MisuseError):
    """The file is not a recording, or this version cannot read it."""


@dataclass(frozen=True, slots=True)
class Posted:
    """A message of the operator, and the tick in which it was sent."""

    tick: int
    message: Message


@dataclass(frozen=True, slots=True)
class RecordedEntry:
    """One message of the file. time: simulated s."""

    topic: str
    time: float
    data: bytes


@dataclass(slots=True)
class Recording:
    """A recorded run.

    version: of the program that recorded it
    part, began: number of this part, from 1, and the simulated time at which it begins, s
    following: file name of the next part, "" if this is the last
    first: the tick from which the run was resumed
    snapshot: of the swarm in that tick, empty if the run began with the scenario, or the snapshot was too large to
        record
    posted: in order, including earlier parts
    obstacles: likewise
    robots: who has come and gone
    states: hash of the state by tick
    accounting: the last account of each command by its id
    counts: messages by topic
    seconds: simulated time of the last message
    complete: whether the file was closed properly
    """

    file: Path
    version: str
    seed: int
    scenario: Scenario
    part: int = 1
    began: float = 0.0
    following: str = ""
    first: int = 0
    snapshot: bytes = b""
    posted: list[Posted] = field(default_factory=list)
    obstacles: list[WorldChange] = field(default_factory=list)
    robots: list[RobotsBody] = field(default_factory=list)
    states: dict[int, str] = field(default_factory=dict)
    accounting: dict[str, dict[str, object]] = field(default_factory=dict)
    counts: dict[str, int] = field(default_factory=dict)
    seconds: float = 0.0
    complete: bool = False


Body = TypeVar("Body")


def decoded(kind: type[Body], data: bytes) -> Body:
    """The body of an entry. Raises ValueError if it is of another type."""
    return msgspec.json.decode(data, type=kind)


def load_recording(file: Path) -> Recording:
    """The contents of `file`, without poses and readings. Raises NoRecordingError, RecordingError."""
    recording, kept_bytes = _start(file), dict[str, int]()
    for entry in entries(file, recording):
        try:
            _take(recording, entry, kept_bytes)
        except (ValueError, KeyError, TypeError, RecursionError) as error:  # msgspec's ValidationError is a ValueError
            raise NoRecordingError(f"{file}: {entry.topic} at {entry.time:g} s holds something else: {error}") from None
        stored = (recording.posted, recording.states, recording.accounting, recording.obstacles)
        if max(len(each) for each in stored) > MAX_MESSAGES:
            raise NoRecordingError(f"{file} holds more than {MAX_MESSAGES} messages of an operator, or states")
        if kept_bytes.get("", 0) > MAX_KEPT:
            raise NoRecordingError(f"{file} holds more than {MAX_KEPT} bytes of messages, accounts and states")
    return recording


def _take(recording: Recording, entry: RecordedEntry, stored_bytes: dict[str, int]) -> None:
    """Store the contents of an entry, if its topic is used here. stored_bytes: "" for all, and by command, since only
    its last account is stored."""
    if entry.topic in (OBSTACLES, POSTED, STATE, ROBOTS):
        stored_bytes[""] = stored_bytes.get("", 0) + len(entry.data)
    if entry.topic == OBSTACLES:
        change = unpack(WorldChange, entry.data)
        if not all(name.isascii() and name.isdigit() and len(name) < 20 for name in change.put):
            raise ValueError("a solid thing without a number")
        recording.obstacles.append(change)
    if entry.topic == ROBOTS:
        recording.robots.append(decoded(RobotsBody, entry.data))
    if entry.topic == ACCOUNTING:
        account = decoded(dict[str, object], entry.data)
        command = str(account["command"])
        stored_bytes[""] = stored_bytes.get("", 0) + len(entry.data) - stored_bytes.get(f"={command}", 0)
        stored_bytes[f"={command}"] = len(entry.data)
        recording.accounting[command] = account
    if entry.topic not in (POSTED, STATE):
        return
    body = json.loads(entry.data)
    if entry.topic == POSTED:
        recording.posted.append(Posted(_tick(body), msgspec.convert(body["message"], Message)))
    else:
        recording.states[_tick(body)] = str(body["hash"])


def _tick(body: dict[str, object]) -> int:
    tick = body["tick"]
    if not (isinstance(tick, int) and 0 <= tick <= MAX_TICKS):
        raise ValueError(f"tick {str(tick)[:40]} does not lie in 0..{MAX_TICKS}")
    return tick


def entries(file: Path, recording: Recording) -> Iterator[RecordedEntry]:
    """Every message of `file` in order, up to its end or to where it breaks off; counted in `recording`."""
    topics: dict[int, str] = {}
    recording.counts, recording.complete = {}, False
    for record in _records(file):
        if isinstance(record, Channel):
            topics[record.id] = record.topic
        elif isinstance(record, Metadata) and record.name == FOLLOWING:
            recording.following = record.metadata.get("file", "")
        elif isinstance(record, Footer):
            recording.complete = True
        elif isinstance(record, Record) and (topic := topics.get(record.channel_id)) is not None:
            recording.counts[topic] = recording.counts.get(topic, 0) + 1
            recording.seconds = max(recording.seconds, record.log_time / NANO)
            yield RecordedEntry(topic, record.log_time / NANO, record.data)


def _start(file: Path) -> Recording:
    """Read the metadata and attachments before the first message."""
    about: dict[str, str] | None = None
    snapshot = b""
    for record in _records(file):
        if isinstance(record, Metadata) and record.name == ABOUT:
            about = record.metadata
            _check_format(file, about)
        elif isinstance(record, Attachment) and record.name == SNAPSHOT:
            snapshot = record.data
        elif isinstance(record, Attachment) and record.name == SCENARIO and about is not None:
            first = _whole(about, "from_tick") if "from_tick" in about else 0
            scenario, version, seed = _scenario(file, record.data), about.get("version", "?"), _whole(about, "seed")
            part, began = _whole(about, "part"), _time(about, "began")
            return Recording(file, version, seed, scenario, part, began, first=first, snapshot=snapshot)
        elif isinstance(record, Record):
            break
    raise NoRecordingError(f"{file} is not a sleepcast recording: make one with run SCENARIO --record FILE")


def _check_format(file: Path, about: dict[str, str]) -> None:
    version = _whole(about, "format")
    if version > FORMAT:
        by = about.get("version", "a newer one")
        raise NoRecordingError(
            f"{file} has format {version}, which is newer than this sleepcast, which reads format {FORMAT}: "
            f"update sleepcast (the file was recorded by version {by})"
        )


def _whole(about: dict[str, str], name: str) -> int:
    text = about.get(name, "")
    if not (text.isascii() and text.isdigit() and len(text) < 20):
        raise NoRecordingError(f'the recording says {name} "{text[:40]}", wanted a whole number')
    return int(text)


def _time(about: dict[str, str], name: str) -> float:
    text = about.get(name, "")
    try:
        seconds = float(text)
    except ValueError:
        seconds = -1.0
    if not 0.0 <= seconds < float("inf"):
        raise NoRecordingError(f'the recording says {name} "{text[:40]}", wanted seconds')
    return seconds


def _scenario(file: Path, data: bytes) -> Scenario:
    try:
        return scenario_of(data)
    except SerialError as error:
        raise NoRecordingError(f"{file}: {error}") from None


@contextmanager
def alive(recording: Recording) -> Iterator[None]:
    """Guards the reconstruction of the recorded swarm: raises NoRecordingError if it fails, because the contents of a
    file may be inconsistent."""
    try:
        yield
    except SleepcastError:
        raise
    except (ValueError, TypeError, LookupError, ArithmeticError, AttributeError, RecursionError, MemoryError) as error:
        reason = str(error).split("\n")[0][:300] or type(error).__name__
        raise NoRecordingError(f"{recording.file}: the scenario in it cannot be simulated: {reason}") from error


def _records(file: Path) -> Iterator[McapRecord]:
    """Every record, including those in chunks, up to the end or to where the file breaks off."""
    try:
        with _Bounded(open_file(file)) as stream:
            yield from _whole_records(stream)
    except OSError as error:
        raise UnreadableRecordingError(f"cannot read {file}: {error.strerror or error}") from None


class _Bounded(BufferedReader):
    """A file that returns no more bytes at once than a record may have, whatever lengths it states."""

    def read(self, size: int | None = -1, /) -> bytes:
        if size is None or not 0 <= size <= MAX_RECORD:
            raise EOFError(f"a length of {size}")
        return super().read(size)


def _whole_records(stream: _Bounded) -> Iterator[McapRecord]:
    reader = iter(StreamReader(stream, emit_chunks=True, record_size_limit=MAX_RECORD).records)
    while True:
        try:
            record = next(reader, None)
            parts = breakup_chunk(_opened(record), validate_crc=True) if isinstance(record, Chunk) else [record]
        except _BROKEN:
            return
        for part in parts:
            if part is None:
                return
            yield part


def _check_count(data: bytes, most: int) -> None:
    """Raises ValueError for more than `most` records: a few kB of zeros could become millions."""
    at = 0
    for _ in range(most):
        if at >= len(data):
            return
        at += RECORD_HEAD + int.from_bytes(data[at + 1 : at + RECORD_HEAD], "little")
    if at < len(data):
        raise ValueError(f"a chunk of more than {most} records")


def _opened(chunk: Chunk) -> Chunk:
    """The chunk uncompressed. Raises ValueError if its size is not what it states: a few bytes of zeros could become
    gigabytes."""
    size = chunk.uncompressed_size
    if size > MAX_RECORD:
        raise ValueError(f"a chunk of {size} bytes, at most {MAX_RECORD} are read")
    if chunk.compression == "lz4":
        data = LZ4FrameDecompressor().decompress(chunk.data, max_length=size + 1)
    elif chunk.compression == "zstd":
        with ZstdDecompressor().stream_reader(chunk.data) as stream:
            data = stream.read(size + 1)
    else:
        data = chunk.data
    if len(data) != size:
        raise ValueError(f"a chunk that says {size} bytes and has others")
    _check_count(data, max(LEAST_RECORDS, len(chunk.data)))
    return replace(chunk, compression="", data=data)
