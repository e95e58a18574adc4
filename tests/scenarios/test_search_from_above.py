"""Search from above: what footprints find at random and in lanes, against Gage's two laws."""

from __future__ import annotations

import numpy as np
import pytest

import sleepcast as sc

RATE = 10.0 * 4.0 * 20 / 200.0**2
"""Of the field in a second: twice the height, the speed and the searchers, by its area."""
HELD_OUT = range(100, 120)
AT = np.arange(10.0, 151.0, 10.0)
"""s since they began to look."""
BEGIN = {"random.sleep": 10.0, "lanes.sleep": 90.0}
STRAY = "(WHEN (= role SEARCHER) (RULE stray (WHEN (PROB 5%) (SETQ drive_turn (RANDOM -60deg/s 60deg/s)))))"


def found(mission: str, seeds: range, at: np.ndarray, command: str = "") -> np.ndarray:
    """The share found so long after the searchers began to look, on average over these seeds. command: sent then"""
    shares = []
    for seed in seeds:
        with sc.open("search-from-above", seed=seed, over={"mission": mission}, mission=True, threads=1) as fleet:
            fleet.run(BEGIN[mission] - fleet.time, quiet=True)
            if command:
                fleet.send(command, everybody=True)
            shares.append([np.nanmean(fleet.run(BEGIN[mission] + t - fleet.time, quiet=True)["found"]) for t in at])
            assert np.nansum(fleet["crashed"]) == 0.0
    mean: np.ndarray = np.mean(shares, axis=0)
    return mean


def at_random(at: np.ndarray) -> np.ndarray:
    return 1.0 - np.exp(-RATE * at)


def test_at_random_and_in_lanes_they_find_about_what_gage_says() -> None:
    """Two runs at random differ by some points, those in lanes do not."""
    at = np.array([20.0, 50.0])
    assert found("random.sleep", range(1, 3), at) == pytest.approx(at_random(at), abs=0.08)
    assert found("lanes.sleep", range(1, 2), at) == pytest.approx(RATE * at, abs=0.03)


@pytest.mark.nightly
def test_held_out_searches_at_random_meet_the_law_within_three_points() -> None:
    assert found("random.sleep", HELD_OUT, AT) == pytest.approx(at_random(AT), abs=0.03)


@pytest.mark.nightly
def test_held_out_sweeps_meet_the_line_within_three_points() -> None:
    assert found("lanes.sleep", HELD_OUT, AT[:5]) == pytest.approx(RATE * AT[:5], abs=0.03)


@pytest.mark.nightly
def test_searchers_that_keep_turning_fall_behind() -> None:
    """The control, without which the law could be one that nothing misses."""
    at = np.array([50.0, 80.0])
    assert (found("random.sleep", HELD_OUT, at, STRAY) < at_random(at) - 0.1).all()
