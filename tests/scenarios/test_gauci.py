"""Aggregation without computation: one bit of sight gathers robots that slide, and none that see little or jam."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

import sleepcast as sc
from sleepcast.experiments.measures import read_measure

GATHERED = read_measure("largest_cluster 12cm")


def gathered(seeds: Sequence[int], seconds: float, **over: object) -> list[float]:
    """Share of the robots in the largest cluster in the end."""
    found = []
    for seed in seeds:
        changes = {key.replace("__", "."): value for key, value in over.items()}
        with sc.open("gauci", seed=seed, over=changes, mission=True, threads=1) as fleet:
            fleet.run(seconds, quiet=True)
            found.append(GATHERED(fleet))
    return found


def test_robots_that_see_one_bit_gather() -> None:
    assert min(gathered((1, 2), 300.0, robots__count=20)) > 0.95


def test_robots_that_see_little_do_not() -> None:
    assert max(gathered((1, 2), 120.0, constants__FAR="0.2m")) < 0.3


def test_robots_that_turn_the_other_way_scatter() -> None:
    with sc.open("gauci", seed=1, threads=1) as fleet:
        spread = read_measure("gyration")
        before = spread(fleet)
        fleet.send("(RULE flee (IF (< (SONAR 0) FAR) (DRIVE 0 (- SPIN)) (DRIVE BACK ARC)))", everybody=True)
        fleet.run(120, quiet=True)
        assert spread(fleet) > 1.5 * before


@pytest.mark.nightly
def test_held_out_seeds() -> None:
    """Nine runs of ten end with 95 % in one cluster; bodies that stop where they touch never do."""
    seeds = range(100, 110)
    assert sum(share >= 0.95 for share in gathered(seeds, 600.0)) >= 9
    assert max(gathered(seeds, 600.0, robots__body__contact="stop")) < 0.7
