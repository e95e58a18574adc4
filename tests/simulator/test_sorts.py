"""Several sorts of robots in one world: each keeps its own limits, shape and sensors, and all of them meet."""

from __future__ import annotations

from math import isnan, pi
from pathlib import Path

import numpy as np
import pytest

from simulated import sensed
from simulator.sonar.sonar_reference import readings as reference
from sleepcast.loop import Swarm
from sleepcast.simulator import Changes, Simulator, choose, load
from sleepcast.simulator.engine import Machine
from sleepcast.simulator.motion.steps import SKIN
from small_worlds import write

WORLD = """
format = 1
title = "Several sorts"
seconds = "1min"
seed = 3

[world]
width = "12m"
height = "12m"
edge = "wall"
"""
SORTS = """
[[robots]]
like = "scout"
count = 2
motion = "still"

[robots.stores.battery]
reach = "10m"

[[robots]]
like = "nomad200"
type = "nomad"
count = 1
motion = "still"

[[robots]]
like = "disc"
count = 1
motion = "still"

[robots.limits]
speed = "2m/s"

[robots.stores.water]
start = ["3kg", "3kg"]
"""
SCOUT, OTHER, NOMAD, DISC = range(4)
NAMES = ("scout1", "scout2", "nomad1", "disc1")


def mixed(folder: Path, robots: str = SORTS, machine: Machine | None = None, count: int | None = None) -> Simulator:
    return Simulator(load(write(folder, more=robots, text=WORLD), Changes(robots=count)), machine=machine)


def apart(simulator: Simulator) -> Simulator:
    """Everybody at rest in a corner of its own, looking east."""
    for number, (x, y) in enumerate([(2.0, 2.0), (2.0, 10.0), (2.0, 6.0), (9.0, 9.0)]):
        simulator.place(number, x, y, 0.0)
    return simulator


@pytest.fixture(params=["numpy", "numba"])
def machine(request: pytest.FixtureRequest) -> Machine:
    return choose(request.param, 1)


