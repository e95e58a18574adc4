"""Recordings from anywhere: whatever a file holds, it is read as far as it goes, or refused in a sentence."""

from __future__ import annotations

import json
import os
import struct
import time
from pathlib import Path

import lz4.frame
import msgspec
import pytest
import zstandard

from cli.calling import called, called_here
from sleepcast.channel import Kind, Message
from sleepcast.simulator import load
from sleepcast.simulator.packing import pack
from sleepcast.simulator.recording import recording as recording_module
from sleepcast.simulator.recording.recorder import ACCOUNTING, MAX_RECORD, POSTED, READINGS, RULES, STATE, Recorder
from sleepcast.simulator.recording.recording import NoRecordingError, RecordingError, load_recording
from sleepcast.simulator.scenario.scenario import Scenario
from small_worlds import write

CHUNK, ATTACHMENT = 6, 9
"""Sorts of records, as MCAP numbers them."""


@pytest.fixture
def scenario(tmp_path: Path) -> Scenario:
    return load(write(tmp_path).parent)


def recording(folder: Path, scenario: Scenario, *notes: tuple[str, object]) -> Path:
    """A recording of one state, and of these notes."""
    file = folder / "run.mcap"
    with Recorder(file, scenario, 3, version="0.0.9", complain=pytest.fail) as recorder:
        recorder.note(STATE, 0.0, {"tick": 0, "hash": "first"})
        for topic, body in notes:
            recorder.note(topic, 0.0, body)
    return file


def first(data: bytes, sort: int) -> int:
    """Where the first record of a sort begins."""
    at = 8
    while data[at] != sort:
        at += 9 + int.from_bytes(data[at + 1 : at + 9], "little")
    return at


def chunk(compression: bytes, size: int, data: bytes) -> bytes:
    body = struct.pack("<QQQI", 0, 0, size, 0) + struct.pack("<I", len(compression)) + compression
    body += struct.pack("<Q", len(data)) + data
    return bytes([CHUNK]) + struct.pack("<Q", len(body)) + body


ZEROS = bytes(3 * MAX_RECORD)


@pytest.mark.parametrize(
    ("name", "compressed"), [(b"lz4", lz4.frame.compress(ZEROS)), (b"zstd", zstandard.compress(ZEROS))]
)
@pytest.mark.parametrize("size", [1_000, 2**63 - 1])
def test_a_chunk_larger_than_it_says_is_the_end(
    tmp_path: Path, scenario: Scenario, name: bytes, compressed: bytes, size: int
) -> None:
    file = recording(tmp_path, scenario)
    data = file.read_bytes()
    at = first(data, CHUNK)
    file.write_bytes(data[:at] + chunk(name, size, compressed) + data[at:])
    found = load_recording(file)
    assert (found.complete, found.states) == (False, {})


