"""Blind vehicles follow those that see: the group finds the light, only with its eyes, and flees when it is told to.

The numbers are those of forty runs with other seeds: the centre is 60 m from the light at the start, 35 m after 500 s
(one run deviates by 2 m), 10 m after 1,000 s (by 3 m) and 0.9 m after 1,500 s (by 0.7 m). A mean over ten runs is held
against the round values 34, 7 and 1 within two such deviations, a single run within four.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from cli.calling import called
from sleepcast.api.assembly import assemble
from sleepcast.loop import Swarm, resume, snapshot
from sleepcast.simulator import Order, find_scenario
from sleepcast.station import Station
from swarms import station_of

SCENARIO = find_scenario("braitenberg")
*RULES, FLIGHT = SCENARIO.mission
GATHERING = [order for order in RULES if "sFlag" not in order.text]
"""The rules without the two that make the eyes mind the light."""
EXPECTED = {500: (34.0, 2.0), 1000: (7.0, 3.0), 1500: (1.0, 0.75)}
"""Seconds: the distance in m, and the deviation of one run."""

SEEDS = range(10)


def start(seed: int, orders: Sequence[Order]) -> tuple[Swarm, Station]:
    return assemble(replace(SCENARIO, mission=tuple(orders)), seed, mission=True)


@pytest.fixture(scope="module")
def half_way() -> list[bytes]:
    """The group of each seed after 500 s, as a snapshot: to go on from there is never to have stopped."""
    found = []
    for seed in SEEDS:
        swarm, _ = start(seed, RULES)
        swarm.run(500)
        found.append(snapshot(swarm))
    return found


def go_on(data: bytes) -> tuple[Swarm, Station]:
    swarm = resume(data, desk=station_of)
    assert isinstance(swarm.desk, Station)
    return swarm, swarm.desk


def series(swarm: Swarm, name: str) -> dict[float, float]:
    return {sample[0]: sample[1] for sample in swarm.simulator.measured()[name]}


@pytest.mark.nightly
@pytest.mark.slow
def test_the_group_finds_the_light_and_stays_together(half_way: list[bytes]) -> None:
    runs = []
    for seed in SEEDS:
        swarm, _ = go_on(half_way[seed])
        swarm.run(1000)
        runs.append(distance := series(swarm, "distance_to_light"))
        assert 58.0 < distance[0] < 62.0
        for seconds, (expected, deviation) in EXPECTED.items():
            assert abs(distance[seconds] - expected) < 4 * deviation + 1, (seed, seconds)
        gyration = series(swarm, "radius_of_gyration")
        assert 3.0 < gyration[0] < 4.0
        assert max(gyration.values()) < 9.0
        assert np.mean([gyration[s] for s in range(1400, 1501, 10)]) == pytest.approx(4.5, abs=0.8)
        blind = swarm.simulator.x[20:], swarm.simulator.y[20:]
        assert np.hypot(blind[0].mean() - 140.0, blind[1].mean() - 80.0) < 4.0
    for seconds, (expected, deviation) in EXPECTED.items():
        mean = float(np.mean([distance[seconds] for distance in runs]))
        assert abs(mean - expected) < 2 * deviation, (seconds, mean)


@pytest.mark.slow
@pytest.mark.nightly
def test_without_the_rules_for_the_light_it_stays_where_it_is() -> None:
    assert len(RULES) - len(GATHERING) == 2
    for seed in SEEDS:
        swarm, _ = start(seed, GATHERING)
        swarm.run(2000)
        distance, gyration = series(swarm, "distance_to_light"), series(swarm, "radius_of_gyration")
        assert distance[2000] > 50.0, seed
        assert gyration[2000] < 9.0, seed


@pytest.mark.slow
@pytest.mark.nightly
def test_one_broadcast_on_the_way_turns_attraction_into_flight(half_way: list[bytes]) -> None:
    """At 500 s, 35 m away, the group turns round: 58 m at 1,000 s and 84 m at 1,500 s (one run deviates by 4 m)."""
    for seed in SEEDS:
        swarm, desk = go_on(half_way[seed])
        command = desk.send(FLIGHT.text)
        swarm.run(1000)
        distance, gyration = series(swarm, "distance_to_light"), series(swarm, "radius_of_gyration")
        assert distance[500] < 43.0, seed
        assert distance[1000] > distance[500] + 10.0, seed
        assert distance[1500] > 68.0, seed
        assert gyration[1500] < 9.0, seed
        account = desk.accounting(command.id)
        assert (account.n_matched, account.n_not_matched) == (20, 20)


@pytest.mark.slow
def test_the_whole_mission_finds_the_light_and_leaves_it() -> None:
    """From the lamp itself everybody flees his own way at first; then the group goes one way: 50 m away at 3,000 s."""
    found = json.loads(called("run", "braitenberg", "--seed", "1", "--json").out)
    distance = dict(map(tuple, found["measures"]["distance_to_light"]))
    assert distance[1500.0] < 3.0
    assert distance[2500.0] > 8.0
    assert distance[3000.0] > 25.0
    assert [command["matched"] for command in found["accounting"]] == [40, 40, 20, 20, 20, 20, 20]
    assert {command["fault"] + command["silent"] for command in found["accounting"]} == {0}


def test_a_run_repeats_between_processes() -> None:
    first, again, other = (
        json.loads(called("run", "braitenberg", "--seconds", "120", "--json", "--seed", seed).out)
        for seed in ("5", "5", "6")
    )
    assert first["measures"]["distance_to_light"][0][0] == 0.0
    assert len(first["measures"]["distance_to_light"]) == 13
    assert first["measures"] == again["measures"]
    assert first["state_hash"] == again["state_hash"] != other["state_hash"]


def test_eyes_sense_the_light_and_the_body_does_not() -> None:
    swarm, _ = start(1, RULES)
    swarm.run(5)
    for node in swarm.minds.values():
        values = dict(node.variables())
        assert values["myCaste"] == (4.0 if node.number <= 20 else 3.0)
        assert (values["sFlag"] == 1.0) is (node.number <= 20)
        assert [rule.name for rule in node.rules() if rule.active] == ["E5", "E6", "together", "stray"]


def test_another_number_of_vehicles_keeps_the_castes_in_proportion() -> None:
    scenario = replace(SCENARIO, robots=replace(SCENARIO.robots, count=10))
    swarm, _ = assemble(scenario, 1, mission=True)
    swarm.run(3)
    assert [dict(node.variables())["myCaste"] for node in swarm.minds.values()] == [4.0] * 5 + [3.0] * 5
