"""The quick look at who is near in the air: nobody who touches is left out, and who is far is."""

from __future__ import annotations

import numpy as np
import pytest

from sleepcast.simulator import Simulator, choose, read_scenario
from sleepcast.simulator.bodies import closeness

AIR = """
format = 2
title = "air"
seconds = "1min"
tick = "0.1s"

[world]
width = "12m"
height = "12m"
{edge}

[robots]
like = "copter"
count = 60
z = ["2m", "25m"]

[robots.body]
radius = "0.2m"
"""


@pytest.mark.parametrize("edge", ["", 'edge = "torus"'])
def test_the_same_copters_crash_whoever_is_looked_at(edge: str, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("numba")
    found, scenario = [], read_scenario(AIR.format(edge=edge))
    for machine, many in (("numpy", 0), ("numba", 0), ("numba", 1_000)):
        monkeypatch.setattr(closeness, "MANY", many)
        simulator = Simulator(scenario, machine=choose(machine, 1))
        everybody = np.arange(60)
        simulator.act("drive_speed", everybody, np.linspace(-5.0, 5.0, 60))
        simulator.act("drive_climb", everybody, np.tile((-1.0, 0.0, 1.0), 20))
        for _ in range(40):
            simulator.step()
        flight = simulator.bodies.flight
        assert flight
        found.append((simulator.state_hash(), [each.text for each in simulator.sayings]))
        assert 0 < flight.crashed.sum() < 60
    assert found[0] == found[1] == found[2]


def test_who_is_far_from_everybody_is_left_out(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("numba")
    monkeypatch.setattr(closeness, "MANY", 0)
    simulator = Simulator(read_scenario(AIR.format(edge="")), machine=choose("numba", 1))
    bodies, flight = simulator.bodies, simulator.bodies.flight
    assert flight
    bodies.x[:], bodies.y[:], flight.z[:] = 6.0, 6.0, np.linspace(2.0, 61.0, 60)
    flight.z[7] = flight.z[8] - 0.5
    look = closeness.Closeness(bodies, flight)
    assert look.of(np.arange(60), np.full((3, 60), 0.1)).tolist() == [7, 8]
