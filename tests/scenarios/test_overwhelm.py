"""Overwhelm: rovers that strike together beat an opponent to which the same rovers, one by one, are lost."""

from __future__ import annotations

from collections.abc import Sequence
from math import sqrt
from typing import NamedTuple

import numpy as np
import pytest

import sleepcast as sc

ENDURANCE, RELOAD = 60.0, 1.0
"""s: what wears the opponent out, and between two of its shots."""
ALL_TAKE_PART = {"constants.NEAR": "142m", "constants.FUELLED": "0%"}


class Fight(NamedTuple):
    """How a fight ended: rovers in the strike, rovers left of all, and whether the opponent was beaten."""

    strike: int
    left: int
    beaten: bool


def fight(mission: str, seed: int, **over: object) -> Fight:
    with sc.open(
        "overwhelm", seed=seed, over={"mission": f"{mission}.sleep", **over}, mission=True, threads=1
    ) as fleet:
        fleet.run(75.0, quiet=True)
        strike = 0 if mission == "no-order" else int((fleet["(IN strike)"] > 0).sum())
        return Fight(strike, int((fleet["fallen"] == 0).sum()), bool((fleet["strength"] == 0).any()))


def fights(mission: str, seeds: Sequence[int], **over: object) -> list[Fight]:
    return [fight(mission, seed, **over) for seed in seeds]


def of(rovers: int) -> dict[str, object]:
    return {**ALL_TAKE_PART, "robots[0].groups.ours.count": rovers}


def square_law(rovers: int) -> float:
    """Rovers that are left of so many, if all come into reach at the same moment."""
    return sqrt(max(0.0, rovers**2 - 2.0 * ENDURANCE / RELOAD))


def test_together_they_beat_it_and_one_by_one_they_are_lost() -> None:
    together, alone = fight("together", 1, **of(20)), fight("one-by-one", 1, **of(20))
    assert together.strike == alone.strike == 20
    assert together.beaten
    assert together.left >= 5
    assert not alone.beaten
    assert alone.left == 0


def test_too_few_are_lost_together_as_well() -> None:
    assert fight("together", 1, **of(6)) == (6, 0, False)


def test_without_an_order_nobody_strikes() -> None:
    found = fight("no-order", 1, **of(20))
    assert not found.beaten
    assert found.left > 10


def test_something_moves_from_the_start_and_the_strike_gathers_out_of_reach() -> None:
    with sc.open("overwhelm", seed=1, mission=True, threads=1) as fleet:
        x, y = fleet.x.copy(), fleet.y.copy()
        fleet.run(10.0, quiet=True)
        assert np.hypot(fleet.x - x, fleet.y - y).mean() > 1.0
        fleet.run(30.0, quiet=True)
        strike = (fleet["(IN strike)"] > 0) & (fleet["fallen"] == 0)
        away = np.hypot(fleet.x - fleet.x[-1], fleet.y - fleet.y[-1])[strike]
        assert away.min() > 4.0
        assert away.max() < 20.0


@pytest.mark.nightly
def test_held_out_seeds() -> None:
    seeds = range(100, 120)
    assert sum(each.beaten for each in fights("together", seeds)) >= 19
    assert sum(each.beaten for each in fights("one-by-one", seeds)) <= 8
    assert not any(each.beaten for each in fights("no-order", seeds[:5]))
    for rovers in (20, 30):
        left = np.mean([each.left for each in fights("together", seeds, **of(rovers))])
        assert square_law(rovers) - 5.0 < left < square_law(rovers), "the first are lost before the last are there"
    assert np.mean([each.left for each in fights("one-by-one", seeds, **of(16))]) < 1.0
