"""The show: a hundred copters form letters and a sphere; nobody comes near anybody, in wind and over a lossy radio."""

from __future__ import annotations

from math import inf

import numpy as np
import pytest

import sleepcast as sc
from sleepcast.experiments.measures import read_measure

CLOSEST = read_measure("closest")
APART = 1.0
"""m that all keep from each other, at every tick."""
WITHOUT = {"constants.LOOK": "0m"}
"""The control: nobody looks at anybody."""
SEEDS = range(101, 121)
"""By none of them anything was chosen."""


def closest(fleet: sc.SimulatedFleet, until: float) -> float:
    """Fly on until this time (s); gives the least distance of two at any tick, m."""
    least = inf
    while fleet.time < until - 0.05:
        fleet.run("0.1s", quiet=True)
        least = min(least, CLOSEST(fleet))
    return least


def arrived(fleet: sc.SimulatedFleet) -> float:
    """The share of copters at their places."""
    return float((fleet["(DIST x y z px py pz)"] < 0.5).mean())


def colours(fleet: sc.SimulatedFleet) -> set[int]:
    """What the page and the view show."""
    return set(fleet.swarm.simulator.colours())


def check_the_show(seed: int, robots: int) -> None:
    with sc.open("show", seed=seed, robots=robots, mission=True, threads=1) as fleet:
        least = closest(fleet, 62.0)
        assert arrived(fleet) >= 0.99, "letters"
        assert np.ptp(fleet["z"]) == pytest.approx(40.0, abs=0.5)
        assert colours(fleet) == {1, 2}
        least = min(least, closest(fleet, 69.0))
        assert colours(fleet) == {3, 4}
        least = min(least, closest(fleet, 112.0))
        assert arrived(fleet) >= 0.99, "a sphere"
        radius = np.sqrt((fleet.x - 50.0) ** 2 + (fleet.y - 40.0) ** 2 + (fleet["z"] - 30.0) ** 2)
        assert np.median(np.abs((radius - 10.75) % 2.5 - 1.25)) < 0.1
        assert colours(fleet) == {1, 2, 3, 4, 5}
        least = min(least, closest(fleet, 175.0))
        assert least >= APART
        assert not fleet["flying"].any()
        assert not fleet["crashed"].any()
        assert (fleet["(DIST x y home_x home_y)"] < 1.0).all()


def test_forty_take_their_places_and_keep_apart_as_nobody_does_without_the_rule() -> None:
    with sc.open("show", seed=101, robots=40, mission=True, threads=1) as fleet:
        assert closest(fleet, 40.0) >= APART
        assert arrived(fleet) >= 0.95
    with sc.open("show", seed=101, robots=40, mission=True, threads=1, over=WITHOUT) as fleet:
        assert closest(fleet, 30.0) < APART


@pytest.mark.nightly
@pytest.mark.parametrize("seed", SEEDS)
def test_a_hundred_fly_it(seed: int) -> None:
    check_the_show(seed, 100)


@pytest.mark.nightly
@pytest.mark.parametrize("seed", SEEDS[:5])
def test_five_hundred_fly_it(seed: int) -> None:
    check_the_show(seed, 500)


@pytest.mark.nightly
@pytest.mark.parametrize("seed", SEEDS)
def test_without_the_rule_they_come_nearer(seed: int) -> None:
    with sc.open("show", seed=seed, mission=True, threads=1, over=WITHOUT) as fleet:
        assert closest(fleet, 30.0) < APART
