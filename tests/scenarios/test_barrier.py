"""Barrier: who gets through a line of guards unseen, against probability."""

from __future__ import annotations

import numpy as np
import pytest

import sleepcast as sc

WATCHED = 2 * 2.5 / 100.0
"""Of the width of the strip, by one guard."""
AT_RANDOM = WATCHED - (WATCHED / 2) ** 2
"""The same on average, if the guard stands anywhere: part of its reach may lie outside."""


def unseen(seed: int, guards: int, *, arranged: bool) -> float:
    """Share of intruders that get through unseen."""
    over = {"constants.GUARDS": guards, "constants.ARRANGED": int(arranged)}
    with sc.open("barrier", seed=seed, over=over, mission=True, threads=1) as fleet:
        fleet.run(160.0, quiet=True)
        through = fleet["(AND (= role INTRUDER) (INSIDE north))"] > 0
        assert through.sum() == 200
        missed = float(np.nanmean(1.0 - fleet["seen"]))
        assert fleet["(IN unseen)"].sum() == pytest.approx(200 * missed)
        return missed


def test_guards_side_by_side_leave_only_the_gaps_between_them() -> None:
    assert unseen(1, 10, arranged=True) == pytest.approx(1 - 10 * WATCHED, abs=0.1)
    assert unseen(1, 22, arranged=True) < 0.02


def test_guards_at_random_let_as_many_through_as_chance_says() -> None:
    missed = np.mean([unseen(seed, 20, arranged=False) for seed in range(1, 4)])
    assert missed == pytest.approx((1 - AT_RANDOM) ** 20, abs=0.15)
    assert missed > 0.15, "at random twenty guards do not close the line"


@pytest.mark.nightly
def test_held_out_seeds() -> None:
    for guards in (5, 10, 20, 40):
        random = [unseen(seed, guards, arranged=False) for seed in range(100, 130)]
        arranged = [unseen(seed, guards, arranged=True) for seed in range(100, 110)]
        assert np.mean(random) == pytest.approx((1 - AT_RANDOM) ** guards, abs=0.06)
        assert np.mean(arranged) == pytest.approx(max(0.0, 1 - guards * WATCHED), abs=0.03)
