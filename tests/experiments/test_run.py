"""Runs and their results: real worker processes, real kills, and files that outlive them."""

from __future__ import annotations

import gc
import json
import os
import pickle
import re
import signal
import socket
import sqlite3
import subprocess
import sys
import time
import weakref
from collections.abc import Iterator
from contextlib import suppress
from math import inf, isnan
from multiprocessing import active_children
from pathlib import Path
from runpy import run_path
from threading import Thread

import msgspec
import numpy as np
import pytest

import forkserver
import sleepcast as sc
from sleepcast.cli import main
from sleepcast.core.extras import installing
from sleepcast.experiments import run
from sleepcast.experiments.drawing import band
from sleepcast.experiments.plan import Experiment, PlannedRun, Precision, experiment_of
from sleepcast.experiments.results import (
    FORMAT,
    Results,
    ResultsError,
    RunResult,
    export,
    outcomes_in,
    summary_of,
    table_of,
)
from sleepcast.experiments.run import (
    ENDED,
    ClusterError,
    ClusterLostError,
    Runner,
    checked_cluster,
    do,
    opened,
    outcome_in,
    run_all,
    verify,
)
from small_worlds import write
from swarms import settle

FEW = ("robots.count=10",)
THOUSAND = ",".join(f"0.{number:03d}" for number in range(1000))
MANY = f"radio.loss={THOUSAND},1"
HUGE = tuple(word for key in ("loss", "duplication", "reordering") for word in ("--over", f"radio.{key}={THOUSAND}"))


def experiment(**changes: object) -> Experiment:
    options = {
        "over": ["robots.count=10", "radio.loss=0,0.5"],
        "measures": ["mean battery"],
        "seeds": 2,
        "seconds": 2.0,
    }
    return experiment_of("crowd", **{**options, **changes})  # type: ignore[arg-type]


def count(folder: Path) -> int:
    """How many runs are finished, while they go on."""
    try:
        return sum(1 for _ in outcomes_in(folder))
    except ResultsError:  # it has not begun
        return 0


def sweep(wanted: Experiment, folder: Path, workers: int = 1) -> None:
    with Results(folder, wanted) as results:
        for _ in run_all(results, workers):
            pass


def fill(wanted: Experiment, folder: Path) -> None:
    """The same results, without processes that do the runs: for tests of what is in a folder."""
    with Results(folder, wanted) as results:
        results.keep(do(wanted, each) for each in results.missing())


def as_before(folder: Path, change: str) -> None:
    """Make the results those of version 0.2.0. change: in SQL."""
    with sqlite3.connect(folder / "runs.sqlite") as connection:
        connection.executescript(f"{change}; PRAGMA user_version = 1")


