"""Lloyd: robots that drive to the centroids of their Voronoi cells cover a field ever better, and in the end well."""

from __future__ import annotations

from math import sqrt

import numpy as np
import pytest

import sleepcast as sc
from sleepcast.experiments.measures import read_measure

COST = read_measure("voronoi_cost")
BEST = 5.0 * 40.0 * 40.0 / (18.0 * sqrt(3.0) * 24.0)
"""m2; see the scenario's page."""
RISE = 1e-9
"""Of the cost, by which rounding may make it rise in a tick."""
TO_ALL_OTHERS = "(RULE cover (GOTO (MEAN_X SIGHT) (MEAN_Y SIGHT)))"


def costs(seed: int, ticks: int = 120, rule: str | None = None, **constants: str) -> np.ndarray:
    """The cost before each tick and at the end, m2. rule: what robots do instead of the mission."""
    over = {f"constants.{name}": value for name, value in constants.items()}
    with sc.open("lloyd", seed=seed, over=over, mission=rule is None, threads=1) as fleet:
        if rule is not None:
            fleet.send(rule, everybody=True)
        found = [COST(fleet)]
        for _ in range(ticks):
            fleet.run(fleet.swarm.simulator.scenario.tick, quiet=True)
            found.append(COST(fleet))
    return np.array(found)


def never_rises(found: np.ndarray) -> bool:
    return bool((np.diff(found) <= RISE * found[:-1]).all())


def test_the_cost_never_rises_and_ends_near_the_best() -> None:
    found = costs(1)
    assert never_rises(found)
    assert found[0] > 300.0
    assert BEST < found[-1] < 1.2 * BEST


def test_with_short_sight_it_never_rises_either_but_ends_higher() -> None:
    found = costs(1, ticks=80, SIGHT="8m")
    assert never_rises(found)
    assert 3.0 * BEST < found[-1] < 0.5 * found[0]


def test_robots_that_drive_to_the_middle_of_the_others_cover_less_and_less() -> None:
    found = costs(1, ticks=60, rule=TO_ALL_OTHERS)
    assert not never_rises(found)
    assert found[-1] > found[0]


@pytest.mark.nightly
def test_held_out_seeds() -> None:
    for seed in range(100, 140):
        found = costs(seed, ticks=160)
        assert never_rises(found), seed
        assert BEST < found[-1] < 1.2 * BEST, seed
        assert not never_rises(costs(seed, ticks=60, rule=TO_ALL_OTHERS)), seed
