"""A society of strategies: it ends with the one that a trial of each finds best, and has a best size."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest

import sleepcast as sc

UPHILL = 2
SEASON, HALF_AN_HOUR = 150.0, 1800.0


def society(seed: int, seconds: float, robots: int = 16, **constants: object) -> tuple[list[int], float]:
    """How many robots have each plan in the end, and how much algae they killed in a minute."""
    over = {f"constants.{name}": value for name, value in constants.items()}
    with sc.open("society", seed=seed, robots=robots, over=over, mission=True, threads=1) as fleet:
        fleet.run(seconds, quiet=True)
        plans = np.bincount(fleet["plan"].astype(int), minlength=5)[1:].tolist()
        return plans, float(fleet["total"].sum()) / seconds * 60.0


def best_plan(seeds: Iterable[int]) -> int:
    """The plan with which sixteen robots kill most if all have it."""
    killed = {plan: [society(seed, HALF_AN_HOUR, GIVEN=plan)[1] for seed in seeds] for plan in (1, 2, 3, 4)}
    return max(killed, key=lambda plan: float(np.mean(killed[plan])))


def test_what_pays_spreads_and_without_learning_nothing_does() -> None:
    plans, killed = society(1, 3.1 * SEASON)
    assert np.argmax(plans) + 1 == UPHILL
    assert killed > 100.0
    assert society(1, 1.1 * SEASON, ADOPTED=0, CHANCE=0)[0] == [4, 4, 4, 4]


@pytest.mark.nightly
def test_it_ends_with_the_plan_that_a_trial_finds_best() -> None:
    assert best_plan(range(100, 105)) == UPHILL
    ends = [society(seed, HALF_AN_HOUR)[0] for seed in range(110, 120)]
    assert sum(int(np.argmax(plans)) + 1 == UPHILL for plans in ends) >= 8


@pytest.mark.nightly
def test_there_is_a_best_size() -> None:
    def profit(robots: int) -> float:
        killed = [society(seed, HALF_AN_HOUR, robots)[1] for seed in range(120, 124)]
        return float(np.mean(killed)) - 60.0 * 0.06 * robots

    middle = profit(12)
    assert middle > profit(4) + 10.0
    assert middle > profit(32) + 10.0
