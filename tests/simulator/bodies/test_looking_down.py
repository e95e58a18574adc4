"""Cameras that look down from what flies: which robots and lights lie in their footprints, alone and in batches."""

from __future__ import annotations

from math import hypot, isnan, nan, radians, tan
from pathlib import Path

import numpy as np
import pytest

import sleepcast as sc
from cli.calling import called_warm
from machines import MACHINES
from sleepcast.core.settings import SettingsError
from sleepcast.loop import Swarm
from sleepcast.node.node import Node
from sleepcast.simulator import Simulator
from sleepcast.simulator.bodies.looking_down import BLIND
from sleepcast.simulator.engine import Machine
from sleepcast.simulator.scenario.scenario import Scenario, read_scenario

TEXT = """
format = 2
title = "cameras that look down"
seconds = "1min"

[world]
width = "60m"
height = "60m"

[[world.polygons]]
corners = [["20m", "20m"], ["30m", "20m"], ["30m", "30m"], ["20m", "30m"]]
tall = "4m"
name = "the house"

[[robots]]
like = "copter"
count = 6
z = ["8m", "13m"]

[robots.camera]
angle = "80deg"

[robots.limits]
speed = "4m/s"

[robots.flight]
ceiling = "14m"

[[robots]]
type = "rover"
count = 40
motion = "still"
limits = { speed = "1m/s", turn_rate = "90deg/s", acceleration = "1m/s2" }
body = { radius = "0.2m" }

[constants]
red = 3

[neighbours]
reach = "9m"

[lights.lamp]
x = "45m"
y = "10m"
reach = "11m"

[lights.torch]
x = "47m"
y = "10m"
"""
SLOPE = tan(radians(40.0))
TEXTS = (
    "(BELOW)",
    "(BELOW red)",
    "(BELOW (MOD id 2))",
    "(BELOW UNKNOWN)",
    "(BELOW_X)",
    "(BELOW_Y red)",
    "(BELOW_ID red)",
    "(SUM-OVER (n 9m) (BELOW (OF n colour)))",
    "(BELOW_LIGHTS)",
    "(BELOW_LIGHT_X)",
    "(BELOW_LIGHT_Y)",
)
RULES = (
    "(WHEN (= (MOD id 2) 0) (COLOUR red))",
    "(WHEN flying (RULE turn (WHEN TRUE (SETQ drive_turn (* (BELOW red) 10deg/s)) (SETQ drive_speed 3m/s))))",
)


def scenario(*changes: tuple[str, str]) -> Scenario:
    text = TEXT
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    return read_scenario(text)


def world(machine: Machine | None = None, *changes: tuple[str, str], seed: int = 3) -> Simulator:
    """Each second robot is red."""
    sim = Simulator(scenario(*changes), seed, machine)
    show = next(each.many for each in sim.model.functions if each.name == "COLOUR")
    assert show
    show(sim.robots, np.arange(0, 46, 2), np.full(23, 3.0))
    sim.step()
    return sim


def put(sim: Simulator, robot: int, x: float, y: float, z: float = nan) -> None:
    """Have a robot here and at rest; z: of what flies."""
    assert sim.bodies.flight
    sim.place(robot, x, y, 0.0)
    sim.bodies.flight.z[robot] = z
    sim.bodies.forget()


def found(sim: Simulator, text: str, robot: int = 0) -> float:
    fleet = Swarm(sim).fleet
    (results,) = fleet.evaluate(text, [robot])
    return list(fleet.values())[robot].result(results, 0).value


