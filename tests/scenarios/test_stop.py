"""Two Scouts stop at the next barrier when they are told to: all of them, at ten inches, and nobody sooner."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from scenarios.stopping import INCH, ORDER, SCENARIO, Outcome, Trial, distance, laboratory, poses_of, ruler
from sleepcast.api.assembly import assemble
from sleepcast.loop import Swarm

NEAR, FAR = 8 * INCH, 10 * INCH
"""Where a robot is to stop, m."""
EARLY = FAR + 0.5 * INCH
"""m from the nearest thing; who stopped farther away was misled."""
TWENTY, FOUR, TWO, ONE = range(20), range(4), range(2), range(1)

each_of_four_or_twenty = pytest.mark.parametrize(
    "seed", [pytest.param(seed, marks=() if seed in FOUR else pytest.mark.nightly) for seed in TWENTY]
)
two_or_twenty = pytest.mark.parametrize("seeds", [TWO, pytest.param(TWENTY, marks=pytest.mark.nightly)], ids=str)


@cache
def outcome(seed: int, pause: float | None = None, loss: float = 0.0) -> Outcome:
    return Trial(laboratory(pause, loss=loss), seed).run()


def check(found: Outcome, where: object) -> None:
    """Nobody stood before the order; both stopped between eight and ten inches from something, and stayed."""
    assert found.stood == 0, where
    assert len(found.stops) == 2, where
    assert all(NEAR <= stop.distance <= FAR for stop in found.stops), (where, found)
    assert found.moved == 0.0, where


@each_of_four_or_twenty
def test_both_stop_within_ten_inches_of_something_and_nobody_before_the_order(seed: int) -> None:
    check(outcome(seed), seed)


@pytest.mark.parametrize("loss", [0.02, 0.3])
@two_or_twenty
def test_the_same_where_messages_are_lost(seeds: range, loss: float) -> None:
    """The order is sent until everybody has answered; who hears it twice does not mind."""
    for seed in seeds:
        check(outcome(seed, loss=loss), (seed, loss))


@pytest.mark.parametrize("seeds", [ONE, pytest.param(TWENTY, marks=pytest.mark.nightly)], ids=str)
def test_sonars_that_hear_each_other_stop_robots_early_and_a_longer_pause_cures_most(seeds: range) -> None:
    """As the thesis found it: 4 ms between two pings are too short, 24 ms are enough, or nearly."""
    early = {}
    for pause in (0.004, 0.024):
        found = [outcome(seed, pause) for seed in seeds]
        assert all(len(each.stops) == 2 for each in found)
        early[pause] = np.mean([stop.distance > EARLY for each in found for stop in each.stops])
    assert early[0.004] > 0.7
    assert early[0.024] < 0.15


def test_the_order_may_bring_another_distance_and_another_speed() -> None:
    order = f"""
        (PROGN
          (DEFVAR m0 12in)
          (SETQ m1 4in/s)
          (RULE obey (COND ((AND stopOrder (< front_range m0)) (ST))))
          {ORDER})"""
    trial = Trial(laboratory(), 2)
    found = trial.run(order)
    assert found.stood == 0
    assert all(11.5 * INCH < stop.distance <= 12 * INCH for stop in found.stops), found
    assert all(dict(mind.variables())["m1"] == pytest.approx(4 * INCH) for mind in trial.swarm.minds.values())


def test_the_mission_of_the_scenario_stops_both() -> None:
    swarm, desk = assemble(SCENARIO, None, mission=True)
    swarm.run(SCENARIO.mission[1].time)
    assert min(surroundings(swarm)) > 15 * INCH
    swarm.run(SCENARIO.seconds - swarm.now())
    assert [desk.accounting(command.id).n_matched for command in desk.commands()] == [2, 2]
    assert [dict(mind.variables())["frozen"] for mind in swarm.minds.values()] == [1.0, 1.0]
    assert all(8 * INCH < each < 10 * INCH for each in surroundings(swarm))


def surroundings(swarm: Swarm) -> list[float]:
    """How far each robot is from the nearest thing, m."""
    points, poses = ruler(SCENARIO.shapes), poses_of(swarm)
    return [distance(points, poses, each) for each in range(len(poses))]
