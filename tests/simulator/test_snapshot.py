"""A simulator made from a snapshot goes on as the one would have that it was taken of."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from simulator.scenario.test_events import THINGS
from simulator.test_sorts import SORTS, mixed
from sleepcast.core.errors import MisuseError
from sleepcast.core.serial import SerialError, pack, unpack
from sleepcast.simulator import Area, Circle, Simulator, Wall, find_scenario
from sleepcast.simulator.packing import pack as packed_scenario
from sleepcast.simulator.snapshot import SimulatorState, resume, state_of
from sleepcast.simulator.world import world
from small_worlds import scouts, simulator

MOST = 1 << 24
BEFORE, AFTER = 60, 60

SONAR = ("[robots.sonar]\n", '[robots.sonar]\nnoise = "1%"\ndropout = "5%"\npause = "10ms"\n')
MANY = ("count = 1\n", "count = 12\n")
WANDER = ('motion = "still"', 'motion = "wander"')
TALK = (SONAR[0], f"{SONAR[1]}\n[robots.sonar.crosstalk]\nchance = 0.7\nrobots = true\n")
NOISE = '\n[noise]\nx = "1m"\nbattery = "2%"\n'


def crafts(folder: Path) -> Simulator:
    return simulator(folder, WANDER, more=NOISE)


def firing(folder: Path) -> Simulator:
    return scouts(folder, SONAR, MANY, WANDER)


def listening(folder: Path) -> Simulator:
    return Simulator(find_scenario("braitenberg"), 4)


def in_rooms(folder: Path) -> Simulator:
    sim = Simulator(find_scenario("crowd"), 4)
    sim.act("drive_speed", slice(None), np.full(len(sim.names), 0.5))
    return sim


def counting(folder: Path) -> Simulator:
    return scouts(folder, ("[robots.sonar]\n", "counts = 100\n\n[robots.sonar]\n"), MANY, WANDER)


def counting_beside_others(folder: Path) -> Simulator:
    """One sort counts steps of its wheels, one has exact encoders, and one has no wheels."""
    return mixed(
        folder, SORTS.replace("[robots.stores.battery]", "[robots.wheels]\ncounts = 100\n\n[robots.stores.battery]", 1)
    )


def talking(folder: Path) -> Simulator:
    return scouts(folder, TALK, MANY, WANDER)


def arranged(folder: Path, table: tuple[str, str] = TALK) -> Simulator:
    """Sonars of some robots fire in orders of their own, those of one not at all."""
    sim = scouts(folder, table, MANY, WANDER)
    for robot, order, pause in ((2, (3, 3, 1), 0.001), (5, (), 0.0), (7, range(16), 0.2)):
        sim.bodies.rings[0].arrange(robot, order, pause)
    return sim


def arranged_in_part(folder: Path) -> Simulator:
    """The same where those of the others fire in every tick."""
    return arranged(folder, (SONAR[0], '[robots.sonar]\nnoise = "1%"\n'))


def of_several_sorts(folder: Path) -> Simulator:
    """One sort has sonars that fire in order, one all at once, and one has none."""
    return mixed(folder, SORTS.replace("[robots.stores.battery]", f"{SONAR[1]}\n[robots.stores.battery]", 1))


def eventful(folder: Path) -> Simulator:
    """Some of what is to happen happens before the snapshot, some after it."""
    return scouts(folder, MANY, WANDER, more=THINGS.replace('"2.5s"', '"7s"').replace('"3s"', '"8s"'))


def meddle(sim: Simulator, tick: int) -> None:
    """What minds and people do to bodies and world."""
    if sim.scenario.pings is not None:
        sim.pings(np.array([tick % 7, 11]), np.array([1.0, 2.0]))
    if tick % 20 == 5:
        number = sim.world.add(Circle(6.0 + tick / 30, 5.0, 0.2))
        sim.world.move(number, 0.5, 0.0)
    if tick % 20 == 15:
        sim.world.remove(max(sim.world.shapes))
        sim.world.add(Wall(((1.0, 1.0), (2.0, 1.0))))
    robot = sim.robots[tick % len(sim.robots)]
    if tick % 3 == 0:
        robot.tumble()
        robot.go_to(3.0, 4.0)
    if tick % 5 == 0:
        robot.stop()
        robot.release()
        robot.say(f"{tick}")
    if tick % 11 == 0:
        robot.hold(tick % 2 == 0)


def run(sim: Simulator, first: int, last: int) -> None:
    for tick in range(first, last):
        meddle(sim, tick)
        if tick % 2:
            sim.sense()
        sim.step()


def kept(sim: Simulator) -> SimulatorState:
    return unpack(SimulatorState, pack(state_of(sim), MOST), MOST, "simulator")


def everything(sim: Simulator) -> object:
    return (
        sim.state_hash(),
        sim.measured(),
        list(sim.sayings),
        list(sim.news),
        dict(sim.world.shapes),
        np.array(sim.readings()).tobytes(),
    )


@pytest.mark.parametrize(
    "make",
    [
        crafts,
        firing,
        counting,
        counting_beside_others,
        listening,
        in_rooms,
        talking,
        arranged,
        arranged_in_part,
        of_several_sorts,
        eventful,
    ],
)
def test_it_goes_on_to_the_last_bit(tmp_path: Path, make: Callable[[Path], Simulator]) -> None:
    sim = make(tmp_path)
    run(sim, 0, BEFORE)
    before = kept(sim)
    other = resume(before)
    assert everything(other) == everything(sim)
    threaded = resume(before, threads=1)
    for one in (sim, other, threaded):
        run(one, BEFORE, BEFORE + AFTER)
    assert everything(sim) == everything(other) == everything(threaded)
    again = resume(before)
    run(again, BEFORE, BEFORE + AFTER)
    assert everything(again) == everything(sim)


def test_another_seed_is_another_future_of_the_same_past(tmp_path: Path) -> None:
    sim = firing(tmp_path)
    run(sim, 0, BEFORE)
    other = resume(kept(sim), seed=99)
    assert other.state_hash() == sim.state_hash()
    for one in (sim, other):
        run(one, BEFORE, BEFORE + AFTER)
    assert other.state_hash() != sim.state_hash()


def test_a_snapshot_changes_nothing(tmp_path: Path) -> None:
    sim, other = firing(tmp_path), firing(tmp_path)
    run(sim, 0, BEFORE)
    state_of(sim)
    run(sim, BEFORE, BEFORE + AFTER)
    run(other, 0, BEFORE + AFTER)
    assert everything(sim) == everything(other)


def test_a_full_world_stays_full(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sim = firing(tmp_path)
    number = sim.world.add(Wall(((1.0, 1.0), (2.0, 1.0))))
    sim.world.add(Area((((4.0, 4.0), (5.0, 4.0), (5.0, 5.0)),), "pond"))
    other = resume(kept(sim)).world
    assert other.shapes == sim.world.shapes
    monkeypatch.setattr(world, "MAX_SOLIDS", len(sim.world.solids))
    with pytest.raises(MisuseError, match="the world is full"):
        other.add(Circle(6.0, 6.0, 0.2))
    other.remove(number)
    assert other.add(Circle(6.0, 6.0, 0.2)) == number + 2


def broken(parcel: SimulatorState, **changes: object) -> SimulatorState:
    return SimulatorState(**{name: getattr(parcel, name) for name in parcel.__struct_fields__} | changes)


def test_what_no_run_comes_to_is_refused(tmp_path: Path) -> None:
    sim = firing(tmp_path)
    run(sim, 0, 5)
    parcel = kept(sim)
    for name, value in (
        ("x", np.nan),
        ("heading", np.inf),
        ("mode", 7),
        ("due of ring 0", -1e9),
        ("turn of ring 0", 16),
        ("speed", np.nan),
    ):
        columns = sim.bodies.arrays()
        there = columns["sensed"][3] if name == "speed" else columns[name]
        before = there[2]
        there[2] = value
        with pytest.raises(SerialError, match=name.split()[0]):
            resume(kept(sim))
        there[2] = before
    assert resume(kept(sim)).state_hash() == sim.state_hash()
    scenario = sim.scenario
    for wrong in (
        replace(scenario, tick=0.0),
        replace(scenario, width=np.nan),
        replace(scenario, robots=replace(scenario.robots, count=10**9)),
        replace(scenario, robots=replace(scenario.robots, count=11)),
        replace(scenario, robots=replace(scenario.robots, ring=None)),
    ):
        with pytest.raises(SerialError):
            resume(broken(parcel, scenario=packed_scenario(wrong)))
    for changes in ({"tick": -1}, {"seed": -1}, {"following": 1}, {"things": b"[]"}, {"said": [(0.0, 99, "")]}):
        with pytest.raises(SerialError):
            resume(broken(parcel, **changes))
    for name in parcel.columns:
        columns = dict(parcel.columns)
        del columns[name]
        with pytest.raises(SerialError, match="columns"):
            resume(broken(parcel, columns=columns))