class TestFootprint:
    @pytest.mark.parametrize("machine", MACHINES)
    @pytest.mark.parametrize("edge", ["fence", "torus"])
    def test_what_is_seen_lies_in_a_cone(self, machine: Machine, edge: str) -> None:
        """Beside a reference robot by robot, where nothing hides anything."""
        town = TEXT[TEXT.index("[[world.polygons]]") : TEXT.index("[[robots]]")]
        sim = world(machine, (town, ""), ('height = "60m"', f'height = "60m"\nedge = "{edge}"'))
        bodies, seen = sim.bodies, 0
        assert bodies.flight
        z = np.nan_to_num(bodies.flight.z)
        for robot in range(6):
            below = []
            for other in range(46):
                dx, dy = bodies.x[other] - bodies.x[robot], bodies.y[other] - bodies.y[robot]
                if edge == "torus":
                    dx, dy = ((each + 30.0) % 60.0 - 30.0 for each in (dx, dy))
                if other != robot and z[robot] - z[other] > 0.0 and hypot(dx, dy) <= (z[robot] - z[other]) * SLOPE:
                    below.append((hypot(dx, dy), other))
            assert found(sim, "(BELOW)", robot) == len(below)
            assert found(sim, "(BELOW red)", robot) == sum(other % 2 == 0 for _, other in below)
            assert found(sim, "(BELOW_ID)", robot) == pytest.approx(min(below)[1] + 1 if below else nan, nan_ok=True)
            seen += len(below)
        assert seen > 15

    def test_it_is_as_wide_as_the_robot_is_above_what_it_looks_at(self) -> None:
        sim = world()
        for robot in range(1, 46):
            put(sim, robot, 1.0, 1.0, nan if robot > 5 else 5.0)
        put(sim, 0, 50.0, 50.0, 10.0)
        assert isnan(found(sim, "(BELOW_X)"))
        put(sim, 10, 50.0 + 10.0 * SLOPE - 0.01, 50.0)
        assert found(sim, "(BELOW)") == 1.0
        put(sim, 10, 50.0 + 10.0 * SLOPE + 0.01, 50.0)
        assert found(sim, "(BELOW)") == 0.0
        put(sim, 1, 50.0, 50.0 + 2.0 * SLOPE - 0.01, 8.0)
        assert found(sim, "(BELOW)") == 1.0, "another copter, two metres below"
        put(sim, 1, 50.0, 50.0, 10.5)
        assert found(sim, "(BELOW)") == 0.0, "and none above"

    def test_each_type_has_its_own_angle(self) -> None:
        narrow = '[[robots]]\nlike = "copter"\ntype = "b"\nz = ["9m", "9m"]\ncount = 1\ncamera = { angle = "20deg" }\n'
        sim = world(None, ("[constants]", f"{narrow}\n[constants]"))
        for robot in range(46):
            put(sim, robot, 1.0, 1.0, nan if robot > 5 else 5.0)
        put(sim, 0, 50.0, 50.0, 10.0)
        put(sim, 46, 50.0, 49.0, 10.0)
        put(sim, 10, 54.0, 50.0)
        assert Swarm(sim).fleet.values_of("(IF flying (BELOW) 0)", 0.0)[[0, 46]].tolist() == [1.0, 0.0]

    def test_of_several_the_one_nearest_to_its_middle_is_told(self) -> None:
        sim = world()
        for robot in range(1, 46):
            put(sim, robot, 1.0, 1.0, nan if robot > 5 else 5.0)
        put(sim, 0, 50.0, 50.0, 10.0)
        for robot, x in ((11, 53.0), (12, 52.0), (14, 48.0)):
            put(sim, robot, x, 50.0)
        assert [found(sim, f"(BELOW{what})") for what in ("", "_ID", "_X", "_Y")] == [3.0, 13.0, 52.0, 50.0]
        assert found(sim, "(BELOW_ID 0)") == 12.0
        assert found(sim, "(BELOW 7)") == 0.0
        assert isnan(found(sim, "(BELOW_ID 7)"))

    def test_a_house_hides_what_stands_behind_it(self) -> None:
        sim = world()
        for robot in range(1, 46):
            put(sim, robot, 1.0, 1.0, nan if robot > 5 else 5.0)
        put(sim, 10, 31.0, 25.0)
        put(sim, 0, 32.0, 25.0, 10.0)
        assert found(sim, "(BELOW)") == 1.0
        put(sim, 0, 26.0, 25.0, 10.0)
        assert found(sim, "(BELOW)") == 0.0, "the line passes the edge of the roof at 2 m"
        put(sim, 0, 28.5, 25.0, 13.0)
        assert found(sim, "(BELOW)") == 1.0, "and here at 5.2 m"
        put(sim, 1, 25.0, 25.0, 4.0)
        put(sim, 0, 27.0, 25.0, 7.0)
        assert found(sim, "(BELOW)") == 1.0, "who stands on the roof is seen"
        put(sim, 0, 29.0, 25.0, 7.0)
        assert found(sim, "(BELOW)") == 0.0, "three metres deep it is 2.5 m wide"

    def test_lights_are_seen_within_their_reach(self) -> None:
        sim = world()
        put(sim, 0, 44.0, 10.0, 10.0)
        assert [found(sim, f"(BELOW_LIGHT{what})") for what in ("S", "_X", "_Y")] == [2.0, 45.0, 10.0]
        put(sim, 0, 44.0, 10.0, 13.0)
        assert found(sim, "(BELOW_LIGHTS)") == 1.0, "the lamp is seen from 11 m away"
        assert found(sim, "(BELOW_LIGHT_X)") == 47.0
        put(sim, 0, 44.0, 30.0, 13.0)
        assert found(sim, "(BELOW_LIGHTS)") == 0.0
        assert isnan(found(sim, "(BELOW_LIGHT_X)"))

    def test_places_are_told_as_the_robot_believes_to_be_placed(self) -> None:
        sim = world(None, ("[constants]", '[noise]\nx = "5m"\n[constants]'))
        put(sim, 0, 44.0, 10.0, 10.0)
        sim.bodies.sense()
        believed = float(sim.bodies.sensed[0, 0])
        assert abs(believed - 44.0) > 0.1
        assert found(sim, "(BELOW_LIGHT_X)") == pytest.approx(believed + 1.0)


