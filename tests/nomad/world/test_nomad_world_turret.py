"""A Nomad 200: wheels that steer together, a turret that turns by itself, infrared sensors; and zeroing."""

from __future__ import annotations

from math import cos, degrees, hypot, nan, radians, sin
from pathlib import Path

import pytest

from machines import ALL
from nomad.world.nomad_time import run, until_rest
from sleepcast.core.errors import MisuseError
from sleepcast.nomad.world.building import nomad_world
from sleepcast.nomad.world.nomad_world import NomadWorld
from sleepcast.nomad.world.setups import SETUPS
from sleepcast.robot import Axes, Pose

EAST = [(1.0, -1.0), (2.0, -1.0), (2.0, 1.0), (1.0, 1.0)]
"""A box whose west side stands 1 m east of the origin."""
RADIUS = 0.225


@pytest.fixture
def nomad() -> NomadWorld:
    return nomad_world(setup="nomad200", machine=ALL[-1])


class TestAxes:
    def test_it_steers_and_has_a_turret(self, nomad: NomadWorld) -> None:
        assert nomad.steers(0)
        assert nomad.radius(0) == RADIUS
        nomad.set_speeds(0, Axes(0.3, radians(20), radians(-10)))
        run(nomad, 2.0)
        condition = nomad.observe(0)
        assert condition.moving == (True, True, True)
        assert condition.speeds == pytest.approx((0.3, radians(20), radians(-10)))

    def test_each_axis_keeps_its_limit(self, nomad: NomadWorld) -> None:
        nomad.set_speeds(0, Axes(9.0, -9.0, 9.0))
        run(nomad, 2.0)
        assert nomad.observe(0).speeds == pytest.approx((0.508, -radians(45), radians(45)))

    def test_steering_leaves_the_turret_where_it_looks(self, nomad: NomadWorld) -> None:
        nomad.travel(0, Axes(0.0, radians(70), nan))
        until_rest(nomad)
        pose = nomad.observe(0).real
        assert degrees(pose.heading) == pytest.approx(70.0, abs=1e-4)
        assert (pose.x, pose.y, pose.turret) == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)

    def test_the_turret_turns_by_itself(self, nomad: NomadWorld) -> None:
        nomad.travel(0, Axes(third=radians(-30)))
        assert until_rest(nomad) == pytest.approx(30 / 45 + 0.75, abs=0.06)
        condition = nomad.observe(0)
        assert condition.real == pytest.approx((0.0, 0.0, 0.0, radians(-30)), abs=1e-6)
        assert condition.believed == condition.real

    def test_the_way_leads_where_it_steers(self, nomad: NomadWorld) -> None:
        """A quarter of a circle, of radius speed over rate, once both are at speed."""
        nomad.set_speeds(0, Axes(0.2, 0.4))
        run(nomad, 2.0)
        x, y, heading, _ = nomad.observe(0).real
        middle = x - 0.5 * sin(heading), y + 0.5 * cos(heading)
        run(nomad, 3.0)
        x, y, heading, _ = nomad.observe(0).real
        assert (x - 0.5 * sin(heading), y + 0.5 * cos(heading)) == pytest.approx(middle, abs=1e-6)

    def test_all_ways_at_once_end_where_they_should(self, nomad: NomadWorld) -> None:
        nomad.travel(0, Axes(1.0, radians(90), radians(180)))
        until_rest(nomad)
        condition = nomad.observe(0)
        assert degrees(condition.real.heading) == pytest.approx(90.0, abs=1e-4)
        assert abs(degrees(condition.real.turret)) == pytest.approx(180.0, abs=1e-4)
        assert condition.speeds == pytest.approx((0.0, 0.0, 0.0), abs=1e-9)


class TestEmptyBattery:
    def test_nothing_turns_the_turret_but_itself(self, tmp_path: Path) -> None:
        text = (SETUPS / "nomad200.toml").read_text(encoding="utf-8")
        file = tmp_path / "short.toml"
        file.write_text(text.replace('["100%", "100%"]', '["100%", "100%"]\nreach = "0.5m"'), encoding="utf-8")
        world = nomad_world(setup=file)
        world.set_speeds(0, Axes(0.4, 0.4))
        run(world, 3.0)
        begin = world.observe(0)
        assert begin.battery == 0.0
        assert begin.speeds == (0.0, 0.0, 0.0)
        run(world, 1.0)
        assert world.observe(0).real == begin.real
        assert begin.real.turret == pytest.approx(0.0, abs=1e-9)


