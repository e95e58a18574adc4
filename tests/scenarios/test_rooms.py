"""Leaving a room and converging through an opening: pushing jams for good; giving way, and an order, let all out."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import pytest

import sleepcast as sc
from sleepcast.experiments.measures import read_measure

BUMPS, JAM = read_measure("mean bumps"), read_measure("gap (IF (KNOWN left) left time)")
OUT = read_measure("share (> x OUTSIDE)")
FEW: Mapping[str, object] = {"robots.count": 20}


class Left(NamedTuple):
    """seconds: until 90 % were out, or the end; out: share of the robots; bumps: of a robot; jam: s without anybody."""

    seconds: float
    out: float
    bumps: float
    jam: float


def leave(
    mission: str,
    seeds: Sequence[int],
    scenario: str = "leave-room",
    *,
    most: float = 300.0,
    over: Mapping[str, object] | None = None,
) -> list[Left]:
    found = []
    for seed in seeds:
        changes = {"mission": f"{mission}.sleep", **(over or {})}
        with sc.open(scenario, seed=seed, over=changes, mission=True, threads=1) as fleet:
            while fleet.time < most - 0.01 and OUT(fleet) < 0.9:
                fleet.run(1.0, quiet=True)
            found.append(Left(fleet.time, OUT(fleet), BUMPS(fleet), JAM(fleet)))
    return found


def mean(runs: Sequence[Left], of: str) -> float:
    return sum(float(getattr(run, of)) for run in runs) / len(runs)


@pytest.mark.parametrize("scenario", ["leave-room", "opening"])
def test_who_gives_way_gets_out_and_who_pushes_jams(scenario: str) -> None:
    narrow = {**FEW, "world.rooms.door": "0.3m"}
    (pushing,) = leave("at-once", (1,), scenario, most=60.0, over=narrow)
    (polite,) = leave("yielding", (1,), scenario, over=narrow)
    assert pushing.out < 0.4
    assert pushing.jam > 30.0
    assert polite.out >= 0.9


def test_nearest_first_is_quick_and_nearly_without_contact() -> None:
    ordered = leave("nearest-first", (1, 2), over=FEW)
    polite = leave("yielding", (1, 2), over=FEW)
    assert mean(ordered, "seconds") < mean(polite, "seconds")
    assert mean(ordered, "bumps") < 0.5 * mean(polite, "bumps")


@pytest.mark.parametrize("mission", ["thirds", "by-distance"])
def test_robots_released_in_parts_get_out(mission: str) -> None:
    (run,) = leave(mission, (1,), over=FEW)
    assert run.out >= 0.9
    assert run.seconds > 40.0, "the last third, and the last rings, have to wait so long"


def test_nobody_fits_through_a_door_narrower_than_a_robot_and_nobody_leaves_unreleased() -> None:
    (narrow,) = leave("yielding", (1,), most=60.0, over={**FEW, "world.rooms.door": "0.19m"})
    assert narrow.out == 0.0
    with sc.open("leave-room", seed=1, over={"mission": "yielding.sleep"}, mission=True, threads=1) as fleet:
        fleet.run(1.0, quiet=True)
        fleet.send("(SETQ free 0)", everybody=True)
        fleet.run(60.0, quiet=True)
        assert OUT(fleet) == 0.0


@pytest.mark.nightly
@pytest.mark.parametrize("scenario", ["leave-room", "opening"])
def test_held_out_seeds(scenario: str) -> None:
    """Fifty robots and a door of two diameters."""
    seeds = range(100, 110)
    pushing = leave("at-once", seeds, scenario)
    ways = {each: leave(each, seeds, scenario) for each in ("yielding", "thirds", "by-distance", "nearest-first")}
    assert mean(pushing, "out") < 0.3
    assert sum(run.jam > 200.0 for run in pushing) >= 9
    assert min(run.out for runs in ways.values() for run in runs) >= 0.9
    assert mean(ways["nearest-first"], "seconds") < 0.9 * mean(ways["yielding"], "seconds")
    assert mean(ways["nearest-first"], "bumps") < 0.3 * mean(ways["yielding"], "bumps")


@pytest.mark.nightly
def test_held_out_wider_doors_are_faster_and_a_hurry_does_no_harm() -> None:
    """Faster is not slower: what robots lose by pressing is not more when they are faster."""
    seeds = range(100, 110)
    doors = [
        mean(leave("yielding", seeds, over={"world.rooms.door": door}), "seconds") for door in ("0.3m", "0.4m", "0.6m")
    ]
    assert doors == sorted(doors, reverse=True)
    paces = [
        mean(leave("yielding", seeds, over={"constants.PACE": pace}), "seconds")
        for pace in ("0.3m/s", "0.5m/s", "1.2m/s")
    ]
    assert paces == sorted(paces, reverse=True)
