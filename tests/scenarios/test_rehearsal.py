"""The rehearsal: ten copters fly their mission, and no name in it is the simulator's own."""

from __future__ import annotations

import numpy as np
import pytest

import sleepcast as sc
from sleepcast.robot import Limits, hovering
from sleepcast.simulator import find_scenario
from sleepcast.simulator.bodies.body import Body

SEEDS = (11, 12, 13)


@pytest.mark.parametrize("seed", SEEDS)
def test_ten_copters_take_off_stop_go_on_and_land(seed: int) -> None:
    with sc.open("rehearsal", seed=seed, mission=True) as fleet:
        flight = fleet.swarm.simulator.bodies.flight
        assert flight is not None
        fleet.run(14.0)
        assert flight.z.tolist() == pytest.approx([2.0] * 10, abs=1e-6)
        fleet.run(9.0)
        held = fleet.table("x", "y", "z")
        assert all(10.5 < y < 19.0 for y in held["y"]), "STOP came on the way"
        assert flight.speeds(np.arange(10)).tolist() == [0.0] * 10
        fleet.run(21.0)
        assert fleet.table("y")["y"].tolist() == pytest.approx([20.0] * 10, abs=0.01)
        fleet.run(26.0)
        assert flight.z.tolist() == [0.0] * 10
        assert not flight.crashed.any()


def test_its_mission_names_only_what_all_know_that_hover() -> None:
    limits = Limits(1.0, 1.0, 1.0, climb=1.0)
    known = {each.name for each in (*hovering.sensors(limits, 1.0), *hovering.actuators(limits))}
    known |= {each.name for each in hovering.functions(Body)}
    words = " ".join(order.text for order in find_scenario("rehearsal").mission)
    named = {word for word in words.replace("(", " ").replace(")", " ").split() if word.isidentifier()}
    assert named - {"WHEN", "AND", "NOT", "ABS", "SETQ", "STOP", "RELEASE"} <= known
    assert {"battery", "height", "flying", "TAKEOFF", "GOTO", "LAND"} <= named
