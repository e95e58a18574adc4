"""Nomads move, turn, rest and bump as formulas say, and are where they say they are."""

from __future__ import annotations

from collections.abc import Callable
from math import degrees, hypot, inf, isclose, nan, pi, radians, sqrt
from pathlib import Path

import numpy as np
import pytest

from machines import ALL, MACHINES
from nomad.world.nomad_time import run, until_rest
from sleepcast.core.errors import MisuseError
from sleepcast.nomad.world.building import nomad_world
from sleepcast.nomad.world.nomad_world import NomadWorld
from sleepcast.robot import Axes, LidarKind, Pose
from sleepcast.simulator.engine import Machine

TENTH = 0.00254
"""m of a tenth of an inch."""
BOX = [(1.0, -0.5), (2.0, -0.5), (2.0, 0.5), (1.0, 0.5)]


@pytest.fixture
def scout() -> NomadWorld:
    """A lone ideal Scout at the origin."""
    return nomad_world(machine=ALL[-1])


class TestScout:
    def test_it_begins_at_rest_in_the_middle(self, scout: NomadWorld) -> None:
        condition = scout.observe(0)
        assert (scout.count, scout.time, scout.steers(0), scout.radius(0)) == (1, 0.0, False, 0.17)
        assert condition.real == condition.believed == Pose(0.0, 0.0, 0.0, 0.0)
        assert condition.speeds == Axes(0.0, 0.0, 0.0)
        assert condition.moving == (False, False, False)
        assert np.isnan(condition.sonars).all()
        assert len(condition.sonars) == 16
        assert (condition.infrared, condition.touched, condition.battery) == ((), (), 1.0)

    @pytest.mark.parametrize(("right", "left", "rate"), [(40, -40, 33.73), (52, -22, 31.20)])
    def test_it_turns_at_the_rates_of_the_thesis(self, scout: NomadWorld, right: int, left: int, rate: float) -> None:
        """Degrees a second for tenths of inches a second at the wheels: (right - left) / (2 * 1.18597)."""
        scout.set_speeds(0, Axes(right * TENTH, left * TENTH))
        run(scout, 1.0)
        before = scout.observe(0).real.heading
        scout.step()
        found = degrees(scout.observe(0).real.heading - before) / scout.tick
        assert isclose(found, rate, rel_tol=2e-4)
        assert isclose(found, (right - left) / (2 * 0.118597) / 10, rel_tol=1e-5)

    def test_speeds_rise_as_fast_as_wheels_can(self, scout: NomadWorld) -> None:
        scout.set_speeds(0, Axes(0.5, -0.3))
        scout.step()
        assert scout.observe(0).speeds == pytest.approx((2.0 * scout.tick, -2.0 * scout.tick, 0.0))
        run(scout, 1.0)
        assert scout.observe(0).speeds == pytest.approx((0.5, -0.3, 0.0))
        assert scout.observe(0).moving == (True, True, False)

    def test_an_axis_left_out_goes_on(self, scout: NomadWorld) -> None:
        scout.set_speeds(0, Axes(0.2, 0.1))
        scout.set_speeds(0, Axes(first=0.3))
        run(scout, 1.0)
        assert scout.observe(0).speeds == pytest.approx((0.3, 0.1, 0.0))

    def test_no_wheel_exceeds_its_limits(self, scout: NomadWorld) -> None:
        scout.set_speeds(0, Axes(inf, -50.0, 3.0))
        run(scout, 2.0)
        assert scout.observe(0).speeds == pytest.approx((1.0, -1.0, 0.0))

    def test_rest_brakes_evenly(self, scout: NomadWorld) -> None:
        """v2 / 2a, less half a tick's way: the speed falls at the beginning of each tick."""
        scout.set_speeds(0, Axes(0.8, 0.8))
        run(scout, 1.0)
        begin = scout.observe(0).real.x
        scout.rest(0)
        assert until_rest(scout) == pytest.approx(0.8 / 2.0)
        way = scout.observe(0).real.x - begin
        assert isclose(way, 0.8**2 / (2 * 2.0) - 0.5 * scout.tick * 0.8, rel_tol=1e-9)

    def test_place_puts_body_and_belief_somewhere(self, scout: NomadWorld) -> None:
        scout.set_speeds(0, Axes(0.5, 0.5))
        run(scout, 1.0)
        scout.place(0, Pose(1.5, -2.0, 7.0, 0.0))
        condition = scout.observe(0)
        assert condition.real == condition.believed
        assert condition.real == pytest.approx((1.5, -2.0, 7.0 - 2.0 * pi, 7.0 - 2.0 * pi))
        run(scout, 0.5)
        assert scout.observe(0).real[:2] == pytest.approx((1.5, -2.0))

    def test_place_keeps_a_number_that_is_none_and_stays_in_the_world(self, scout: NomadWorld) -> None:
        scout.place(0, Pose(1.0, 2.0, 0.5, nan))
        scout.place(0, Pose(nan, inf, nan, nan))
        x, y, heading, _ = scout.observe(0).real
        assert (x, heading) == pytest.approx((1.0, 0.5))
        assert y == pytest.approx(scout.size[1] / 2.0 - 0.17)

    def test_belief_is_corrected_and_the_body_stays(self, scout: NomadWorld) -> None:
        scout.believe(0, x=3.0, heading=pi / 2)
        condition = scout.observe(0)
        assert condition.believed == pytest.approx((3.0, 0.0, pi / 2, pi / 2))
        assert condition.real == Pose(0.0, 0.0, 0.0, 0.0)
        scout.travel(0, Axes(1.0, 1.0))
        until_rest(scout)
        condition = scout.observe(0)
        assert condition.real == pytest.approx((1.0, 0.0, 0.0, 0.0), abs=1e-9)
        assert condition.believed == pytest.approx((3.0, 1.0, pi / 2, pi / 2), abs=1e-9)

    def test_limp_wheels_roll_out(self, scout: NomadWorld) -> None:
        scout.set_speeds(0, Axes(0.5, 0.5))
        run(scout, 1.0)
        scout.limp(0, (True, True, True))
        assert until_rest(scout) == pytest.approx(0.5 / (0.25 * 2.0))


