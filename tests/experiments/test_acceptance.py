"""Tests that are saved from a session and run again."""

from __future__ import annotations

import sys
import tracemalloc
import warnings
import zipfile
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

import forkserver
import sleepcast as sc
from sleepcast.core.errors import MisuseError
from sleepcast.experiments.acceptance import read_test, run_test
from sleepcast.experiments.measures import read_measure
from sleepcast.simulator.world.world import Circle
from small_worlds import write

RADIO = ('delay = "0s"', 'delay = "0.25s"\njitter = "0.3s"\nloss = 0.2')


def played(folder: Path) -> sc.SimulatedFleet:
    """A session on a bad radio, with every sort of command."""
    write(folder, RADIO)
    fleet = sc.open(folder, seed=11, robots=30, threads=1, over={"robots.limits.speed": "4m/s"})
    fleet.run(1.3, quiet=True)
    fleet.send("(WHEN (> battery 60%)\n  (JOIN crew))", wait=0)
    fleet.run(0.7, quiet=True)
    fleet.send("(RULE roam (WHEN (IN crew) (GOTO 1m 1m)))", standing=True, everybody=True, wait=0)
    fleet.ask("battery", only=["rover1", "rover2"], wait=1.0)
    fleet.run(0.9, quiet=True)
    fleet.stop(wait=1.7)
    fleet.send("(WHEN (IN crew) (DRIVE 1 0))", wait=0.4)
    fleet.release(wait=1.0)
    fleet.send("(WHEN (IN crew) (MARK))", but=["rover3"], deadline=2.0, wait=0)
    fleet.run(3.1, quiet=True)
    return fleet


def test_a_session_repeats_bit_for_bit(tmp_path: Path) -> None:
    with played(tmp_path) as fleet:
        saved = fleet.save_test(tmp_path / "again", counts=["(IN crew)"], goals=["mean x >= 0"], exact=True)
        hashed = fleet.hash
    verdict = run_test(read_test(saved), threads=1)
    assert verdict.missed == ()
    assert verdict.state == hashed
    assert len(verdict.counts) == 7
    mission = (saved / "mission.sleep").read_text()
    for words in ("standing (RULE", "ask only rover1,rover2 battery", "STOP", "RELEASE", "within 2.0s but rover3"):
        assert words in mission


def test_a_changed_expectation_fails_with_a_sentence(tmp_path: Path) -> None:
    with played(tmp_path) as fleet:
        saved = fleet.save_test(tmp_path / "again", counts=["(IN crew)"])
        members = len(fleet.groups["crew"])
    mission, file = saved / "mission.sleep", saved / "test.toml"
    text = mission.read_text()
    first = int(text.partition("= matched ")[2].partition(",")[0])
    mission.write_text(text.replace(f"= matched {first},", "= matched at least 29,", 1))
    file.write_text(file.read_text().replace(f"== {members}", f"== {members + 1}"))
    command = [sys.executable, "-m", "sleepcast", "run", str(saved), "--quiet"]
    done = forkserver.run(command, capture_output=True, text=True)
    assert done.returncode == 1, done.stderr
    assert done.stdout.startswith("again: not yet\n")
    assert f"(WHEN (> battery 60%) (JOIN crew)): wanted matched at least 29, but it was {first}" in done.stdout
    assert f"wanted count (IN crew) == {members + 1}, but it was {members} at" in done.stdout
    assert run_test(read_test(saved), threads=1).to_dict()["passed"] is False


@pytest.mark.parametrize(("when", "missed"), [("once", 0), ("always", 1)])
def test_a_goal_is_looked_at_on_every_tick(tmp_path: Path, when: str, missed: int) -> None:
    with sc.open("stop", robots=3, threads=1) as fleet:
        saved = fleet.run(2.0, quiet=True).save_test(tmp_path / "again")
    brief = "count (< 1.25s time 1.35s)"
    goal = f"{brief} >= 1" if when == "once" else f"{brief} <= 0"
    with (saved / "test.toml").open("a") as file:
        file.write(f'[[goals]]\nholds = "{goal}"\nwhen = "{when}"\n')
    found = run_test(read_test(saved), threads=1).missed
    assert len(found) == missed
    assert all("but it was 3 at 1.3 s" in each for each in found)


def test_what_is_true_is_what_the_language_says(tmp_path: Path) -> None:
    """Every number but 0; of these, only those above 0 were counted."""
    with sc.open("bravo", robots=4, threads=1) as fleet:
        fleet.run(1.5, quiet=True)
        for text, true in (("(- 0 1)", 4), ("(- id 1)", 3), ("(- 0 id)", 4), ("(- id id)", 0), ("(/ 1 0)", 0)):
            assert len(fleet.preview(f"(WHEN {text} (MARK))").yes) == true
            assert read_measure(f"count {text}")(fleet) == true
            assert read_measure(f"share {text}")(fleet) == true / 4
        assert read_measure("largest_cluster 200mi (- 0 id)")(fleet) == 1.0
        saved = fleet.save_test(tmp_path / "again", counts=["(- 0 id)"])
    assert 'holds = "count (- 0 id) == 4"' in (saved / "test.toml").read_text(encoding="utf-8")


