"""Robots that wait where they meet, the longer the brighter it is, gather at the lamp; without waiting they do not."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

import sleepcast as sc
from sleepcast.experiments.measures import read_measure
from sleepcast.experiments.plan import experiment_of_scenario


def near(seeds: Sequence[int], *, wait: str = "120s", moments: int = 5) -> float:
    """Mean share of the robots near the lamp, after five minutes and at so many moments 30 s apart."""
    experiment = experiment_of_scenario("beeclust")
    assert experiment
    measure = read_measure(experiment.measures["near"])
    found = []
    for seed in seeds:
        with sc.open("beeclust", seed=seed, over={"constants.WAIT": wait}, mission=True, threads=1) as fleet:
            fleet.run(300, quiet=True)
            for _ in range(moments):
                found.append(measure(fleet))
                fleet.run(30, quiet=True)
    return float(np.mean(found))


def test_they_gather_at_the_lamp() -> None:
    assert near((1,), moments=2) > 0.35


def test_without_waiting_they_are_spread() -> None:
    assert near((1,), wait="0s", moments=2) < 0.25


@pytest.mark.nightly
def test_held_out_seeds() -> None:
    """Without waiting the share is that of the area, 0.126."""
    seeds = range(100, 106)
    assert near(seeds, moments=10) >= 0.35
    assert 0.07 <= near(seeds, wait="0s", moments=10) <= 0.18