class TestSensing:
    def test_they_have_one_vocabulary_and_names_of_their_own(self, tmp_path: Path) -> None:
        simulator = mixed(tmp_path)
        assert tuple(simulator.names) == NAMES
        names = [sensor.name for sensor in simulator.model.sensors]
        assert {"battery", "water", "bumper", "sonar0", "sonar15", "front_range"} <= set(names)
        assert {function.name for function in simulator.model.functions} >= {"VM", "SONAR", "DRIVE"}

    def test_what_a_sort_lacks_is_unknown(self, tmp_path: Path) -> None:
        simulator = apart(mixed(tmp_path))
        simulator.step()
        lacks = [{name for name, value in sensed(simulator, number).items() if isnan(value)} for number in range(4)]
        sonars = {f"sonar{number}" for number in range(16)} | {"front_range"}
        assert lacks == [{"water"}, {"water"}, {"water"}, {"battery"} | sonars]
        assert sensed(simulator, DISC)["water"] == 3.0

    def test_and_stays_so_for_who_is_placed_and_for_children_of_other_sorts(self, tmp_path: Path) -> None:
        bare = SORTS.replace('like = "disc"', 'like = "disc"\nbody = { bumpers = 0 }')
        simulator = apart(mixed(tmp_path, bare.replace("count =", "hatch = true\ncount =")))
        swarm = Swarm(simulator)
        swarm.evaluate("scout1", "(HATCH disc 1)")
        swarm.evaluate("disc1", "(HATCH scout 1)")
        swarm.step()
        swarm.step()
        children = {"disc5", "scout6"}
        assert children < swarm.minds.keys()
        felt = {name: swarm.minds[name].evaluate("bumper").value for name in (*NAMES, *children)}
        assert {name for name, bumper in felt.items() if isnan(bumper)} == {"disc1", "disc5"}

    def test_a_function_that_a_sort_lacks_is_a_fault_where_it_is_reached(self, tmp_path: Path) -> None:
        swarm = Swarm(apart(mixed(tmp_path)))
        swarm.run(0.1)
        for name, text, fault in [
            ("disc1", "(SONAR 0)", "this robot has no sonars"),
            ("disc1", "(VM 1 1)", "this robot has no wheels"),
            ("nomad1", "(VM 1 1)", "this robot has no wheels"),
        ]:
            found = swarm.evaluate(name, text).faults
            assert [fault in each.reason for each in found] == [True], (name, text, found)
        assert not swarm.evaluate("disc1", "(WHEN FALSE (SONAR 0))").faults
        assert not swarm.evaluate("scout1", "(PROGN (VM 0.1 0.1) (SONAR 0))").faults

    def test_sonars_begin_at_their_own_rim_and_end_at_the_others(self, tmp_path: Path, machine: Machine) -> None:
        simulator = apart(mixed(tmp_path, machine=machine))
        simulator.place(NOMAD, 5.0, 2.0, pi)
        assert sensed(simulator, SCOUT)["sonar0"] == pytest.approx(3.0 - 0.17 - 0.225, abs=1e-5)
        assert sensed(simulator, NOMAD)["sonar0"] == pytest.approx(3.0 - 0.17 - 0.225, abs=1e-5)
        simulator.place(DISC, 3.5, 2.0, 0.0)
        assert sensed(simulator, SCOUT)["sonar0"] == pytest.approx(1.5 - 0.17 - 0.2, abs=1e-5)

    def test_every_range_is_that_of_the_reference(self, tmp_path: Path, machine: Machine) -> None:
        count = 90
        simulator = mixed(tmp_path, SORTS.replace('"scout"', '"scout"\ntype = "scout"'), machine, count)
        bodies, worst = simulator.bodies, 0.0
        corners = [(0.0, 0.0), (12.0, 0.0), (12.0, 12.0), (0.0, 12.0)]
        walls = list(zip(corners, corners[1:] + corners[:1], strict=True))
        table = bodies.sonar_ranges()
        for part in (bodies.parts[0], bodies.parts[1]):
            for number in range(count):
                ring = bodies.rings_of(number)
                if ring is None or bodies.part_of(number) is not part:
                    continue
                discs = [(bodies.x[i], bodies.y[i], bodies.radii[i]) for i in range(count) if i != number]
                wanted = reference(ring.cones, bodies.x[number], bodies.y[number], bodies.heading[number], discs, walls)
                clipped = np.clip(wanted, ring.ring.least, ring.ring.most)
                worst = max(worst, float(np.abs(table[number] - clipped).max()))
        assert worst < 1e-5


class TestMoving:
    def test_each_sort_keeps_its_own_limits(self, tmp_path: Path) -> None:
        simulator = apart(mixed(tmp_path))
        for robot in simulator.robots:
            robot.drive(10.0, 0.0)
        for _ in range(15):
            simulator.step()
        assert simulator.bodies.speed.tolist() == pytest.approx(
            [1.0, 1.0, 20 * 0.0254, 1.5]
        )  # the disc still speeds up

    def test_wheels_turn_with_inertia_and_others_at_once(self, tmp_path: Path) -> None:
        simulator = apart(mixed(tmp_path))
        for robot in simulator.robots:
            robot.drive(0.0, 10.0)
        simulator.step()
        heading = simulator.bodies.heading
        assert heading[NOMAD] == pytest.approx(0.1 * pi / 4)
        assert heading[DISC] == pytest.approx(0.1 * pi)
        assert heading[SCOUT] == pytest.approx(0.1 * 2.0 * 0.2 / 0.3452)

    def test_driving_uses_what_the_sort_uses(self, tmp_path: Path) -> None:
        simulator = apart(mixed(tmp_path))
        for robot in simulator.robots:
            robot.drive(0.4, 0.0)
        for _ in range(50):
            simulator.step()
        used = [1.0 - sensed(simulator, number)["battery"] for number in (SCOUT, NOMAD)]
        assert used[0] == pytest.approx((simulator.x[SCOUT] - 2.0) / 10.0)
        assert used[1] == 0.0

    def test_encoders_are_wrong_only_on_wheels_that_slip(self, tmp_path: Path) -> None:
        slipping = SORTS.replace(
            "[robots.stores.battery]", '[robots.wheels]\nslip_left = "5%"\n\n[robots.stores.battery]'
        )
        simulator = apart(mixed(tmp_path, slipping))
        for robot in simulator.robots:
            robot.drive(0.4, 0.1)
        for _ in range(40):
            simulator.step()
        for number in range(4):
            believed = sensed(simulator, number)
            wrong = abs(believed["x"] - simulator.x[number]) + abs(believed["y"] - simulator.y[number])
            assert (wrong > 0.01) == (number in (SCOUT, OTHER))


