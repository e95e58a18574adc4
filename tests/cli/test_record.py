"""Recording a run and reading it again: the same run, also after a kill, a full disk, or in another process."""

from __future__ import annotations

import json
import os
import resource
import signal
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import msgspec
import numpy as np
import pytest
from mcap.exceptions import EndOfFile, McapError
from mcap.reader import NonSeekingReader, make_reader
from mcap.writer import Writer

from cli.calling import Called, called, called_warm
from console.running import PATIENCE, Program, open_page
from sleepcast.cli import replay
from sleepcast.cli.interrupts import Interrupts
from sleepcast.console.adapters.recording import load_timeline
from sleepcast.loop import Swarm
from sleepcast.simulator import load
from sleepcast.simulator.recording.foxglove import read_poses
from sleepcast.simulator.recording.json_messages import RuleBody
from sleepcast.simulator.recording.recorder import Recorder
from sleepcast.simulator.recording.recording import Recording, entries, load_recording
from small_worlds import write

MISSION = """
@1s (WHEN (> battery 50%) (JOIN full))
@2s (WHEN (IN full) (DRIVE 2m/s 10deg/s) (TK "off we go") (REPORT "left with" battery))
@3s (WHEN (IN full) (RULE turn (IF (> x 600m) (ST)) :priority 2))
"""


TOLD = ("/poses", "/readings")


def small_world(folder: Path) -> Path:
    """A small world with a mission and a bad radio."""
    file = write(folder, ('delay = "0s"', 'delay = "0.1s"\nloss = 0.2'))
    file.write_text('mission = "mission.sleep"\n' + file.read_text(encoding="utf-8"), encoding="utf-8")
    (folder / "mission.sleep").write_text(MISSION, encoding="utf-8")
    return folder


@pytest.fixture
def world(tmp_path: Path) -> Path:
    return small_world(tmp_path)


