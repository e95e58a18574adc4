"""Bodies on the ground that drive in every direction: alone, beside others, and the same for one and for many."""

from __future__ import annotations

from math import hypot, isnan, pi
from pathlib import Path

import numpy as np
import pytest

import sleepcast as sc
from cli.calling import called_warm
from machines import MACHINES
from simulated import sensed, steps
from sleepcast.core.errors import MisuseError
from sleepcast.core.settings import SettingsError
from sleepcast.robot import Limits, Setpoint
from sleepcast.simulator import Simulator, SingleRobot, read_scenario
from sleepcast.simulator.engine import Machine, NumPyMachine, choose, has_numba
from sleepcast.simulator.single_robot import SafetyLimits
from sleepcast.simulator.snapshot import resume, state_of
from sleepcast.testing.robot_contract import Rig, RobotContract

YARD = """
format = 2
title = "a yard"
seconds = "1min"
tick = "0.1s"

[world]
width = "40m"
height = "40m"

[robots]
like = "omni"
motion = "still"
starts = [["10m", "10m", "0deg"], ["20m", "10m", "90deg"], ["30m", "10m", "180deg"]]
"""
MIXED = (
    YARD.replace("[robots]", "[[robots]]")
    + """
[[robots]]
like = "scout"
motion = "still"
starts = [["10m", "30m", "0deg"], ["20m", "30m", "0deg"]]
"""
)
FLYING = (
    YARD.replace("[robots]", "[[robots]]").replace(
        "starts", 'body = { drive = "omni", radius = "0.2m", bumpers = 0 }\nstarts'
    )
    + """
[[robots]]
like = "copter"
starts = [{ x = "10m", y = "30m", z = "5m" }]
"""
)


def yard(machine: Machine | None = None, text: str = YARD) -> Simulator:
    return Simulator(read_scenario(text), machine=machine)


class TestContract(RobotContract):
    @pytest.fixture
    def rig(self) -> Rig:
        simulator = yard(text=YARD.replace("40m", "1km"))
        simulator.place(1, 500.0, 500.0, 0.3)
        return Rig(simulator.robots[1], lambda seconds: steps(simulator, seconds))


def test_it_drives_ahead_and_to_its_side_and_turns_at_once() -> None:
    simulator = yard()
    body = simulator.robots[1]  # it looks to the north, so its left is in the west
    body.act(Setpoint(speed=0.3, turn_rate=0.0, side=0.4))
    steps(simulator, 10.0)
    drives = sensed(simulator, 1)
    assert (drives["speed"], drives["side_speed"]) == pytest.approx((0.3, 0.4))
    assert 20.0 - drives["x"] == pytest.approx(0.4 * 10.0, abs=0.2)
    assert drives["y"] - 10.0 == pytest.approx(0.3 * 10.0, abs=0.2)
    assert drives["heading"] == pytest.approx(pi / 2.0)
    body.act(Setpoint(turn_rate=0.5))
    steps(simulator, 1.0)
    assert sensed(simulator, 1)["heading"] == pytest.approx(pi / 2.0 + 0.5)
    assert sensed(simulator, 1)["side_speed"] == pytest.approx(0.4), "the other speeds stay"


def test_the_limits_are_those_of_the_vector() -> None:
    simulator = yard()
    limits = simulator.model.limits
    before = (0.0, 0.0)
    for wanted in ((50.0, 50.0), (-50.0, 0.0), (0.0, -50.0)):
        simulator.robots[0].act(Setpoint(speed=wanted[0], turn_rate=0.0, side=wanted[1]))
        for _ in range(40):
            simulator.step()
            after = float(simulator.bodies.speed[0]), float(simulator.bodies.side_speed[0])
            assert hypot(*after) <= limits.speed * (1.0 + 1e-12)
            change = hypot(after[0] - before[0], after[1] - before[1])
            assert change <= limits.acceleration * simulator.scenario.tick * (1.0 + 1e-9)
            before = after
        assert hypot(*before) == pytest.approx(limits.speed)


