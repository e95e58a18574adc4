"""`sleepcast export`: recordings as files of other programs, and what is no recording refused with a sentence."""

from __future__ import annotations

import json
import resource
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from io import BytesIO
from pathlib import Path

import polars
import pytest
from hypothesis import given
from hypothesis import strategies as st
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from cli.calling import called_warm
from exporting.recorded import YARD, one_picture, recorded
from sleepcast.cli.export import COUNTED
from sleepcast.core.errors import SleepcastError
from sleepcast.exporting import FORMATS, export_recording, place_of
from sleepcast.simulator.recording import recorder
from sleepcast.simulator.recording.recorder import Recorder
from sleepcast.simulator.recording.recording import load_recording

TABLES = ("csv", "parquet", "ros2")
"""Formats that every computer can write that runs the tests."""


@pytest.fixture
def yard(tmp_path: Path) -> Path:
    """A recording of version 0.2.0, in a folder of its own."""
    file = tmp_path / "yard.mcap"
    file.write_bytes(YARD.read_bytes())
    return file


def beside(file: Path) -> set[str]:
    return {each.name for each in file.parent.iterdir()} - {file.name}


def test_the_formats_are_those_of_the_help() -> None:
    assert list(COUNTED) == list(FORMATS)
    said = called_warm("export", "--help").out
    assert all(f"  {to} " in said for to in FORMATS)


@pytest.mark.parametrize("to", TABLES)
def test_a_recording_of_0_2_0_is_exported_beside_itself(yard: Path, to: str) -> None:
    done = called_warm("export", str(yard), "--to", to)
    assert (done.status, done.out.count("\n")) == (0, 1)
    assert done.out.startswith(f"{yard.parent / f'yard-{to}'}: ")
    assert f"{COUNTED[to]}s of yard, 10 s" in done.out
    assert done.err.startswith("what is missing or otherwise:\n  ")
    assert beside(yard) == {f"yard-{to}"}
    done = called_warm("export", str(yard), "--to", to)
    assert (done.status, done.out) == (2, "")
    assert "already exists: choose another place with --out, or replace it with --force" in done.err
    assert called_warm("export", str(yard), "--to", to, "--force").status == 0


def test_it_says_what_was_written_as_one_object(yard: Path) -> None:
    place = yard.parent / "tables"
    done = called_warm("export", str(yard), "--to", "csv", "--out", str(place), "--only", "scout2", "--json")
    assert (done.status, done.err) == (0, "")
    told = json.loads(done.out)
    assert (told["place"], told["to"], told["scenario"], told["seed"]) == (str(place), "csv", "yard", 3)
    assert (told["began"], told["seconds"], told["complete"]) == (0.0, 10.0, True)
    rows = {each["name"]: each["rows"] for each in told["parts"]}
    assert (rows["robots"], rows["poses"], rows["commands"]) == (1, 11, 3)
    assert polars.read_csv(place / "poses.csv").height == 11
    assert any("hashes of the state" in each for each in told["left_out"])
    bag = json.loads(called_warm("export", str(yard), "--to", "ros2", "--json").out)
    types = {each["name"]: each["type"] for each in bag["parts"]}
    assert types["/scout1/pose"] == "geometry_msgs/msg/PoseStamped"


def test_of_a_cut_recording_all_that_is_complete_is_exported(yard: Path) -> None:
    yard.write_bytes(YARD.read_bytes()[:-3_000])
    done = called_warm("export", str(yard), "--to", "csv", "--json")
    assert done.status == 0
    told = json.loads(done.out)
    assert told["complete"] is False
    assert f"the recording was broken off: this is what came before, up to {told['seconds']:g} s" in told["left_out"]
    assert polars.read_csv(yard.parent / "yard-csv" / "poses.csv")["time"].max() == told["seconds"]


def test_a_part_says_what_lies_before_and_after_it(tmp_path: Path) -> None:
    def fill(recorder: Recorder) -> None:
        for time in (0.0, 5.0, 10.0):
            one_picture(recorder, time)
            if time < 10.0:
                recorder.turn(time + 1.0)

    recorded(tmp_path, fill)
    told = json.loads(called_warm("export", str(tmp_path / "run-0002.mcap"), "--to", "csv", "--json").out)
    assert "what came before 1 s: this is part 2 of a recording" in told["left_out"]
    assert "what comes after 5 s: it is in run-0003.mcap" in told["left_out"]