def record(world: Path, *options: str, seconds: str = "20") -> Called:
    return called_warm("run", str(world), "--seconds", seconds, "--json", "--record", str(world / "run.mcap"), *options)


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A small world with a whole recording of it."""
    world = small_world(tmp_path_factory.mktemp("recorded"))
    assert record(world).status == 0
    return world


def bodies(recording: Recording, topic: str) -> Iterator[dict[str, object]]:
    for entry in entries(recording.file, recording):
        if entry.topic == topic:
            yield json.loads(entry.data)


def test_a_recorded_run_is_the_same_run_and_can_be_repeated(world: Path) -> None:
    plain = json.loads(called_warm("run", str(world), "--seconds", "20", "--json").out)
    done = record(world)
    assert (done.status, done.err) == (0, "")
    outcome = json.loads(done.out)
    assert outcome["state_hash"] == plain["state_hash"]
    found = called("replay", str(world / "run.mcap"), "--verify", "--json")
    assert (found.status, found.err) == (0, "")
    told = json.loads(found.out)
    assert told["verified"] == {"same": True, "compared": 3, "differs_from_tick": None}
    assert told["state_hash"] == plain["state_hash"]
    assert told["complete"] is True
    assert (told["scenario"], told["seed"], told["robots"], told["seconds"]) == (world.name, 3, 20, 20.0)
    assert [each["tick"] for each in told["messages"]] == [10, 20, 30]
    none = {"unknown": 0, "held": 0}  # which a recording leaves out
    rows = [none | row for row in told["accounting"]]
    wanted = [{name: row[name] for name in row if name not in ("command", "predicted")} for row in rows]
    assert wanted == plain["accounting"]


def test_another_seed_and_number_of_robots_are_in_the_recording(world: Path) -> None:
    assert record(world, "--seed", "11", "--robots", "7", seconds="5").status == 0
    told = json.loads(called_warm("replay", str(world / "run.mcap"), "--verify", "--json").out)
    assert (told["seed"], told["robots"], told["verified"]["same"]) == (11, 7, True)


def test_pictures_fall_on_the_first_tick_at_each_multiple(world: Path) -> None:
    assert record(world, "--record-pictures", "0.25", "--record-readings", "0.5", seconds="1.2").status == 0
    recording = load_recording(world / "run.mcap")
    times = {
        topic: [entry.time for entry in entries(recording.file, recording) if entry.topic == topic] for topic in TOLD
    }
    assert times["/poses"] == pytest.approx([0.0, 0.3, 0.5, 0.8, 1.0, 1.2])  # the end is seen in any case
    assert times["/readings"][:3] == pytest.approx([0.0, 0.5, 1.0])


def test_pictures_readings_and_lines_are_there_at_the_rates_asked_for(world: Path) -> None:
    assert record(world, "--record-pictures", "1", "--record-readings", "4").status == 0
    recording = load_recording(world / "run.mcap")
    times = [entry.time for entry in entries(recording.file, recording) if entry.topic == "/poses"]
    assert times == [float(second) for second in range(21)]
    readings = list(bodies(recording, "/readings"))
    assert len(readings) == 6
    poses = [e.data for e in entries(recording.file, recording) if e.topic == "/poses" and e.time % 4 == 0]
    for data, row in zip(poses, readings, strict=True):
        np.testing.assert_allclose(read_poses(data, 20)[:, 0], row["x"], rtol=1e-6)
    log = b"".join(entry.data for entry in entries(recording.file, recording) if entry.topic == "/log")
    for line in (b"off we go", b"left with", b"(JOIN full)", b"active rules: turn", b"matched"):
        assert line in log
    rules = list(bodies(recording, "/rules"))
    assert rules
    assert rules[0]["rules"] == [{"name": "turn", "text": "(IF (> x 600m) (ST))", "active": True, "priority": 2}]
    shown = load_timeline(load_recording(world / "run.mcap")).rules[str(rules[0]["robot"])].at(20.0)
    assert [(rule.name, rule.priority) for rule in shown] == [("turn", 2)]
    assert b"priority" not in msgspec.json.encode(RuleBody("turn", "1", True)), "as a recording of 0.2.0 has it"
    full = sum(each["matched"] for each in recording.accounting.values() if "JOIN" in str(each["text"]))  # type: ignore[misc]
    marks = list(bodies(recording, "/sleepcast/marks"))[-1]
    assert marks["names"] == ["full"]
    assert 0 < full < 20


def test_other_programs_can_read_it(recorded: Path) -> None:
    with (recorded / "run.mcap").open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    assert summary.statistics is not None
    schemas = {
        summary.channels[key].topic: summary.schemas[summary.channels[key].schema_id] for key in summary.channels
    }
    assert (schemas["/poses"].name, schemas["/poses"].encoding) == ("foxglove.PosesInFrame", "protobuf")
    assert (schemas["/points"].name, schemas["/points"].encoding) == ("foxglove.PointCloud", "protobuf")
    assert (schemas["/log"].name, schemas["/log"].encoding) == ("foxglove.Log", "protobuf")
    for topic in ("/scene", "/groups"):
        assert (schemas[topic].name, schemas[topic].encoding) == ("foxglove.SceneUpdate", "protobuf")
    # Rerun draws what is protobuf, and takes what is JSON for bytes (docs/counterparts.md).
    plain = {topic for topic, schema in schemas.items() if schema.encoding == "jsonschema"}
    assert plain.isdisjoint({"/poses", "/points", "/scene", "/groups", "/log"})
    assert "/readings" in plain
    assert (schemas["/sleepcast/marks"].name, schemas["/sleepcast/marks"].encoding) == ("sleepcast.Marks", "jsonschema")
    assert summary.statistics.message_start_time == 0
    assert summary.statistics.message_end_time == 20_000_000_000


def test_killed_in_mid_run_the_file_is_readable_up_to_its_last_second(world: Path) -> None:
    file = world / "run.mcap"
    options = ("--page", "--speed", "20", "--record", str(file), "--record-pictures", "0.1")
    with Program("run", world, *options) as program, open_page(program) as page:
        while (tick := int.from_bytes(page.frame()[12:16], "little")) < 400:
            pass
        assert program.wait(signal.SIGKILL) == -signal.SIGKILL
    recording = load_recording(file)
    assert not recording.complete
    assert recording.seconds >= tick * 0.1 - 20.0, "the last second at twenty times real time"
    told = called_warm("replay", str(file), "--verify")
    assert told.status == 0
    assert "ends early" in told.out
    assert "the same to the last bit" in told.out


def test_paused_on_the_page_nothing_recorded_waits_in_memory(world: Path) -> None:
    file = world / "run.mcap"
    with Program("run", world, "--page", "--speed", "5", "--record", file) as program, open_page(program) as page:
        page.ask("send", text="(WHEN (> battery 30%) (JOIN some))", everybody=True)
        # Until the first tick, which waits for the kernels, nothing goes on the air.
        page.wait_for("commands", lambda found: any(row["matched"] for row in found["rows"]))
        page.tell("pace", running=False)
        deadline = time.monotonic() + PATIENCE
        while not (found := load_recording(file)).posted and time.monotonic() < deadline:
            time.sleep(0.1)
        assert [each.message.text for each in found.posted] == ["(WHEN (> battery 30%) (JOIN some))"]
    found = load_recording(file)
    assert found.complete, "Ctrl-C ends a recording in good order"
    assert called_warm("replay", str(file), "--verify").status == 0


def test_a_full_disk_ends_the_recording_with_a_sentence_and_not_the_run(world: Path) -> None:
    file = world / "run.mcap"
    most = 40_000
    command = [sys.executable, "-m", "sleepcast", "run", str(world), "--seconds", "200", "--json"]
    done = subprocess.run(
        [*command, "--record", str(file), "--record-pictures", "0.1"],
        preexec_fn=lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (most, most)),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 1
    assert "cannot record any further to" in done.stderr
    assert done.stderr.count("\n") == 1
    assert json.loads(done.stdout)["seconds"] == 200.0
    assert file.stat().st_size <= most
    assert load_recording(file).version, "what was written is still a recording"


def test_a_recording_that_cannot_begin_leaves_no_file(world: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Neither on a disk that is full from the start, nor where something else prevents it."""
    said: list[str] = []
    file = world / "run.mcap"
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (0, hard))
    try:
        with Recorder(file, load(world), 3, version="test", complain=said.append) as recorder:
            assert recorder.failed
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert said == [f"cannot record to {file}: File too large. The run goes on; nothing of it is recorded"]
    assert not file.exists()
    monkeypatch.setattr(Recorder, "_save", lambda _: 1 / 0)
    with pytest.raises(ZeroDivisionError):
        Recorder(file, load(world), 3, version="test", complain=said.append)
    assert not file.exists()


