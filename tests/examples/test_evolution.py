"""The example that evolves a controller: candidates get better, and what they are taught is what the paper has."""

from __future__ import annotations

from pathlib import Path
from runpy import run_path

import numpy as np
import pytest

EXAMPLE = run_path(str(Path(__file__).resolve().parents[2] / "examples" / "evolve_gauci.py"))
PUBLISHED, Round, Trial = (EXAMPLE[name] for name in ("PUBLISHED", "Round", "Trial"))
RING = np.array([0.584, -0.545, 0.809, 0.808])
"""Who sees somebody drives there: they gather soon, and then chase each other in a ring."""


def test_the_published_speeds_are_those_of_the_scenario() -> None:
    """BACK, ARC and SPIN of `gauci`, in m/s and rad/s."""
    text = EXAMPLE["rule"](PUBLISHED)
    for name, value in (("blind_speed", -0.1088), ("seeing_speed", 0.0)):
        assert f"(DEFVAR {name} {value:.4f}m/s)" in text
    for name, degrees in (("blind_turn", -43.14), ("seeing_turn", -287.6)):
        told = float(text.partition(f"{name} ")[2].partition("rad")[0])
        assert np.rad2deg(told) == pytest.approx(degrees, abs=0.05)


def test_robots_gather_by_them_and_others_do_not() -> None:
    apart = EXAMPLE["dispersion"](np.array([PUBLISHED, np.zeros(4), RING]), [1, 2], 2.0, 40.0)
    assert apart.shape == (3, 2)
    assert (apart[0] < 0.2 * apart[1]).all()
    assert (apart[0] < apart[2]).all()  # so a round of 40 s is long enough to tell a heap from a ring


def test_new_candidates_are_half_of_all_speeds_and_their_mirror_images_are_not_tried() -> None:
    new = EXAMPLE["born"](Round(500, 0, 0.0, Trial(2.0, 1.0, 1)), np.empty((0, 4)), np.random.default_rng(1))
    assert new.shape == (500, 4)
    assert (new[:, 0] >= new[:, 1]).all()
    assert 0.3 < np.mean(new[:, 2] > new[:, 3]) < 0.7
    assert np.abs(new).max() <= 1.0


def test_children_are_near_those_who_were_kept() -> None:
    best = np.array([[0.9, 0.5, 0.0, -0.9], [0.5, 0.1, 0.3, 0.3], [-0.5, -0.9, -1.0, 1.0]])
    born = EXAMPLE["born"](Round(40, 2, 0.05, Trial(2.0, 1.0, 1)), best, np.random.default_rng(1))
    assert (born[:2] == best[:2]).all()
    apart = np.abs(born[2:, None, :] - best[:2]).max(axis=2)
    assert (apart.min(axis=1) < 0.25).all()
    assert (apart.argmin(axis=1) == 0).any()
    assert (apart.argmin(axis=1) == 1).any()
    assert np.abs(born).max() <= 1.0


def test_a_small_search_finds_better_ones_and_the_same_ones_again() -> None:
    rounds = Round(24, 0, 0.0, Trial(2.0, 15.0, 1)), Round(8, 4, 0.1, Trial(2.0, 25.0, 1))
    evolved = EXAMPLE["evolve"](rounds, quiet=True)
    assert (evolved == EXAMPLE["evolve"](rounds, quiet=True)).all()
    apart = EXAMPLE["dispersion"](np.array([evolved, np.zeros(4)]), [3, 4], 2.0, 40.0)
    assert apart[0].mean() < 0.7 * apart[1].mean()


def test_it_says_which_one_gathers_better() -> None:
    def said(speeds: object) -> str:
        return str(EXAMPLE["compared"](speeds, range(3, 5), 20.0))

    assert said(PUBLISHED).endswith("the evolved one is no worse")
    assert said(np.zeros(4)).endswith("the evolved one is worse")


@pytest.mark.nightly
def test_the_whole_search_ends_no_worse_than_the_published_speeds() -> None:
    assert EXAMPLE["compared"](EXAMPLE["evolve"](quiet=True)).endswith("the evolved one is no worse")
