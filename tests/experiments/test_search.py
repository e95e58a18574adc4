"""A search finds what is best, does the same points on any number of workers, and goes on where it was killed."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from sleepcast.cli import main
from sleepcast.core.errors import MisuseError
from sleepcast.core.extras import installing
from sleepcast.experiments.plan import Experiment, read_experiment
from sleepcast.experiments.results import Results, ResultsError, RunResult, best_of, outcomes_in
from sleepcast.experiments.run import verify

pytest.importorskip("optuna")

TEXT = """
scenario = "crowd"
seconds = "100ms"
seeds = 2
sampling = "search"
points = {points}
minimise = "miss"
together = 3

[over]
radio.loss = {{ low = 0, high = 1 }}
robots.limits.speed = {{ low = "1m/s", high = "3m/s" }}
robots.count = {{ low = 3, high = 6, whole = true }}
world.edge = ["wall", "fence"]

[measures]
miss = "far_off.miss"
"""
MODULE = """
import os, time
calls = 0

def miss(fleet):
    global calls
    calls += 1
    if calls > int(os.environ.get("ENOUGH", "1000")):  # and goes on until it is killed
        time.sleep(1000.0)
    scenario = fleet.swarm.simulator.scenario
    off = abs(scenario.radio.loss - 0.3) + abs(scenario.robots.limits.speed - 2.0) + abs(len(fleet) - 5)
    return off + (0.5 if scenario.fenced else 0.0)
