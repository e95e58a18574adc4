"""Line-sweep: what a line of sensors finds against its speed, and theory."""

from __future__ import annotations

import numpy as np
import pytest

import sleepcast as sc

REACH, CHANCE, LOOK = 4.0, 0.05, 0.5
"""m; of finding at a look; s from look to look."""
LINED_UP = 50.0


def law(pace: float) -> float:
    """The share that is found, on average over where a target lies in its lane."""
    aside = (np.arange(400) + 0.5) / 400 * REACH
    looks = 2.0 * np.sqrt(REACH**2 - aside**2) / (pace * LOOK)
    return float(np.mean(1.0 - (1.0 - CHANCE) ** looks))


def found(seed: int, pace: float, chance: float = CHANCE) -> float:
    over = {"constants.PACE": f"{pace}m/s", "constants.CHANCE": chance}
    with sc.open("line-sweep", seed=seed, over=over, mission=True, threads=1) as fleet:
        fleet.run(LINED_UP + 95.0 / pace + 5.0, quiet=True)
        sensors = fleet["role"] == 1
        assert (fleet.x[sensors] > 90.0).all(), "the line is through"
        assert np.ptp(fleet.x[sensors]) < 6.0, "side by side"
        return float(np.nanmean(fleet["found"]))


def test_a_fast_line_finds_less_as_theory_says() -> None:
    fast, slow = found(1, 4.0), found(1, 1.0)
    assert fast == pytest.approx(law(4.0), abs=0.08)
    assert slow == pytest.approx(law(1.0), abs=0.1)
    assert fast < 0.5 * slow


def test_sensors_without_a_chance_find_nothing() -> None:
    assert found(1, 4.0, chance=0.0) == 0.0


@pytest.mark.nightly
@pytest.mark.parametrize("pace", [0.5, 1.0, 2.0, 4.0])
def test_held_out_seeds(pace: float) -> None:
    assert np.mean([found(seed, pace) for seed in range(100, 120)]) == pytest.approx(law(pace), abs=0.025)
