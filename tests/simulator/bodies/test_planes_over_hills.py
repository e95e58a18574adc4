"""Planes over a ground map: on slopes they take off, land and roll, and they fly into hills that are too high."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import sleepcast as sc
from simulated import refused, sensed, steps
from sleepcast.simulator import Simulator, read_scenario
from sleepcast.simulator.bodies.pilot import NO_CLIMB
from sleepcast.simulator.snapshot import resume, state_of

HILLS = """
format = 2
title = "planes over hills"
seconds = "10min"
tick = "0.25s"

[world]
width = "1200m"
height = "600m"
ground = { file = "FILE", low = "2m", high = "HIGH" }

[robots]
like = "plane"
flight = { failsafe = "rtl" }
starts = [["500m", "300m", "0deg"], ["620m", "200m", "180deg"], { x = "200m", y = "300m", z = "50m" }]
"""
UPHILL, DOWNHILL, HOME = range(3)


def text(folder: Path, shape: tuple[float, float, float] = (0.0, 1.0, 1.0), high: str = "32m") -> str:
    """Heights in the west, in the middle and in the east as shares of the highest, level at the ends, and two slopes of
    300 m between."""
    across = np.interp(np.arange(120) + 0.5, (30.0, 60.0, 90.0), 65_535.0 * np.array(shape))
    Image.fromarray(np.tile(np.round(across).astype(np.uint16), (60, 1))).save(folder / "hills.png")
    return HILLS.replace("FILE", str(folder / "hills.png")).replace("HIGH", high)


def hills(folder: Path, shape: tuple[float, float, float] = (0.0, 1.0, 1.0), high: str = "32m") -> Simulator:
    return Simulator(read_scenario(text(folder, shape, high)))


@pytest.mark.parametrize("robot", [UPHILL, DOWNHILL])
def test_it_rolls_on_a_slope_takes_off_and_lands_there(tmp_path: Path, robot: int) -> None:
    simulator = hills(tmp_path)
    body, start = simulator.robots[robot], sensed(simulator, robot)["z"]
    body.take_off(40.0)
    rolled = []
    while not sensed(simulator, robot)["flying"]:
        simulator.step()
        rolled.append(sensed(simulator, robot))
    assert len(rolled) > 5
    assert [each["height"] for each in rolled[:-1]] == [0.0] * (len(rolled) - 1)
    assert (rolled[-2]["z"] > start) == (robot == UPHILL)
    assert rolled[-1]["speed"] >= 10.0 - 1e-9
    steps(simulator, 60.0)
    assert sensed(simulator, robot)["z"] == pytest.approx(start + 40.0, abs=0.01)
    body.go_to(450.0, 300.0, 60.0)
    steps(simulator, 40.0)
    body.touch_down()
    while sensed(simulator, robot)["armed"]:
        simulator.step()
    assert simulator.news == []
    touched = sensed(simulator, robot)
    assert touched["speed"] > 5.0
    while sensed(simulator, robot)["speed"] > 0.0:
        simulator.step()
        assert sensed(simulator, robot)["height"] == 0.0
    landed = sensed(simulator, robot)
    assert [landed[name] for name in ("flying", "armed", "crashed", "climb_rate")] == [0.0] * 4
    assert landed["z"] != touched["z"], "it rolled out on the slope"


def test_it_refuses_to_take_off_towards_a_slope_that_is_too_steep(tmp_path: Path) -> None:
    simulator = hills(tmp_path, high="80m")
    assert refused(lambda: simulator.robots[UPHILL].take_off(40.0)) == NO_CLIMB
    simulator.robots[DOWNHILL].take_off(40.0)
    assert sensed(simulator, DOWNHILL)["armed"] == 1.0


def test_it_crashes_into_a_hill_that_is_higher_than_it_flies(tmp_path: Path) -> None:
    simulator = hills(tmp_path, (0.0, 1.0, 0.0), "80m")
    simulator.robots[HOME].go_to(1000.0, 300.0, 60.0)
    steps(simulator, 60.0)
    assert [(each.robot, each.text) for each in simulator.news] == [(HOME, "has crashed into the ground")]
    assert sensed(simulator, HOME)["crashed"] == 1.0


def test_one_that_returns_home_first_circles_up_over_the_hill(tmp_path: Path) -> None:
    simulator = hills(tmp_path, (0.0, 1.0, 0.0), "60m")
    for height in (100.0, 50.0):
        simulator.robots[HOME].go_to(1000.0, 300.0, height)
        steps(simulator, 90.0)
    simulator.robots.let_go(np.array([HOME]))
    heights = []
    while simulator.x[HOME] > 900.0:
        simulator.step()
        heights.append(sensed(simulator, HOME)["z"])
    assert heights[-1] == pytest.approx(2.0 + 58.0 * 29.5 / 30.0 + 30.0 + 2 * 0.7, abs=0.11)
    steps(simulator, 120.0)
    circles = sensed(simulator, HOME)
    assert np.hypot(simulator.x[HOME] - 200.0, simulator.y[HOME] - 300.0) == pytest.approx(60.0, abs=0.5)
    assert (circles["flying"], circles["crashed"]) == (1.0, 0.0)


def test_worlds_and_snapshots_come_to_the_same(tmp_path: Path) -> None:
    orders = "(WHEN (AND (= id 1) (NOT flying)) (TAKEOFF 40m))", "(WHEN flying (LAND))"
    together = sc.open_many(text(tmp_path), seeds=[1, 2], quiet=True)
    alone = sc.open(text(tmp_path), seed=2)
    for order in orders:
        for fleet in (together, alone):
            fleet.send(order, wait=0)
            fleet.run(20.0, quiet=True)
    assert alone.snapshot() == together[1].snapshot()
    simulator = hills(tmp_path)
    simulator.robots[UPHILL].take_off(40.0)
    steps(simulator, 2.0)
    again = resume(state_of(simulator))
    for each in (simulator, again):
        steps(each, 10.0)
    assert again.bodies.state_hash() == simulator.bodies.state_hash()


def test_around_a_torus_one_that_rolls_stays_on_the_ground(tmp_path: Path) -> None:
    around = text(tmp_path).replace('height = "600m"', 'height = "600m"\nedge = "torus"')
    simulator = Simulator(read_scenario(around.replace('["500m", "300m", "0deg"]', '["1195m", "300m", "0deg"]')))
    simulator.robots[UPHILL].take_off(40.0)
    while simulator.x[UPHILL] > 600.0:
        simulator.step()
        assert sensed(simulator, UPHILL)["height"] == 0.0
    assert sensed(simulator, UPHILL)["speed"] < 10.0
