"""Task Element Bravo, from the sentence to the ring: who joins, and where they end up."""

from __future__ import annotations

import json
import subprocess
import sys
from math import atan2, cos, hypot, pi, radians, sin, sqrt

import numpy as np
import pytest

from sleepcast.loop import Swarm
from sleepcast.simulator import Simulator, find_scenario
from sleepcast.station import Account, Station

MILE = 1609.344
SHARE = pi * 25 / 400 * 0.5 * 0.3
EXPECTED = 1000 * SHARE
DEVIATION = sqrt(1000 * SHARE * (1 - SHARE))


def would_join(sim: Simulator) -> set[int]:
    """The robots that meet the conditions now, found without the language."""
    vessel = sim.scenario.places[0]
    fuel, ordnance = sim.bodies.stores
    near = np.hypot(sim.x - vessel.x, sim.y - vessel.y) < 5 * MILE
    return set(np.flatnonzero(near & (fuel > 0.5) & (ordnance > 0.7)).tolist())


def members(swarm: Swarm) -> set[int]:
    return {i for i, node in enumerate(swarm.minds.values()) if "bravo" in node.groups}


def with_desk(seed: int) -> tuple[Swarm, Station]:
    scenario = find_scenario("bravo")
    swarm = Swarm(Simulator(scenario, seed), scenario.mission)
    swarm.desk = desk = Station(swarm.vocabulary, swarm.minds, swarm.post, swarm)
    return swarm, desk


def accounts(desk: Station) -> list[Account]:
    return [desk.accounting(command.id) for command in desk.commands()]


class TestWhoJoins:
    def test_the_share_is_what_geometry_says(self) -> None:
        """Over many seeds: each count within five deviations of a binomial, their mean and spread where they belong."""
        scenario = find_scenario("bravo")
        counts = np.array([len(would_join(Simulator(scenario, seed))) for seed in range(200)])
        assert np.abs(counts - EXPECTED).max() < 5 * DEVIATION
        assert abs(counts.mean() - EXPECTED) < 3 * DEVIATION / sqrt(200)
        assert 0.8 * DEVIATION < counts.std() < 1.2 * DEVIATION

    @pytest.mark.parametrize("seed", [7, 8, 9])
    def test_just_those_join_that_meet_the_conditions(self, seed: int) -> None:
        swarm, desk = with_desk(seed)
        swarm.run(9.9)
        assert members(swarm) == set()
        for _ in range(3):
            swarm.step()
            if not members(swarm):
                meeting = would_join(swarm.simulator)  # what they sense when they think
        assert abs(len(members(swarm)) - EXPECTED) < 5 * DEVIATION
        # Whoever is right at the edge may have crossed it within the tick.
        assert len(members(swarm) ^ meeting) <= 1
        (account,) = accounts(desk)
        assert account.n_matched == len(members(swarm))
        assert (account.n_fault, account.n_silent) == (0, 0)
        assert account.n_not_matched == 1000 - account.n_matched

    def test_membership_is_a_snapshot(self) -> None:
        swarm, _ = with_desk(7)
        swarm.run(15)
        joined = members(swarm)
        swarm.simulator.bodies.stores[0] = 0.1
        swarm.run(5)
        assert members(swarm) == joined


@pytest.fixture(scope="module")
def swarm() -> Swarm:
    """One run of the whole mission, taken up by one test after the other."""
    return with_desk(7)[0]


class TestWhereTheyGo:
    def place(self, swarm: Swarm, index: int) -> tuple[float, float]:
        vessel, angle = swarm.simulator.scenario.places[0], radians(137.5) * (index + 1)
        return vessel.x + MILE * cos(angle), vessel.y + MILE * sin(angle)

    def test_bravo_covers_the_vessel_and_stays(self, swarm: Swarm) -> None:
        sim = swarm.simulator
        swarm.run(900 - sim.time - 1)
        bravo = members(swarm)
        assert bravo
        for index in bravo:
            x, y = self.place(swarm, index)
            assert hypot(sim.x[index] - x, sim.y[index] - y) <= sim.model.geometry.radius
            assert sim.bodies.speed[index] == 0
        vessel = sim.scenario.places[0]
        angles = sorted(atan2(sim.y[i] - vessel.y, sim.x[i] - vessel.x) for i in bravo)
        gaps = np.diff([*angles, angles[0] + 2 * pi])
        assert gaps.max() < pi / 2  # all round, not in a heap

    def test_the_others_go_on_as_before(self, swarm: Swarm) -> None:
        sim = swarm.simulator
        others = [i for i in range(1000) if i not in members(swarm) and sim.bodies.stores[0, i] > 0]
        assert (sim.bodies.speed[others] > 10.0).all()

    def test_bravo_renders_assistance(self, swarm: Swarm) -> None:
        sim, vessel = swarm.simulator, swarm.simulator.scenario.places[0]
        swarm.run(sim.scenario.seconds - sim.time)
        assert sim.time == sim.scenario.seconds
        for index in members(swarm):
            assert hypot(sim.x[index] - vessel.x, sim.y[index] - vessel.y) <= sim.model.geometry.radius


def test_stop_ends_everything_at_once() -> None:
    swarm, desk = with_desk(7)
    swarm.run(60)
    stop = desk.stop()
    swarm.run(0.3)
    assert desk.accounting(stop.id).n_matched == 1000
    swarm.run(swarm.simulator.model.limits.speed / swarm.simulator.model.limits.acceleration)
    assert (swarm.simulator.bodies.speed == 0).all()


RUN = """
import json, sys
from sleepcast.loop import Swarm
from sleepcast.simulator import Simulator, find_scenario
from sleepcast.station import Station
scenario = find_scenario("bravo")
swarm = Swarm(Simulator(scenario, int(sys.argv[1])), scenario.mission)
swarm.desk = desk = Station(swarm.vocabulary, swarm.minds, swarm.post, swarm)
swarm.run(60)
accounts = [desk.accounting(command.id).to_dict() for command in desk.commands()]
print(json.dumps([swarm.simulator.state_hash(), accounts, swarm.measures()]))
"""


def in_a_process(seed: int) -> list[object]:
    command = [sys.executable, "-c", RUN, str(seed)]
    found: list[object] = json.loads(subprocess.run(command, capture_output=True, text=True, check=True).stdout)
    return found


def test_a_run_repeats_between_processes_and_another_seed_makes_another() -> None:
    swarm, desk = with_desk(7)
    swarm.run(60)
    here = [swarm.simulator.state_hash(), [account.to_dict() for account in accounts(desk)], swarm.measures()]
    assert in_a_process(7) == here
    assert in_a_process(8)[0] != here[0]
