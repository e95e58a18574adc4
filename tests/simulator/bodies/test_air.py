"""Wind and downwash: what they do to copters, and that a seed decides it."""

from __future__ import annotations

from math import hypot

import numpy as np
import pytest

from machines import MACHINES
from simulated import steps
from sleepcast.core.settings import SettingsError
from sleepcast.simulator import Simulator, read_scenario
from sleepcast.simulator.engine import Machine
from sleepcast.simulator.motion.downwash import DEEP, MEASURED_RADIUS, STRONGEST, push
from sleepcast.simulator.motion.wind import wind_at
from sleepcast.simulator.scenario.fields import VectorField
from sleepcast.simulator.scenario.flight import GRAVITY
from sleepcast.simulator.scenario.wind import WindSpec
from sleepcast.simulator.snapshot import resume, state_of
from sleepcast.simulator.world.torus import PLAIN

SKY = """
format = 2
title = "a windy sky"
seconds = "1min"
tick = "0.1s"
seed = 3

[world]
width = "60m"
height = "60m"

[wind]
uniform = { x = "3m/s" }

[robots]
like = "copter"
starts = [{ x = "20m", y = "30m", z = "8m", heading = "0deg" }, ["20m", "10m", "0deg"]]
"""
HIGH, LOW = 0, 1


def sky(wind: str = 'uniform = { x = "3m/s" }', machine: Machine | None = None, seed: int | None = None) -> Simulator:
    return Simulator(read_scenario(SKY.replace('uniform = { x = "3m/s" }', wind)), machine=machine, seed=seed)


def test_against_a_wind_that_is_slower_it_keeps_its_place_and_flies_slower() -> None:
    sim = sky()
    steps(sim, 5.0)
    assert (sim.x[HIGH], sim.y[HIGH]) == (pytest.approx(20.0), pytest.approx(30.0))
    assert (sim.x[LOW], sim.y[LOW]) == (20.0, 10.0), "what stands on the ground stays there"
    ways = []
    for speed in (-9.0, 9.0):
        sim.act("drive_speed", np.array([HIGH]), np.array([speed]))
        steps(sim, 5.0)
        before = sim.x[HIGH]
        steps(sim, 1.0)
        ways.append(sim.x[HIGH] - before)
    assert ways == [pytest.approx(-2.0, abs=0.01), pytest.approx(5.0, abs=0.01)]


def test_a_wind_that_is_faster_carries_it_away_and_it_says_so_once() -> None:
    sim = sky('uniform = { x = "7m/s" }')
    sim.robots[HIGH].stop()
    steps(sim, 5.0)
    before = sim.x[HIGH]
    steps(sim, 1.0)
    assert sim.x[HIGH] - before == pytest.approx(2.0, abs=0.01)
    assert [(each.robot, each.text) for each in sim.news] == [
        (HIGH, "is carried away: the wind is faster than it flies")
    ]


def test_gusts_move_a_stopped_one_a_little_and_it_comes_back() -> None:
    sim = sky('uniform = { x = "3m/s" }\ngusts = "1.5m/s"\ngust_size = "3m"')
    sim.robots[HIGH].stop()
    away = []
    for _ in range(300):
        sim.step()
        away.append(hypot(sim.x[HIGH] - 20.0, sim.y[HIGH] - 30.0))
    assert 0.01 < max(away) < 1.0
    assert np.mean(away[200:]) < 0.3, "it does not drift off"


@pytest.mark.parametrize("machine", MACHINES)
def test_the_seed_alone_decides_the_gusts(machine: Machine) -> None:
    wind = (
        'uniform = { x = "3m/s" }\nswirls = [{ x = "20m", y = "20m", peak = "1m/s", radius = "9m" }]\ngusts = "1.5m/s"'
    )
    runs = [sky(wind, machine), sky(wind), sky(wind, seed=4)]
    for each in runs:
        steps(each, 3.0)
    hashes = [each.state_hash() for each in runs]
    assert hashes[0] == hashes[1] != hashes[2]
    again = resume(state_of(runs[0]))
    for each in (runs[0], again):
        steps(each, 2.0)
    assert again.state_hash() == runs[0].state_hash()