class TestTravel:
    @pytest.mark.parametrize("tenths", [1000, -1000, 1, 37, 2, 2919])
    def test_it_ends_where_it_was_sent(self, scout: NomadWorld, tenths: int) -> None:
        scout.travel(0, Axes(tenths * TENTH, tenths * TENTH))
        until_rest(scout)
        assert abs(scout.observe(0).real.x / TENTH - tenths) < 1e-3
        assert scout.observe(0).speeds == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)

    @pytest.mark.parametrize(("way", "cruise", "acceleration"), [(2.54, 0.5, 1.0), (1.0, 0.2, 0.1), (0.3, 1.0, 2.0)])
    def test_its_time_is_that_of_a_trapezoid(
        self, scout: NomadWorld, way: float, cruise: float, acceleration: float
    ) -> None:
        scout.cruise(0, Axes(cruise, cruise))
        scout.accelerate(0, Axes(acceleration, acceleration))
        scout.travel(0, Axes(way, way))
        fastest = min(cruise, sqrt(way * acceleration))
        expected = way / fastest + fastest / acceleration
        assert abs(until_rest(scout) - expected) <= 3 * scout.tick

    def test_each_wheel_goes_its_own_way(self, scout: NomadWorld) -> None:
        quarter = 90 * 0.118597 * 10 * TENTH
        scout.travel(0, Axes(quarter, -quarter))
        until_rest(scout)
        x, y, heading, _ = scout.observe(0).real
        assert degrees(heading) == pytest.approx(90.0, abs=0.001)
        assert (x, y) == pytest.approx((0.0, 0.0), abs=1e-9)

    def test_it_turns_round_when_it_is_too_fast_to_stop(self, scout: NomadWorld) -> None:
        scout.set_speeds(0, Axes(1.0, 1.0))
        run(scout, 1.0)
        begin = scout.observe(0).real.x
        scout.travel(0, Axes(0.1, 0.1))
        farthest = begin
        while any(scout.observe(0).moving):
            scout.step()
            farthest = max(farthest, scout.observe(0).real.x)
        assert farthest - begin > 0.2
        assert scout.observe(0).real.x - begin == pytest.approx(0.1, abs=1e-6)

    def test_a_cruise_of_nothing_is_no_motion(self, scout: NomadWorld) -> None:
        scout.cruise(0, Axes(0.0, 0.0))
        scout.travel(0, Axes(1.0, 1.0))
        run(scout, 0.5)
        assert scout.observe(0).moving == (False, False, False)
        assert scout.observe(0).real.x == 0.0

    def test_a_wall_holds_it_up_and_not_for_good(self, scout: NomadWorld) -> None:
        assert scout.add(BOX)
        scout.travel(0, Axes(2.0, 2.0))
        run(scout, 10.0)
        assert scout.observe(0).moving == (True, True, False)
        assert scout.observe(0).real.x == pytest.approx(1.0 - 0.17, abs=1e-5)
        assert scout.remove(BOX)
        until_rest(scout)
        assert scout.observe(0).real.x == pytest.approx(2.0, abs=1e-5)

    @pytest.mark.parametrize("way", [nan, inf, -inf])
    def test_odd_ways(self, scout: NomadWorld, way: float) -> None:
        scout.travel(0, Axes(way, way))
        run(scout, 1.0)
        assert np.isfinite(scout.observe(0).real).all()


