"""Commands after the end of a run: said before it begins, listed, counted, and never taken as met."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

import sleepcast as sc
from cli.calling import called_warm
from sleepcast.experiments.acceptance import read_test, run_test
from small_worlds import write

MISSION = """
@0.5s (MARK)
= matched 20
@3s   (WHEN (>= battery 0%)
        (JOIN full))
= matched 20, fault 0
@4s   STOP
"""
LATE = "2 commands come after the end at 1 s and are never sent: @3s (WHEN (>= battery 0%) (JOIN full)); @4s STOP"


@pytest.fixture
def world(tmp_path: Path) -> Path:
    (tmp_path / "yard").mkdir()
    file = write(tmp_path / "yard")
    file.write_text('mission = "mission.sleep"\n' + file.read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / "yard" / "mission.sleep").write_text(MISSION, encoding="utf-8")
    return tmp_path / "yard"


def test_a_run_says_so_before_it_begins_and_what_was_wanted_is_not_met(world: Path) -> None:
    done = called_warm("run", str(world), "--seconds", "1")
    assert (done.status, done.err) == (1, f"{LATE}\n")
    place = world / "mission.sleep"
    end = "but it was never sent: the run ended at 1 s, before 3 s"
    for wanted in ("matched 20", "fault 0"):
        assert f"{place}:4: (WHEN (>= battery 0%) (JOIN full)): wanted {wanted}, {end}" in done.out
    assert f"  {LATE}\n" in done.out
    assert "(MARK): wanted" not in done.out


def test_scripts_get_them_as_a_list(world: Path) -> None:
    told = json.loads(called_warm("run", str(world), "--seconds", "1", "--json").out)
    assert [(each["time"], each["text"]) for each in told["never_sent"]] == [
        (3.0, "(WHEN (>= battery 0%)\n        (JOIN full))"),
        (4.0, "STOP"),
    ]
    assert len(told["missed"]) == 2
    whole = called_warm("run", str(world), "--seconds", "5", "--json")
    assert (whole.status, whole.err, json.loads(whole.out)["never_sent"]) == (0, "", [])


def test_what_is_wanted_goes_on_in_a_snapshot(world: Path) -> None:
    half = world / "half.snap"
    mission = (world / "mission.sleep").read_text()
    (world / "mission.sleep").write_text(mission.replace("(MARK)\n= matched 20", "(MARK)\n= matched 19"))
    assert called_warm("run", str(world), "--seconds", "1", "--snapshot", str(half)).status == 1
    again = called_warm("run", "--from", str(half), "--seconds", "1")
    assert (again.status, again.out.count("it was never sent: the run ended at 2 s, before 3 s")) == (1, 2)
    later = called_warm("run", "--from", str(half), "--seconds", "4")
    assert (later.status, later.out.count(": wanted ")) == (1, 1)
    assert "(MARK): wanted matched 19, but it was 20" in later.out  # it was sent before the snapshot


def test_python_has_them(world: Path) -> None:
    with sc.open(world, mission=True) as fleet:
        assert [line.time for line in fleet.mission.rest] == [0.5, 3.0, 4.0]
        assert [line.text for line in fleet.run(3.0, quiet=True).mission.rest] == ["STOP"]


def test_a_sweep_says_so_before_and_counts_them_after(world: Path) -> None:
    sweep = ("sweep", str(world), "--measure", "mean battery", "--seeds", "2", "--quiet", "--workers", "1")
    done = called_warm(*sweep, "--seconds", "1s", "--out", str(world / "short"))
    before, *after = done.err.splitlines()
    assert (done.status, before) == (0, LATE)
    ended = "never sent in 2 of 2 runs, which ended before: "
    assert after == [f"{ended}@3s (WHEN (>= battery 0%) (JOIN full))", f"{ended}@4s STOP"]
    early = ("--until", "max time >= 3.5", "--seconds", "5s", "--out", str(world / "early"), "--json")
    done = called_warm(*sweep, *early)
    assert (done.err, json.loads(done.out)["never_sent"]) == ("", {"@4s STOP": 2})
    assert json.loads(called_warm("sweep", str(world / "early"), "--json", "--quiet").out)["never_sent"] == {
        "@4s STOP": 2
    }


def test_a_sweep_says_in_how_many_runs_a_count_came_otherwise(world: Path) -> None:
    (world / "mission.sleep").write_text("@0.5s (WHEN (> battery 60%) (MARK))\n= matched at least 1, not matched 20\n")
    sweep = ("sweep", str(world), "--measure", "mean battery", "--seeds", "2", "--quiet", "--workers", "1")
    done = called_warm(*sweep, "--seconds", "1s", "--out", str(world / "results"))
    wanted = f"{world / 'mission.sleep'}:1: (WHEN (> battery 60%) (MARK)): wanted not matched 20"
    assert (done.status, done.err) == (0, f"not as its mission wanted in 2 of 2 runs: {wanted}\n")
    assert json.loads(called_warm("sweep", str(world / "results"), "--json", "--quiet").out)["missed"] == {wanted: 2}


def test_a_sweep_over_times_looks_at_each_of_them(world: Path) -> None:
    text = (world / "scenario.toml").read_text()
    (world / "scenario.toml").write_text(f'{text}\n[constants]\nLATE = "0.1s"\n')
    (world / "mission.sleep").write_text("@{LATE} (MARK)\n")
    sweep = ("sweep", str(world), "--over", "constants.LATE=0.5s,9s", "--measure", "mean battery", "--workers", "1")
    done = called_warm(*sweep, "--seconds", "1s", "--out", str(world / "results"), "--quiet")
    assert done.err.splitlines() == [
        "1 command comes after the end at 1 s and is never sent: @9s (MARK)",
        "never sent in 1 of 2 runs, which ended before: @9s (MARK)",
    ]


def test_a_saved_test_lists_those_of_its_scenario_too(world: Path, tmp_path: Path) -> None:
    with sc.open(world, mission=True, threads=1) as fleet:
        saved = fleet.run(1.0, quiet=True).save_test(tmp_path / "again")
    with (saved / "mission.sleep").open("a") as file:
        file.write("@2s (UNMARK)\n")
    verdict = run_test(read_test(saved), threads=1)
    assert [each["time"] for each in verdict.to_dict()["never_sent"]] == [2.0, 3.0, 4.0]  # type: ignore[attr-defined]
    assert verdict.missed == (f"{saved / 'mission.sleep'}:1: it was to be sent at 2 s, after the end",)
    assert "3 commands come after the end at 1 s and are never sent: @2s (UNMARK); @3s" in verdict.to_text()
