"""The best of two sites: who hears few others chooses slowly and well, who hears many fast and at random."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import pytest

import sleepcast as sc

PATIENCE = 2400.0
"""Simulated seconds after which nobody waits for an agreement any more."""


def choices(seeds: Iterable[int], near: str, *, modulated: bool = True) -> list[tuple[float, float]]:
    """Of each run: the seconds until all agree, and the share of robots that are for the better site then."""
    found = []
    for seed in seeds:
        over = {"constants.NEAR": near, "constants.MODULATED": int(modulated)}
        with sc.open("best-of-n", seed=seed, over=over, mission=True, threads=1) as fleet:
            while fleet.time < PATIENCE and np.ptp(fleet["opinion"]) > 0.0:
                fleet.run(10.0, quiet=True)
            found.append((fleet.time, float((fleet["opinion"] == 1.0).mean())))
    return found


def test_they_agree_and_each_judges_the_site_of_its_opinion() -> None:
    with sc.open("best-of-n", seed=1, over={"constants.NEAR": "1m"}, mission=True, threads=1) as fleet:
        fleet.run(60.0, quiet=True)
        found, spreading = fleet["found"], (fleet["task"] == 0.0) & (fleet["found"] > 0.0)
        assert set(found[spreading]) == {1.0, 0.75}
        while np.ptp(fleet["opinion"]) > 0.0:
            fleet.run(10.0, quiet=True)
            assert fleet.time < PATIENCE


@pytest.mark.nightly
def test_a_larger_neighbourhood_is_faster_and_less_accurate() -> None:
    from scipy.stats import (
        fisher_exact,
        mannwhitneyu,
    )  # importing it takes a second, which every process would wait for

    """Held-out seeds; both signs at p < 0.01."""
    seeds = range(100, 140)
    few, many = choices(seeds, "15cm"), choices(seeds, "1m")
    assert mannwhitneyu([t for t, _ in many], [t for t, _ in few], alternative="less").pvalue < 0.01
    right = [sum(better > 0.5 for _, better in each) for each in (few, many)]
    table = [[right[0], len(few) - right[0]], [right[1], len(many) - right[1]]]
    assert fisher_exact(table, alternative="greater").pvalue < 0.01, right


@pytest.mark.nightly
def test_without_modulation_the_better_site_wins_by_chance() -> None:
    right = sum(better > 0.5 for _, better in choices(range(140, 180), "20cm", modulated=False))
    assert 12 <= right <= 28, right