class TestBelief:
    def test_corrected_angles_leave_the_body_alone(self, nomad: NomadWorld) -> None:
        nomad.believe(0, heading=radians(30), turret=radians(50))
        condition = nomad.observe(0)
        assert (condition.believed.heading, condition.believed.turret) == pytest.approx((radians(30), radians(50)))
        assert (condition.real.heading, condition.real.turret) == (0.0, 0.0)
        nomad.believe(0, heading=radians(10))
        assert nomad.observe(0).believed.turret == pytest.approx(radians(50))
        nomad.travel(0, Axes(second=radians(15)))
        until_rest(nomad)
        condition = nomad.observe(0)
        assert condition.believed[2:] == pytest.approx((radians(25), radians(50)), abs=1e-6)
        assert condition.real[2:] == pytest.approx((radians(15), 0.0), abs=1e-6)

    def test_place_turns_the_turret_too(self, nomad: NomadWorld) -> None:
        nomad.place(0, Pose(1.0, 2.0, radians(-90), radians(135)))
        condition = nomad.observe(0)
        assert condition.real == condition.believed
        assert condition.real == pytest.approx((1.0, 2.0, radians(-90), radians(135)))


class TestSensors:
    def test_sonars_look_along_the_turret(self, nomad: NomadWorld) -> None:
        nomad.add(EAST)
        nomad.place(0, Pose(0.0, 0.0, radians(45), radians(90)))
        run(nomad, 1.0)
        sonars = nomad.observe(0).sonars
        assert min(sonars) == sonars[12] == pytest.approx(1.0 - RADIUS, abs=1e-5)

    def test_infrared_sees_what_is_near_and_along_the_turret(self, nomad: NomadWorld) -> None:
        nomad.place(0, Pose(0.6, 0.0, radians(45), radians(90)))
        assert nomad.observe(0).infrared == pytest.approx((24 * 0.0254,) * 16)
        nomad.add(EAST)
        seen = nomad.observe(0).infrared
        assert min(seen) == seen[12] == pytest.approx(0.4 - RADIUS, abs=1e-5)
        assert seen[4] == pytest.approx(24 * 0.0254)

    def test_infrared_sees_other_robots(self) -> None:
        for machine in ALL:
            world = nomad_world(setup="nomad200", robots=2, machine=machine)
            world.place(0, Pose(0.0, 0.0, 0.0, 0.0))
            world.place(1, Pose(-0.7, 0.0, 0.0, 0.0))
            assert world.observe(0).infrared[8] == pytest.approx(0.7 - 2 * RADIUS, abs=1e-5)

    def test_the_bumper_counts_from_the_heading(self, nomad: NomadWorld) -> None:
        nomad.add(EAST)
        nomad.place(0, Pose(1.0 - RADIUS - 5e-4, 0.0, radians(60), radians(10)))
        assert nomad.observe(0).touched == pytest.approx((radians(300),))

    def test_prediction_is_what_it_then_reads(self, nomad: NomadWorld) -> None:
        nomad.add(EAST)
        pose = Pose(0.5, 0.3, radians(20), radians(-50))
        sonars, infrared = nomad.predict(0, pose)
        nomad.place(0, pose)
        run(nomad, 1.0)
        assert nomad.observe(0).sonars == pytest.approx(sonars, abs=1e-4)
        assert nomad.observe(0).infrared == pytest.approx(infrared, abs=1e-4)

    def test_prediction_leaves_robots_out_and_keeps_the_limits(self) -> None:
        world = nomad_world(robots=2)
        world.place(1, Pose(1.0, 0.0, 0.0, 0.0))
        sonars, infrared = world.predict(0, Pose(0.0, 0.0, 0.0, radians(77)))
        assert sonars == pytest.approx((255 * 0.0254,) * 16)
        assert infrared == ()
        world.add(EAST)
        near, _ = world.predict(0, Pose(0.8, 0.0, 0.0, radians(77)))
        assert near[0] == pytest.approx(6 * 0.0254)

    @pytest.mark.parametrize("odd", [nan, float("inf")])
    def test_a_prediction_needs_numbers(self, nomad: NomadWorld, odd: float) -> None:
        with pytest.raises(MisuseError, match="not finite"):
            nomad.predict(0, Pose(odd, 0.0, 0.0, 0.0))


