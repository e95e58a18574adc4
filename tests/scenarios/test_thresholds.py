"""Division of labour: low thresholds work first, and work is shared anew when they are taken away."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

import sleepcast as sc
from sleepcast.experiments.measures import read_measure
from sleepcast.experiments.plan import experiment_of_scenario
from sleepcast.simulator import find_scenario

ALIKE = """(RULE respond
  (IF busy
    (WHEN (PROB (* QUIT ONE_TICK)) (SETQ busy 0))
    (WHEN (PROB (* 0.2 ONE_TICK)) (SETQ busy 1))))"""
"""The control: all begin as often, however much there is to do."""


class Shares(NamedTuple):
    """The share of their time that robots with a low and with a high threshold work, and what is left to do."""

    low: float
    high: float
    left: float


def work(fleet: sc.SimulatedFleet, seconds: float) -> Shares:
    """What is done from now on."""
    fleet.send("(SETQ worked 0)", everybody=True, wait=0)
    fleet.run(seconds, quiet=True)
    worked = fleet["worked"] / seconds
    return Shares(worked[:50].mean(), worked[50:].mean(), fleet.swarm.simulator.stocks()["work"])


def before_and_after(seed: int, seconds: float, control: bool = False) -> tuple[Shares, Shares]:
    """The shares with everybody, and without those that have a low threshold."""
    begin, respond, labour, remove = (command.text for command in find_scenario("thresholds").commands)
    with sc.open("thresholds", seed=seed, threads=1) as fleet:
        for text in (begin, ALIKE if control else respond, labour):
            fleet.send(text, everybody=True)
        fleet.run(40, quiet=True)
        before = work(fleet, seconds)
        fleet.send(remove)
        fleet.run(60, quiet=True)
        return before, work(fleet, seconds)


def hold(before: Shares, after: Shares) -> None:
    assert before.low > 2.0 * before.high
    assert after.low == 0.0
    assert after.high > 3.0 * before.high
    assert after.left < 25.0


def test_low_thresholds_work_first_and_the_others_step_in() -> None:
    hold(*before_and_after(1, 60.0))


def test_without_thresholds_the_work_piles_up() -> None:
    before, after = before_and_after(1, 60.0, control=True)
    assert abs(before.low - before.high) < 0.1
    assert abs(after.high - before.high) < 0.1
    assert after.left > 25.0


@pytest.mark.nightly
def test_held_out_seeds_follow_theory() -> None:
    experiment = experiment_of_scenario("thresholds")
    assert experiment
    errors = []
    for seed in range(100, 105):
        before, after = before_and_after(seed, 240.0)
        hold(before, after)
        for removed, found in ((0, before.high), (50, after.high)):
            with sc.open("thresholds", over={"constants.REMOVED": removed}) as fleet:
                errors.append(found - read_measure(experiment.measures["high_theory"])(fleet))
    assert np.max(np.abs(errors)) < 0.03