class TestContact:
    @pytest.mark.parametrize("speeds", [(0.5, 0.5), (1.0, 0.95), (-0.6, -0.6)])
    def test_bodies_stop_where_they_touch_and_never_overlap(
        self, scout: NomadWorld, speeds: tuple[float, float]
    ) -> None:
        scout.add([(-2.0, -2.0), (2.0, -2.0), (2.0, 2.0), (-2.0, 2.0)])
        scout.set_speeds(0, Axes(*speeds))
        for _ in range(400):
            scout.step()
            x, y = scout.observe(0).real[:2]
            assert max(abs(x), abs(y)) + 0.17 <= 2.0
        assert scout.observe(0).touched

    @pytest.mark.parametrize(("setup", "machine"), [("noisy", machine) for machine in ALL] + [("nomad200", ALL[-1])])
    def test_a_crowd_under_random_commands_never_overlaps(self, setup: str, machine: Machine) -> None:
        world = nomad_world(setup=setup, robots=8, machine=machine)
        radius, half, chance = world.radius(0), 1.5, np.random.default_rng(5)
        world.add([(-half, -half), (half, -half), (half, half), (-half, half)])
        touches = 0
        for step in range(200):
            robot = int(chance.integers(8))
            ask = (world.set_speeds, world.travel)[int(chance.integers(2))]
            ask(robot, Axes(*chance.uniform(-1.0, 1.0, 3)))
            if step % 50 == 49:
                world.limp(robot, (True, True, False))
            world.step()
            poses = [world.observe(number).real for number in range(8)]
            inside = [pose for pose in poses if max(abs(pose.x), abs(pose.y)) < half]
            assert all(max(abs(pose.x), abs(pose.y)) + radius <= half for pose in inside)
            gaps = [hypot(a.x - b.x, a.y - b.y) for i, a in enumerate(poses) for b in poses[:i]]
            assert min(gaps) >= 2 * radius
            touches += sum(bool(world.observe(number).touched) for number in range(8))
        assert touches > 10

    def test_the_bumper_feels_it_until_the_body_leaves(self, scout: NomadWorld) -> None:
        scout.place(0, Pose(0.0, 0.0, radians(10.0), 0.0))
        scout.add(BOX)
        scout.set_speeds(0, Axes(0.3, 0.3))
        run(scout, 6.0)
        assert scout.observe(0).touched == pytest.approx((radians(350.0),), abs=1e-6)
        scout.rest(0)
        run(scout, 1.0)
        assert len(scout.observe(0).touched) == 1
        scout.set_speeds(0, Axes(-0.3, -0.3))
        run(scout, 0.5)
        assert scout.observe(0).touched == ()

    def test_a_corner_is_felt_on_both_sides(self, scout: NomadWorld) -> None:
        edge = scout.size[0] / 2.0 - 0.17 - 5e-4
        scout.place(0, Pose(edge, edge, 0.0, 0.0))
        assert scout.observe(0).touched == pytest.approx((0.0, pi / 2))

    def test_both_robots_feel_each_other(self) -> None:
        world = nomad_world(robots=2)
        world.place(1, Pose(1.0, 0.0, pi / 2, 0.0))
        world.set_speeds(0, Axes(0.4, 0.4))
        run(world, 4.0)
        assert world.observe(0).real.x == pytest.approx(1.0 - 2 * 0.17, abs=1e-4)
        assert world.observe(0).touched == pytest.approx((0.0,), abs=1e-6)
        assert world.observe(1).touched == pytest.approx((pi / 2,), abs=1e-6)
        assert world.observe(1).real[:2] == (1.0, 0.0)