@pytest.mark.parametrize("record", [bytes(9), b"\xf0" + bytes(8), b"\x05" + struct.pack("<Q", 22) + bytes(22)])
def test_a_few_bytes_that_unpack_to_millions_of_records_are_the_end(
    tmp_path: Path, scenario: Scenario, record: bytes
) -> None:
    file = recording(tmp_path, scenario)
    data = file.read_bytes()
    at = first(data, CHUNK)
    plain = record * (MAX_RECORD // len(record))
    file.write_bytes(data[:at] + chunk(b"zstd", len(plain), zstandard.compress(plain)) + data[at:])
    began = time.process_time()
    assert not load_recording(file).complete
    assert time.process_time() - began < 5.0, "read to the end, it takes 10 to 20 s"


def test_what_is_kept_of_a_recording_has_a_bound(
    tmp_path: Path, scenario: Scenario, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A megabyte may hold a gigabyte of accounts; the last one of each command counts."""
    account = {"text": "a" * 10_000}
    again = recording(tmp_path, scenario, *((ACCOUNTING, account | {"command": "desk/1"}) for _ in range(200)))
    monkeypatch.setattr(recording_module, "MAX_KEPT", 100_000)
    assert len(load_recording(again).accounting) == 1
    again.unlink()
    many = recording(tmp_path, scenario, *((ACCOUNTING, account | {"command": f"desk/{n}"}) for n in range(200)))
    with pytest.raises(NoRecordingError, match="holds more than 100000 bytes"):
        load_recording(many)


def test_a_chunk_compressed_by_another_program_is_read(tmp_path: Path, scenario: Scenario) -> None:
    file = recording(tmp_path, scenario)
    data = file.read_bytes()
    at = first(data, CHUNK)
    size = int.from_bytes(data[at + 1 : at + 9], "little")
    plain = lz4.frame.decompress(data[at + 9 + 28 + 4 + 3 + 8 : at + 9 + size])
    for name, packed in ((b"", plain), (b"zstd", zstandard.compress(plain))):
        file.write_bytes(data[:at] + chunk(name, len(plain), packed) + data[at + 9 + size :])
        assert load_recording(file).states == {0: "first"}


@pytest.mark.parametrize("length", [2**40, 2**62, 2**64 - 1])
def test_a_length_that_nothing_can_have_is_the_end(tmp_path: Path, scenario: Scenario, length: int) -> None:
    file = recording(tmp_path, scenario)
    data = file.read_bytes()
    at = first(data, ATTACHMENT) + 9 + 16 + 4 + len("scenario") + 4 + len("application/json")
    file.write_bytes(data[:at] + struct.pack("<Q", length) + data[at + 8 :])
    with pytest.raises(NoRecordingError, match="is not a sleepcast recording"):
        load_recording(file)


def changed(scenario: Scenario, *where: str, value: object) -> bytes:
    """The scenario as it is packed, with another value there."""
    plain = json.loads(pack(scenario))
    table = plain
    for name in where[:-1]:
        table = table[name]
    assert where[-1] in table
    table[where[-1]] = value
    return json.dumps(plain).encode()


@pytest.mark.parametrize(
    ("where", "value"),
    [
        (("robots", "geometry", "radius"), 1e308),
        (("robots", "geometry", "radius"), float("nan")),
        (("robots", "bumpers"), 10**9),
        (("robots", "count"), 10**12),
        (("robots", "wander", "steadiness"), -30.0),
        (("width",), -1.0),
        (("tick",), 0.0),
    ],
)
@pytest.mark.parametrize("options", [("--verify",), ("--no-browser", "--port", "0")])
def test_a_scenario_that_cannot_be_is_refused(
    tmp_path: Path,
    scenario: Scenario,
    where: tuple[str, ...],
    value: object,
    options: tuple[str, ...],
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    data = changed(scenario, *where, value=value)
    with monkeypatch.context() as patch:
        patch.setattr("sleepcast.simulator.recording.recorder.pack", lambda _: data)
        file = recording(tmp_path, scenario)
    done = called_here(capsys, "replay", str(file), *options)
    assert (done.status, done.out) == (2, "")
    assert str(file) in done.err


@pytest.mark.parametrize(
    ("topic", "data"),
    [(RULES, b'{"robot":"x","rules":[],"more":' + b'{"x":' * 100_000), (READINGS, b'{"x":[true]}')],
)
def test_what_the_page_cannot_show_is_refused_before_it_is_opened(
    tmp_path: Path, scenario: Scenario, topic: str, data: bytes
) -> None:
    file = tmp_path / "run.mcap"
    with Recorder(file, scenario, 3, version="0.0.9", complain=pytest.fail) as recorder:
        recorder._write(topic, 0, data)
    done = called("replay", str(file), "--no-browser", "--port", "0")
    assert (done.status, done.out) == (2, "")
    assert f"{topic} at 0 s cannot be shown" in done.err
    assert "Traceback" not in done.err


def test_where_nothing_was_compared_nothing_is_verified(tmp_path: Path, scenario: Scenario) -> None:
    """A run that was killed within its first half second has recorded no state."""
    file = recording(tmp_path, scenario)
    data = file.read_bytes()
    file.write_bytes(data[: first(data, CHUNK)])
    done = called("replay", str(file), "--verify")
    assert done.status == 1
    assert "not verified: the recording holds no state to compare with" in done.out
    assert json.loads(called("replay", str(file), "--verify", "--json").out)["verified"] == {
        "same": False,
        "compared": 0,
        "differs_from_tick": None,
    }


def test_a_pipe_is_refused_at_once(tmp_path: Path) -> None:
    """It would be waited for, and could be read only once."""
    os.mkfifo(tmp_path / "pipe")
    for file, why in ((tmp_path / "pipe", "that is no file"), (tmp_path, "Is a directory")):
        with pytest.raises(RecordingError, match=f"cannot read {file}: {why}"):
            load_recording(file)
    done = called("run", "--from", str(tmp_path / "pipe"))
    assert (done.status, done.out) == (2, "")
    assert done.err == f"cannot read the snapshot {tmp_path / 'pipe'}: that is no file\n"


def test_a_message_without_a_deadline_is_read_as_it_is_written_now_and_as_it_was_before(
    scenario: Scenario, tmp_path: Path
) -> None:
    message = Message("desk", 1, 2, Kind.COMMAND, 1.5, text="(MARK)", standing=True)
    file = tmp_path / "run.mcap"
    with Recorder(file, scenario, 3, version="0.0.9", complain=pytest.fail) as recorder:
        recorder.posted(1.5, 15, message)
        before = json.dumps({"tick": 16, "message": msgspec.to_builtins(message)})
        assert "Infinity" in before
        recorder._write(POSTED, 1_600_000_000, before.encode())
    assert [(each.tick, each.message) for each in load_recording(file).posted] == [(15, message), (16, message)]
