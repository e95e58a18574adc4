"""Following the gap: robots with a scanner drive through a course that stops blind ones at its first walls."""

from __future__ import annotations

from typing import NamedTuple

import pytest

import sleepcast as sc
from sleepcast.experiments.measures import read_measure

THROUGH, BUMPS, FARTHEST = map(read_measure, ("share (> x FINISH)", "mean bumps", "max x"))
SECOND_WALL = 9.0
"""x of the second wall, m."""


class Driven(NamedTuple):
    """through: share of the robots; bumps: of a robot; farthest: x of the first one, m; seconds: until all were."""

    through: float
    bumps: float
    farthest: float
    seconds: float


def drive(seed: int, seconds: float = 120.0, **over: object) -> Driven:
    changes = {f"constants.{name}": value for name, value in over.items()}
    with sc.open("follow-the-gap", seed=seed, over=changes, mission=True, threads=1) as fleet:
        while fleet.time < seconds - 0.01 and THROUGH(fleet) < 1.0:
            fleet.run(2.0, quiet=True)
        return Driven(THROUGH(fleet), BUMPS(fleet), FARTHEST(fleet), fleet.time)


@pytest.mark.parametrize("seed", [101, *(pytest.param(each, marks=pytest.mark.nightly) for each in range(102, 112))])
def test_all_get_through_by_the_widest_gap(seed: int) -> None:
    found = drive(seed)
    assert found.through == 1.0, found
    assert found.bumps < 3.0, found


@pytest.mark.parametrize("seed", [101, *(pytest.param(each, marks=pytest.mark.nightly) for each in range(102, 112))])
def test_nobody_gets_through_without_eyes(seed: int) -> None:
    found = drive(seed, seconds=40.0, EYES=0)
    assert found.through == 0.0
    assert found.farthest < SECOND_WALL