def test_a_chunk_that_went_in_before_the_disk_was_full_is_kept(world: Path) -> None:
    said: list[str] = []
    file = world / "run.mcap"
    recorder = Recorder(file, load(world), 3, version="test", complain=said.append)
    recorder.note("/sleepcast/state", 1.0, {"tick": 10, "hash": "first"})
    while os.path.getsize(file) < 2_500:
        time.sleep(0.05)
    before = load_recording(file).states
    while not before:
        time.sleep(0.05)
        before = load_recording(file).states
    size = file.stat().st_size
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size + 20, hard))
    try:
        recorder.note("/sleepcast/state", 2.0, {"tick": 20, "hash": "second" * 50})
        recorder.close()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    assert recorder.failed
    assert len(said) == 1
    assert file.stat().st_size == size, "half a chunk was taken off again"
    assert load_recording(file).states == {10: "first"}


def test_nothing_is_replaced_and_what_cannot_be_written_is_told_before_the_run(world: Path) -> None:
    kept = world / "run.mcap"
    kept.write_text("precious")
    done = record(world)
    assert (done.status, done.out) == (2, "")
    assert "already exists" in done.err
    assert kept.read_text() == "precious"
    done = called_warm("run", str(world), "--record", str(world / "no" / "such.mcap"))
    assert (done.status, done.out) == (1, "")
    assert "cannot record to" in done.err


