"""Coming to rest in the simulator: bodies tell how far they still go, the desk counts them, and a robot that was
stopped begins its next life at rest."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import sleepcast
from sleepcast.loop import vocabulary_of
from sleepcast.node.node import Node
from sleepcast.node.state import stand
from sleepcast.robot import RestSensing
from sleepcast.simulator import Changes, Simulator, choose, find_scenario
from sleepcast.station.account import Account


def rest(found: Account) -> tuple[int, int, int]:
    """How many are at rest, still move, and do not tell."""
    assert found.rest is not None
    return found.rest.n_at_rest, found.rest.n_stopping, found.rest.n_accepted


@pytest.mark.parametrize("name", ["bravo", "maze", "gauci"])
def test_a_simulated_body_goes_as_far_as_it_tells(name: str) -> None:
    """Also one on wheels, and never farther: a body that touches something is at rest sooner."""
    count = 12
    world = Simulator(find_scenario(name, Changes(count, None, True)), 5, choose("numpy", 1))
    robots = np.arange(count)
    full = np.full(count, world.model.limits.speed)
    world.robots.drive(robots, full, np.zeros(count))
    for _ in range(40):
        world.step()
    speeds, distances = world.robots.rest_states(robots)
    assert (speeds > 0.0).any()
    assert isinstance(world.robots[0], RestSensing)
    assert world.robots[0].rest_state() == (speeds[0], distances[0])
    start = world.x.copy(), world.y.copy()
    world.robots.stop(robots)
    for _ in range(2_000):
        world.step()
        if not world.robots.rest_states(robots)[0].any():
            break
    gone = np.hypot(world.x - start[0], world.y - start[1])
    tick = world.scenario.tick
    assert (gone <= distances + speeds * tick + 1e-6).all()
    assert gone == pytest.approx(distances, abs=float(speeds.max()) * tick) or name != "bravo"
    assert all(state is not None and state.at_rest for state in (world.robots[i].rest_state() for i in range(count)))


def test_the_account_of_a_simulated_fleet_tells_stopping_and_at_rest_apart() -> None:
    fleet = sleepcast.open("bravo", robots=50, seed=2)
    fleet.send("(DRIVE 20kn 0)", everybody=True)
    fleet.run(40)
    stop = fleet.stop()
    assert rest(stop.account) == (0, 50, 0)
    assert (len(stop.matched), len(stop.at_rest), len(stop.stopping)) == (50, 0, 50)
    assert not stop.account.stands
    state = stop.stopping["scout1"]
    assert 9.0 < state.speed < 20.0 * 1852.0 / 3600.0
    assert state.distance == pytest.approx(state.speed**2)
    fleet.run(10)
    some = stop.stopping["scout1"]
    assert 0.0 < some.speed < state.speed
    fleet.run(20)
    assert rest(stop.account) == (50, 0, 0)
    assert (stop.account.stands, len(stop.at_rest), stop.stopping) == (True, 50, {})
    fleet.release()
    fleet.send("(DRIVE 20kn 0)", everybody=True)
    fleet.run(5)
    assert rest(stop.account) == (50, 0, 0), "what comes later is no part of it"


def test_a_snapshot_keeps_who_was_not_at_rest(tmp_path: Path) -> None:
    fleet = sleepcast.open("bravo", robots=10, seed=2)
    fleet.send("(DRIVE 20kn 0)", everybody=True)
    fleet.run(40)
    stop = fleet.stop()
    fleet.save(tmp_path / "a.snap")
    again = sleepcast.resume(tmp_path / "a.snap")
    command = next(each for each in again.station.commands() if each.id == stop.id)
    assert rest(again.station.accounting(command.id)) == rest(stop.account) == (0, 10, 0)
    for run in (fleet, again):
        run.run(30)
    assert rest(again.station.accounting(command.id)) == rest(stop.account) == (10, 0, 0)


def test_a_robot_that_was_stopped_begins_its_next_life_at_rest(tmp_path: Path) -> None:
    """Not at the speed at which its scenario lets robots begin."""
    for stopped in (False, True):
        world = Simulator(find_scenario("bravo", Changes(1, None, True)), 1, choose("numpy", 1))
        body = world.robots[0]
        assert world.bodies.speed[0] > 0.0
        node = Node("r1", vocabulary_of(body.model), body=body)
        if stopped:
            stand(node, "")
        x = float(world.x[0])
        world.step()
        state = node.rest_state()
        assert state is not None
        assert state.at_rest is stopped
        assert (float(world.x[0]) == x) is stopped


def test_a_body_on_wheels_that_turns_on_the_spot_is_not_at_rest() -> None:
    world = Simulator(find_scenario("maze", Changes(2, None, True)), 1, choose("numpy", 1))
    body = world.robots[0]
    body.drive(0.0, 1.0)
    for _ in range(20):
        world.step()
    state = body.rest_state()
    assert state.speed > 0.0
    assert state.distance == pytest.approx(0.0, abs=1e-9)