class TestSonar:
    def test_readings_are_as_old_as_their_turn(self, scout: NomadWorld) -> None:
        """In sequence, each 4 ms after the echo of the one before: 2 * 6.477 m / c + 4 ms where nothing is near."""
        each = 2 * 6.477 / 343.0 + 0.004
        for fired in range(1, 17):
            while scout.time < (fired - 1) * each + 1e-9:
                scout.step()
            sonars = scout.observe(0).sonars
            assert [not np.isnan(value) for value in sonars] == [number < fired for number in range(16)]
            assert sonars[fired - 1] == pytest.approx(6.477)

    def test_they_look_from_where_the_body_is(self, scout: NomadWorld) -> None:
        scout.add([(2.0, -1.0), (3.0, -1.0), (3.0, 1.0), (2.0, 1.0)])
        run(scout, 1.0)
        scout.believe(0, x=-100.0)
        run(scout, 1.0)
        assert scout.observe(0).sonars[0] == pytest.approx(2.0 - 0.17, abs=1e-5)


def scanned(folder: Path, laser: str, machine: Machine | None = None) -> NomadWorld:
    """Two robots in a room of 18.288 m whose scanners are as this says."""
    file = folder / "room.toml"
    file.write_text(f'format = 2\n[world]\nwidth = "18.288m"\nheight = "18.288m"\n[laser]\n{laser}\n')
    return nomad_world(file, robots=2, machine=machine)


class TestLidar:
    @pytest.mark.parametrize("machine", MACHINES)
    @pytest.mark.parametrize("reach", [1.5, 5.0, 10.0])
    def test_it_sees_sides_and_robots_from_the_middle_of_the_body(
        self, machine: Machine, reach: float, tmp_path: Path
    ) -> None:
        world = scanned(tmp_path, f'beams = 4\nfrom = "0deg"\nrange = "{reach}m"', machine)
        assert world.add(BOX)
        world.place(1, Pose(-2.0, 0.0, 0.0, 0.0))
        world.place(0, Pose(0.0, 0.25, pi / 2.0, 0.0))
        north, west, south, east = world.scan(0)
        assert (west, east) == (pytest.approx(9.144, rel=1e-6) if reach > 9.2 else inf, pytest.approx(1.0))
        assert (north, south) == (inf, inf) if reach < 8.0 else (pytest.approx(8.894), pytest.approx(9.394))
        world.place(0, Pose(0.0, 0.0, pi / 2.0, 0.0))
        assert world.scan(0)[1] == (pytest.approx(2.0 - 0.17) if reach > 2.0 else inf)
        assert world.scan(1)[0] == (pytest.approx(2.0 - 0.17) if reach > 2.0 else inf)

    def test_it_is_what_the_world_says_else_a_beam_a_degree(self, tmp_path: Path) -> None:
        assert nomad_world(robots=1).lidar(0) == LidarKind(360, 0.0, pytest.approx(pi / 180.0), 0.0, 8.0)
        world = scanned(tmp_path, 'beams = 7\nfrom = "-90deg"\nto = "90deg"\nrange = "9m"\nleast = "5m"')
        assert world.lidar(0) == LidarKind(7, -pi / 2.0, pytest.approx(pi / 6.0), 5.0, 9.0)
        world.place(0, Pose(5.0, 0.0, 0.0, 0.0))
        assert world.scan(0)[3] == -inf, "the edge is 4.1 m away, too near to be measured"