def test_gusts_are_smooth_bounded_and_carried_along() -> None:
    spec = WindSpec(VectorField("wind", "m/s", "", (2.0, 1.0), ()), gusts=1.0, gust_size=5.0)
    drawn = np.random.default_rng(1)
    x, y = drawn.uniform(-100.0, 100.0, (2, 5_000))
    east, north = wind_at(spec, 7, 0.0, x, y, PLAIN)
    for gust in (east - 2.0, north - 1.0):
        assert np.abs(gust).max() <= 1.0
        assert np.abs(gust).max() > 0.8
        assert abs(gust.mean()) < 0.05
    assert abs(np.corrcoef(east, north)[0, 1]) < 0.1
    later = wind_at(spec, 7, 10.0, x + 20.0, y + 10.0, PLAIN)
    assert np.allclose(later[0], east)
    beside = wind_at(spec, 7, 0.0, x + 1e-6, y, PLAIN)
    assert np.abs(beside[0] - east).max() < 1e-5
    assert np.hypot(east, north).max() <= spec.fastest


@pytest.mark.parametrize(("below", "grams"), [(0.2, 10.0), (0.3, 8.0), (0.4, 6.0), (0.5, 4.0), (0.7, 0.0), (0.8, 0.0)])
def test_downwash_is_as_it_was_measured(below: float, grams: float) -> None:
    pushed = push(np.array([below]), np.zeros(1), np.array([MEASURED_RADIUS]))
    assert pushed[0] == pytest.approx(GRAVITY * grams / 34.0, abs=1e-9)


def test_downwash_is_a_cone_that_is_scaled_with_the_body() -> None:
    radius = np.full(3, 0.5)
    assert push(np.array([-1.0, 0.0, DEEP * 0.5]), np.zeros(3), radius).tolist() == [0.0, 0.0, 0.0]
    aside = push(np.full(3, 2.0), np.array([0.0, 0.5, 1.4]), radius)
    assert 0.0 == aside[2] < aside[1] < aside[0] < STRONGEST


PAIR = SKY.replace(', heading = "0deg" }, ["20m", "10m", "0deg"]]', ' }, { x = "20m", y = "30m", z = "10.5m" }]')


def sunk(switch: str) -> tuple[float, str]:
    """How far the lower one of two has sunk after 2 s, m, and the hash of the state."""
    wind = f'uniform = {{ x = "0m/s" }}\ndownwash = {switch}'
    sim = Simulator(read_scenario(PAIR.replace('uniform = { x = "3m/s" }', wind)))
    steps(sim, 2.0)
    assert sim.bodies.flight is not None
    assert sim.bodies.flight.z[1] == 10.5, "nothing pushes the upper one"
    return 8.0 - float(sim.bodies.flight.z[0]), sim.state_hash()


def test_downwash_pushes_who_is_below_where_it_is_switched_on() -> None:
    assert sunk("false")[0] == 0.0
    assert sunk("true")[0] > 0.01
    assert sunk("true") == sunk("true")


@pytest.mark.parametrize(
    ("wind", "why"),
    [
        ('gusts = "1m/s"', "gusts come with the wind: give it a uniform part"),
        ('uniform = { x = "150m/s", y = "150m/s" }', "at most 200 are possible"),
        ('uniform = { x = "3m" }', "wind.uniform.x"),
    ],
)
def test_a_wind_that_cannot_be_is_refused(wind: str, why: str) -> None:
    with pytest.raises(SettingsError, match=why.replace(".", r"\.")):
        sky(wind)


def test_wind_needs_something_that_flies() -> None:
    with pytest.raises(SettingsError, match="it pushes only robots that fly"):
        read_scenario(SKY[: SKY.index("[robots]")] + "[robots]\nlike = 'disc'\ncount = 2\n")