class TestTouching:
    def test_they_stop_where_their_rims_meet(self, tmp_path: Path, machine: Machine) -> None:
        simulator = apart(mixed(tmp_path, machine=machine))
        simulator.place(DISC, 4.0, 2.0, 0.0)
        simulator.robots[SCOUT].drive(1.0, 0.0)
        for _ in range(40):
            simulator.step()
        assert simulator.x[SCOUT] == pytest.approx(4.0 - 0.17 - 0.2 - SKIN, abs=1e-6)
        assert sensed(simulator, SCOUT)["bumper"] == 1.0

    def test_a_bumper_has_as_many_parts_as_its_sort(self, tmp_path: Path) -> None:
        simulator = apart(mixed(tmp_path))
        simulator.place(SCOUT, 11.0, 2.0, pi)
        simulator.place(NOMAD, 11.0, 6.0, pi)
        simulator.robots[SCOUT].drive(-1.0, 0.0)
        simulator.robots[NOMAD].drive(-1.0, 0.0)
        for _ in range(40):
            simulator.step()
        assert [sensed(simulator, number)["bumper"] for number in (SCOUT, NOMAD)] == [
            5.0,
            11.0,
        ]  # behind, of 8 and of 20

    @pytest.mark.parametrize("name", ["numpy", "numba"])
    def test_no_two_ever_overlap(self, tmp_path: Path, name: str) -> None:
        wandering = SORTS.replace('motion = "still"\n', "")
        simulator = mixed(tmp_path, wandering, choose(name, 1), 120)
        bodies = simulator.bodies
        for _ in range(200):
            simulator.step()
            gap = np.hypot(bodies.x[:, None] - bodies.x, bodies.y[:, None] - bodies.y)
            gap -= bodies.radii[:, None] + bodies.radii
            np.fill_diagonal(gap, np.inf)
            assert gap.min() >= 0.0
            walls = np.minimum.reduce([bodies.x, bodies.y, 12.0 - bodies.x, 12.0 - bodies.y]) - bodies.radii
            assert walls.min() >= 0.0
        assert (bodies.bumper > 0).any()


class TestRepeating:
    def test_threads_change_nothing(self, tmp_path: Path) -> None:
        def state(threads: int) -> str:
            noisy = SORTS.replace('motion = "still"\n', "").replace(
                "[robots.stores.battery]", "[robots.sonar]\nnoise = 0.01\n\n[robots.stores.battery]"
            )
            simulator = mixed(tmp_path, noisy, choose("numba", threads), 150)
            for _ in range(20):
                simulator.step()
            simulator.readings()
            return simulator.state_hash()

        assert state(1) == state(2)

    def test_a_run_with_no_robot_of_a_sort_is_one_without_it(self, tmp_path: Path) -> None:
        simulator = mixed(tmp_path, count=2)
        assert tuple(simulator.names) == ("scout1", "nomad1")
        simulator.step()
        assert not isnan(simulator.readings()[0][-1])

    def test_the_same_robots_in_two_tables_behave_as_in_one(self, tmp_path: Path) -> None:
        one = '\n[robots]\nlike = "scout"\ncount = 6\n'
        two = '\n[[robots]]\nlike = "scout"\ncount = 4\n\n[[robots]]\nlike = "scout"\ncount = 2\n'
        both = [mixed(tmp_path, robots) for robots in (one, two)]
        for _ in range(50):
            for simulator in both:
                simulator.step()
        assert tuple(both[0].names) == tuple(both[1].names)
        assert both[0].readings() == both[1].readings()

    def test_rules_run_on_all_of_them(self, tmp_path: Path) -> None:
        swarm = Swarm(apart(mixed(tmp_path)))
        swarm.run(0.2)
        results = [swarm.evaluate(name, "(WHEN (< front_range 200in) (JOIN near))") for name in NAMES]
        assert [result.matched for result in results][DISC] is False
