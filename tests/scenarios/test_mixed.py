"""Mixed: one broadcast to copters that find and rovers that fetch, and rovers without copters."""

from __future__ import annotations

import numpy as np
import pytest

import sleepcast as sc

SAMPLES = 20
HELD_OUT = range(200, 220)


def fetched(fleet: sc.SimulatedFleet) -> int:
    return int(np.nansum(fleet["fetched"]))


def time_of_all(seed: int) -> float:
    """s until all samples are fetched and all rovers home again, to within 5; at most 600."""
    with sc.open("mixed", seed=seed, mission=True, threads=1) as fleet:
        while fleet.time < 600.0:
            fleet.run(5.0, quiet=True)
            if fetched(fleet) == SAMPLES and not np.nansum(fleet["job"]):
                break
        assert not np.nansum(fleet["crashed"])
        return fleet.time


def fetched_alone(seed: int) -> int:
    """How many samples rovers without copters fetch in ten minutes."""
    with sc.open("mixed", seed=seed, over={"mission": "alone.sleep"}, mission=True, threads=1) as fleet:
        return fetched(fleet.run(600.0, quiet=True))


def test_one_broadcast_has_copters_call_rovers_to_what_they_see() -> None:
    with sc.open("mixed", seed=1, mission=True, threads=1) as fleet:
        fleet.run(120.0, quiet=True)
        (line,) = fleet.mission
        assert line.result is not None
        assert len(line.result.matched) == len(fleet.names)
        assert fetched(fleet) >= 4
        assert (fleet["job"][4:10] > 0.0).any()


def test_a_copter_that_tells_nobody_has_nothing_fetched() -> None:
    with sc.open("mixed", seed=1, mission=True, threads=1) as fleet:
        fleet.run(1.0, quiet=True)
        fleet.send("(WHEN (= kind COPTER) (FORGET call))", everybody=True)
        fleet.run(120.0, quiet=True)
        assert fetched(fleet) == 0


@pytest.mark.nightly
def test_held_out_all_are_fetched_within_ten_minutes() -> None:
    assert sum(time_of_all(seed) < 600.0 for seed in HELD_OUT) >= 19


@pytest.mark.nightly
def test_held_out_rovers_without_copters_fetch_less_than_sixty_per_cent() -> None:
    """The control."""
    assert np.mean([fetched_alone(seed) for seed in HELD_OUT]) < 12.0
