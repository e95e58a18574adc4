"""The soak, as small as it can be: a robot of each kind, two swarms, everything that goes wrong once."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from benchmarks.channel.lab import why_not
from benchmarks.soak.nodes import KINDS, MICROPYTHON, ROS2, mixed
from benchmarks.soak.schedule import EVERY, schedule

ROOT = Path(__file__).resolve().parents[2]
REASON = why_not() or ("" if shutil.which("cc") or shutil.which("gcc") else "without a C compiler")
NEARLY = 80.0


@pytest.mark.skipif(bool(REASON), reason=f"no networks of our own here: {REASON}")
@pytest.mark.nightly
def test_a_small_fleet_loses_nothing_and_does_nothing_twice() -> None:
    """How fast it is, and whether memory grows, a run of a minute cannot tell."""
    options = ("--nodes", "8", "--seconds", "90", "--speed", "5", "--seed", "1", "--json")
    command = [sys.executable, "-m", "benchmarks.soak", *options]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert done.returncode in (0, 1), done.stderr
    assert done.stdout, done.stderr
    report = json.loads(done.stdout)
    assert report["events"].keys() >= {"kill", "partition", "wrong", "restart", "one-shot", "stop"}
    assert sum(int(row["nodes"]) for row in report["kinds"]) <= 8
    counted = [bar for bar in report["bars"] if bar["unit"] == "" and "bytes" not in bar["name"]]
    assert len(counted) == 9
    assert [bar for bar in counted if not bar["met"]] == [], done.stderr
    assert next(bar["value"] for bar in report["bars"] if bar["unit"] == "%") > NEARLY
    assert report["settled_after"] is not None


def test_the_schedule_is_the_seed_s_and_has_everything() -> None:
    def planned(seed: int) -> list[object]:
        return list(schedule(seed, 600.0, ["c1", "c2", "c3"], ["c1"], ["ana", "ben"]))

    assert planned(1) == planned(1) != planned(2)
    events = schedule(1, 600.0, ["c1", "c2", "c3"], ["c1"], ["ana", "ben"])
    assert {event.what for event in events} == {*EVERY, "one-shot", "rule", "restart"}
    assert {event.who for event in events if event.what in ("clock", "wrong")} == {("c1",)}
    assert all(0.0 < event.time < 600.0 for event in events)
    spared = schedule(1, 6_000.0, ["c1", "c2", "c3"], ["c1", "c2"], ["ana", "ben"], ["c1"])
    assert {event.who[0] for event in spared if event.what in ("kill", "wrong")} == {"c2", "c3"}


@pytest.mark.parametrize("count", [8, 9, 37, 100, 400])
def test_there_are_as_many_nodes_as_wanted_and_some_of_each_kind(count: int) -> None:
    for without in ((), (ROS2, MICROPYTHON)):
        found = mixed(count, without)
        assert sum(number for _, number in found) == count
        assert {kind for kind, _ in found} == {*KINDS} - {*without}


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (("--nodes", "3"), "--nodes 3: wanted 8 to 400"),
        (("--speed", "nan"), "wanted 60 to 2,592,000 --seconds, and a --speed of 1 to 100"),
    ],
)
def test_it_says_what_it_wants(options: tuple[str, ...], said: str) -> None:
    command = [sys.executable, "-m", "benchmarks.soak", *options]
    done = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
    assert (done.returncode, said in done.stderr) == (2, True)
