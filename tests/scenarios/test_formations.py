"""Formations: places from numbers are met and all different, and hops from a seed put robots in order."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

import sleepcast as sc

ALONE = "(LET ((angle (RANDOM 0deg 360deg))) (GOTO (+ 20m (* 12m (COS angle))) (+ 20m (* 12m (SIN angle)))))"


def closest(fleet: sc.SimulatedFleet) -> float:
    """The least distance between two robots, m."""
    x, y = fleet.x, fleet.y
    away: NDArray[np.float64] = np.hypot(x[:, None] - x, y[:, None] - y) + np.where(np.eye(x.size), np.inf, 0.0)
    return float(away.min())


def farthest_off(fleet: sc.SimulatedFleet) -> float:
    """The greatest distance of a robot from its place, m."""
    return float(np.hypot(fleet.x - fleet["px"], fleet.y - fleet["py"]).max())


def check_the_mission(seed: int) -> None:
    with sc.open("formations", seed=seed, mission=True, threads=1) as fleet:
        fleet.run(39.0, quiet=True)
        assert farthest_off(fleet) < 0.2
        assert np.ptp(fleet.y) < 0.3, "a line"
        assert closest(fleet) > 0.8
        fleet.run(40.0, quiet=True)
        radius = np.hypot(fleet.x - 20.0, fleet.y - 20.0)
        assert radius == pytest.approx(np.full(36, 12.0), abs=0.2), "a circle"
        assert closest(fleet) > 1.8
        fleet.run(40.0, quiet=True)
        radius = np.hypot(fleet.x - 20.0, fleet.y - 20.0)
        assert radius.min() < 5.5, "a star"
        assert radius.max() > 14.5
        assert closest(fleet) > 0.7
        fleet.run(9.5, quiet=True)
        hops = fleet["hops"]
        away = np.hypot(fleet.x - fleet.x[0], fleet.y - fleet.y[0])
        assert (6.0 * hops >= away).all(), "no hop is longer than the radio reaches"
        assert hops.max() >= 5.0
        fleet.run(30.0, quiet=True)
        assert fleet.x == pytest.approx(2.0 + 2.0 * hops, abs=0.2), "ranks"


def test_the_mission_forms_all_of_them() -> None:
    check_the_mission(1)


def test_a_circle_by_chance_has_robots_in_each_others_place() -> None:
    with sc.open("formations", seed=1, threads=1) as fleet:
        fleet.send(ALONE, everybody=True)
        fleet.run(30.0, quiet=True)
        assert np.hypot(fleet.x - 20.0, fleet.y - 20.0) == pytest.approx(np.full(36, 12.0), abs=0.2)
        assert closest(fleet) < 0.5


@pytest.mark.nightly
def test_held_out_seeds() -> None:
    for seed in range(100, 110):
        check_the_mission(seed)