@pytest.fixture
def measures(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A module `own_measures` that the workers find, too."""
    monkeypatch.setenv(
        "XDG_DATA_HOME", str(tmp_path / "data")
    )  # what is kept of own folders is no business of whoever runs the tests
    monkeypatch.setattr(sys, "path", [*sys.path, str(tmp_path / "modules")])
    (tmp_path / "modules").mkdir()
    monkeypatch.delitem(sys.modules, "own_measures", raising=False)
    return tmp_path / "modules" / "own_measures.py"


class TestOneRun:
    def test_it_is_what_the_front_door_gives(self) -> None:
        wanted = experiment(over=FEW, measures=["mean battery", "far=share (> (DIST x y 0 0) 5m)"], seeds=1)
        found = do(wanted, next(wanted.runs()))
        fleet = sc.open("crowd", over={"robots.count": 10}, seed=1, mission=True).run(2.0)
        assert found.error == ""
        assert found.samples == ((2.0, fleet["battery"].mean(), (fleet["(DIST x y 0 0)"] > 5.0).mean()),)
        assert found.hash == fleet.hash

    def test_samples_are_taken_all_along_and_change_nothing(self) -> None:
        wanted = experiment(over=FEW, seeds=1, every=0.5)
        found = do(wanted, next(wanted.runs()))
        assert [sample[0] for sample in found.samples] == [0.0, 0.5, 1.0, 1.5, 2.0]
        without = experiment(over=FEW, seeds=1)
        assert found.hash == do(without, next(without.runs())).hash

    def test_it_ends_as_soon_as_the_condition_holds(self) -> None:
        wanted = experiment(over=FEW, seeds=1, seconds=60.0, every=0.5, until="max time >= 0.7")
        assert [sample[0] for sample in do(wanted, next(wanted.runs())).samples] == [0.0, 0.5, 0.7]

    @pytest.mark.parametrize("every", [None, 0.5])
    def test_a_condition_that_holds_for_one_tick_is_seen(self, every: float | None) -> None:
        wanted = experiment(over=FEW, seeds=1, every=every, until="count (< 0.25s time 0.35s) >= 1")
        found = do(wanted, next(wanted.runs()))
        assert found.samples[-1][0] == 0.3
        assert len(found.samples) == (1 if every is None else 2)

    def test_looking_at_the_condition_changes_nothing(self) -> None:
        ended = experiment(over=FEW, seeds=1, seconds=60.0, until="max (IF (> front_range 0) time 0) >= 0.7")
        found = do(ended, next(ended.runs()))
        assert found.samples[-1][0] == 0.7
        longer = experiment(over=FEW, seeds=1, seconds=0.7)
        assert found.same_as(do(longer, next(longer.runs())))

    def test_samples_fall_on_the_first_tick_at_each_multiple(self) -> None:
        wanted = experiment(over=FEW, seeds=1, seconds=1.2, every=0.25)
        samples = do(wanted, next(wanted.runs())).samples
        assert [sample[0] for sample in samples] == [0.0, 0.3, 0.5, 0.8, 1.0, 1.2]

    def test_commands_are_sent_in_their_time(self, tmp_path: Path) -> None:
        text = """
            scenario = "stop"
            seconds = "2s"
            every = "1s"
            mission = false
            measures.members = "count (IN a)"
            commands = [{ at = "1.05s", text = "(WHEN (>= x 0) (JOIN a))" }]
        """
        from sleepcast.experiments.plan import read_experiment

        wanted = read_experiment(tmp_path / "experiment.toml", text)
        found = do(wanted, next(wanted.runs()))
        robots = len(sc.open("stop"))
        assert [sample[1] for sample in found.samples] == [0.0, 0.0, robots]

    def test_what_nobody_knows_is_unknown(self) -> None:
        wanted = experiment(over=FEW, seeds=1, measures=["mean (/ 1 0)", "n=count (> (/ 1 0) 0)"])
        assert do(wanted, next(wanted.runs())).samples == ((2.0, None, 0.0),)


class TestManyRuns:
    def test_any_number_of_workers_finds_the_same(self, tmp_path: Path) -> None:
        for workers in (1, 2):
            sweep(experiment(), tmp_path / f"{workers}", workers)
        one, two = (list(outcomes_in(tmp_path / f"{workers}")) for workers in (1, 2))
        assert [each.run for each in one] == list(experiment().runs())
        assert all(each.same_as(other) for each, other in zip(one, two, strict=True))
        assert all(same for _, same in verify(tmp_path / "2", 1))

    def test_there_are_as_many_runs_as_the_precision_takes(self, tmp_path: Path, measures: Path) -> None:
        measures.write_text("def scattered(fleet):\n    return fleet.swarm.simulator.seed % 5 * (len(fleet) - 5)\n")
        wanted = experiment_of("crowd", over=["robots.count=5,10"], measures=["own_measures.scattered"], seeds=30)
        wanted = msgspec.structs.replace(wanted, seconds=0.1, precision=Precision("scattered", 3.0, 5))
        with Results(tmp_path / "results", wanted) as results:
            rounds = [(outcome.run.seed - 1) // 5 for outcome in run_all(results, 2)]
        assert rounds == sorted(rounds), "one round after the other"
        table = table_of(tmp_path / "results")
        runs = {count: list(table["robots.count"]).count(count) for count in (5, 10)}
        assert runs[5] == 5, "all alike, so the first round was enough"
        assert 5 < runs[10] < 30
        scattered = np.array(table["scattered"], float)[np.array(table["robots.count"]) == 10]
        _, low, high = band(scattered)
        assert (high - low) / 2 <= 3.0
        _, low, high = band(scattered[:-5])
        assert (high - low) / 2 > 3.0, "and not one round more than it takes"
        assert summary_of(tmp_path / "results").done == runs[5] + runs[10]

    def test_a_failed_run_is_a_row_and_the_others_go_on(self, tmp_path: Path, measures: Path) -> None:
        measures.write_text(
            "def odd(fleet):\n    return 1 / (fleet.station.vocabulary and fleet.swarm.simulator.seed % 2)\n"
        )
        wanted = experiment(over=FEW, seeds=3, measures=["own_measures.odd"])
        sweep(wanted, tmp_path / "results")
        found = list(outcomes_in(tmp_path / "results"))
        assert [each.error for each in found] == ["", "ZeroDivisionError: division by zero", ""]
        assert summary_of(tmp_path / "results").sentence() == "3 of 3 runs done, 1 of them failed"
        table = table_of(tmp_path / "results")
        assert isnan(float(table["odd"][1]))

    @pytest.mark.parametrize(
        ("value", "error"),
        [
            ("'abc'", "measure \"own_measures.odd\" gave 'abc', a str: wanted a number"),
            ("'3.5'", "measure \"own_measures.odd\" gave '3.5', a str: wanted a number"),
            ("None", 'measure "own_measures.odd" gave None, a NoneType: wanted a number'),
            ("fleet.x", 'measure "own_measures.odd" gave a ndarray: wanted one number'),
            ("__import__('sys').exit(3)", "SystemExit: 3"),
        ],
    )
    def test_a_measure_that_gives_no_number_fails_its_run(
        self, value: str, error: str, tmp_path: Path, measures: Path
    ) -> None:
        measures.write_text(f"def odd(fleet):\n    return {value} if fleet.swarm.simulator.seed == 2 else 1.0\n")
        wanted = experiment(over=FEW, seeds=2, measures=["own_measures.odd"])
        assert [do(wanted, run).error for run in wanted.runs()] == ["", error]

    def test_nan_is_missing_and_counted(self, tmp_path: Path, measures: Path) -> None:
        measures.write_text("def odd(fleet):\n    return float('nan') if fleet.swarm.simulator.seed == 2 else 1.0\n")
        fill(experiment(over=FEW, seeds=3, measures=["own_measures.odd"]), tmp_path / "results")
        assert summary_of(tmp_path / "results").sentence() == "3 of 3 runs done; 1 value unknown"
        assert table_of(tmp_path / "results").to_dict()["odd"] == [1.0, None, 1.0]

    def test_a_measure_that_never_ends_costs_its_run(self, tmp_path: Path, measures: Path) -> None:
        measures.write_text(
            "import time\n\n\n"
            "def odd(fleet):\n    while fleet.swarm.simulator.seed == 2:\n        time.sleep(0.01)\n    return 1.0\n"
        )
        wanted = experiment(over=FEW, seeds=4, measures=["own_measures.odd"])
        with Results(tmp_path / "results", wanted) as results:
            for _ in run_all(results, 2, limit=6.0):
                pass
        errors = [each.error for each in outcomes_in(tmp_path / "results")]
        late = "it took longer than 6 s: is a measure hanging?"
        assert errors[1] == late
        assert set(errors) <= {"", late}, "the others may be late only on a busy machine"
        assert len(errors) == 4
        for process in active_children():
            assert not process.is_alive()

    def test_a_measure_that_never_ends_is_met_before_the_first_run(self, measures: Path) -> None:
        measures.write_text("def odd(fleet):\n    while True:\n        pass\n")
        command = [*(sys.executable, "-m", "sleepcast", "sweep", "crowd", "--measure", "own_measures.odd")]
        done = forkserver.run(
            [*command, "--timeout", "300ms", "--out", "results"], cwd=measures.parent, capture_output=True, text=True
        )
        assert done.returncode == 2
        first, second = done.stderr.splitlines()
        assert first == f"this sweep runs programs: own_measures.odd of {measures}"
        assert second == "the trial of the measures took longer than 0.3 s: is one hanging?"

    def test_a_worker_that_the_system_ends_costs_one_run(self, tmp_path: Path, measures: Path) -> None:
        measures.write_text(
            "import os, signal\n\n\n"
            "def deadly(fleet):\n"
            "    if fleet.swarm.simulator.seed == 3:\n"
            "        os.kill(os.getpid(), signal.SIGKILL)\n"
            "    return 1.0\n"
        )
        wanted = experiment(over=FEW, seeds=5, measures=["own_measures.deadly"])
        sweep(wanted, tmp_path / "results")
        assert [each.error for each in outcomes_in(tmp_path / "results")] == ["", "", ENDED, "", ""]
        with Results(tmp_path / "results", wanted) as results:
            assert results.missing() == []
            assert [run.seed for run in results.missing(retry=True)] == [3]

    @pytest.mark.parametrize("short", [True, False])
    def test_of_short_runs_the_next_one_lies_ready(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, short: bool
    ) -> None:
        monkeypatch.setattr(run, "SHORT", inf if short else 0.0)
        begun, begin = [], run._Worker.begin

        def noted(worker: run._Worker, planned: PlannedRun) -> None:
            begun.append((planned.seed, [each.seed for each in worker.runs]))
            begin(worker, planned)

        monkeypatch.setattr(run._Worker, "begin", noted)
        sweep(experiment(over=FEW, seeds=4), tmp_path / "results")
        assert begun == [(1, []), (2, []), (3, [2] if short else []), (4, [3] if short else [])]
        assert [each.error for each in outcomes_in(tmp_path / "results")] == [""] * 4

    def test_after_kill_9_nothing_is_lost_or_done_twice(self, tmp_path: Path, measures: Path) -> None:
        measures.write_text(
            "import pathlib, time\n\n\n"
            "def noted(fleet):\n"
            f"    with open({str(tmp_path / 'noted')!r}, 'a') as noted:\n"
            "        noted.write(f'{fleet.swarm.simulator.seed}\\n')\n"
            f"    while fleet.swarm.simulator.seed > 20 and not pathlib.Path({str(tmp_path / 'killed')!r}).exists():\n"
            "        time.sleep(0.01)\n"
            "    return 1.0\n"
        )
        command = [
            *(sys.executable, "-m", "sleepcast", "sweep", "crowd", "--over", *FEW, "--seeds", "30", "--seconds", "2s"),
            *("--measure", "own_measures.noted", "--out", str(tmp_path / "results"), "--workers", "2", "--quiet"),
        ]
        process = forkserver.Popen(command, cwd=measures.parent, start_new_session=True)
        try:
            while count(tmp_path / "results") < 5:
                assert process.poll() is None
                time.sleep(0.01)
        finally:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()
        kept = {each.run.seed for each in outcomes_in(tmp_path / "results")}
        before = (tmp_path / "noted").read_text().split()
        (tmp_path / "killed").touch()
        again = forkserver.run(command, cwd=measures.parent, capture_output=True, text=True, check=True)
        assert "30 of 30 runs done" in again.stdout
        after = (tmp_path / "noted").read_text().split()[len(before) :]
        # One more is the trial of the measures before the first run, which has the seed 1.
        assert sorted(map(int, after)) == sorted([1, *(seed for seed in range(1, 31) if seed not in kept)])
        assert len(list(outcomes_in(tmp_path / "results"))) == 30

    def test_workers_end_with_their_owner(self, tmp_path: Path, measures: Path) -> None:
        measures.write_text(
            "import os, pathlib\n\n\n"
            "def seen(fleet):\n"
            f"    pathlib.Path({str(tmp_path)!r}, f'worker-{{os.getpid()}}').touch()\n"
            "    return 1.0\n"
        )
        command = [
            *(
                sys.executable,
                "-m",
                "sleepcast",
                "sweep",
                "crowd",
                "--over",
                *FEW,
                "--seeds",
                "9999",
                "--seconds",
                "1s",
            ),
            *("--measure", "own_measures.seen", "--out", str(tmp_path / "results"), "--workers", "2", "--quiet"),
        ]
        process = forkserver.Popen(command, cwd=measures.parent, stderr=subprocess.PIPE, text=True)
        while len(workers := [each.name.split("-")[1] for each in tmp_path.glob("worker-*")]) < 3:
            assert process.poll() is None
            time.sleep(0.01)
        process.send_signal(signal.SIGINT)
        assert "go on with sleepcast sweep" in process.communicate(timeout=60)[1]
        assert process.returncode == 130
        for number in workers:
            while Path("/proc", number).exists():
                time.sleep(0.01)


class TestEnd:
    def test_what_coincides_is_done_once_and_then_nothing_is_missing(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        asked = ["sweep", "crowd", "--over", "robots.count=5,5", "--seconds", "0.1s", "--measure", "mean x", "--json"]
        assert main([*asked, "--out", str(tmp_path / "results"), "--workers", "1", "--quiet"]) == 0
        said = capsys.readouterr()
        assert (json.loads(said.out)["runs"], json.loads(said.out)["done"]) == (1, 1)
        assert "over robots.count: 5 was given more than once, and is done once" in said.err

    def test_a_sweep_whose_runs_are_missing_fails(
        self, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("sleepcast.experiments.run.run_all", lambda *_, **__: (nothing for nothing in ()))
        asked = ["sweep", "crowd", "--over", *FEW, "--seeds", "2", "--measure", "mean x", "--quiet"]
        assert main([*asked, "--out", str(tmp_path / "results")]) == 1
        assert "2 runs are missing: go on with sleepcast sweep" in capsys.readouterr().err

    def test_results_that_count_equal_runs_twice_are_left_as_they_are(self, tmp_path: Path) -> None:
        wanted = experiment(seeds=1)
        fill(wanted, tmp_path / "results")
        plan = tmp_path / "results" / "experiment.toml"
        plan.write_text(plan.read_text().replace("seeds = 1", "seeds = [1, 1]"))
        with pytest.raises(ResultsError, match="names equal points or seeds twice"):
            Results(tmp_path / "results", wanted)
        assert len(list(outcomes_in(tmp_path / "results"))) == 2, "they can be read"


class TestResults:
    def test_another_experiment_is_refused(self, tmp_path: Path) -> None:
        fill(experiment(seeds=1), tmp_path / "results")
        with pytest.raises(ResultsError, match="holds the results of another experiment"):
            Results(tmp_path / "results", experiment(seeds=2))

    def test_a_folder_with_something_else_is_refused(self, tmp_path: Path) -> None:
        (tmp_path / "letter").touch()
        with pytest.raises(ResultsError, match="exists already, and holds no results"):
            Results(tmp_path, experiment())

    def test_two_sweeps_do_not_write_into_one_folder(self, tmp_path: Path) -> None:
        with Results(tmp_path / "results", experiment()):
            with pytest.raises(ResultsError, match="another sweep is writing here"):
                Results(tmp_path / "results", experiment())
            assert list(outcomes_in(tmp_path / "results")) == [], "but others may read"

    def test_a_full_disk_stops_it_and_what_is_written_is_intact(self, tmp_path: Path) -> None:
        wanted = experiment(over=FEW, seeds=40, seconds=0.1, every=0.001)
        program = (
            "import resource, sys\n"
            "from pathlib import Path\n"
            "from sleepcast.cli import main\n"
            "resource.setrlimit(resource.RLIMIT_FSIZE, (40_000, 40_000))\n"
            "sys.exit(main(sys.argv[1:]))\n"
        )
        (tmp_path / "experiment.toml").write_text(wanted.to_toml())
        command = (
            "sweep",
            str(tmp_path / "experiment.toml"),
            "--out",
            str(tmp_path / "results"),
            "--quiet",
            "--workers",
            "1",
        )
        done = subprocess.run([sys.executable, "-c", program, *command], capture_output=True, text=True, check=False)
        assert done.returncode == 1, done.stderr
        assert "cannot be written" in done.stderr
        assert "Traceback" not in done.stderr
        kept = list(outcomes_in(tmp_path / "results"))
        assert 0 < len(kept) < 40
        assert all(not each.error for each in kept)
        assert main(command) == 0, "there is room again"
        again = list(outcomes_in(tmp_path / "results"))
        assert len(again) == 40
        numbers = {each.run.number for each in kept}
        assert [each for each in again if each.run.number in numbers] == kept

    @pytest.mark.parametrize("place", ["/proc/nowhere", "file/results"])
    def test_a_place_where_nothing_can_be_written_is_named(
        self, place: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
    ) -> None:
        (tmp_path / "file").touch()
        (tmp_path / "experiment.toml").write_text(experiment().to_toml())
        assert main(["sweep", str(tmp_path / "experiment.toml"), "--out", str(tmp_path / place)]) == 1
        said = capsys.readouterr().err
        assert f"{tmp_path / place}: cannot be written: " in said
        assert "Traceback" not in said

    def test_results_of_a_newer_format_are_refused(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        fill(experiment(seeds=1), tmp_path / "results")
        with sqlite3.connect(tmp_path / "results" / "runs.sqlite") as connection:
            assert connection.execute("PRAGMA user_version").fetchone() == (2,)
            connection.execute("PRAGMA user_version = 3")
        figure = ("--x", "seed", "--y", "mean_battery", "--out", str(tmp_path / "a.svg"))
        for command in (["sweep"], ["sweep", "--verify"], ["plot", *figure]):
            assert main([command[0], str(tmp_path / "results"), *command[1:]]) == 2
            assert "have format 3, and this sleepcast knows formats up to 2" in capsys.readouterr().err

    @pytest.mark.parametrize(
        ("changes", "reason"),
        [
            ({"until": "max time >= 0.2"}, "which looked at `until` only when a sample was due"),
            ({"every": 0.25}, "which took samples only every so many whole ticks"),
        ],
    )
    def test_results_of_older_rules_are_read_but_not_gone_on_with(
        self, tmp_path: Path, changes: dict[str, object], reason: str
    ) -> None:
        folder, wanted = tmp_path / "results", experiment(over=FEW, seconds=0.3, **changes)
        fill(wanted, folder)
        as_before(folder, "")
        sweep(wanted, folder)  # nothing is left to do
        as_before(folder, "DELETE FROM runs WHERE number = 1")
        said = f"done by sleepcast 0.2.0 or earlier, {reason}: .* \\(sleepcast sweep .*/experiment.toml --out ANOTHER"
        with pytest.raises(ResultsError, match=said):
            sweep(wanted, folder)
        with pytest.raises(ResultsError, match=said):
            list(verify(folder, 1))
        assert summary_of(folder).done == 1

    def test_results_to_which_the_rules_make_no_difference_go_on(self, tmp_path: Path) -> None:
        folder, wanted = tmp_path / "results", experiment(over=FEW, seconds=0.5, every=0.2)
        fill(wanted, folder)
        whole = list(outcomes_in(folder))
        dropped = "".join(f"; ALTER TABLE runs DROP COLUMN {each}" for each in ("unsent", "missed"))
        as_before(folder, f"DELETE FROM runs WHERE number = 1{dropped}")
        fill(wanted, folder)
        assert all(each.same_as(before) for each, before in zip(outcomes_in(folder), whole, strict=True))
        with sqlite3.connect(folder / "runs.sqlite") as connection:
            assert connection.execute("PRAGMA user_version").fetchone() == (2,)

    def test_a_scenario_of_another_name_is_no_plan(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        write(tmp_path).rename(tmp_path / "yard.toml")
        options = ("--seeds", "1", "--seconds", "100ms", "--quiet", "--workers", "1")
        assert main(["sweep", "yard.toml", "--measure", "mean x", *options, "--out", "out"]) == 0
        assert summary_of(tmp_path / "out").done == 1

    def test_the_folder_says_what_made_the_results(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.chdir(tmp_path)
        git = ("git", "-c", "user.name=a", "-c", "user.email=a@b.c")
        for words in (("init", "-q"), ("commit", "-q", "--allow-empty", "-m", "begin")):
            subprocess.run([*git, *words], check=True)
        commit = subprocess.run(["git", "rev-parse", "HEAD"], capture_output=True, text=True, check=True).stdout.strip()
        fill(experiment(), tmp_path / "results")
        about = json.loads((tmp_path / "results" / "about.json").read_text())
        assert about["git"] == commit
        assert about["sleepcast"] == sc.__version__
        assert {"python", "numpy", "machine", "cores", "began"} <= about.keys()
        for each in outcomes_in(tmp_path / "results"):
            assert len(each.hash) >= 16
            assert each.run.seed in (1, 2)

    def test_damaged_results_are_named(self, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
        fill(experiment(seeds=1), tmp_path / "results")
        (tmp_path / "results" / "runs.sqlite").write_bytes(b"garbage")
        assert main(["sweep", str(tmp_path / "results")]) == 1
        assert "its runs.sqlite is damaged" in capsys.readouterr().err
        assert (
            main(["plot", str(tmp_path / "results"), "--x", "seed", "--y", "x", "--out", str(tmp_path / "a.svg")]) == 2
        )
        assert "the results cannot be read" in capsys.readouterr().err

    def test_tables_for_other_programs_say_the_same(self, tmp_path: Path) -> None:
        parquet = pytest.importorskip("pyarrow.parquet")
        fill(experiment(measures=["mean battery", "mean (/ 1 0)"]), tmp_path / "results")
        for name in ("table.csv", "table.parquet"):
            export(tmp_path / "results", tmp_path / name)
        read = parquet.read_table(tmp_path / "table.parquet").to_pydict()
        assert read == table_of(tmp_path / "results").to_dict()
        assert read["radio.loss"] == [0.0, 0.5, 0.0, 0.5]
        assert read["mean_1_0"] == [None] * 4
        lines = (tmp_path / "table.csv").read_text().splitlines()
        assert lines[0] == "robots.count,radio.loss,run,seed,time,mean_battery,mean_1_0,error,hash"
        assert len(lines) == 5
        with pytest.raises(ResultsError, match="ends in"):
            export(tmp_path / "results", tmp_path / "table.xls")


class TestCommandLine:
    def test_a_sweep_goes_on_is_verified_and_drawn(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        pytest.importorskip("matplotlib")
        monkeypatch.chdir(tmp_path)
        options = ("--seeds", "2", "--seconds", "1s", "--measure", "mean battery", "--every", "500ms", "--quiet")
        assert main(["sweep", "crowd", "--over", "robots.count=5,10", *options, "--out", "out.csv", "--json"]) == 0
        assert json.loads(capsys.readouterr().out) == {
            "runs": 4,
            "done": 4,
            "failed": 0,
            "unknown": 0,
            "results": "out",
            "table": "out.csv",
            "never_sent": {},
            "missed": {},
        }
        assert main(["sweep", "out", "--verify", "--workers", "1"]) == 0
        assert "4 of 4 runs came out the same" in capsys.readouterr().out
        for kind, by in (("line", ()), ("box", ()), ("heat", ("--by", "seed"))):
            drawn = ("--y", "mean_battery", "--kind", kind, *by, "--out", f"{kind}.svg")
            assert main(["plot", "out", "--x", "robots.count", *drawn]) == 0
            before = (tmp_path / f"{kind}.svg").read_bytes()
            if by:
                subprocess.run([sys.executable, f"{kind}.py"], check=True)
            else:  # as it would be in a process of its own, which takes a second to load matplotlib
                run_path(f"{kind}.py", run_name="__main__")
            assert (tmp_path / f"{kind}.svg").read_bytes() == before, "the program beside it draws the same"

    def test_a_changed_result_is_found(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
    ) -> None:
        import sqlite3

        fill(experiment(over=FEW, seeds=2), tmp_path / "results")
        with sqlite3.connect(tmp_path / "results" / "runs.sqlite") as connection:
            connection.execute("UPDATE runs SET hash = 'x' WHERE number = 1")
        assert main(["sweep", str(tmp_path / "results"), "--verify", "--quiet"]) == 1
        said = capsys.readouterr()
        assert "1 of 2 runs came out the same" in said.out
        assert "run 1 " in said.err

    @pytest.mark.parametrize(
        ("arguments", "sentence"),
        [
            (("sweep", "crowd", "--measure", "mean x"), "say where the results are to be kept"),
            (("sweep", "crowd", "--out", "o"), "nothing is measured"),
            (("sweep", "crowd", "--measure", "mean xx", "--out", "o"), 'unknown name "xx"'),
            (("sweep", "crowd", "--measure", "math.sin", "--out", "o"), "math.sin. fails: TypeError"),
            (("sweep", "crowd", "--measure", "mean x", "--over", "radio.los=0", "--out", "o"), "did you mean loss"),
            (
                ("sweep", "crowd", "--measure", "mean x", "--over", MANY, "--out", "o"),
                "1,001 values: at most 1,000 fit",
            ),
            (("sweep", "crowd", "--measure", "mean x", *HUGE, "--out", "o"), "1,000,000,000 runs: at most 1,000,000"),
            (("sweep", "crowd", "--measure", "mean x", "--port", "0", "--out", "o"), "add --page"),
            (("sweep", "crowd", "--verify", "--page", "--out", "o"), "leave out --verify"),
            (("sweep", "crowd", "--timeout", "5s", "--cluster", "tcp://x", "--out", "o"), "leave it out"),
            (("sweep", "nix.toml", "--out", "o"), "nix.toml: cannot be read"),
            (("sweep", "nix", "--verify", "--out", "o"), "o: no results|the results cannot be read"),
            (("plot", "nix", "--x", "a", "--y", "b", "--out", "a.svg"), "nix: no results of an experiment"),
            (("plot", "nix.csv", "--x", "a", "--y", "b", "--out", "a.svg"), "nix.csv: cannot be read"),
            (("plot", "nix", "--x", "a", "--y", "b", "--out", "a.gif"), "ends in .svg"),
        ],
    )
    def test_misuse_is_a_sentence(
        self,
        arguments: tuple[str, ...],
        sentence: str,
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
        capsys: pytest.CaptureFixture[str],
    ) -> None:
        monkeypatch.chdir(tmp_path)
        assert main(list(arguments)) == 2
        said = capsys.readouterr().err
        assert re.search(sentence, said), said
        assert "Traceback" not in said
        assert not list(tmp_path.iterdir()), "nothing is left behind"


MISSING = {
    "pyarrow": ("sweep", "o", "--out", "o.parquet"),
    "matplotlib": ("plot", "o", "--x", "seed", "--y", "mean_battery", "--out", "o.svg"),
    "scipy": ("sweep", "crowd", "--measure", "clusters 2m", "--out", "p"),
    "scipy.stats": ("sweep", "drawn.toml", "--out", "p"),
    "distributed": ("sweep", "crowd", "--measure", "mean x", "--cluster", "tcp://127.0.0.1:9", "--out", "p"),
    "optuna": ("sweep", "search.toml", "--out", "p"),
}
"""Commands that need a library. The program in which each of these is missing loads what none of them needs once, and
does each command in a process that is forked from it."""
WITHOUT = """
import importlib.util, json, os, sys
missing, find = None, importlib.util.find_spec
importlib.util.find_spec = lambda name: None if name == missing else find(name)
import sleepcast.api.assembly, sleepcast.cli.sweep, sleepcast.experiments.results, sleepcast.experiments.run
from sleepcast.cli import main
cases = json.loads(sys.argv[1])
assert not cases.keys() & sys.modules.keys(), "loaded by who does not need it"
class Nobody:
    def find_spec(self, name, path=None, target=None):
        if (name + ".").startswith(missing + "."):
            raise ModuleNotFoundError(name)
for missing, command in cases.items():
    if child := os.fork():
        os.waitpid(child, 0)
        continue
    out = os.open(f"{missing}.said", os.O_WRONLY | os.O_CREAT)
    os.dup2(out, 1)
    os.dup2(out, 2)
    sys.meta_path.insert(0, Nobody())
    print("status", main(command), flush=True)
    os._exit(0)
"""


@pytest.fixture(scope="module")
def without(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where what each of these commands says lies."""
    folder = tmp_path_factory.mktemp("without")
    fill(experiment(seeds=1, over=FEW), folder / "o")
    drawn = (
        'scenario = "crowd"\npoints = 2\n{}\n[over]\nradio.loss = {{ low = 0, high = 1 }}\n[measures]\na = "mean x"\n'
    )
    (folder / "drawn.toml").write_text(drawn.format('sampling = "sobol"'))
    (folder / "search.toml").write_text(drawn.format('sampling = "search"\nmaximise = "a"'))
    subprocess.run([sys.executable, "-c", WITHOUT, json.dumps(MISSING)], cwd=folder, check=True)
    return folder


@pytest.mark.parametrize("missing", MISSING)
def test_a_missing_library_gives_the_command_that_installs_it(
    missing: str, without: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(without)  # the command is told for whoever is in that folder
    said = (without / f"{missing}.said").read_text()
    assert said.endswith("status 2\n"), said
    assert any(f"install it: {installing(extra)}" in said for extra in ("experiments", "cluster", "search"))
    assert "Traceback" not in said


class Dask:
    """A dask scheduler and its workers."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        file = folder / "scheduler.json"
        self._options = ("--no-dashboard", "--scheduler-file", f"{file}")
        self._workers: list[subprocess.Popen[bytes]] = []
        self.scheduler = self._start("scheduler", "--host", "127.0.0.1", "--port", "0")
        while not (file.exists() and file.stat().st_size):
            assert self.scheduler.poll() is None, (folder / "log").read_text()
            time.sleep(0.05)
        self.address: str = json.loads(file.read_text())["address"]

    def add_worker(self) -> None:
        """Start one with one thread."""
        self._workers.append(self._start("worker", "--nthreads", "1", "--no-nanny"))

    def forget_workers(self) -> None:
        """End the workers, and wait until a scheduler that is left knows of none."""
        while self._workers:
            _end(self._workers.pop())
        if self.scheduler.poll() is None:
            from distributed import Client

            with Client(self.address) as client:
                while client.nthreads():
                    time.sleep(0.05)

    def close(self) -> None:
        _end(*self._workers, self.scheduler)

    def _start(self, *words: str) -> subprocess.Popen[bytes]:
        command = [sys.executable, "-W", "ignore", "-m", "dask", *words, *self._options]
        with (self.folder / "log").open("ab") as log:
            return subprocess.Popen(command, cwd=self.folder, stdout=log, stderr=log)


def _end(*processes: subprocess.Popen[bytes]) -> None:
    for process in processes:
        process.kill()
        process.wait()


@pytest.fixture(scope="module")
def schedulers() -> Iterator[list[Dask]]:
    """Those that were started: the latest one may still be there."""
    started = list[Dask]()
    yield started
    for each in started:
        each.close()


@pytest.fixture
def dask(schedulers: list[Dask], tmp_path_factory: pytest.TempPathFactory) -> Iterator[Dask]:
    """A dask scheduler without workers; it serves one test after the other, until one ends it."""
    pytest.importorskip("distributed")
    if not schedulers or schedulers[-1].scheduler.poll() is not None:
        schedulers.append(Dask(tmp_path_factory.mktemp("dask")))
    yield schedulers[-1]
    schedulers[-1].forget_workers()


class TestCluster:
    @pytest.mark.nightly
    def test_a_local_cluster_does_for_a_trial(self, tmp_path: Path) -> None:
        pytest.importorskip("distributed")
        program = (
            "import sys\n"
            "from distributed import LocalCluster\n"
            "from sleepcast.cli import main\n"
            "if __name__ == '__main__':\n"
            "    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as cluster:\n"
            "        sys.exit(main([*sys.argv[1:], '--cluster', cluster.scheduler_address]))\n"
        )
        (tmp_path / "program.py").write_text(program)
        (tmp_path / "experiment.toml").write_text(experiment().to_toml())
        done = subprocess.run(
            [*(sys.executable, "-W", "ignore", "program.py", "sweep", "experiment.toml", "--out", "there", "--quiet")],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 0, done.stderr
        assert "4 of 4 runs done" in done.stdout
        assert all(each.same_as(do(experiment(), each.run)) for each in outcomes_in(tmp_path / "there"))

    def test_the_workers_of_a_cluster_find_the_same(self, dask: Dask, tmp_path: Path) -> None:
        wanted = experiment(seeds=4)
        fill(wanted, tmp_path / "here")
        (tmp_path / "experiment.toml").write_text(wanted.to_toml())
        command = (sys.executable, "-m", "sleepcast", "sweep", "experiment.toml", "--out", "there", "--quiet")
        with forkserver.Popen(
            [*command, "--cluster", dask.address],
            cwd=tmp_path,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        ) as sweep:
            assert sweep.stderr is not None
            assert sweep.stderr.readline().rstrip().endswith("has no workers: the sweep goes on once there are some")
            dask.add_worker()
            dask.add_worker()
            printed, said = sweep.communicate()
        assert sweep.returncode == 0, said
        assert "8 of 8 runs done" in printed
        here, there = (list(outcomes_in(tmp_path / name)) for name in ("here", "there"))
        assert all(each.same_as(other) for each, other in zip(here, there, strict=True))

    def test_workers_that_come_later_get_runs_too(self, dask: Dask) -> None:
        distributed = pytest.importorskip("distributed")
        wanted = experiment(seeds=10)
        with distributed.Client(dask.address) as desk, run.Cluster(wanted, dask.address) as pool:
            dask.add_worker()
            found = pool.map(wanted.runs())
            assert all(each.error == "" for each in next(found))
            dask.add_worker()
            desk.wait_for_workers(2)
            next(found)
            next(found)
            assert len(desk.run_on_scheduler(lambda dask_scheduler: list(dask_scheduler.tasks))) >= 2 * run.AHEAD - 1
            assert 3 + len(list(found)) == len(list(wanted.runs()))

    def test_a_scheduler_that_ends_meanwhile_is_named(self, dask: Dask, capfd: pytest.CaptureFixture[str]) -> None:
        """It takes along what it had been given, which is no failure of these runs."""
        wanted = experiment(seeds=400)
        dask.add_worker()
        with run.Cluster(wanted, dask.address) as pool:
            found = pool.map(wanted.runs())
            done = next(found)
            dask.scheduler.kill()
            with pytest.raises(ClusterLostError, match="has gone; what is done is kept"):
                done += [each for more in found for each in more]
        dask.scheduler.wait()
        assert all(each.error == "" for each in done)
        assert "Traceback" not in capfd.readouterr().err

    @pytest.mark.parametrize(
        ("address", "why"),
        [
            ("tcp://192.0.2.1:8786", "nothing shows who it is. Use tls://.* or add --insecure"),
            ("192.0.2.1:8786", "nothing shows who it is"),
            ("tcp://127.0.0.1.example.org:8786", "nothing shows who it is"),
            ("inproc://192.0.2.1/1/1", "is no address of a dask scheduler"),
            ("tcp://127.0.0.1", "is no address of a dask scheduler"),
            ("tcp://127.0.0.1:port", "is no address of a dask scheduler"),
        ],
    )
    def test_whoever_answers_elsewhere_shows_who_it_is(self, address: str, why: str) -> None:
        with pytest.raises(ClusterError, match=why):
            checked_cluster(address, insecure=False)
        for trusted in ("tls://192.0.2.1:8786", "tcp://127.0.0.1:8786", "tcp://[::1]:8786", "localhost:8786"):
            assert checked_cluster(trusted, insecure=False) == trusted
        assert checked_cluster("tcp://192.0.2.1:8786", insecure=True)

    def test_what_a_worker_answers_is_an_outcome_of_this_run_or_a_failure(self) -> None:
        wanted = experiment(over=FEW, seeds=2)
        one, other = wanted.runs()
        good = RunResult(one, ((0.0, 0.5), (1.0, None)), "", "abc", 0.1, rules=FORMAT)
        assert outcome_in(msgspec.json.encode(good), wanted, one) == good
        failed = RunResult(one, error="it failed", rules=FORMAT)
        assert outcome_in(msgspec.json.encode(failed), wanted, one) == failed
        strange = [
            *(None, 5, "", b"", b"{}", b"[" * 100_000, good, pickle.dumps(good)),
            *(
                msgspec.json.encode(msgspec.structs.replace(good, **change))
                for change in (
                    {"run": other},
                    {"samples": ((0.0,),)},
                    {"samples": ((0.0, 1.0, 2.0),)},
                    {"samples": ()},
                    {"hash": "a" * 1_000},
                    {"error": "and samples"},
                    {"rules": FORMAT - 1},
                )
            ),
        ]
        for answer in strange:
            found = outcome_in(answer, wanted, one)
            assert (found.run, found.samples) == (one, ())
            assert "no outcome of this run" in found.error

    def test_a_scheduler_that_talks_nonsense_is_named(self, monkeypatch: pytest.MonkeyPatch) -> None:
        pytest.importorskip("distributed")
        monkeypatch.setattr(run, "CONNECTING", 0.5)
        with socket.create_server(("127.0.0.1", 0)) as server:

            def answer() -> None:
                with suppress(OSError):
                    while True:
                        connection, _ = server.accept()
                        with connection:
                            connection.sendall(b"HTTP/1.1 400 Bad Request\r\n\r\n" * 100)

            Thread(target=answer, daemon=True).start()
            address = f"tcp://127.0.0.1:{server.getsockname()[1]}"
            with pytest.raises(ClusterError, match="no dask scheduler answers"):
                run.Cluster(experiment(), address)

    def test_a_cluster_that_does_not_answer_is_named(self, tmp_path: Path) -> None:
        pytest.importorskip("distributed")
        program = (
            "import sys\n"
            "from sleepcast.cli import main\n"
            "from sleepcast.experiments import run\n"
            "run.CONNECTING = 0.2\n"
            "sys.exit(main(sys.argv[1:]))\n"
        )
        (tmp_path / "experiment.toml").write_text(experiment(seeds=1).to_toml())
        command = ("sweep", "experiment.toml", "--out", "there", "--cluster", "tcp://127.0.0.1:9")
        done = subprocess.run(
            [sys.executable, "-W", "ignore", "-c", program, *command],
            cwd=tmp_path,
            capture_output=True,
            text=True,
            check=False,
        )
        assert done.returncode == 2, done.stderr
        assert "no dask scheduler answers at tcp://127.0.0.1:9" in done.stderr
        assert "Traceback" not in done.stderr


class TestRunsOfAPoint:
    """Runs that one process does one after the other have much in common, and are the same as each alone."""

    @pytest.mark.parametrize("name", ["crowd", "vicsek", "maze", "two-desks", "energy", "society", "gauci"])
    def test_a_run_after_others_is_the_same_to_the_last_bit(self, name: str) -> None:
        over = ["robots.count=20"]
        wanted = experiment_of(name, over=over, measures=["mean x"], seeds=3, seconds=2.0, every=1.0)
        runner, runs = Runner(wanted), list(wanted.runs())
        for each in runs:
            found, alone = runner.do(each), do(wanted, each)
            assert found.error == ""
            assert found.same_as(alone)
            assert (found.unsent, found.missed) == (alone.unsent, alone.missed)
        with runner.opened(runs[1]) as fleet, opened(wanted, runs[1]) as alone_fleet:
            for each_fleet in (fleet, alone_fleet):
                each_fleet.run(2.0)
            assert fleet.snapshot() == alone_fleet.snapshot()

    @pytest.mark.parametrize("name", ["crowd", "vicsek", "gauci", "best-of-n"])
    def test_rules_that_were_compiled_in_one_run_are_native_from_the_first_tick_of_the_next(self, name: str) -> None:
        """Those that call functions of the body, too: they call those of its own world."""
        wanted = experiment_of(name, over=["robots.count=20"], measures=["mean x"], seeds=2)
        first, second = wanted.runs()
        runner = Runner(wanted)
        for each, native in ((first, False), (second, True)):
            with runner.opened(each) as fleet:
                fleet.swarm.step()
                minds = fleet.swarm.fleet
                kernels = minds.kernels
                if kernels is None:
                    pytest.skip("without llvmlite nothing is native")
                assert (kernels.plan(minds.memory.mind_of(0), minds.state) is not None) == native
                for _ in range(8):
                    fleet.swarm.step()
                kernels.settle()

    def test_nothing_of_a_world_is_held_on_to(self) -> None:
        wanted = experiment_of("best-of-n", over=["robots.count=20"], measures=["mean x"], seeds=2)
        runner, seen = Runner(wanted), []
        for each in wanted.runs():
            with runner.opened(each) as fleet:
                fleet.run(1.0)
                settle(fleet.swarm)
                seen.append(weakref.ref(fleet.swarm.simulator.bodies))
            del fleet
        gc.collect()
        assert [each() for each in seen] == [None, None]

    def test_points_differ_and_a_failed_run_leaves_nothing_behind(self) -> None:
        wanted = experiment(over=["robots.count=10,11", "radio.loss=0,0.9"], seeds=2)
        runner = Runner(wanted)
        runs = list(wanted.runs())
        broken = PlannedRun(99, {"robots.count": 10, "radio.loss": 7}, 1)
        for each in (*runs, broken, *reversed(runs)):
            assert runner.do(each).same_as(do(wanted, each))
