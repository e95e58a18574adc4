"""Recordings in several files, each of which stands for itself; solid things that change while a run is recorded."""

from __future__ import annotations

import json
import resource
from math import inf
from pathlib import Path

import pytest
from mcap.reader import make_reader

from cli.calling import LONGEST, called_warm
from console.running import Program, open_page
from sleepcast.api.assembly import assemble
from sleepcast.api.recording import RecordingPlan, recorded
from sleepcast.cli.streams import complain
from sleepcast.console.adapters.recording import load_timeline
from sleepcast.console.adapters.swarm import outlines
from sleepcast.core.errors import MisuseError
from sleepcast.simulator import Changes, Circle, Wall, find_scenario, load
from sleepcast.simulator.recording.recorder import Recorder, Rotation, part_file, read_rotation
from sleepcast.simulator.recording.recording import Recording, load_recording
from small_worlds import SCOUTS, write

MISSION = """
@1s (WHEN (> battery 50%) (JOIN full))
@2s (WHEN (IN full) (RULE turn (IF (> x 600m) (ST))))
@12s (WHEN (IN full) (DRIVE 2m/s 10deg/s))
"""


@pytest.fixture
def world(tmp_path: Path) -> Path:
    scenario = write(tmp_path)
    scenario.write_text('mission = "mission.sleep"\n' + scenario.read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / "mission.sleep").write_text(MISSION, encoding="utf-8")
    return tmp_path


@pytest.fixture
def parts(world: Path) -> list[Path]:
    """Twenty seconds in parts of six."""
    file = world / "run.mcap"
    done = called_warm("run", str(world), "--seconds", "20", "--quiet", "--record", str(file), "--record-rotate", "6s")
    assert (done.status, done.err) == (0, "")
    return sorted(world.glob("*.mcap"), key=lambda part: load_recording(part).part)


def test_a_part_follows_upon_the_other(parts: list[Path]) -> None:
    found = [load_recording(part) for part in parts]
    assert [part.name for part in parts] == ["run.mcap", "run-0002.mcap", "run-0003.mcap", "run-0004.mcap"]
    assert [each.part for each in found] == [1, 2, 3, 4]
    assert [each.began for each in found] == [0.0, 6.0, 12.0, 18.0]
    assert [each.following for each in found] == ["run-0002.mcap", "run-0003.mcap", "run-0004.mcap", ""]
    assert [each.seconds for each in found] == pytest.approx([6.0, 12.0, 18.0, 20.0], abs=1.0)
    assert all(each.complete for each in found)


def test_each_part_numbers_its_schemas_alike(parts: list[Path]) -> None:
    """Decoders of mcap-protobuf-support keep schemas by number, and take those of one file for those of the next."""
    numbered = []
    for part in parts:
        with part.open("rb") as stream:
            summary = make_reader(stream).get_summary()
        assert summary is not None
        numbered.append({number: schema.name for number, schema in summary.schemas.items()})
    assert len(numbered) == 4
    assert numbered.count(numbered[0]) == 4


def test_each_part_holds_what_went_before(parts: list[Path], world: Path) -> None:
    called_warm("run", str(world), "--seconds", "20", "--quiet", "--record", str(world / "whole.mcap"))
    whole, last = load_recording(world / "whole.mcap"), load_recording(parts[-1])
    assert last.posted == whole.posted
    assert last.accounting == whole.accounting
    assert last.states[200] == whole.states[200]
    timeline, wanted = load_timeline(last), load_timeline(whole)
    marks = timeline.marks_at(19.0)
    assert marks == wanted.marks_at(19.0)
    assert any(marks.groups)
    assert timeline.poses.at(19.0) == wanted.poses.at(19.0)
    assert {name: rules.at(19.0) for name, rules in timeline.rules.items()} == {
        name: rules.at(19.0) for name, rules in wanted.rules.items()
    }


def test_each_part_can_be_verified_by_itself_and_says_which_it_is(parts: list[Path]) -> None:
    for number, part in enumerate(parts, 1):
        done = called_warm("replay", str(part), "--verify", "--quiet")
        assert done.status == 0, done.out
        assert f"  part {number}: from {6 * (number - 1)} s on" in done.out
    told = json.loads(called_warm("replay", str(parts[1]), "--json").out)
    assert (told["part"], told["began"], told["following"]) == (2, 6.0, "run-0003.mcap")


