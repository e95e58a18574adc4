"""Robots at exactly one place: each is told from the other by its number, not by its distance."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

import sleepcast as sc
from sleepcast.simulator import Simulator, choose, read_scenario

WORLD = """format = 1
title = "one place"
seconds = "10s"
[world]
width = "20m"
height = "20m"
{edge}
[lights.lamp]
x = "10m"
y = "10m"
[neighbours]
reach = "5m"
noise = {noise}
[pings]
reach = "5m"
[robots]
like = "scout"
motion = "still"
body.bumpers = 0
starts = [[10, 10, "30deg"], [10, 10, "30deg"], [10, 13, 0]]
{robots}
"""
EDGES = ("", 'edge = "torus"')
IDEAL = """[robots]
type = "rover"
motion = "still"
limits = { speed = "1m/s", turn_rate = "1rad/s", acceleration = "2m/s2" }
body = { radius = "0.2m", sonars = 8, sonar_range = "2m" }
starts = [[10, 10, "30deg"], [10, 10, "30deg"], [10, 13, 0]]
"""
MACHINES = ("numpy", "numba")
RINGS = ("", 'sonar.pause = "20ms"', 'sonar.beam = "30deg"\nsonar.count = 12')


def world(robots: str = "", edge: str = "", noise: float = 0.0) -> str:
    return WORLD.format(robots=robots, edge=edge, noise=noise)


@pytest.mark.parametrize(("edge", "noise"), list(product(EDGES, (0.0, 0.1))))
def test_neighbours_see_each_other(edge: str, noise: float) -> None:
    fleet = sc.open(world(edge=edge, noise=noise))
    fleet.run(0.1)
    assert fleet["(COUNT 1m)"].tolist() == [1.0, 1.0, 0.0]
    assert fleet["(COUNT 5m)"].tolist() == [2.0, 2.0, 2.0]
    for text in ("(NEAREST_DIST 5m)", "(RANK_DIST 1 5m)"):
        assert fleet[text][:2].tolist() == [0.0, 0.0]
    for text in ("(NEAREST_X 5m)", "(MEAN_X 1m)", "(OUTLIER_X 1m)"):
        assert fleet[text][:2].tolist() == [10.0, 10.0]
    assert fleet["(MEAN_HEADING 1m)"][:2] == pytest.approx(np.radians([30.0, 30.0]))


def test_who_is_at_ones_own_place_is_in_no_direction() -> None:
    fleet = sc.open(world())
    fleet.run(0.1)
    assert np.isnan(fleet["(GAP 1m)"][:2]).all()
    assert fleet["(GAP 5m)"][:2] == pytest.approx([2 * np.pi] * 2)
    assert fleet["(GAP_BEARING 5m)"][:2] == pytest.approx([-np.pi / 2] * 2)
    assert fleet["sFlag"].tolist() == [1.0, 1.0, 1.0]
    assert fleet["sRange"][:2].tolist() == [0.0, 0.0]
    assert np.isnan(fleet["sBearing"]).tolist() == [True, True, False]


def test_pings_are_heard_at_no_distance() -> None:
    sim = Simulator(read_scenario(world()), machine=choose("numpy"))
    names = [sensor.name for sensor in sim.model.sensors]
    sim.ping(0, 3.0)
    sim.step()
    heard = [sim.sensed[names.index(name)] for name in ("pFlag", "pRange", "pBearing", "pCaste")]
    assert heard[0].tolist() == [0.0, 1.0, 1.0]
    assert (heard[1][1], heard[3][1]) == (0.0, 3.0)
    assert np.isnan(heard[2]).tolist() == [True, True, False]


@pytest.mark.parametrize(
    ("machine", "robots"),
    list(product(MACHINES, RINGS)),
)
def test_every_sonar_reads_its_minimum(machine: str, robots: str) -> None:
    sim = Simulator(read_scenario(world(robots)), machine=choose(machine))
    for _ in range(9):
        sim.step()
    sim.sense()
    ranges = sim.sensed[list(sim.sonar_rows)]
    assert ranges[:, :2] == pytest.approx(0.1524)
    assert np.nanmin(ranges[:, 2]) == pytest.approx(3.0 - 0.17 * 2, abs=0.01)


def test_ideal_sectors_all_see_it() -> None:
    text = world()
    sim = Simulator(read_scenario(text[: text.index("[robots]")] + IDEAL))
    assert [sim.robots[0].sonar(number) for number in range(8)] == [0.0] * 8
    assert sim.robots[2].sonar(6) == 2.0


def test_bodies_that_were_put_into_each_other_drive_apart() -> None:
    text = world().replace("body.bumpers = 0\n", "").replace("[10, 10", "[10, 7", 1)
    for machine in MACHINES:
        sim = Simulator(read_scenario(text), machine=choose(machine))
        sim.place(0, 10.0, 10.0, 0.0)
        sim.robots[0].drive(0.5, 0.0)
        for _ in range(30):
            sim.step()
        assert sim.x[0] - sim.x[1] > 0.34
