"""Simulated bodies: they keep the contract of a robot, move as physics allows, and sense what is there."""

from __future__ import annotations

from collections.abc import Callable
from math import atan2, hypot, inf, isclose, pi, radians
from pathlib import Path

import numpy as np
import pytest

from sleepcast.robot import Setpoint
from sleepcast.simulator import Body, Saying, Simulator
from sleepcast.simulator.bodies.body import TUMBLE
from sleepcast.testing.robot_contract import Rig, RobotContract
from small_worlds import simulator


def run(sim: Simulator, seconds: float) -> None:
    for _ in range(round(seconds / sim.scenario.tick)):
        sim.step()


def put(sim: Simulator, number: int, x: float, y: float, heading: float = 0.0) -> Body:
    """Move one robot to a place by hand, at rest."""
    bodies = sim.bodies
    bodies.x[number], bodies.y[number], bodies.heading[number], bodies.speed[number] = x, y, heading, 0.0
    return sim.robots[number]


def clear(sim: Simulator) -> None:
    """Put all robots far away from the middle."""
    sim.bodies.x[:], sim.bodies.y[:] = 1.0, 1.0


class TestContract(RobotContract):
    @pytest.fixture
    def rig(self, tmp_path: Path) -> Rig:
        sim = simulator(tmp_path)
        return Rig(put(sim, 4, 500.0, 500.0), lambda seconds: run(sim, seconds))


class TestDriving:
    def test_straight_on(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path)
        put(sim, 0, 100.0, 200.0, radians(30)).drive(5.0, 0.0)
        run(sim, 12.5)  # 2.5 s to full speed, then 10 s at it
        gone = hypot(sim.x[0] - 100.0, sim.y[0] - 200.0)
        assert isclose(gone, 0.5 * 5.0 * 2.5 + 5.0 * 10, rel_tol=0.01)
        assert isclose(atan2(sim.y[0] - 200.0, sim.x[0] - 100.0), radians(30), rel_tol=1e-9)

    def test_a_circle(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path, ('tick = "0.1s"', 'tick = "0.01s"'))
        body = put(sim, 0, 500.0, 500.0)
        sim.bodies.speed[0] = 5.0
        body.drive(5.0, pi / 10)
        xs = []
        for _ in range(20):
            run(sim, 1.0)
            xs.append((float(sim.x[0]), float(sim.y[0])))
        radius = 5.0 / (pi / 10)
        assert all(isclose(hypot(x - 500.0, y - (500.0 + radius)), radius, rel_tol=0.01) for x, y in xs)
        assert hypot(xs[-1][0] - 500.0, xs[-1][1] - 500.0) < 0.2

    def test_turn_rate_is_limited(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path)
        put(sim, 0, 500.0, 500.0).drive(0.0, 1000.0)
        sim.step()
        assert isclose(sim.bodies.heading[0], sim.model.limits.turn_rate * 0.1)

    def test_backwards(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path)
        put(sim, 0, 500.0, 500.0).drive(-5.0, 0.0)
        run(sim, 10)
        assert sim.x[0] < 470.0

    def test_others_are_left_alone(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path)
        before = sim.x.copy()
        put(sim, 0, 500.0, 500.0).drive(5.0, 0.0)
        run(sim, 5)
        assert (sim.x[1:] == before[1:]).all()


class TestGoTo:
    @pytest.mark.parametrize("heading", [0.0, 1.0, pi / 2, pi, -2.0])
    @pytest.mark.parametrize("target", [(700.0, 500.0), (500.0, 503.0), (499.0, 499.0), (10.0, 990.0)])
    def test_it_arrives_and_stays(self, tmp_path: Path, heading: float, target: tuple[float, float]) -> None:
        sim = simulator(tmp_path)
        put(sim, 0, 500.0, 500.0, heading).go_to(*target)
        run(sim, 200)
        for _ in range(50):
            sim.step()
            assert hypot(sim.x[0] - target[0], sim.y[0] - target[1]) <= sim.model.geometry.radius
        assert sim.bodies.speed[0] == 0

    def test_a_fast_body_that_turns_slowly_arrives_as_well(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path, ('"90deg/s"', '"3deg/s"'))
        put(sim, 0, 500.0, 500.0).go_to(500.0, 520.0)
        sim.bodies.speed[0] = 5.0
        run(sim, 300)
        assert hypot(sim.x[0] - 500.0, sim.y[0] - 520.0) <= sim.model.geometry.radius

    def test_a_body_that_is_there_stays_there(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path)
        put(sim, 0, 500.0, 500.0).go_to(500.0, 500.0)
        run(sim, 5)
        assert (sim.x[0], sim.y[0], sim.bodies.heading[0]) == (500.0, 500.0, 0.0)

    def test_a_point_outside_the_world_is_the_nearest_one_inside(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path)
        put(sim, 0, 900.0, 500.0).go_to(5000.0, 500.0)
        run(sim, 60)
        assert hypot(sim.x[0] - 1000.0, sim.y[0] - 500.0) <= sim.model.geometry.radius