def emptied(file: Path) -> None:
    file.write_bytes(b"")


def cut_at_the_start(file: Path) -> None:
    file.write_bytes(YARD.read_bytes()[:500])


def not_a_recording(file: Path) -> None:
    file.write_text("time,x\n0,1\n")


def a_folder(file: Path) -> None:
    file.unlink()
    file.mkdir()


def gone(file: Path) -> None:
    file.unlink()


def of_the_future(file: Path) -> None:
    with file.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        writer.add_metadata("sleepcast", {"format": "2", "version": "9.1", "seed": "1"})
        writer.finish()  # type: ignore[no-untyped-call]


@pytest.mark.parametrize(
    ("spoil", "words"),
    [
        (emptied, "is not a sleepcast recording"),
        (cut_at_the_start, "is not a sleepcast recording"),
        (not_a_recording, "is not a sleepcast recording"),
        (a_folder, "cannot read"),
        (gone, "cannot read"),
        (of_the_future, "format 2, which is newer than this sleepcast"),
    ],
)
def test_what_is_no_recording_is_refused_and_leaves_nothing(
    yard: Path, spoil: Callable[[Path], None], words: str
) -> None:
    spoil(yard)
    done = called_warm("export", str(yard), "--to", "csv")
    assert (done.status, done.out) == (2, "")
    assert words in done.err
    assert done.err.count("\n") == 1
    assert beside(yard) == set()


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--to", "csv", "--only", "scout9"), 'no robot "scout9" was recorded (did you mean scout'),
        (("--to", "xls"), "'xls' is not one of"),
        ((), "Missing option '--to'"),
        (("--to", "rrd", "--out", "run.bag"), "run.bag: Rerun opens files that end in .rrd"),
        (("--to", "csv", "--out", "/no/such/place"), "there is no folder /no/such: make it"),
    ],
)
def test_what_is_asked_wrongly_is_refused_with_a_sentence(yard: Path, options: tuple[str, ...], words: str) -> None:
    done = called_warm("export", str(yard), *options)
    assert (done.status, done.out) == (2, "")
    assert words in done.err
    assert beside(yard) == set()


def test_the_recording_itself_is_never_replaced(yard: Path) -> None:
    before = yard.read_bytes()
    done = called_warm("export", str(yard), "--to", "csv", "--out", str(yard), "--force")
    assert done.status == 2
    assert "is the recording itself" in done.err
    renamed = yard.rename(yard.with_suffix(".rrd"))
    done = called_warm("export", str(renamed), "--to", "rrd", "--force")
    assert done.status == 2
    assert "is the recording itself" in done.err
    assert renamed.read_bytes() == before


@pytest.mark.parametrize("to", TABLES)
def test_a_full_disk_ends_it_with_a_sentence_and_leaves_nothing(yard: Path, to: str) -> None:
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1_000, hard))
    try:
        done = called_warm("export", str(yard), "--to", to)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert (done.status, done.out) == (1, "")
    assert f"cannot write {yard.parent / f'yard-{to}'}: " in done.err
    assert done.err.endswith("Nothing of it is left\n")
    assert beside(yard) == set()


PRESSED = """
import os, signal, sys
from sleepcast.exporting import tables
from sleepcast.cli import main

take, taken = tables.TableSink.take, []

def noisy(sink, event):
    take(sink, event)
    taken.append(event)
    if len(taken) == 20:
        os.kill(os.getpid(), signal.SIGINT)

tables.TableSink.take = noisy
sys.exit(main(["export", sys.argv[1], "--to", "csv"]))
"""


def test_ctrl_c_leaves_nothing(yard: Path) -> None:
    done = subprocess.run([sys.executable, "-c", PRESSED, str(yard)], capture_output=True, text=True, check=False)
    assert done.returncode == 128 + signal.SIGINT
    assert "Traceback" not in done.stderr
    assert beside(yard) == set()


