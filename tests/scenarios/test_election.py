"""Election by gossip: all agree on the highest vote, and on another leader when the first one dies."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

import sleepcast as sc

ROBOTS = 100
DEATH = 30.0
"""s at which the mission lets the leader die."""


def leaders(fleet: sc.SimulatedFleet) -> list[int]:
    """The different leaders that robots follow, the highest last; those that know of none are -1."""
    return sorted(np.unique(np.nan_to_num(fleet["(MOD vote TERM)"], nan=-1.0)).astype(int).tolist())


def after(seeds: Sequence[int], seconds: float, **over: object) -> list[list[int]]:
    found = []
    for seed in seeds:
        with sc.open("election", seed=seed, over=over, mission=True, threads=1) as fleet:
            found.append(leaders(fleet.run(seconds, quiet=True)))
    return found


def test_all_agree_on_the_highest_and_on_the_next_one_when_it_dies() -> None:
    with sc.open("election", seed=1, mission=True, threads=1) as fleet:
        assert leaders(fleet.run(5.0, quiet=True)) == [ROBOTS]
        assert leaders(fleet.run(DEATH - 5.0, quiet=True)) == [ROBOTS], "nobody deposes a leader that lives"
        assert leaders(fleet.run(16.0, quiet=True)) == [ROBOTS - 1]
        assert fleet["vote"].min() == 1_000 + ROBOTS - 1, "the next term, in which the dead leader knows the new one"


def test_robots_that_hand_nothing_on_never_agree() -> None:
    with sc.open("election", seed=1, threads=1) as fleet:
        fleet.send(
            "(PROGN (DEFVAR vote id) (RULE elect (EVERY 1s (TELL (WHEN (> ,id vote) (SETQ vote ,id))))))",
            everybody=True,
        )
        fleet.run(20.0, quiet=True)
        assert len(leaders(fleet)) > 2


@pytest.mark.nightly
def test_held_out_seeds() -> None:
    seeds = range(100, 110)
    assert after(seeds, 10.0).count([ROBOTS]) == 10
    second = after(seeds, DEATH + 15.0)  # mostly 99; another one where two robots began terms at the two ends
    assert all(len(each) == 1 and each != [ROBOTS] for each in second)
    lossy = after(seeds, 25.0, **{"radio.loss": 0.4})
    assert sum(len(each) == 1 for each in lossy) >= 9
