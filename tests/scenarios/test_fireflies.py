"""Fireflies: robots that see flashes come to flash together; how long two of them take, against theory."""

from __future__ import annotations

from collections.abc import Sequence
from math import log

import numpy as np
import pytest

import sleepcast as sc
from sleepcast.experiments.measures import read_measure

TOGETHER = read_measure("order (* 360deg phase)")
ALIKE = read_measure("std phase")
CYCLE = 10.0
"""s."""


def order(seeds: Sequence[int], seconds: float, **over: object) -> list[float]:
    """The order of the phases after so many seconds, by seed."""
    found = []
    for seed in seeds:
        with sc.open("fireflies", seed=seed, over=over, mission=True, threads=1) as fleet:
            found.append(TOGETHER(fleet.run(seconds, quiet=True)))
    return found


def time_of_two(seed: int, pull: float) -> float:
    """Simulated seconds until two robots flash together."""
    over = {"constants.PULL": pull, "pings.reach": "60m"}
    with sc.open("fireflies", robots=2, seed=seed, over=over, mission=True, threads=1) as fleet:
        fleet.run(1.0, quiet=True)
        while ALIKE(fleet) > 0.02:
            fleet.run(1.0, quiet=True)
        return fleet.time


def test_robots_that_see_far_flash_together() -> None:
    assert min(order((1, 2), 120.0, **{"pings.reach": "15m"})) > 0.95


def test_robots_that_do_not_heed_flashes_or_see_none_do_not() -> None:
    assert max(order((1,), 120.0, **{"pings.reach": "15m", "constants.PULL": 1})) < 0.3
    assert max(order((1,), 120.0, **{"pings.reach": "0.1m"})) < 0.3


@pytest.mark.nightly
def test_held_out_seeds() -> None:
    seeds = range(100, 110)
    assert sum(each > 0.95 for each in order(seeds, 300.0, **{"pings.reach": "15m"})) >= 9
    assert max(order(seeds, 300.0, **{"pings.reach": "15m", "constants.PULL": 1})) < 0.35
    # 1 / ln a flashes on average, half a cycle each
    means = [np.mean([time_of_two(seed, pull) for seed in range(100, 160)]) for pull in (1.1, 1.2, 1.4)]
    theory = [CYCLE / (2 * log(pull)) for pull in (1.1, 1.2, 1.4)]
    assert means == pytest.approx(theory, rel=0.3)
