"""The crowd: ten rules keep any number of Scouts busy, and nobody overlaps anybody."""

from __future__ import annotations

import json
import sys
from math import sqrt

import numpy as np
import pytest

import forkserver
from sleepcast.core.errors import MisuseError
from sleepcast.loop import Swarm
from sleepcast.simulator import Changes, Simulator, Wall, choose, find_scenario
from sleepcast.station import Station

SECONDS = 40.0


@pytest.fixture(scope="module")
def swarm() -> Swarm:
    """A small crowd after a while."""
    scenario = find_scenario("crowd", Changes(robots=60))
    swarm = Swarm(Simulator(scenario), scenario.mission)
    swarm.desk = Station(swarm.vocabulary, swarm.minds, swarm.post, swarm)
    swarm.run(SECONDS)
    return swarm


def known(swarm: Swarm, name: str) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return np.array([dict(node.variables())[name] for node in swarm.minds.values()])


def test_everybody_learned_ten_rules(swarm: Swarm) -> None:
    for node in swarm.minds.values():
        rules = [rule.name for rule in node.rules() if rule.active]
        assert len(rules) == 10
        assert not [rule for rule in node.rules() if rule.last_fault]


def test_they_get_somewhere(swarm: Swarm) -> None:
    start = Simulator(swarm.simulator.scenario)
    gone = np.hypot(swarm.simulator.x - start.x, swarm.simulator.y - start.y)
    assert float(np.median(gone)) > 2.0
    assert known(swarm, "trips").sum() >= 5


def test_they_seldom_touch_and_never_overlap(swarm: Swarm) -> None:
    sim = swarm.simulator
    away = np.hypot(sim.x[:, None] - sim.x, sim.y[:, None] - sim.y)
    np.fill_diagonal(away, np.inf)
    assert away.min() >= 2 * 0.17
    assert known(swarm, "bumps").mean() < 0.05 * SECONDS / sim.scenario.tick


def test_who_is_tired_is_marked(swarm: Swarm) -> None:
    tired = swarm.simulator.bodies.stores[0] < 0.2
    assert tired.any()
    assert (known(swarm, "marked")[tired] == 1).all()
    assert (known(swarm, "marked")[~tired] == 0).all()


class TestChanges:
    def test_the_world_grows_with_the_robots(self) -> None:
        for robots, area in ((50, 4.0), (200, 4.0), (50, 16.0)):
            scenario = find_scenario("crowd", Changes(robots, None if area == 4.0 else area))
            assert scenario.robots.count == robots
            assert scenario.width == scenario.height == pytest.approx(sqrt(robots * area))

    def test_walls_stand_on_all_sides_and_between_rooms(self) -> None:
        scenario = find_scenario("crowd", Changes(robots=400))
        assert sum(isinstance(shape, Wall) for shape in scenario.shapes) > 10
        assert not scenario.fenced

    def test_without_walls_there_is_nothing_solid(self) -> None:
        scenario = find_scenario("crowd", Changes(robots=400, walls=False))
        assert not scenario.shapes
        assert scenario.fenced

    def test_more_robots_than_minds_are_refused(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("sleepcast.loop.swarm.MAX_MINDS", 9)
        simulator = Simulator(find_scenario("crowd", Changes(robots=10, walls=False)))
        with pytest.raises(MisuseError, match=r"10 robots are too many: at most 9 minds"):
            Swarm(simulator)


def run(*options: str) -> dict[str, object]:
    command = [sys.executable, "-m", "sleepcast", "run", "crowd", "--json", "--quiet", "--seconds", "3", *options]
    found: dict[str, object] = json.loads(forkserver.run(command, capture_output=True, text=True, check=True).stdout)
    return found


def test_the_command_line_changes_the_crowd_and_threads_do_not() -> None:
    one, two = (run("--robots", "120", "--threads", threads) for threads in "12")
    assert one["state_hash"] == two["state_hash"]
    assert one["robots"] == 120
    sparse = run("--robots", "120", "--density", "16", "--no-walls")
    assert sparse["state_hash"] != one["state_hash"]


def test_a_density_that_is_none_is_refused() -> None:
    command = [sys.executable, "-m", "sleepcast", "run", "crowd", "--density", "0"]
    done = forkserver.run(command, capture_output=True, text=True)
    assert done.returncode == 2
    assert "--density must be from" in done.stderr


def test_both_machines_bring_the_crowd_about_its_business() -> None:
    """They differ in the last digits, so their crowds part in the end, but not in the first moments."""
    found = []
    for machine in ("numpy", "numba"):
        if machine == "numba":
            pytest.importorskip("numba")
        scenario = find_scenario("crowd", Changes(robots=50))
        swarm = Swarm(Simulator(scenario, machine=choose(machine)), scenario.mission)
        swarm.desk = Station(swarm.vocabulary, swarm.minds, swarm.post, swarm)
        swarm.run(2.0)
        found.append((swarm.simulator.x.copy(), swarm.simulator.y.copy()))
    assert np.abs(np.subtract(*found)).max() < 0.02
