"""Shapes of a school: a swarm, a ring that turns, or a school that travels, by how far robots head alike."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

import sleepcast as sc
from sleepcast.experiments.measures import read_measure

SAME_WAY, TURNING = read_measure("polarization"), read_measure("rotation")


def shapes(seeds: Sequence[int], alike: str, seconds: float = 180.0) -> list[str]:
    """What the group is in the end: a "swarm", a "ring" or a "school"."""
    found = []
    for seed in seeds:
        with sc.open("couzin", seed=seed, over={"constants.HEAD_ALIKE": alike}, mission=True, threads=1) as fleet:
            fleet.run(seconds, quiet=True)
            school, ring = SAME_WAY(fleet) > 0.7, TURNING(fleet) > 0.7
            found.append("school" if school else "ring" if ring else "swarm")
    return found


def test_the_width_of_one_zone_decides() -> None:
    assert shapes((1,), "1m", 60.0) == ["swarm"]
    assert shapes((1,), "1.5m", 180.0) == ["ring"]
    assert shapes((1,), "12m", 60.0) == ["school"]


@pytest.mark.nightly
def test_held_out_seeds() -> None:
    seeds = range(100, 110)
    assert shapes(seeds, "1m").count("swarm") >= 9
    assert shapes(seeds, "1.5m").count("ring") >= 8
    assert shapes(seeds, "12m").count("school") >= 9