"""


def experiment(points: int = 12) -> Experiment:
    return read_experiment(Path("experiment.toml"), TEXT.format(points=points))


def off(outcome: RunResult) -> float:
    """What the measure gives, worked out from the settings alone."""
    point = outcome.run.point
    found = abs(float(point["radio.loss"]) - 0.3) + abs(float(str(point["robots.limits.speed"])[:-3]) - 2.0)
    return found + abs(int(point["robots.count"]) - 5) + (0.5 if point["world.edge"] == "fence" else 0.0)


def search(folder: Path, wanted: Experiment) -> list[RunResult]:
    """The whole search, with results that are worked out instead of run."""
    with Results(folder, wanted) as results:
        while left := results.missing():
            results.keep(RunResult(run, ((0.1, off(RunResult(run))),)) for run in left)
    return list(outcomes_in(folder))


def test_it_finds_what_is_best(tmp_path: Path) -> None:
    found = search(tmp_path / "results", experiment(60))
    assert [each.run.number for each in found] == list(range(120)), "two seeds at each of 60 points"
    best = best_of(tmp_path / "results")
    assert best is not None
    assert best.value == min(map(off, found)) < 0.25
    assert best.point["robots.count"] == 5
    assert best.point["world.edge"] == "wall"
    assert best.sentence().startswith("best miss: 0.")
    last, first = (sorted(map(off, some))[len(some) // 2] for some in (found[-40:], found[:20]))
    assert last < 0.5 * first, "it draws near"
    assert all(isinstance(each.run.point["robots.count"], int) for each in found)


def test_it_goes_on_wherever_it_was_interrupted(tmp_path: Path) -> None:
    whole = search(tmp_path / "whole", experiment())
    for kept in (0, 1, 5, 6, 7, 23):
        with Results(tmp_path / f"{kept}", experiment()) as results:
            results.keep(whole[:kept])
        assert search(tmp_path / f"{kept}", experiment()) == whole


def test_unknown_values_and_failed_runs_do_not_stop_it(tmp_path: Path) -> None:
    with Results(tmp_path / "results", experiment()) as results:
        while left := results.missing():
            results.keep(
                RunResult(run, error="no") if run.number % 3 else RunResult(run, ((0.1, None),)) for run in left
            )
        assert best_of(tmp_path / "results") is None
        assert {run.number % 3 for run in results.missing(retry=True)} == {1, 2}


def test_each_point_is_done_once_and_there_are_no_more_than_differ(tmp_path: Path) -> None:
    text = TEXT.format(points=9).replace("radio.loss = { low = 0, high = 1 }", "").replace("high = 6", "high = 4")
    text = text.replace('robots.limits.speed = { low = "1m/s", high = "3m/s" }', "")
    wanted = read_experiment(Path("experiment.toml"), text)
    assert wanted.repeats() == ("points: only 4 different ones fit into these ranges, not 9",)
    with Results(tmp_path / "results", wanted) as results:
        while left := results.missing():
            results.keep(RunResult(run, ((0.1, 1.0),)) for run in left)
    points = [json.dumps(each.run.point) for each in outcomes_in(tmp_path / "results")]
    assert len(points) == len(wanted) == 8, "two seeds"
    assert len(set(points)) == 4, "every one of them was tried"


def test_one_worker_and_two_do_the_same_and_kill_9_loses_nothing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path)])
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    (tmp_path / "far_off.py").write_text(MODULE)
    file = tmp_path / "experiment.toml"
    file.write_text(TEXT.format(points=12))
    two = ["--out", str(tmp_path / "two"), "--workers", "2", "--quiet", "--json"]
    assert main(["sweep", str(file), "--trust", *two]) == 0  # from then on the plan's folder is ours
    best = json.loads(capsys.readouterr().out)["best"]
    assert best["measure"] == "miss"
    command = [sys.executable, "-m", "sleepcast", "sweep", str(file), "--workers", "1", "--quiet", "--out"]
    environment = {**os.environ, "ENOUGH": "9"}
    process = subprocess.Popen([*command, str(tmp_path / "one")], env=environment, start_new_session=True)
    try:
        while not (tmp_path / "one" / "runs.sqlite").exists() or done(tmp_path / "one") < 8:
            assert process.poll() is None
            time.sleep(0.01)
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
    assert 8 <= done(tmp_path / "one") < 24
    again = subprocess.run([*command, str(tmp_path / "one")], capture_output=True, text=True, check=True)
    assert "24 of 24 runs done" in again.stdout
    assert f"best miss: {best['value']:.4g} at radio.loss = " in again.stdout
    one, two = (list(outcomes_in(tmp_path / name)) for name in ("one", "two"))
    assert [each.run for each in one] == [each.run for each in two]
    assert all(each.same_as(other) for each, other in zip(one, two, strict=True))
    assert all(off(each) == pytest.approx(each.samples[0][1]) for each in one)
    assert all(same for _, same in verify(tmp_path / "one", 1, 4))


def done(folder: Path) -> int:
    try:
        return sum(1 for _ in outcomes_in(folder))
    except ResultsError:  # it has not begun
        return 0


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ('minimise = "miss"', "", "a search has one goal: wanted maximise"),
        ('minimise = "miss"', 'minimise = "miss"\nmaximise = "miss"', "a search has one goal"),
        ('minimise = "miss"', 'minimise = "mis"', 'minimise: nothing is measured as "mis" .did you mean miss'),
        ("together = 3", "together = 0", "together: wanted a whole number from 1"),
        ("points = 12", "points = 6000", "points: wanted a whole number from 1 to 5000"),
        ("low = 3, high", "low = 3.5, high", "wanted whole numbers as ends"),
        ("whole = true", "while = true", "while: unknown key .did you mean whole"),
        ('"wall", "fence"', '"wall", "fense"', "did you mean fence"),
        ("[measures]", '[precision]\nmeasure = "miss"\nwithin = 1\n[measures]', "a search does every point"),
        ('"search"', '"sobol"', "minimise: unknown key"),
    ],
)
def test_what_is_wrong_is_said(old: str, new: str, sentence: str) -> None:
    text = TEXT.format(points=12).replace("far_off.miss", "mean x").replace(old, new)
    with pytest.raises(MisuseError, match=sentence):
        read_experiment(Path("experiment.toml"), text).checked()


def test_what_is_written_is_read_as_the_same() -> None:
    once = experiment()
    assert read_experiment(Path("experiment.toml"), once.to_toml()) == once


def test_without_optuna_the_command_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sleepcast.experiments.plan.find_spec", lambda name: None)
    with pytest.raises(MisuseError, match=re.escape(installing("search"))):
        read_experiment(Path("experiment.toml"), TEXT.format(points=3).replace("far_off.miss", "mean x")).checked()
