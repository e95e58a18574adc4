"""Neighbours with a delay: all that is sensed of them is as old as that, from where one is now, whatever happens."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import sleepcast as sc
from sleepcast.core.errors import MisuseError
from sleepcast.core.serial import SerialError
from sleepcast.core.settings import SettingsError
from sleepcast.simulator import Simulator, load, read_scenario
from sleepcast.simulator.scenario import population, signals
from sleepcast.simulator.snapshot import resume, state_of
from small_worlds import write

SHOWING = '\n[neighbours]\nreach = "2km"\n{delay}\nshows_groups = ["bravo"]\n[neighbours.shares]\nload = "kg"\n'
LATE = 'delay = "0.3s"'
SKY = """
format = 2
title = "a sky"
seconds = "1min"
tick = "0.1s"

[world]
width = "100m"
height = "100m"

[robots]
like = "copter"
count = 4
z = ["5m", "8m"]

[robots.starts]
shape = "circle"
spacing = "10m"
center = ["50m", "50m"]
"""
MOVING = (
    "(RULE go (PROGN (SETQ drive_speed (* id 0.3m/s)) (SETQ drive_turn (* id 3deg/s)) {more} (SHARE_LOAD time) "
    "(COLOUR (MOD (* 10 time) 3))))"
)
ABSOLUTE = ("(OF 2 x)", "(OF 2 y)", "(OF 2 heading)", "(OF 2 load)", "(OF 2 colour)", "(OF 2 bravo)", "(MEAN_Y 2km)")


def course(file: Path, texts: tuple[str, ...], more: str = "") -> tuple[np.ndarray, np.ndarray]:
    """What robot 1 senses in each of twelve ticks, and where robots 1 and 2 truly are."""
    with sc.open(file, seed=3) as fleet:
        fleet.send(MOVING.format(more=more), everybody=True)
        fleet.send("(WHEN (= id 2) (JOIN bravo))", everybody=True)
        sensed, places = [], []
        for _ in range(12):
            sensed.append([fleet[text][0] for text in texts])
            places.append(np.stack((fleet.x, fleet.y, fleet.z))[:, :2])
            fleet.run(0.1)
        return np.array(sensed), np.array(places)


def both(folder: Path, sky: bool, texts: tuple[str, ...]) -> tuple[tuple[np.ndarray, np.ndarray], ...]:
    """The same course without a delay and with one."""
    courses = []
    for delay in ("", LATE):
        place = folder / (delay[:5] or "now")
        place.mkdir()
        if sky:
            file = place / "scenario.toml"
            file.write_text(SKY + SHOWING.format(delay=delay))
        else:
            file = write(place, ("count = 20", "count = 4"), more=SHOWING.format(delay=delay))
        climbs = "(SETQ drive_side 0.2m/s) (SETQ drive_climb (* id 0.2m/s))" if sky else ""
        courses.append(course(file, texts, climbs))
    return tuple(courses)


@pytest.mark.parametrize("sky", [False, True], ids=["plane", "sky"])
def test_neighbours_are_sensed_as_they_were(tmp_path: Path, sky: bool) -> None:
    texts = (*ABSOLUTE, *(["(OF 2 z)", "(MEAN_Z 2km)"] if sky else []))
    (now, places), (late, same_places) = both(tmp_path, sky, texts)
    assert np.array_equal(places, same_places), "nobody moves by what it senses"
    assert late[3:] == pytest.approx(now[:-3], abs=1e-9, nan_ok=True)
    assert (np.ptp(now[:-3], axis=0) > 0.0)[:5].all(), "all of it has changed"


@pytest.mark.parametrize("sky", [False, True], ids=["plane", "sky"])
def test_they_are_sensed_from_where_one_is_now(tmp_path: Path, sky: bool) -> None:
    _, (late, places) = both(tmp_path, sky, ("(OF 2 distance)", "(NEAREST_DIST 2km)", "(OF 2 x)"))
    ways = places[:-3, :, 1] - places[3:, :, 0]
    assert late[3:, 0] == pytest.approx(np.linalg.norm(ways, axis=1), abs=1e-9)
    assert (late[3:, 1] <= late[3:, 0]).all()


def test_until_so_much_time_has_passed_they_are_as_at_the_start(tmp_path: Path) -> None:
    roaming = ('motion = "still"', 'motion = "wander"')
    sim = Simulator(load(write(tmp_path, roaming, more=SHOWING.format(delay=LATE))), 3)
    (mean,) = (each.many for each in sim.model.functions if each.name == "MEAN_X")
    assert mean
    start, robots = sim.bodies.x.copy(), np.arange(20)
    for tick in range(4):
        seen = mean(sim.robots, robots, np.full(20, 2e3))
        assert seen == pytest.approx((start.sum() - start) / 19, abs=1e-9), tick
        sim.step()
    assert np.abs(mean(sim.robots, robots, np.full(20, 2e3)) - (start.sum() - start) / 19).max() > 0.01


FOLLOW = "(RULE follow (DRIVE 0.5m/s (CLAMP (- (MEAN_X 2km) (OF (NEAREST_ID 2km) x)) -1 1)))"


def test_what_goes_on_equals_what_never_stopped_alone_and_in_a_batch(tmp_path: Path) -> None:
    file = write(tmp_path, more=SHOWING.format(delay=LATE))
    with sc.open(file, seed=4) as alone:
        alone.send(FOLLOW, everybody=True)
        alone.run(1.0 - alone.time)
        middle, fork = alone.snapshot(), alone.fork()
        alone.run(1.0)
        worlds = sc.open_many(file, seeds=[3, 4])
        for world in worlds:
            world.send(FOLLOW, everybody=True)
        worlds.run(2.0 - worlds.time)
        resumed = sc.resume(middle)
        for other in (resumed, fork):
            other.run(1.0)
        assert {worlds[1].hash, resumed.hash, fork.hash} == {alone.hash}
        assert worlds[0].hash != alone.hash


PEN = """
format = 2
title = "a pen"
seconds = "1min"
tick = "0.1s"