def test_long_recordings_are_not_kept_in_memory(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ten times the chunks of a file take no more of it."""
    monkeypatch.setattr(recorder, "CHUNK", 10_000)

    def pictures(count: int) -> Callable[[Recorder], None]:
        def fill(into: Recorder) -> None:
            for tick in range(count):
                one_picture(into, 0.001 * tick)

        return fill

    most = []
    for count in (100, 1_000):
        recording = recorded(tmp_path / str(count), pictures(count))
        command = [sys.executable, "-c", PEAK, str(recording.file)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        most.append(int(done.stdout))
        assert polars.read_csv(recording.file.parent / "run-csv" / "poses.csv").height == 3 * count
    assert most[1] - most[0] < 200_000, most


PEAK = """
import sys, tracemalloc
from pathlib import Path
from sleepcast.exporting import export_recording, place_of
from sleepcast.simulator.recording.recording import load_recording
file = Path(sys.argv[1])
recording = load_recording(file)
tracemalloc.start()
export_recording(recording, "csv", place_of(file, "csv"))
print(tracemalloc.get_traced_memory()[1])
"""


FORMAT = st.sampled_from(("csv", "csv", "csv", "csv", "parquet", "ros2"))
"""A bag takes ten times as long as tables."""


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where damaged recordings lie, and what is exported of them beside them."""
    return tmp_path_factory.mktemp("damaged") / "run.mcap"


@given(data=st.data())
def test_damaged_files_are_exported_as_far_as_they_go_or_refused(run: Path, data: st.DataObject) -> None:
    whole = bytearray(YARD.read_bytes())
    for at in data.draw(st.lists(st.integers(0, len(whole) - 1), max_size=4)):
        whole[at] ^= 1 << data.draw(st.integers(0, 7))
    length = data.draw(st.integers(0, len(whole)))
    _exported_or_refused(run, bytes(whole[:length]), data.draw(FORMAT))


@given(data=st.data())
def test_messages_that_hold_anything_are_exported_or_refused(run: Path, data: st.DataObject) -> None:
    """Also where checksums are right: one message of the recording is changed, and the file written anew."""
    at, to = data.draw(st.integers(0, len(MESSAGES) - 1)), data.draw(FORMAT)
    topic, time, body = MESSAGES[at]
    noise = data.draw(
        st.binary(max_size=20) | st.sampled_from([b"1e400", b"-1", b"null", b"\\ud800", b"[]", b"9" * 30])
    )
    begin = data.draw(st.integers(0, len(body)))
    changed = body[:begin] + noise + body[begin + data.draw(st.integers(0, 20)) :]
    _exported_or_refused(run, _written([*MESSAGES[:at], (topic, time, changed), *MESSAGES[at + 1 :]]), to)


def _exported_or_refused(file: Path, content: bytes, to: str) -> None:
    file.write_bytes(content)
    with suppress(SleepcastError):
        only = ["scout2"] if to == "ros2" else ()  # each topic takes a while
        export_recording(load_recording(file), to, place_of(file, to), only=only, force=True)
    assert beside(file) <= {f"run-{each}" for each in TABLES}


def _messages() -> list[tuple[str, int, bytes]]:
    with YARD.open("rb") as stream:
        found = make_reader(stream).iter_messages(log_time_order=False)
        return [(channel.topic, message.log_time, message.data) for _, channel, message in found]


MESSAGES = _messages()


def _written(messages: list[tuple[str, int, bytes]]) -> bytes:
    """The recording with other messages."""
    out = BytesIO()
    writer = Writer(out, compression=CompressionType.NONE)
    writer.start()
    with YARD.open("rb") as stream:
        reader = make_reader(stream)
        for metadata in reader.iter_metadata():
            writer.add_metadata(metadata.name, metadata.metadata)
        for each in reader.iter_attachments():
            writer.add_attachment(each.create_time, each.log_time, each.name, each.media_type, each.data)
    channels = {topic: writer.register_channel(topic, "", 0) for topic in dict.fromkeys(m[0] for m in messages)}
    for topic, time, body in messages:
        writer.add_message(channels[topic], time, body, time)
    writer.finish()  # type: ignore[no-untyped-call]
    return out.getvalue()
