"""Every machine moves what flies in the same way, to the last bit, whatever it is doing and on however many threads."""

from __future__ import annotations

from unittest.mock import patch

import numpy as np
import pytest

from machines import ALL
from sleepcast.simulator import Simulator, fast, read_scenario
from sleepcast.simulator.engine import Machine, choose, has_numba

AIR = """
format = 2
title = "air"
seconds = "1min"
tick = "0.1s"

[world]
width = "200m"
height = "150m"
{edge}

[[robots]]
like = "copter"
count = {copters}
z = ["0m", "30m"]

[robots.body]
radius = "0.4m"

[robots.flight]
hovers = "10s"
climbs = "20m"

[robots.stores.battery]
start = ["0%", "100%"]
reach = "40m"

[[robots]]
like = "crazyflie"
count = {crazyflies}
z = ["0m", "3m"]

[[robots]]
like = "disc"
count = 5
body = {{ bumpers = 0 }}
"""


BREEZE = '\n[wind]\nuniform = {x = "0.4m/s", y = "-0.2m/s"}\ngusts = "0.3m/s"\n'
STORM = '\n[wind]\nuniform = {x = "5m/s", y = "1m/s"}\ngusts = "2m/s"\ndownwash = true\n'


def busy(machine: Machine, copters: int = 240, crazyflies: int = 75, edge: str = "", wind: str = "") -> Simulator:
    """Robots that take off, fly to places and heights, are driven, land, fall, are held, stopped, or run dry."""
    text = AIR.format(copters=copters, crazyflies=crazyflies, edge=edge)
    sim = Simulator(read_scenario(text + wind), seed=3, machine=machine)
    draw, flies = np.random.default_rng(8), np.arange(copters + crazyflies)
    for name, most in (("drive_speed", 7.0), ("drive_side", 7.0), ("drive_turn", 9.0)):
        sim.act(name, flies[flies % 7 < 5], draw.uniform(-most, most, np.count_nonzero(flies % 7 < 5)))
    climbing = flies[flies % 7 == 1]
    sim.act("drive_climb", climbing, draw.uniform(-2.0, 2.0, len(climbing)))
    sim.robots.take_off(flies[flies % 7 == 2], np.full(np.count_nonzero(flies % 7 == 2), 2.5))
    going = flies[flies % 7 > 4]
    sim.robots.go_to(going, *draw.uniform(((0.0,), (0.0,), (0.2,)), ((200.0,), (150.0,), (2.9,)), (3, len(going))))
    sim.robots.touch_down(flies[flies % 7 == 3])
    sim.robots.hold(flies[::11], np.ones(len(flies[::11]), bool))
    sim.robots.stop(flies[::13])
    sim.robots.disarm(flies[::17])
    sim.robots.cut_motors(flies[::19])
    return sim


def flown(sim: Simulator, ticks: int = 120) -> str:
    everybody = np.arange(len(sim.robots) - 5)
    for tick in range(ticks):
        if tick % 40 == 20:
            sim.robots.release(everybody)
            sim.robots.take_off(everybody[tick % 3 :: 3])
            sim.robots.hold(everybody[tick % 5 :: 5], np.zeros(len(everybody[tick % 5 :: 5]), bool))
        sim.step()
    return sim.state_hash()


@pytest.mark.parametrize("edge", ["", 'edge = "torus"', 'edge = "wall"'])
def test_machines_agree_to_the_last_bit(edge: str) -> None:
    sims = [busy(machine, edge=edge) for machine in ALL]
    hashes = {flown(sim) for sim in sims}
    flight = sims[-1].bodies.flight
    assert flight is not None
    assert len(hashes) == 1
    assert flight.compiles == has_numba()
    copters = flight.flies
    for some in (flight.flying[copters] > 0.0, sims[0].bodies.stores[0, copters] > 0.0, flight.locked[copters]):
        assert 0 < np.count_nonzero(some) < 300, "some are in the air, have used up their batteries, or have fallen"


@pytest.mark.parametrize(("edge", "wind"), [("", BREEZE), ('edge = "torus"', BREEZE), ("", STORM)])
def test_machines_agree_in_the_wind(edge: str, wind: str) -> None:
    sims = [busy(machine, 100, 40, edge, wind) for machine in ALL]
    assert len({flown(sim) for sim in sims}) == 1
    flight = sims[-1].bodies.flight
    assert flight is not None
    assert flight.air is not None
    assert flight.compiles == has_numba()
    assert np.isfinite(flight.air.anchor_x).sum() > 5, "some hold their place"
    assert flight.air.carried.sum() > 5, "others are carried away"


@pytest.mark.parametrize(("copters", "crazyflies"), [(1, 1), (15, 16), (17, 1)])
def test_machines_agree_on_few(copters: int, crazyflies: int) -> None:
    assert len({flown(busy(machine, copters, crazyflies), 60) for machine in ALL}) == 1


def test_threads_do_not_matter() -> None:
    pytest.importorskip("numba")
    with patch.object(fast, "ALONE", 50):
        assert len({flown(busy(choose("numba", threads)), 60) for threads in (1, 2, 3)}) == 1
