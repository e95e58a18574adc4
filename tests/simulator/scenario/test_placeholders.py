"""Numbers of a scenario's constants in its mission and commands, written as `{NAME}`."""

from __future__ import annotations

from pathlib import Path

import pytest

from sleepcast.core.errors import MisuseError
from sleepcast.experiments.plan import read_experiment
from sleepcast.experiments.run import opened
from sleepcast.simulator import Changes, Scenario, find_scenario
from small_worlds import write

MORE = """
[constants]
NEAR = "5mi"
share = "35%"
N = 4

[[commands]]
title = "Come"
text = "(WHEN (AND (< (DIST x y 0 0) {NEAR}) (> battery {SHARE})) (JOIN crew{N}))"
"""
MISSION = """
@{N}s (WHEN (> battery {share}) (JOIN near))   ; {WRONG} is a comment
"""


def world(folder: Path, mission: str = MISSION, **over: object) -> Scenario:
    write(folder, ('title = "a small world"', 'title = "a small world"\nmission = "m.sleep"'), more=MORE)
    (folder / "m.sleep").write_text(mission)
    return find_scenario(str(folder), Changes(over=tuple(over.items())))


def test_a_placeholder_is_the_number_as_it_is_written(tmp_path: Path) -> None:
    found = world(tmp_path)
    assert found.commands[-1].text == "(WHEN (AND (< (DIST x y 0 0) 5mi) (> battery 35%)) (JOIN crew4))"
    (order,) = found.mission
    assert (order.time, order.text.partition(" ;")[0].strip()) == (4.0, "(WHEN (> battery 35%) (JOIN near))")


def test_what_a_sweep_varies_reaches_it(tmp_path: Path) -> None:
    found = world(tmp_path, **{"constants.N": 7, "constants.NEAR": "0.1m"})
    assert found.mission[0].time == 7.0
    assert "0.1m)" in found.commands[-1].text
    text = """
        scenario = "."
        over.constants.share = ["35%", "100%"]
        measures.joined = "share (IN late)"
        commands = [{ at = "1s", text = "(WHEN (> battery {share}) (JOIN late))" }]
    """
    wanted = read_experiment(tmp_path / "experiment.toml", text).checked()
    for run in wanted.runs():
        with opened(wanted, run) as fleet:
            assert [order.text for order in fleet.swarm.mission if order.time == 1.0] == [
                f"(WHEN (> battery {run.point['constants.share']}) (JOIN late))"
            ]


def test_an_unknown_name_is_named_with_the_nearest(tmp_path: Path) -> None:
    with pytest.raises(MisuseError, match=r"m.sleep:2: there is no constant shale .did you mean share\?"):
        world(tmp_path, "\n@1s (WHEN (> battery {shale}) (ST))\n")


def test_numbers_keep_all_their_digits(tmp_path: Path) -> None:
    for value in ("0.3m", "1e-07m", "123456.789km", "33.3%", "17deg", "0.1min"):
        text = world(tmp_path, **{"constants.NEAR": value}).commands[-1].text
        written = text.partition("(DIST x y 0 0) ")[2].partition(")")[0]
        assert written == value