class TestFence:
    @pytest.mark.parametrize(("x", "y", "heading"), [(990, 500, 0), (10, 500, pi), (500, 990, pi / 2), (990, 990, 0.8)])
    def test_a_body_that_drives_outwards_is_turned_back(
        self, tmp_path: Path, x: float, y: float, heading: float
    ) -> None:
        sim = simulator(tmp_path)
        put(sim, 0, x, y, heading).drive(5.0, 0.0)
        run(sim, 30)
        assert hypot(sim.x[0] - 500.0, sim.y[0] - 500.0) < hypot(x - 500.0, y - 500.0) - 50.0

    def test_wanderers_stay_inside_and_keep_moving(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path, ('motion = "still"', 'motion = "wander"'), ("count = 20", "count = 300"))
        for _ in range(3000):
            sim.step()
            assert ((sim.x >= 0) & (sim.x <= 1000) & (sim.y >= 0) & (sim.y <= 1000)).all()
        assert np.abs(sim.bodies.speed).min() > 1.0
        # Not drawn to the edge: the outer tenth on each side is 36 % of the area.
        edge = (sim.x < 100) | (sim.x > 900) | (sim.y < 100) | (sim.y > 900)
        assert edge.mean() < 0.6


class TestWandering:
    def test_headings_drift_slowly_and_to_both_sides(self, tmp_path: Path) -> None:
        more = '\n[robots.wander]\nturn_rate = "2deg/s"\nsteadiness = "10s"\n'
        changes = (('motion = "still"', 'motion = "wander"'), ("count = 20", "count = 1000"))
        sim = simulator(tmp_path, *changes, ('"1km"\nheight', '"900km"\nheight'), more=more)
        run(sim, 100)
        rates = sim.bodies.roaming
        assert isclose(rates.std(), radians(2), rel_tol=0.1)
        assert abs(rates.mean()) < radians(0.3)
        before = rates.copy()
        run(sim, 1)
        assert np.corrcoef(before, rates)[0, 1] > 0.8
        run(sim, 60)
        assert abs(np.corrcoef(before, rates)[0, 1]) < 0.15

    def test_the_walk_hardly_depends_on_the_tick(self, tmp_path: Path) -> None:
        more = '\n[robots.wander]\nturn_rate = "2deg/s"\nsteadiness = "10s"\n'
        spreads = []
        for tick in ("0.02s", "0.5s"):
            changes = (('motion = "still"', 'motion = "wander"'), ("count = 20", "count = 1000"))
            sim = simulator(tmp_path, *changes, ('tick = "0.1s"', f'tick = "{tick}"'), more=more)
            run(sim, 60)
            spreads.append(float(sim.bodies.roaming.std()))
        assert isclose(*spreads, rel_tol=0.1)

    def test_wander_can_be_asked_for(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path)
        put(sim, 0, 500.0, 500.0).wander()
        run(sim, 10)
        assert sim.bodies.speed[0] == sim.scenario.robots.wander.speed


