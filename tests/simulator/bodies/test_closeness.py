"""The quick look at who is near in the air: nobody who touches is left out, and who is far is."""

from __future__ import annotations

import numpy as np
import pytest

from sleepcast.simulator import Simulator, choose, read_scenario
from sleepcast.simulator.bodies import closeness
from sleepcast.simulator.bodies.closeness import Closeness

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
@pytest.mark.parametrize("speed", [2.0, 5.0])
def test_the_same_copters_crash_whoever_is_looked_at(edge: str, speed: float) -> None:
    pytest.importorskip("numba")
    found, scenario = [], read_scenario(AIR.format(edge=edge))
    for machine in ("numpy", "numba"):
        simulator = Simulator(scenario, machine=choose(machine, 1))
        everybody = np.arange(60)
        simulator.act("drive_speed", everybody, np.linspace(-speed, speed, 60))
        simulator.act("drive_climb", everybody, np.tile((-1.0, 0.0, 1.0), 20))
        for tick in range(60):
            if tick == 30:
                simulator.place(7, 6.0, 6.0, 0.0)
            simulator.step()
        flight = simulator.bodies.flight
        assert flight
        found.append((simulator.state_hash(), [each.text for each in simulator.news]))
        assert 0 < flight.crashed.sum() < 60
    assert found[0] == found[1]


def look_at(count: int, edge: str = "") -> tuple[Closeness, Simulator]:
    text = AIR.replace("count = 60", f"count = {count}").format(edge=edge)
    simulator = Simulator(read_scenario(text), machine=choose("numba", 1))
    bodies = simulator.bodies
    assert bodies.flight
    bodies.x[:], bodies.y[:], bodies.flight.z[:] = 6.0, 6.0, np.linspace(2.0, 2.0 + count, count)
    bodies.flight.way[:] = 0.01
    return Closeness(bodies, bodies.flight), simulator


def test_who_is_far_from_everybody_is_left_out() -> None:
    pytest.importorskip("numba")
    look, simulator = look_at(60)
    flight = simulator.bodies.flight
    assert flight
    assert look.of(np.arange(60)).size == 0
    flight.z[7] = flight.z[8] - 0.3
    assert look.of(np.arange(60)).tolist() == [7, 8]
    flight.z[7] = flight.z[8] - 0.41
    assert look.of(np.arange(60)).size == 0
    flight.way[2, 7] = -0.03
    assert look.of(np.arange(60)).tolist() == [7, 8], "they were nearer in the tick"


def test_a_crowd_finds_room_or_is_looked_at_as_a_whole(monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("numba")
    look, simulator = look_at(60)
    flight = simulator.bodies.flight
    assert flight
    flight.z[:40] = 5.0
    assert look.of(np.arange(60)).tolist() == list(range(40))
    assert look.pairs.near.shape[1] > 60 * closeness.EACH, "it has grown"
    monkeypatch.setattr(closeness, "MOST", closeness.EACH)
    assert Closeness(simulator.bodies, flight).of(np.arange(60)).tolist() == list(range(60))


@pytest.mark.parametrize("edge", ["", 'edge = "torus"'])
def test_who_has_come_near_since_pairs_were_listed_is_found(edge: str) -> None:
    """Both were a bit too far from each other to be listed."""
    pytest.importorskip("numba")
    look, simulator = look_at(20, edge)
    bodies, flight = simulator.bodies, simulator.bodies.flight
    assert flight
    flight.z[:] = np.linspace(2.0, 62.0, 20)
    flight.z[7] = flight.z[8]
    near = 0.0 if edge else 6.0
    for x_of_7, x_of_8, found in ((0.3, -0.45, []), (0.11, -0.28, [7, 8]), (0.3, -0.45, []), (0.13, -0.26, [7, 8])):
        bodies.x[7], bodies.x[8] = near + x_of_7, (near + x_of_8) % 12.0
        assert look.of(np.arange(20)).tolist() == found
