"""Search: what is found at random and in lanes, against Gage's two laws."""

from __future__ import annotations

from math import exp, log

import numpy as np
import pytest

import sleepcast as sc

CHANCE = 0.5
COVERAGE = 2 * 4.0 * 1.0 * 25 / 200.0**2
"""Of the field in a second: twice the radius, the speed and the searchers, by its area."""
LAID_OUT = 290.0
"""s that searchers drive to their lanes; 200 s later they are through."""


def found(mission: str, seeds: range, *times: float, chance: float = CHANCE) -> np.ndarray:
    """The share found at these times, by seed."""
    shares = []
    for seed in seeds:
        over = {"mission": mission, "constants.CHANCE": chance}
        with sc.open("search", seed=seed, over=over, mission=True, threads=1) as fleet:
            shares.append([np.nanmean(fleet.run(time - fleet.time, quiet=True)["found"]) for time in times])
    return np.array(shares)


three_or_five = pytest.mark.parametrize(
    "seeds", [range(1, 4), pytest.param(range(1, 6), marks=pytest.mark.nightly)], ids=str
)


@three_or_five
def test_a_search_at_random_finds_nearly_what_chance_says(seeds: range) -> None:
    at = (100.0, 200.0, 500.0)
    shares = found("random.sleep", seeds, *at).mean(axis=0)
    law = [1 - exp(-CHANCE * COVERAGE * time) for time in at]
    assert shares == pytest.approx(law, abs=0.06)
    assert (shares < np.array(law) + 0.02).all(), "places are not all equally likely, so it is a little less"


@three_or_five
def test_lanes_find_each_mine_with_the_chance_of_one_pass(seeds: range) -> None:
    shares = found("lanes.sleep", seeds, LAID_OUT, LAID_OUT + 200.0).mean(axis=0)
    assert shares[0] == 0.0, "nobody looks on the way to the lanes"
    assert shares[1] == pytest.approx(CHANCE, abs=0.05)


def test_searchers_that_find_nothing_find_nothing() -> None:
    assert found("random.sleep", range(1, 2), 300.0, chance=0.0) == 0.0


@pytest.mark.nightly
@pytest.mark.parametrize("chance", [0.5, 0.9])
def test_lanes_are_worth_what_gage_says(chance: float) -> None:
    """Held-out seeds. The effort that a random search takes for what lanes find in one pass, in units of theirs."""
    seeds, times = range(100, 140), np.arange(20.0, 1_001.0, 20.0)
    lanes = found("lanes.sleep", seeds, LAID_OUT + 200.0, chance=chance).mean()
    # Searchers look once a metre, so a mine at the rim of two lanes may be out of reach of both.
    assert 0.96 * chance < lanes < 1.02 * chance
    random = found("random.sleep", seeds, *times, chance=chance).mean(axis=0)
    effort = COVERAGE * float(np.interp(lanes, random, times))
    gain = -log(1 - chance) / chance
    assert gain - 0.1 < effort < 1.35 * gain