class TestStores:
    def test_driving_uses_what_it_uses(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path)
        before = float(sim.bodies.stores[0, 0])
        put(sim, 0, 100.0, 500.0).drive(5.0, 0.0)
        run(sim, 60)
        gone = float(sim.x[0]) - 100.0
        assert gone > 250
        assert isclose(before - sim.bodies.stores[0, 0], gone / 20_000, rel_tol=1e-6)

    def test_standing_uses_nothing(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path)
        before = sim.bodies.stores.copy()
        run(sim, 60)
        assert (sim.bodies.stores == before).all()

    def test_an_empty_tank_stops_the_body_for_good(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path)
        sim.bodies.stores[0, 0] = 0.0005  # 10 m
        body = put(sim, 0, 100.0, 500.0)
        body.drive(5.0, 0.0)
        run(sim, 30)
        assert sim.bodies.stores[0, 0] == 0.0
        assert sim.bodies.speed[0] == 0.0
        assert 109.0 < sim.x[0] < 120.0
        body.drive(5.0, 1.0)
        run(sim, 5)
        assert sim.bodies.speed[0] == 0.0

    def test_start_values_are_even_and_shared_out(self, tmp_path: Path) -> None:
        more = '\n[robots.stores.water]\nstart = ["5kg", "20kg"]\nshare = 0.4\n'
        sim = simulator(tmp_path, ("count = 20", "count = 5000"), more=more)
        battery, water = sim.bodies.stores
        assert 0.2 <= battery.min() < 0.22
        assert 0.98 < battery.max() <= 1.0
        assert isclose(battery.mean(), 0.6, rel_tol=0.02)
        assert isclose((water > 0).mean(), 0.4, rel_tol=0.06)
        assert water[water > 0].min() >= 5.0
        assert water.max() <= 20.0
        assert abs(np.corrcoef(battery, water)[0, 1]) < 0.05


class TestTumble:
    def test_it_turns_by_67_degrees_to_either_side_within_the_limits(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path, ("count = 20", "count = 400"))
        sim.bodies.heading[:] = 0.0
        sides = [body.tumble() for body in sim.robots]
        assert 150 < sides.count(1.0) < 250
        sim.step()
        assert np.allclose(np.abs(sim.bodies.heading), sim.model.limits.turn_rate * 0.1)
        run(sim, 2)
        assert np.allclose(sim.bodies.heading, np.array(sides) * TUMBLE)

    def test_each_tick_is_another_throw(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path)
        sides = []
        for _ in range(100):
            sides.append(sim.robots[0].tumble())
            sim.step()
        assert 25 < sides.count(1.0) < 75

    def test_a_held_body_tumbles_afterwards(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path)
        body = put(sim, 0, 500.0, 500.0)
        body.hold(True)
        side = body.tumble()
        run(sim, 2)
        assert sim.bodies.heading[0] == 0.0
        body.hold(False)
        run(sim, 2)
        assert isclose(sim.bodies.heading[0], side * TUMBLE)


class TestStopped:
    @pytest.mark.parametrize(
        "ask",
        [
            lambda body: body.drive(5.0, 1.0),
            lambda body: body.go_to(0.0, 0.0),
            lambda body: body.wander(),
            lambda body: body.tumble(),
            lambda body: body.act(Setpoint(5.0, 1.0)),
        ],
        ids=["drive", "goto", "wander", "tumble", "act"],
    )
    def test_nothing_moves_a_stopped_body(self, tmp_path: Path, ask: Callable[[Body], None]) -> None:
        sim = simulator(tmp_path)
        body = put(sim, 0, 500.0, 500.0)
        body.stop()
        ask(body)
        run(sim, 5)
        assert (sim.x[0], sim.y[0], sim.bodies.heading[0]) == (500.0, 500.0, 0.0)
        body.release()
        run(sim, 5)
        assert (sim.x[0], sim.y[0], sim.bodies.heading[0]) == (500.0, 500.0, 0.0)

    def test_stop_ends_a_tumble(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path)
        body = put(sim, 0, 500.0, 500.0)
        body.tumble()
        body.stop()
        run(sim, 2)
        assert sim.bodies.heading[0] == 0.0


