"""A school in space, as Couzin et al. published it: what it is in four cells of the plane of its zones' widths, and
that it remembers what it was.

What was wanted of each cell was written down before the first run: see the scenario's page.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np
import pytest

import sleepcast as sc
from sleepcast.api.fleet import SimulatedFleet
from sleepcast.experiments.measures import read_measure

SAME_WAY, TURNING = read_measure("polarization"), read_measure("rotation")
CELLS = {"swarm": ("1m", "14m"), "torus": ("2m", "14m"), "dynamic": ("5m", "14m"), "parallel": ("13m", "22m")}
"""Up to where fish head alike, and stay together: widths of orientation and attraction of 0 and 13 m, 1 and 12 m, 4
and 9 m, 12 and 9 m."""


def orders(fleet: SimulatedFleet, seconds: float, samples: int = 10) -> tuple[float, float]:
    """How far all head the same way and turn around their centre, on average over the next seconds."""
    found = []
    for _ in range(samples):
        fleet.run(seconds / samples, quiet=True)
        found.append((SAME_WAY(fleet), TURNING(fleet)))
    same_way, turning = np.mean(found, axis=0).tolist()
    return same_way, turning


def settled(cell: str, seed: int, seconds: float = 100.0) -> tuple[float, float]:
    """The same of the last fifth of a run from a random start."""
    alike, together = CELLS[cell]
    over = {"constants.HEAD_ALIKE": alike, "constants.STAY_TOGETHER": together}
    with sc.open("couzin-3d", seed=seed, over=over, mission=True, threads=1) as fleet:
        fleet.run(0.8 * seconds, quiet=True)
        return orders(fleet, 0.2 * seconds)


def is_in(cell: str, same_way: float, turning: float) -> bool:
    """Whether a school is what its cell wants."""
    if cell == "swarm":
        return same_way <= 0.35 and turning <= 0.35
    if cell == "torus":
        return same_way <= 0.35 and turning >= 0.6
    if cell == "dynamic":
        return same_way >= 0.7 and turning <= 0.35
    return same_way >= 0.95 and turning <= 0.2


def remembered(seed: int, widths: Iterable[str], seconds: float) -> list[tuple[float, float]]:
    """The orders of one school while the zone in which fish head alike has one width after another, each so long."""
    found = []
    with sc.open("couzin-3d", seed=seed, over={"constants.HEAD_ALIKE": "1m"}, mission=True, threads=1) as fleet:
        fleet.run(1.0, quiet=True)
        for width in widths:
            fleet.send(f"(SETQ alike_within {width})", everybody=True)
            fleet.run(0.75 * seconds, quiet=True)
            found.append(orders(fleet, 0.25 * seconds))
    return found


UP_AND_DOWN: Sequence[str] = ("1m", "1.5m", "2m", "2.5m", "3m", "4m", "5m", "4m", "3m", "2.5m", "2m", "1.5m", "1m")


def test_a_wide_zone_makes_a_group_that_travels() -> None:
    assert is_in("parallel", *settled("parallel", 1, 20.0))


@pytest.mark.nightly
def test_a_narrow_zone_makes_a_torus() -> None:
    assert is_in("torus", *settled("torus", 1, 40.0))


@pytest.mark.nightly
@pytest.mark.parametrize(("cell", "wanted"), [("swarm", 18), ("torus", 16), ("dynamic", 18), ("parallel", 18)])
def test_held_out_seeds(cell: str, wanted: int) -> None:
    found = [settled(cell, seed) for seed in range(100, 120)]
    assert sum(is_in(cell, *each) for each in found) >= wanted


@pytest.mark.nightly
def test_a_school_remembers_what_it_was() -> None:
    """Of one width, on the way up it is a torus and on the way down a group that travels; below, a swarm again."""
    up, down = UP_AND_DOWN.index("2m"), len(UP_AND_DOWN) - 1 - UP_AND_DOWN.index("2m")
    remembering = 0
    for seed in range(100, 105):
        found = remembered(seed, UP_AND_DOWN, 40.0)
        rings, travels = found[up][1] > 0.5, is_in("dynamic", *found[down])
        remembering += rings and travels and found[-1][0] < 0.35
    assert remembering >= 4
