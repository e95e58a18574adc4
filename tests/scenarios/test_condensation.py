"""Condensation: a scattered group contracts to a point, if its robots see far enough and drive away from their gaps."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

import sleepcast as sc
from sleepcast.experiments.measures import read_measure

GROUPS, SPREAD = read_measure("clusters 2m"), read_measure("gyration")
CONDENSED = 0.6
"""Root mean square distance from the centre, m, of a group that has met: the last robots still drive to and fro."""


two_or_three = pytest.mark.parametrize(
    "seeds", [range(1, 3), pytest.param(range(1, 4), marks=pytest.mark.nightly)], ids=str
)


def ended(seeds: Sequence[int], sight: str, seconds: float = 300.0) -> list[tuple[float, float]]:
    """Number of groups and spread in the end, by seed."""
    found = []
    for seed in seeds:
        with sc.open("condensation", seed=seed, over={"constants.SIGHT": sight}, mission=True, threads=1) as fleet:
            fleet.run(seconds, quiet=True)
            found.append((GROUPS(fleet), SPREAD(fleet)))
    return found


@two_or_three
def test_a_group_that_sees_itself_contracts_to_a_point(seeds: range) -> None:
    for groups, spread in ended(seeds, "200m"):
        assert groups == 1
        assert spread < CONDENSED


@two_or_three
def test_a_group_that_sees_little_breaks_up(seeds: range) -> None:
    for groups, spread in ended(seeds, "10m"):
        assert groups > 8
        assert spread > 20.0


def test_driving_into_the_gaps_scatters_the_group() -> None:
    with sc.open("condensation", seed=1, threads=1) as fleet:
        before = SPREAD(fleet)
        fleet.send(
            "(RULE scatter (GOTO (+ x (COS (GAP_BEARING SIGHT))) (+ y (SIN (GAP_BEARING SIGHT)))))", everybody=True
        )
        fleet.run(60, quiet=True)
        assert SPREAD(fleet) > before


@pytest.mark.nightly
def test_held_out_seeds() -> None:
    ends = ended(range(100, 140), "32m")
    assert sum(groups == 1 and spread < CONDENSED for groups, spread in ends) >= 38
    assert min(groups for groups, _ in ended(range(100, 120), "10m")) > 5