def test_rates_without_a_recording_are_refused(world: Path) -> None:
    done = called_warm("run", str(world), "--record-pictures", "1")
    assert done.status == 2
    assert "add --record FILE" in done.err


def rewritten(file: Path, **about: str) -> Path:
    """A file that says of itself what a recording says, and nothing else."""
    with file.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        writer.add_metadata("sleepcast", {"format": "1", "version": "9.1", "seed": "1"} | about)
        writer.finish()  # type: ignore[no-untyped-call]
    return file


@pytest.mark.parametrize(
    ("about", "words"),
    [
        ({"format": "2"}, "format 2, which is newer than this sleepcast"),
        ({"format": "x"}, "wanted a whole number"),
        ({}, "is not a sleepcast recording"),
    ],
)
def test_a_file_of_a_newer_format_or_of_somebody_else_is_refused(
    tmp_path: Path, about: dict[str, str], words: str
) -> None:
    done = called_warm("replay", str(rewritten(tmp_path / "x.mcap", **about)), "--headless")
    assert done.status == 2
    assert words in done.err
    assert "Traceback" not in done.err


@pytest.mark.parametrize("size", [0, 7, 30, 500, 3_000])
def test_half_a_file_is_read_as_far_as_it_goes_or_refused(recorded: Path, tmp_path: Path, size: int) -> None:
    whole = (recorded / "run.mcap").read_bytes()
    half = tmp_path / "half.mcap"
    half.write_bytes(whole[:size])
    done = called_warm("replay", str(half), "--headless")
    assert done.status in (0, 2)
    assert "Traceback" not in done.err
    half.write_bytes(whole[:-size] if size else whole)
    assert called_warm("replay", str(half), "--headless").status == 0


def test_what_the_library_of_mcap_reads_of_half_a_file(recorded: Path, tmp_path: Path) -> None:
    """As the page on recordings says: nothing, unless it reads from the start and not in the order of time."""
    half = tmp_path / "half.mcap"
    half.write_bytes((recorded / "run.mcap").read_bytes()[:-50])
    with half.open("rb") as stream, pytest.raises(McapError):
        next(make_reader(stream).iter_messages())
    torn = (EndOfFile, struct.error)
    with half.open("rb") as stream, pytest.raises(torn):
        next(NonSeekingReader(stream).iter_messages())
    topics = set[str]()
    with half.open("rb") as stream, suppress(*torn):
        for _, channel, _ in NonSeekingReader(stream).iter_messages(log_time_order=False):
            topics.add(channel.topic)
    assert topics >= {"/poses", "/readings", "/log"}


def test_a_recording_that_does_not_repeat_is_told(recorded: Path, tmp_path: Path) -> None:
    file = tmp_path / "forged.mcap"
    with Recorder(file, load(recorded), 3, version="0.0.9", complain=pytest.fail) as recorder:
        recorder.note("/sleepcast/state", 0.0, {"tick": 0, "hash": load_recording(recorded / "run.mcap").states[0]})
        recorder.note("/sleepcast/state", 1.0, {"tick": 10, "hash": "another"})
    done = called_warm("replay", str(file), "--verify")
    assert done.status == 1
    assert "the state differs from tick 10 on; recorded by version 0.0.9" in done.out


def test_what_robots_say_does_not_gather_while_a_run_is_verified(world: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a run goes on from a snapshot nobody sits at the desk then; a large swarm that reports in every tick would
    fill the memory."""
    assert called_warm("run", str(world), "--seconds", "1", "--snapshot", str(world / "one.snap")).status == 0
    onward = ("--from", str(world / "one.snap"), "--seconds", "5", "--record", str(world / "run.mcap"))
    assert called_warm("run", *onward).status == 0
    swarms: list[Swarm] = []
    begin = replay._beginning

    def beginning(recording: Recording) -> Swarm:
        swarms.append(begin(recording))
        return swarms[-1]

    monkeypatch.setattr(replay, "_beginning", beginning)
    assert replay._verify(Interrupts(), load_recording(world / "run.mcap"), quiet=True).same
    (swarm,) = swarms
    assert swarm.radio.counts.delivered > 0
    assert swarm.radio.hear() == []