@pytest.mark.parametrize("machine", MACHINES)
def test_all_robots_at_once_come_to_what_each_comes_to(machine: Machine) -> None:
    sim, robots = world(machine), [0, 1, 2, 3, 4, 5, 20]
    put(sim, 0, 44.0, 10.0, 10.0)
    swarm = Swarm(sim)
    views = list(swarm.fleet.values())
    minds = [Node("one", swarm.vocabulary, number=robot + 1, seed=sim.seed, body=sim.robots[robot]) for robot in robots]
    for text in TEXTS:
        (together,) = swarm.fleet.evaluate(text, robots)
        results = [views[robot].result(together, 0) for robot in robots]
        alone = [mind.evaluate(text) for mind in minds]
        told = [
            [(each.value.hex(), [fault.reason for fault in each.faults]) for each in side] for side in (results, alone)
        ]
        assert told[0] == told[1], text
        assert text == "(BELOW UNKNOWN)" or any(not isnan(each.value) for each in results), text


def test_a_robot_without_a_camera_says_so() -> None:
    fleet = Swarm(world()).fleet
    (results,) = fleet.evaluate("(BELOW red)", [20])
    result = list(fleet.values())[20].result(results, 0)
    assert isnan(result.value)
    assert [BLIND in fault.reason for fault in result.faults] == [True]


def commanded(robots: sc.SimulatedFleet) -> sc.SimulatedFleet:
    for rule in RULES:
        robots.send(rule, everybody=True)
    return robots


def test_worlds_and_runs_that_go_on_and_more_threads_equal_one_run() -> None:
    with sc.open(TEXT, seed=4, threads=1) as alone:
        commanded(alone).run(2.0 - alone.time)
        middle = alone.snapshot()
        alone.run(2.0)
        assert (alone["drive_turn"][:6] > 0.0).any()
        worlds = sc.open_many(TEXT, seeds=[3, 4])
        for each in worlds:
            commanded(each)
        worlds.run(4.0 - worlds.time)
        resumed = sc.resume(middle)
        resumed.run(2.0)
        more = commanded(sc.open(TEXT, seed=4, threads=3))
        more.run(4.0 - more.time)
        for other in (worlds[1], resumed, more):
            assert (other.time, other.hash) == (alone.time, alone.hash)


def test_a_recorded_run_comes_again(tmp_path: Path) -> None:
    folder = tmp_path / "cameras"
    folder.mkdir()
    (folder / "scenario.toml").write_text(TEXT, encoding="utf-8")
    file = tmp_path / "run.mcap"
    with sc.open(folder, seed=4) as robots, robots.record(file):
        commanded(robots).run(1.0)
    assert "the same to the last bit" in called_warm("replay", str(file), "--verify").out


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ([('angle = "80deg"', 'angle = "0deg"')], "robots[0].camera.angle"),
        ([('angle = "80deg"', 'angle = "180deg"')], "robots[0].camera.angle"),
        ([('angle = "80deg"', "")], "robots[0].camera.angle"),
        ([('angle = "80deg"', 'angle = "80deg"\nrange = "3m"')], "robots[0].camera.range"),
        (
            [('type = "rover"', 'type = "rover"\ncamera = { angle = "60deg" }')],
            "robots[1].camera: it looks down from above, and these robots do not fly: leave it out, or give them "
            "[robots.flight]",
        ),
        ([("format = 2", "format = 1")], "robots[0].camera: it does not see through walls, so it is of format 2"),
        (
            [('[neighbours]\nreach = "9m"\n', ""), (TEXT[TEXT.index("[lights.lamp]") :], "")],
            "robots[0].camera: it sees lights, and robots by what they show: add a table [neighbours] with its reach",
        ),
        (
            [('height = "60m"', 'height = "60m"\nedge = "torus"'), ('ceiling = "14m"', 'ceiling = "40m"')],
            "a torus of 60 m is too small: they sense others up to 33.564 m far",
        ),
    ],
)
def test_a_scenario_with_such_a_mistake_is_refused(changes: list[tuple[str, str]], message: str) -> None:
    with pytest.raises(SettingsError) as raised:
        scenario(*changes)
    assert message in str(raised.value)