[world]
width = "40m"
height = "40m"

[robots]
type = "rover"
count = 2
hatch = true
motion = "still"

[robots.limits]
speed = "1m/s"
turn_rate = "90deg/s"
acceleration = "10m/s2"

[robots.body]
radius = "0.1m"

[camera]
range = "50m"

[neighbours]
reach = "50m"
delay = "0.3s"
"""


def test_who_has_just_come_is_sensed_at_once_and_who_has_gone_is_not(tmp_path: Path) -> None:
    (tmp_path / "scenario.toml").write_text(PEN)
    with sc.open(tmp_path / "scenario.toml", seed=3) as fleet:
        fleet.run(1.0)
        fleet.send("(WHEN (= id 2) (HATCH rover 1))", everybody=True)
        fleet.run(0.2)
        assert fleet["(COUNT 50m)"].tolist() == [2.0, 2.0, 2.0]
        assert fleet["(OF 3 x)"][0] == pytest.approx(fleet.x[1])
        fleet.send("(WHEN (= id 2) (DIE))", everybody=True)
        fleet.run(0.2)
        assert fleet["(COUNT 50m)"].tolist() == [1.0, 1.0]


def test_a_camera_sees_what_is_shown_now(tmp_path: Path) -> None:
    (tmp_path / "scenario.toml").write_text(PEN)
    with sc.open(tmp_path / "scenario.toml", seed=3) as fleet:
        fleet.send("(COLOUR 4)", everybody=True)
        fleet.run(0.2)
        seen = fleet["(+ (* 10 (SEES 4 -180deg 180deg)) (COUNT 50m 4))"].tolist()
        fleet.run(0.3)
        assert (seen, fleet["(COUNT 50m 4)"].tolist()) == ([10.0, 10.0], [1.0, 1.0])


def test_a_delay_that_cannot_be_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(SettingsError, match=r"shorter than a tick of 0.1 s; leave it out"):
        load(write(tmp_path, more=SHOWING.format(delay='delay = "0.04s"')))
    with pytest.raises(SettingsError, match=r"store what 20 robots show: at most 20971.5 s fit"):
        load(write(tmp_path, more=SHOWING.format(delay='delay = "6h"')))
    monkeypatch.setattr(population, "MAX_DELAYED", 20)
    with pytest.raises(MisuseError, match="room for 8 robots that sense neighbours with a delay is too much"):
        Simulator(read_scenario(PEN))
    assert signals.MAX_DELAYED > 20


@pytest.mark.parametrize("row", [0, 1, 2])
def test_a_state_that_no_run_gives_is_refused(tmp_path: Path, row: int) -> None:
    sim = Simulator(load(write(tmp_path, more=SHOWING.format(delay=LATE))), 3)
    sim.step()
    assert resume(state_of(sim)).state_hash() == sim.state_hash()
    sim.senses.arrays()["seen later"][1, row, 5] = np.nan
    with pytest.raises(SerialError, match="neighbours"):
        resume(state_of(sim))