class TestSlip:
    def test_wheels_of_the_noisy_setup_slip(self) -> None:
        world = nomad_world(setup="noisy", seed=4)
        world.travel(0, Axes(7.0, 7.0))
        until_rest(world)
        condition = world.observe(0)
        assert condition.believed == pytest.approx((7.0, 0.0, 0.0, 0.0), abs=1e-6)
        off = hypot(condition.real.x - 7.0, condition.real.y)
        assert 1e-4 < off < 0.3

    def test_equal_seeds_make_equal_runs(self) -> None:
        def place(seed: int) -> list[Pose]:
            world = nomad_world(setup="noisy", robots=3, seed=seed, crosstalk=True)
            for robot in range(3):
                world.set_speeds(robot, Axes(0.3, 0.2 + 0.05 * robot))
            run(world, 2.0)
            return [world.observe(robot).real for robot in range(3)]

        assert place(1) == place(1)
        assert place(1) != place(2)

    def test_machines_agree(self) -> None:
        def end(machine: Machine) -> list[Pose]:
            world = nomad_world(setup="noisy", robots=4, machine=machine)
            for robot in range(4):
                world.set_speeds(robot, Axes(0.5, 0.3 + 0.1 * robot))
            run(world, 4.0)
            return [world.observe(robot).real for robot in range(4)]

        first, *others = map(end, ALL)
        for other in others:
            assert np.allclose(first, other, atol=1e-6)


class TestSetup:
    @pytest.mark.parametrize("robots", [1, 2, 50])
    def test_robots_start_apart(self, robots: int) -> None:
        world = nomad_world(robots=robots)
        poses = [world.observe(robot).real for robot in range(robots)]
        assert poses[0] == Pose(0.0, 0.0, 0.0, 0.0)
        gaps = [hypot(a.x - b.x, a.y - b.y) for i, a in enumerate(poses) for b in poses[:i]]
        assert min(gaps, default=inf) > 2 * 0.17 + 0.2

    def test_the_world_is_full_at_last(self, tmp_path: Path) -> None:
        file = tmp_path / "closet.toml"
        file.write_text('format = 1\n[world]\nwidth = "2m"\nheight = "2m"\n')
        assert nomad_world(file, robots=4).count == 4
        with pytest.raises(MisuseError, match="12 robots do not fit into this world"):
            nomad_world(file, robots=12)

    @pytest.mark.parametrize("robots", [0, -1, 1001])
    def test_too_few_or_too_many(self, robots: int) -> None:
        with pytest.raises(MisuseError, match="wanted 1 to 1000"):
            nomad_world(robots=robots)

    @pytest.mark.parametrize("tick", [0.0, nan, 2.0])
    def test_ticks_are_sensible(self, tick: float) -> None:
        with pytest.raises(MisuseError, match=r"wanted 0\.001 to 1"):
            nomad_world(tick=tick)


CALLS: list[Callable[[NomadWorld, int], object]] = [
    lambda world, robot: world.observe(robot),
    lambda world, robot: world.steers(robot),
    lambda world, robot: world.radius(robot),
    lambda world, robot: world.set_speeds(robot, Axes(0.1)),
    lambda world, robot: world.travel(robot, Axes(0.1)),
    lambda world, robot: world.cruise(robot, Axes(0.1)),
    lambda world, robot: world.accelerate(robot, Axes(0.1)),
    lambda world, robot: world.limp(robot, (True, True, True)),
    lambda world, robot: world.rest(robot),
    lambda world, robot: world.zero(robot),
    lambda world, robot: world.believe(robot, 0.0),
    lambda world, robot: world.place(robot, Pose(0.0, 0.0, 0.0, 0.0)),
    lambda world, robot: world.predict(robot, Pose(0.0, 0.0, 0.0, 0.0)),
    lambda world, robot: world.along(robot, (0.0, 0.0), (1.0, 0.0)),
    lambda world, robot: world.round(robot, (0.0, 0.0), 1.0, 0.0, 1.0),
    lambda world, robot: world.scan(robot),
    lambda world, robot: world.lidar(robot),
    lambda world, robot: world.track(robot),
    lambda world, robot: world.sonar(robot),
]


@pytest.mark.parametrize("call", CALLS)
@pytest.mark.parametrize("robot", [-1, 2, 10**9])
def test_no_such_robot(call: Callable[[NomadWorld, int], object], robot: int) -> None:
    world = nomad_world(robots=2)
    with pytest.raises(IndexError, match="no robot"):
        call(world, robot)
