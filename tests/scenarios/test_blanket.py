"""Blanket: how much of a field a number of sensors watch, at random and spread by a rule."""

from __future__ import annotations

from math import pi

import numpy as np
import pytest

import sleepcast as sc
from sleepcast.experiments.measures import read_measure

WATCHED = read_measure("covered 5m")
REACH, SIDE = 5.0, 60.0
DISC = pi * REACH**2 / SIDE**2
"""Of the field, by one sensor."""
AT_RANDOM = (pi * REACH**2 - 8 / 3 * REACH**3 / SIDE + REACH**4 / (2 * SIDE**2)) / SIDE**2
"""The chance that two places of the field are within reach of each other."""


def watched(seed: int, sensors: int, *, arranged: bool) -> float:
    over = {"constants.ARRANGED": int(arranged)}
    with sc.open("blanket", seed=seed, robots=sensors, over=over, mission=True, threads=1) as fleet:
        fleet.run(60.0 if arranged else 1.0, quiet=True)
        return WATCHED(fleet)


def test_few_sensors_that_spread_watch_nothing_twice() -> None:
    assert 0.96 * 20 * DISC < watched(1, 20, arranged=True) < 1.01 * 20 * DISC


def test_sensors_that_stay_watch_what_chance_says() -> None:
    found = np.mean([watched(seed, 30, arranged=False) for seed in range(1, 9)])
    assert found == pytest.approx(1 - (1 - AT_RANDOM) ** 30, abs=0.04)
    assert found < 0.8 * 30 * DISC, "the rule is what avoids watching places twice"


@pytest.mark.nightly
def test_held_out_seeds() -> None:
    for sensors in (10, 30, 50):
        random = [watched(seed, sensors, arranged=False) for seed in range(100, 140)]
        arranged = [watched(seed, sensors, arranged=True) for seed in range(100, 110)]
        assert np.mean(random) == pytest.approx(1 - (1 - AT_RANDOM) ** sensors, abs=0.02)
        assert min(arranged) > max(0.85 * min(1.0, sensors * DISC), np.mean(random) + 0.02)
        assert max(arranged) <= 1.01 * min(1.0, sensors * DISC)
