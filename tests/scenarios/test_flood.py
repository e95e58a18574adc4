"""Flood relief over a bad radio: those that heard obey, the others are known to be silent."""

from __future__ import annotations

from math import hypot, pi, sqrt

import numpy as np
import pytest

from sleepcast.loop import Swarm
from sleepcast.simulator import Simulator, find_scenario
from sleepcast.simulator.bodies.bodies import Mode
from sleepcast.station import Station

SHARE = pi * 4 / 64 * 0.5 * 0.4
DEVIATION = sqrt(300 * SHARE * (1 - SHARE))


@pytest.fixture(scope="module")
def ended() -> tuple[Swarm, Station]:
    scenario = find_scenario("flood")
    swarm = Swarm(Simulator(scenario), scenario.mission)
    swarm.desk = desk = Station(swarm.vocabulary, swarm.minds, swarm.post, swarm)
    swarm.run(scenario.seconds)
    return swarm, desk


def test_the_share_is_what_geometry_says() -> None:
    scenario = find_scenario("flood")
    school = scenario.places[0]
    counts = []
    for seed in range(200):
        bodies = Simulator(scenario, seed).bodies
        battery, water = bodies.stores
        near = np.hypot(bodies.x - school.x, bodies.y - school.y) < 2000
        counts.append(int(np.count_nonzero(near & (battery > 0.5) & (water > 0))))
    assert abs(np.mean(counts) - 300 * SHARE) < 3 * DEVIATION / sqrt(200)


def test_every_member_that_heard_brings_its_water(ended: tuple[Swarm, Station]) -> None:
    swarm, _ = ended
    sim, school = swarm.simulator, swarm.simulator.scenario.places[0]
    relief = [i for i, node in enumerate(swarm.minds.values()) if "relief" in node.groups]
    assert abs(len(relief) - 300 * SHARE) < 5 * DEVIATION
    sent = [i for i in relief if sim.bodies.mode[i] == Mode.GOTO]
    assert len(sent) >= len(relief) - 1  # said twice, a command is missed by one in four hundred
    for index in sent:
        assert hypot(sim.x[index] - school.x, sim.y[index] - school.y) <= sim.model.geometry.radius
        assert sim.bodies.stores[1, index] > 0


def test_the_account_is_complete_and_silence_is_told(ended: tuple[Swarm, Station]) -> None:
    swarm, desk = ended
    for command in desk.commands():
        account = desk.accounting(command.id)
        assert account.n_matched + account.n_not_matched + account.n_silent == 300
        assert account.n_fault == 0
        assert 10 < account.n_silent < 55  # a command and its answer both get through with 0.95 ** 2
    assert swarm.radio.counts.lost > 0