class TestSonar:
    def test_ranges_run_from_rim_to_rim_in_the_right_sector(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path)
        clear(sim)
        body = put(sim, 0, 500.0, 500.0, radians(90))
        put(sim, 1, 500.0, 520.0)  # straight ahead
        put(sim, 2, 470.0, 500.0)  # to the left
        assert isclose(body.sonar(0), 19.0)
        assert isclose(body.sonar(4), 29.0)
        assert body.sonar(8) == body.sonar(12) == 100.0
        assert body.sonar(16) == body.sonar(0)

    def test_every_robot_in_range_is_in_just_one_sector(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path, ("count = 20", "count = 2"))
        for degrees in range(0, 360, 7):
            body = put(sim, 0, 500.0, 500.0, radians(13))
            put(sim, 1, 500.0 + 50 * np.cos(radians(degrees)), 500.0 + 50 * np.sin(radians(degrees)))
            assert sum(body.sonar(i) < 100.0 for i in range(16)) == 1

    def test_nearest_looks_between_two_angles(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path)
        clear(sim)
        body = put(sim, 0, 500.0, 500.0, radians(180))
        put(sim, 1, 520.0, 500.0)  # behind
        put(sim, 2, 500.0, 530.0)  # to the right
        assert isclose(body.nearest(-pi, pi), 19.0)
        assert isclose(body.nearest(radians(-120), radians(-60)), 29.0)
        assert isclose(body.nearest(radians(170), radians(190)), 19.0)
        assert isclose(body.nearest(radians(170), radians(-170)), 19.0)
        assert body.nearest(radians(60), radians(120)) == 100.0

    def test_touching_is_zero(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path)
        clear(sim)
        body = put(sim, 0, 500.0, 500.0)
        put(sim, 1, 500.2, 500.0)
        assert body.sonar(0) == 0.0

    def test_a_robot_without_sonars_has_no_such_functions(self, tmp_path: Path) -> None:
        with_, without = simulator(tmp_path), simulator(tmp_path, ('sonars = 16\nsonar_range = "100m"\n', ""))
        assert {f.name for f in with_.model.functions} - {f.name for f in without.model.functions} == {
            "SONAR",
            "NEAREST",
        }


class TestReadings:
    def test_a_body_and_the_simulator_say_the_same(self, tmp_path: Path) -> None:
        for more in ("", '\n[noise]\nx = "3m"\nheading = "5deg"\n'):
            sim = simulator(tmp_path, more=more)
            rows = sim.readings()
            assert sim.readings([3, 1]) == [rows[3], rows[1]]
            assert list(sim.robots[5].sense().values) == rows[5]

    def test_places_are_sensed(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path)
        names = [sensor.name for sensor in sim.model.sensors]
        assert names == ["x", "y", "heading", "speed", "battery", "house_x", "house_y"]
        assert sim.readings([0])[0][-2:] == [500.0, 400.0]

    def test_noise_has_its_deviation_and_changes_no_state(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path, ("count = 20", "count = 4000"), more='\n[noise]\ny = "3m"\nbattery = "1%"\n')
        before = sim.state_hash()
        read = np.array(sim.readings())
        error = read[:, 1] - sim.y
        inner = (sim.y > 20) & (sim.y < 980)
        assert isclose(error[inner].std(), 3.0, rel_tol=0.05)
        assert abs(error[inner].mean()) < 0.2
        assert (read[:, 0] == sim.x).all()
        assert read[:, 4].max() <= 1.0
        assert sim.state_hash() == before
        sim.step()
        later = np.array(sim.readings())[:, 1] - sim.y
        assert abs(np.corrcoef(error[inner], later[inner])[0, 1]) < 0.1

    def test_noise_of_the_heading_goes_on_round_the_circle(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path, ("count = 20", "count = 4000"), more='\n[noise]\nheading = "20deg"\n')
        sim.bodies.heading[:] = 3.0
        read = np.array(sim.readings())[:, 2]
        error = (read - 3.0 + pi) % (2.0 * pi) - pi
        assert np.abs(read).max() <= pi
        assert isclose(error.std(), radians(20), rel_tol=0.05)
        assert abs(error.mean()) < 0.02

    def test_what_is_said_aloud_is_kept(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path)
        run(sim, 1)
        sim.robots[2].say("hello")
        assert list(sim.sayings) == [Saying(1.0, 2, "hello")]

    def test_names_follow_the_type(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path)
        assert sim.names[:2] == ("rover1", "rover2")
        assert len(sim.robots) == len(sim.names) == 20


def test_actuators_are_in_the_order_of_a_setpoint(tmp_path: Path) -> None:
    actuators = simulator(tmp_path).model.actuators
    assert [actuator.name for actuator in actuators] == ["drive_speed", "drive_turn"]
    assert all(-inf < actuator.low < actuator.high < inf for actuator in actuators)