def test_on_the_way_to_a_place_it_keeps_its_heading() -> None:
    simulator = yard()
    simulator.robots[2].go_to(25.0, 16.0)
    steps(simulator, 15.0)
    there = sensed(simulator, 2)
    assert (there["x"], there["y"], there["speed"], there["side_speed"]) == pytest.approx(
        (25.0, 16.0, 0.0, 0.0), abs=1e-6
    )
    assert abs(there["heading"]) == pi


def test_stop_brings_both_speeds_to_rest_and_nothing_old_resumes() -> None:
    simulator = yard()
    body = simulator.robots[0]
    body.act(Setpoint(speed=0.6, turn_rate=0.0, side=0.8))
    steps(simulator, 4.0)
    body.stop()
    state = body.rest_state()
    assert (state.speed, state.distance) == pytest.approx((1.0, 0.5))
    steps(simulator, 2.0)
    body.act(Setpoint(side=0.5))
    assert body.rest_state().at_rest
    body.release()
    x, y = float(simulator.x[0]), float(simulator.y[0])
    steps(simulator, 2.0)
    assert (float(simulator.x[0]), float(simulator.y[0])) == (x, y)
    body.act(Setpoint(side=-0.5))
    body.hold(True)
    steps(simulator, 2.0)
    assert float(simulator.y[0]) == y
    body.hold(False)
    steps(simulator, 2.0)
    assert float(simulator.y[0]) < y - 0.5, "after a hold its motion goes on"
    body.drive(0.2, 0.0)
    steps(simulator, 2.0)
    assert sensed(simulator, 0)["side_speed"] == 0.0, "DRIVE is a whole motion"


def test_a_wall_a_fence_and_others_stop_it_on_its_side_as_well() -> None:
    simulator = yard(text=YARD + '[[world.walls]]\npoints = [["8m", "14.5m"], ["12m", "14.5m"]]\n')
    bodies = simulator.bodies
    simulator.robots[0].act(Setpoint(speed=0.0, turn_rate=0.0, side=1.0))
    simulator.robots[1].act(Setpoint(speed=0.0, turn_rate=0.0, side=-1.0))
    simulator.robots[2].act(Setpoint(speed=0.0, turn_rate=0.0, side=-0.7))
    steps(simulator, 12.0)
    assert bodies.y[0] == pytest.approx(14.5 - 0.2, abs=0.01)
    assert (bodies.bumper[0], bodies.side_speed[0]) == (1.0, pytest.approx(0.0, abs=0.11))
    gap = hypot(bodies.x[1] - bodies.x[2], bodies.y[1] - bodies.y[2])
    assert gap >= 0.4
    simulator = yard()
    simulator.robots[0].act(Setpoint(speed=0.0, turn_rate=0.0, side=-1.0))
    steps(simulator, 40.0)
    assert simulator.bodies.y[0] > 0.0, "near the fence it turns until its course leads inside"


def test_its_battery_pays_for_the_way_in_whatever_direction() -> None:
    simulator = yard(text=YARD + '[robots.stores.battery]\nstart = ["100%", "100%"]\nreach = "10m"\n')
    for robot, (speed, side) in enumerate(((0.6, 0.0), (0.0, -0.6), (0.36, 0.48))):
        simulator.robots[robot].act(Setpoint(speed=speed, turn_rate=0.0, side=side))
    steps(simulator, 5.0)
    left = simulator.bodies.stores[0]
    assert left[0] < 0.8
    assert left.tolist() == pytest.approx([left[0]] * 3)
    steps(simulator, 20.0)
    assert left.tolist() == [0.0] * 3
    assert all(simulator.robots[robot].rest_state().at_rest for robot in range(3)), "empty, it stands"


@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize("text", [YARD, MIXED, FLYING])
def test_one_and_many_are_told_the_same_and_others_have_no_side(machine: Machine, text: str) -> None:
    one, many = yard(machine, text), yard(machine, text)
    everybody = np.arange(one.bodies.count)
    for actuator, value in (("drive_side", 0.4), ("drive_speed", 0.3), ("drive_turn", 0.1)):
        many.act(actuator, everybody, np.full(len(everybody), value))
        for body in one.robots:
            body.act(Setpoint(**{actuator.removeprefix("drive_").replace("turn", "turn_rate"): value}))
        steps(one, 1.0), steps(many, 1.0)
        assert one.state_hash() == many.state_hash(), actuator
    for robot in everybody.tolist():
        assert isnan(sensed(one, robot)["side_speed"]) == (robot >= 3)
    many.robots.stop(everybody)
    for body in one.robots:
        body.stop()
    steps(one, 2.0), steps(many, 2.0)
    assert one.state_hash() == many.state_hash()
    assert all(body.rest_state().at_rest for body in one.robots)


