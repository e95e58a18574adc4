"""The example that evolves a controller: candidates get better, and what they are taught is what the paper has."""

from __future__ import annotations

from pathlib import Path
from runpy import run_path

import numpy as np
import pytest

EXAMPLE = run_path(str(Path(__file__).resolve().parents[2] / "examples" / "evolve_gauci.py"))


def test_the_published_speeds_are_those_of_the_scenario() -> None:
    """BACK, ARC and SPIN of `gauci`, in m/s and rad/s."""
    text = EXAMPLE["rule"](EXAMPLE["PUBLISHED"])
    for name, value in (("blind_speed", -0.1088), ("seeing_speed", 0.0)):
        assert f"(DEFVAR {name} {value:.4f}m/s)" in text
    for name, degrees in (("blind_turn", -43.14), ("seeing_turn", -287.6)):
        told = float(text.partition(f"{name} ")[2].partition("rad")[0])
        assert np.rad2deg(told) == pytest.approx(degrees, abs=0.05)


def test_robots_gather_by_them_and_others_do_not() -> None:
    apart = EXAMPLE["dispersion"]([EXAMPLE["PUBLISHED"], np.zeros(4)], [1, 2], 30.0)
    assert apart.shape == (2, 2)
    assert (apart[0] < 0.6 * apart[1]).all()


def test_a_few_generations_get_better() -> None:
    evolved = EXAMPLE["evolve"](2, 5.0, quiet=True)
    apart = EXAMPLE["dispersion"]([evolved, np.array([0.5, 0.9, -0.3, 0.2])], [3, 4], 20.0)
    assert apart[0].mean() < apart[1].mean()