def test_a_zip_file_is_read_as_well(tmp_path: Path) -> None:
    with sc.open("bravo", robots=20, threads=1) as fleet:
        fleet.run(0.3, quiet=True)
        fleet.send("(WHEN (> fuel 50%) (MARK))", wait=0.5)
        saved = fleet.save_test(tmp_path / "again", counts=["marked"])
    with zipfile.ZipFile(tmp_path / "other.zip", "w") as archive:
        for file in saved.iterdir():
            archive.write(file, f"again/{file.name}")
    test = read_test(tmp_path / "other.zip")
    assert (test.name, run_test(test, threads=1).missed) == ("other", ())
    with zipfile.ZipFile(tmp_path / "none.zip", "w") as archive:
        archive.writestr("a", "b")
    with pytest.raises(MisuseError, match=r"has no test\.toml"):
        read_test(tmp_path / "none.zip")


TEST = 'format = 1\nscenario = "bravo"\nseed = 1\nseconds = 1\nmission = "mission.sleep"\n'


def test_a_goal_of_a_saved_test_runs_no_python(tmp_path: Path) -> None:
    """Wherever it comes from, and though the module lies where Python finds it."""
    (tmp_path / "test.toml").write_text(f'{TEST}[[goals]]\nholds = "os.getpid >= 0"\n')
    (tmp_path / "mission.sleep").touch()
    with zipfile.ZipFile(tmp_path / "sent.zip", "w") as archive:
        for name in ("test.toml", "mission.sleep"):
            archive.write(tmp_path / name, name)
    for place in (tmp_path, tmp_path / "sent.zip"):
        with pytest.raises(MisuseError, match=r"test.toml:7: goals\[0\].holds: .*what comes from others is not run"):
            read_test(place)


def packed(file: Path, members: list[tuple[str, bytes]], how: int = zipfile.ZIP_DEFLATED) -> Path:
    """A zip file with these members, some perhaps of one name."""
    with warnings.catch_warnings(action="ignore"), zipfile.ZipFile(file, "w", how) as archive:
        for name, data in members:
            archive.writestr(name, data)
    return file


def belittled(file: Path) -> Path:
    """The same zip file, whose directory says that each member unpacks to a hundred bytes."""
    data = bytearray(file.read_bytes())
    for mark, offset in ((b"PK\x01\x02", 24), (b"PK\x03\x04", 22)):
        at = -1
        while (at := data.find(mark, at + 1)) >= 0:
            data[at + offset : at + offset + 4] = (100).to_bytes(4, "little")
    file.write_bytes(data)
    return file


LARGE = bytes(64 * 1024**2)


@pytest.mark.parametrize(
    ("make", "why"),
    [
        (lambda file: belittled(packed(file, [("test.toml", LARGE)])), "cannot be read"),
        (lambda file: packed(file, [("test.toml", LARGE)]), "too long: at most"),
        (lambda file: packed(file, [("test.toml", LARGE)], zipfile.ZIP_BZIP2), "packed in another way"),
        (lambda file: packed(file, [("test.toml", LARGE)], zipfile.ZIP_LZMA), "packed in another way"),
        (lambda file: packed(file, [("test.toml", LARGE[: 1024**2])] * 200), "holds 200 files"),
        (lambda file: packed(file, [(f"{number}", b"") for number in range(50_000)]), "too large"),
    ],
    ids=["a lying directory", "long", "bzip2", "lzma", "many", "a long directory"],
)
def test_a_zip_bomb_costs_no_more_than_a_test_may(tmp_path: Path, make: Callable[[Path], Path], why: str) -> None:
    file = make(tmp_path / "sent.zip")
    tracemalloc.start()
    try:
        with pytest.raises(MisuseError, match=why):
            read_test(file)
        assert tracemalloc.get_traced_memory()[1] < 24 * 1024**2
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("cut", [0, 1, 21, 60, 100])
def test_a_damaged_zip_file_is_refused_with_a_sentence(tmp_path: Path, cut: int) -> None:
    file = packed(tmp_path / "sent.zip", [("test.toml", TEST.encode()), ("mission.sleep", b"@1s (ST)\n")])
    data = file.read_bytes()
    for damaged in (data[:cut], data[cut:], data[:cut] + b"\xff" * 30 + data[cut + 30 :]):
        file.write_bytes(damaged)
        with suppress(MisuseError):  # nothing else may come out, and some of it does not matter
            read_test(file)


def test_what_cannot_be_repeated_is_refused(tmp_path: Path) -> None:
    write(tmp_path)
    with sc.open(tmp_path, threads=1) as fleet:
        with pytest.raises(MisuseError, match="Nothing has happened yet"):
            fleet.save_test(tmp_path / "a")
        fleet.run(1.0, quiet=True)
        fleet.save_test(tmp_path / "a")
        with pytest.raises(MisuseError, match="already exists"):
            fleet.save_test(tmp_path / "a")
        with fleet.fork() as fork, pytest.raises(MisuseError, match="goes on from a snapshot, or is a fork"):
            fork.save_test(tmp_path / "b")
        write(tmp_path, ('reach = "20km"', 'reach = "21km"'))
        with pytest.raises(MisuseError, match="not any more the scenario"):
            fleet.save_test(tmp_path / "b")
        fleet.world.add(Circle(10.0, 10.0, 1.0))
        fleet.run(0.1, quiet=True)
        with pytest.raises(MisuseError, match=r"Obstacles were changed by hand at 1\.1 s"):
            fleet.save_test(tmp_path / "b")