class TestFiring:
    def test_only_the_sonars_of_the_order_fire(self) -> None:
        world = nomad_world(robots=2)
        world.fire(0, (3, 7), 0.0)
        run(world, 1.0)
        fired = [number for number, reading in enumerate(world.observe(0).sonars) if reading == reading]
        assert fired == [3, 7]
        assert len([reading for reading in world.observe(1).sonars if reading == reading]) == 16

    def test_none_fires_for_an_empty_order_and_readings_stay(self, nomad: NomadWorld) -> None:
        run(nomad, 1.0)
        before = nomad.observe(0).sonars
        nomad.fire(0, (), 0.0)
        run(nomad, 0.1)
        nomad.add(EAST)
        run(nomad, 1.0)
        assert nomad.observe(0).sonars == before

    @pytest.mark.parametrize(("order", "pause"), [((16,), 0.0), ((-1,), 0.0), ((0,), -1.0), ((0,), nan)])
    def test_odd_orders_are_refused(self, nomad: NomadWorld, order: tuple[int, ...], pause: float) -> None:
        with pytest.raises(MisuseError):
            nomad.fire(0, order, pause)


class TestZero:
    def test_a_scout_comes_to_rest_and_is_at_the_origin(self) -> None:
        world = nomad_world()
        world.place(0, Pose(2.0, 1.0, 1.0, 1.0))
        world.set_speeds(0, Axes(0.5, 0.4))
        run(world, 1.0)
        world.zero(0)
        assert world.observe(0).moving == (True, True, False)
        assert until_rest(world) == pytest.approx(0.25, abs=2 * world.tick)
        assert world.observe(0).real == world.observe(0).believed == Pose(0.0, 0.0, 0.0, 0.0)

    def test_the_turret_goes_home_first(self, nomad: NomadWorld) -> None:
        nomad.place(0, Pose(2.0, 1.0, radians(30), radians(-60)))
        nomad.cruise(0, Axes(0.0, 0.0, 0.0))
        nomad.zero(0)
        assert until_rest(nomad) == pytest.approx(90 / 45 + 0.75, abs=0.1)
        assert nomad.observe(0).real == nomad.observe(0).believed == Pose(0.0, 0.0, 0.0, 0.0)

    def test_without_room_only_the_belief_changes(self) -> None:
        world = nomad_world(robots=2)
        begin = world.observe(1).real
        world.zero(1)
        until_rest(world, 1)
        assert world.observe(1).believed == Pose(0.0, 0.0, 0.0, 0.0)
        assert world.observe(1).real == begin
        assert hypot(*begin[:2]) > 0.3

    def test_a_later_command_ends_it(self) -> None:
        world = nomad_world()
        world.place(0, Pose(1.0, 1.0, 0.0, 0.0))
        world.zero(0)
        world.set_speeds(0, Axes(0.1, 0.1))
        run(world, 1.0)
        x, y, _, _ = world.observe(0).believed
        assert x > 1.05
        assert y == pytest.approx(1.0)


def test_a_slipping_base_takes_its_turret_along(tmp_path: Path) -> None:
    text = (SETUPS / "nomad200.toml").read_text(encoding="utf-8")
    assert 'track = "0.3m"' in text
    file = tmp_path / "slippery.toml"
    file.write_text(text.replace('track = "0.3m"', 'track = "0.3m"\nslip_right = "1%"'), encoding="utf-8")
    world = nomad_world(setup=file)
    world.travel(0, Axes(2.0))
    until_rest(world)
    condition = world.observe(0)
    assert condition.believed == pytest.approx((2.0, 0.0, 0.0, 0.0), abs=1e-6)
    assert condition.real.heading == pytest.approx(0.01 * 2.0 / 0.3, rel=1e-6)
    assert condition.real.turret == pytest.approx(condition.real.heading)
