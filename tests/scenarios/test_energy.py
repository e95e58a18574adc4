"""Work chosen by its energy: cheaper loads, a fair share of robots for each site, and nobody that runs empty."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

import sleepcast as sc
from sleepcast.experiments.measures import read_measure
from sleepcast.experiments.plan import experiment_of_scenario

FAIR = np.array([1.0, 2.0, 3.0]) / 6.0
"""The share of the loads that come in at each site."""
REMOVE = """(WHEN (OR (= job GO_SOUTH) (= job GO_CHARGE))
  (FORGET choose) (FORGET work) (FORGET charge) (SETQ job GONE) (COLOUR GONE) (ST))"""


class Found(NamedTuple):
    """The energy of a load, as a share of a battery; the share of the working robots that was at each site, after the
    first 200 s; the least that was in a battery."""

    energy: float
    shares: NDArray[np.float64]
    least: float


def shares(fleet: sc.SimulatedFleet, seconds: int) -> tuple[NDArray[np.float64], float]:
    """The share of the working robots at each site, from now on, and the least that is in a battery."""
    found, least = np.zeros(3), 1.0
    for _ in range(seconds // 10):
        fleet.run(10, quiet=True)
        found += [(fleet["job"] == site).sum() for site in (1, 2, 3)]
        least = min(least, fleet["battery"].min())
    return found / found.sum(), least


def bring(seed: int, way: str, seconds: int) -> Found:
    """What comes of it if all choose their sites in one way."""
    experiment = experiment_of_scenario("energy")
    assert experiment
    with sc.open("energy", seed=seed, threads=1, mission=True, over={"mission": f"{way}.sleep"}) as fleet:
        fleet.run(200, quiet=True)
        of_each, least = shares(fleet, seconds - 200)
        return Found(read_measure(experiment.measures["energy"])(fleet), of_each, least)


def is_fair(found: NDArray[np.float64]) -> bool:
    return bool((np.abs(found / FAIR - 1.0) <= 0.2).all())


def test_weighing_costs_less_and_is_fair() -> None:
    weigh, chance, nearest = (
        bring(1, way, seconds) for way, seconds in (("weigh", 600), ("chance", 600), ("nearest", 800))
    )
    assert weigh.energy < 0.85 * chance.energy
    assert weigh.energy < 0.85 * nearest.energy
    assert is_fair(weigh.shares)
    assert not is_fair(chance.shares)  # robots wait where little comes in
    assert not is_fair(nearest.shares)
    assert min(weigh.least, chance.least, nearest.least) > 0.0


def test_all_rest_when_there_are_enough_loads() -> None:
    with sc.open("energy", seed=2, threads=1, mission=True) as fleet:
        fleet.run(1, quiet=True)
        fleet.send("(SETQ wanted 20)", everybody=True)
        fleet.run(300, quiet=True)
        delivered = fleet.swarm.simulator.stocks()["depot"]
        assert 20.0 <= delivered <= 60.0
        assert (fleet["job"] == 0.0).all()
        fleet.run(20, quiet=True)
        assert fleet.swarm.simulator.stocks()["depot"] == delivered
        assert fleet["speed"].max() == 0.0


@pytest.mark.nightly
def test_held_out_seeds() -> None:
    for seed in range(100, 105):
        weigh, chance, nearest = (bring(seed, way, 1200) for way in ("weigh", "chance", "nearest"))
        assert weigh.energy < 0.85 * min(chance.energy, nearest.energy)
        assert min(weigh.least, chance.least, nearest.least) > 0.0
        assert is_fair(weigh.shares)


@pytest.mark.nightly
def test_sharing_comes_back_after_half_of_the_robots_are_gone() -> None:
    """All that go to the best site, and those that charge, are taken away at once."""
    for seed in range(100, 105):
        with sc.open("energy", seed=seed, threads=1, mission=True) as fleet:
            fleet.run(300, quiet=True)
            fleet.send(REMOVE)
            assert 12 <= (fleet["job"] == 5.0).sum() <= 28
            fleet.run(200, quiet=True)
            of_each, least = shares(fleet, 600)
            assert is_fair(of_each)
            assert least > 0.0