def test_a_part_on_the_page_begins_where_it_begins(parts: list[Path]) -> None:
    with Program("replay", parts[2]) as program, open_page(program) as page:
        hello = page.news["hello"]
        assert (hello["began"], hello["part"]) == (12.0, 3)
        assert 17.0 <= hello["recorded"] <= 18.0
        page.until("commands", lambda found: len(found["rows"]) >= 2)
        page.tell("pace", running=False)
        page.tell("seek", time=0.0)
        page.until("groups", lambda found: [each["name"] for each in found["groups"]] == ["full"])


def test_parts_by_size_are_of_about_that_size(world: Path) -> None:
    options = ("--record-rotate", "100kB", "--record-pictures", "0.1", "--record-readings", "0.1")
    called_warm("run", str(world), "--seconds", "60", "--quiet", "--record", str(world / "run.mcap"), *options)
    *full, last = sorted(world.glob("run*.mcap"), key=lambda part: load_recording(part).part)
    assert len(full) >= 2
    assert all(90_000 < part.stat().st_size < 200_000 for part in full)
    assert called_warm("replay", str(last), "--verify", "--quiet").status == 0


def test_nothing_is_replaced_by_a_part(world: Path) -> None:
    (world / "run-0002.mcap").write_text("precious")
    done = called_warm("run", str(world), "--record", str(world / "run.mcap"), "--record-rotate", "6s")
    assert (done.status, done.out) == (2, "")
    assert "run-0002.mcap already exists" in done.err
    (world / "run-0002.mcap").rename(world / "run-0003.mcap")
    options = ("--seconds", "20", "--quiet", "--record", str(world / "run.mcap"), "--record-rotate", "6s")
    done = called_warm("run", str(world), *options)
    assert done.status == 0
    assert done.err.count("\n") == 1
    assert "run-0003.mcap already exists" in done.err
    assert f"The recording goes on in {world / 'run-0002.mcap'}" in done.err
    assert load_recording(world / "run-0002.mcap").seconds == 20.0
    assert (world / "run-0003.mcap").read_text() == "precious"


def test_a_disk_that_is_full_when_a_part_ends_leaves_no_empty_part(
    world: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("sleepcast.simulator.recording.recorder.FLUSH_PERIOD", LONGEST)  # nothing is saved in between
    said: list[str] = []
    file = world / "run.mcap"
    recorder = Recorder(file, load(world), 3, version="test", complain=said.append, rotation=Rotation(age=1.0))
    recorder.note("/sleepcast/state", 1.0, {"tick": 10, "hash": "first"})
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1, hard))
    try:
        assert recorder.full(1.0)
        assert not recorder.turn(1.0)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))
    recorder.close()
    assert recorder.failed
    assert len(said) == 1
    assert f"cannot record any further to {file}" in said[0]
    assert not (world / "run-0002.mcap").exists()


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("100MB", Rotation(1e8)),
        ("10min", Rotation(age=600.0)),
        ("1.5gb, 2h", Rotation(1.5e9, 7200.0)),
        ("90s,1min", Rotation(inf, 60.0)),
    ],
)
def test_when_a_part_is_full_can_be_said_in_bytes_and_in_time(text: str, wanted: Rotation) -> None:
    assert read_rotation(text) == wanted


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "write 100MB, 10min, or 100MB,10min"),
        ("100", "write 100MB"),
        ("10m", "write 100MB"),
        ("1e9MB", "write 100MB"),
        ("1kB", "after 100000 to 1e+12 bytes, not 1000"),
        ("0s", "after 1 to 1e+09 s, not 0"),
    ],
)
def test_anything_else_is_refused_in_words(text: str, words: str) -> None:
    with pytest.raises(MisuseError) as refusal:
        read_rotation(text)
    assert words in str(refusal.value)


def test_rotation_without_a_recording_is_refused(world: Path) -> None:
    done = called_warm("run", str(world), "--record-rotate", "6s")
    assert done.status == 2
    assert "add --record FILE" in done.err


