"""A room for each: recruited robots take different rooms, meet the condition, and are replaced when they die."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
import pytest

import sleepcast as sc

DEATH = 60.0
"""Simulated seconds until the robot in the second room dies, as the mission says."""


class Exploration(NamedTuple):
    """taken, again: s until all four rooms were taken, and after the death taken again; inf if never.

    twice: whether two robots ever were in the same room. charge: the least of those that explored, 0 to 1."""

    taken: float
    again: float
    twice: bool
    charge: float


def explore(seed: int, seconds: float, charged: str = "60%") -> Exploration:
    taken, again, twice, charge = np.inf, np.inf, False, 1.0
    with sc.open("explore", seed=seed, over={"constants.CHARGED": charged}, mission=True, threads=1) as fleet:
        fleet.run(5.0, quiet=True)
        while fleet.time < seconds:
            fleet.run(1.0, quiet=True)
            there = np.isin(fleet.names, fleet.groups.get("explorers", ()))
            alive = there & (fleet["frozen"] != 1.0)
            rooms = sorted(fleet["room"][alive].tolist())
            twice |= len(set(rooms)) < len(rooms)
            charge = min(charge, float(fleet["battery"][there].min(initial=1.0)))
            if rooms == [1.0, 2.0, 3.0, 4.0]:
                taken = min(taken, fleet.time)
                if (there & ~alive).any():
                    again = min(again, fleet.time - DEATH)
    return Exploration(taken, again, twice, charge)


def test_each_recruit_takes_a_room_of_its_own() -> None:
    found = explore(1, 30.0)
    assert found.taken < 30.0
    assert not found.twice
    assert found.charge > 0.6


def test_without_the_condition_uncharged_robots_come() -> None:
    assert explore(3, 50.0, charged="0%").charge < 0.6


@pytest.mark.nightly
def test_held_out_seeds() -> None:
    found = [explore(seed, 110.0) for seed in range(100, 120)]
    assert sum(each.taken < 50.0 for each in found) >= 19
    assert not any(each.twice for each in found)
    assert all(each.charge > 0.6 for each in found)
    died = [each.again for each in found if each.taken < DEATH - 10.0]
    assert np.median(died) < 25.0
