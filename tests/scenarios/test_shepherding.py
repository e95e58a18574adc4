"""Shepherding: one dog brings sheep to the fold by collecting and driving; by driving alone it often fails."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

import sleepcast as sc
from sleepcast.experiments.measures import read_measure

HOME = read_measure("min (OR (= caste DOG) (< (DIST x y fold_x fold_y) FOLD))")


def brought(mission: str, seeds: Sequence[int], sheep: int, neighbours: int, seconds: float = 1_000.0) -> int:
    """In how many of the runs all sheep are at the fold at the same time."""
    found = 0
    for seed in seeds:
        over = {
            "mission": f"{mission}.sleep",
            "robots[0].groups.flock.count": sheep,
            "constants.NEIGHBOURS": neighbours,
        }
        with sc.open("shepherding", seed=seed, over=over, mission=True, threads=1) as fleet:
            while fleet.time < seconds and not HOME(fleet):
                fleet.run(20.0, quiet=True)
            found += HOME(fleet) == 1.0
    return found


def test_a_dog_brings_sheep_that_run_together() -> None:
    assert brought("herd", (1,), 10, 9) == 1


def test_sheep_without_a_dog_stay_where_they_graze() -> None:
    with sc.open("shepherding", seed=1, over={"robots[0].groups.flock.count": 10}, threads=1) as fleet:
        orders = fleet.swarm.simulator.scenario.mission
        for order in orders[:-1]:
            fleet.send(order.text, everybody=True)
        away = read_measure("min (IF (= caste SHEEP) (DIST x y fold_x fold_y) UNKNOWN)")
        fleet.run(400.0, quiet=True)
        assert away(fleet) > 60.0


@pytest.mark.nightly
def test_held_out_seeds() -> None:
    """Of sheep that run to half of the others, the dog must collect some."""
    seeds = range(100, 105)
    collecting, driving = brought("herd", seeds, 20, 10), brought("drive-only", seeds, 20, 10)
    assert collecting >= 2
    assert driving < collecting