def test_a_name_without_an_ending_gets_parts_too() -> None:
    assert part_file(Path("a/run"), 1) == Path("a/run")
    assert part_file(Path("a/run"), 12) == Path("a/run-0012")
    assert part_file(Path("a/run.x.mcap"), 2) == Path("a/run.x-0002.mcap")


# ---- solid things


@pytest.fixture
def changed(tmp_path: Path) -> Recording:
    """Forty Scouts among solid things that come, move and go; in parts of four seconds."""
    swarm, station = assemble(find_scenario("crowd", Changes(robots=40)), 5, mission=True)
    world, file = swarm.simulator.world, tmp_path / "run.mcap"
    first = world.add(Circle(5.0, 5.0, 0.4))
    with recorded(swarm, station, RecordingPlan(file, 0.5, 0.5, Rotation(age=4.0)), complain):
        swarm.run(2.0)
        number = world.add(Wall(((2.0, 2.0), (8.0, 2.0))))
        swarm.run(1.0)
        world.move(number, 0.0, 3.0)
        world.remove(first)
        world.remove(1)
        swarm.run(3.0)
        world.add(Circle(3.0, 9.0, 0.5))  # after the last tick: nobody has met it
    return load_recording(tmp_path / "run-0002.mcap")


def test_changes_of_the_world_are_recorded_and_repeated(changed: Recording) -> None:
    assert [(len(each.put), each.gone) for each in changed.obstacles] == [
        (1, ()),
        (1, ()),
        (1, (1, changed_first(changed))),
    ]
    done = called_warm("replay", str(changed.file), "--verify", "--quiet")
    assert done.status == 0, done.out
    assert "the same to the last bit" in done.out


EVENTS = """
[[world.circles]]
center = ["9m", "6m"]
radius = "50cm"
name = "ball"

[[events]]
at = "1s"
move = "ball"
by = ["-1m", "0m"]

[[events]]
at = "2s"
remove = "ball"
"""


def test_what_the_scenario_lets_happen_is_recorded_and_happens_once_when_it_is_repeated(tmp_path: Path) -> None:
    scenario = load(write(tmp_path, ("count = 1", "count = 9"), more=EVENTS, text=SCOUTS))
    swarm, station = assemble(scenario, None, mission=False)
    file = tmp_path / "run.mcap"
    with recorded(swarm, station, RecordingPlan(file, 0.1, 0.1), complain):
        swarm.run(0.9)
        swarm.simulator.world.add(Circle(3.0, 3.0, 0.3))  # in the tick in which the ball moves
        swarm.run(2.1)
    assert [(each.tick, each.own) for each in load_recording(file).obstacles] == [(10, False), (10, True), (20, True)]
    done = called_warm("replay", str(file), "--verify", "--quiet")
    assert done.status == 0, done.out
    timeline = load_timeline(load_recording(file))
    shown = timeline.obstacles.at(1.5)
    assert shown is not None
    assert outlines(Circle(8.0, 6.0, 0.5)) in shown.obstacles


def changed_first(recording: Recording) -> int:
    """The number of the first thing that was added."""
    (number,) = recording.obstacles[0].put
    return int(number)


def test_the_page_shows_what_was_solid_when(changed: Recording) -> None:
    earlier = load_recording(changed.file.with_name("run.mcap"))
    timeline, scene = load_timeline(earlier), load_timeline(earlier).scene.obstacles
    wall = Wall(((2.0, 2.0), (8.0, 2.0)))
    shown = timeline.obstacles.at(2.5)
    assert shown is not None
    assert shown.obstacles == (*scene, outlines(Circle(5.0, 5.0, 0.4)), outlines(wall))
    later = timeline.obstacles.at(3.5)
    assert later is not None
    assert later.obstacles == (*scene[1:], outlines(Wall(((2.0, 5.0), (8.0, 5.0)))))
    assert load_timeline(changed).obstacles.at(5.0) == timeline.obstacles.at(3.5)
    with Program("replay", changed.file) as program, open_page(program) as page:
        told = page.until("obstacles", lambda found: True)
        assert len(told["obstacles"]) == len(scene)
