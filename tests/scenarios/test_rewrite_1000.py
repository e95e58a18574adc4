"""A new rule for a thousand robots: with each broadcast the share that lacks it is multiplied by the loss."""

from __future__ import annotations

from itertools import count
from math import isnan

import pytest

import sleepcast as sc
from sleepcast.experiments.measures import if_known, read_measure

RUNNING = if_known(read_measure("share (= version 2)"))
ENTER, EVERY = 10.0, 0.5
"""s: when the mission sends the new rule first, and how often."""
HEARD = 0.1
"""s from a broadcast until a robot runs what it has heard: delay, jitter and the rest of a tick."""


def seconds(loss: float, seed: int, most: float = 8.0) -> float:
    """From Enter until 99 % run the new rule, s; `most` if they do not."""
    with sc.open("rewrite-1000", seed=seed, over={"radio.loss": loss}, mission=True, threads=1) as fleet:
        fleet.run(ENTER, quiet=True)
        while fleet.time < ENTER + most:
            fleet.run(HEARD, quiet=True)
            share = RUNNING(fleet)
            if not isnan(share) and share >= 0.99:
                return fleet.time - ENTER
    return most


def broadcasts(loss: float, enough: float) -> int:
    """After how many only this share lacks the rule, on average."""
    return next(number for number in count(1) if loss**number <= enough)


@pytest.mark.parametrize("loss", [0.0, 0.1, 0.3, 0.5])
def test_time_until_nearly_all_run_the_new_rule(loss: float) -> None:
    """Between what it would take if 1.5 % might lack it, and if only 0.5 % might: a thousand robots vary as much."""
    least = (broadcasts(loss, 0.015) - 1) * EVERY
    most = (broadcasts(loss, 0.005) - 1) * EVERY + 2 * HEARD
    assert least - 1e-6 < seconds(loss, seed=1) < most + 1e-6


def test_a_rule_that_is_sent_once_never_reaches_them() -> None:
    with sc.open("rewrite-1000", seed=1, threads=1) as fleet:
        rule = fleet.swarm.simulator.scenario.commands[-1].text
        fleet.send(rule, everybody=True, wait=0)
        fleet.run(8.0, quiet=True)
        assert 0.65 < RUNNING(fleet) < 0.75


@pytest.mark.nightly
@pytest.mark.parametrize("loss", [0.1, 0.3, 0.5])
def test_held_out_seeds(loss: float) -> None:
    found = [seconds(loss, seed) for seed in range(100, 120)]
    assert max(found) < (broadcasts(loss, 0.003) - 1) * EVERY + 2 * HEARD