def test_machines_agree_and_a_snapshot_goes_on() -> None:
    hashes = set()
    for machine in (NumPyMachine(), choose("numba", 1)) if has_numba() else (NumPyMachine(),):
        simulator = yard(machine, MIXED.replace('motion = "still"', 'motion = "wander"', 1))
        simulator.robots[1].act(Setpoint(speed=0.1, side=0.3, turn_rate=0.2))
        steps(simulator, 5.0)
        again = resume(state_of(simulator))
        steps(simulator, 5.0), steps(again, 5.0)
        assert again.state_hash() == simulator.state_hash()
        hashes.add(simulator.state_hash())
    assert len(hashes) == 1


@pytest.mark.parametrize(("speed", "side"), [(1.0, 0.0), (0.0, 1.0), (-0.6, 0.8), (0.0, -1.0)])
def test_a_node_s_fence_is_kept_on_every_course(speed: float, side: float) -> None:
    simulator = yard(
        text=YARD.replace(
            '[["10m", "10m", "0deg"], ["20m", "10m", "90deg"], ["30m", "10m", "180deg"]]', '[["20m", "20m", "50deg"]]'
        )
    )
    fence = (15.0, 15.0, 25.0, 25.0)
    limits = SafetyLimits(simulator, Limits(1.0, pi, 1.0, fence))
    with SingleRobot(simulator, None, limits) as body:
        for turn in (0.0, 0.4):
            body.act(Setpoint(speed, turn, side))
            for _ in range(200):
                body.sense()
                x, y = float(simulator.x[0]), float(simulator.y[0])
                assert fence[0] <= x <= fence[2]
                assert fence[1] <= y <= fence[3]
        assert hypot(x - 20.0, y - 20.0) > 3.0, "it does drive"
        body.go_to(30.0, 20.0)
        for _ in range(200):
            body.sense()
        assert float(simulator.x[0]) <= fence[2]


def test_expressions_drive_it_to_its_side() -> None:
    with sc.open(YARD) as fleet:
        fleet.send("(RULE aside (SETQ drive_side 0.5m/s))", everybody=True)
        fleet.run(4.0)
        assert fleet.table()["side_speed"].tolist() == pytest.approx([0.5] * 3)
        assert len(fleet.send("(DRIVE 0.2m/s 0)", everybody=True).matched) == 3
        fleet.stop()
        fleet.run(2.0)
        assert fleet.table()["side_speed"].tolist() == [0.0] * 3


def test_a_recording_of_it_runs_again(tmp_path: Path) -> None:
    with sc.open(MIXED) as fleet, fleet.record(tmp_path / "yard.mcap"):
        fleet.send("(WHEN (KNOWN side_speed) (SETQ drive_side 0.5m/s))")
        fleet.run(3.0)
    assert called_warm("replay", str(tmp_path / "yard.mcap"), "--verify").status == 0


@pytest.mark.parametrize(
    ("change", "why"),
    [
        (("motion", 'wheels = { track = "0.3m" }\nmotion'), "two wheels only drive ahead"),
        (("motion", 'flight = { climb = "1m/s", ceiling = "9m", height = "2m" }\nmotion'), "what flies"),
        (("motion", 'body = { drive = "sideways", radius = "0.2m" }\nmotion'), "ahead, omni"),
        (("motion", "stores = { side_speed = { start = [0, 1] } }\nmotion"), "of this name already"),
    ],
)
def test_what_cannot_drive_so_is_refused(change: tuple[str, str], why: str) -> None:
    with pytest.raises((SettingsError, MisuseError), match=why):
        read_scenario(YARD.replace(*change))
