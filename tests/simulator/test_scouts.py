"""Scouts: wheels, encoders, slip and bumpers behave as physics and closed forms say."""

from __future__ import annotations

from math import atan2, cos, hypot, isclose, pi, radians, remainder, sin, sqrt
from pathlib import Path

import numpy as np
import pytest

from machines import ALL, MACHINES
from sleepcast.core.errors import MisuseError
from sleepcast.simulator import Simulator
from sleepcast.simulator.bodies.body import TUMBLE
from sleepcast.simulator.engine import Machine
from sleepcast.simulator.motion.steps import SKIN
from sleepcast.simulator.world.grid import distance
from sleepcast.simulator.world.world import Circle, Wall
from sleepcast.testing.robot_contract import Rig, RobotContract
from small_worlds import scouts

OPEN = ('width = "12m"\nheight = "12m"\nedge = "wall"', 'width = "1km"\nheight = "1km"')
TRACK = 0.3452
PER_DEGREE = 0.118597
"""Inches that each wheel goes, the one forwards and the other back, while a Scout turns by a degree."""


def run(sim: Simulator, seconds: float) -> None:
    for _ in range(round(seconds / sim.scenario.tick)):
        sim.step()


class TestContract(RobotContract):
    @pytest.fixture
    def rig(self, tmp_path: Path) -> Rig:
        sim = scouts(tmp_path, OPEN)
        sim.place(0, 500.0, 500.0, 0.3)
        return Rig(sim.robots[0], lambda seconds: run(sim, seconds))


def test_sensors_and_functions(tmp_path: Path) -> None:
    model = scouts(tmp_path).model
    names = [sensor.name for sensor in model.sensors]
    assert names == ["x", "y", "heading", "speed", "bumper", *(f"sonar{i}" for i in range(16)), "front_range"]
    assert {"DRIVE", "VM", "ST", "GOTO", "WANDER", "SONAR", "NEAREST"} <= {f.name for f in model.functions}


class TestWheels:
    @pytest.mark.parametrize(("right", "left"), [(0.3, -0.3), (0.5, 0.2), (-0.1, 0.4), (0.2, 0.2)])
    def test_turning_rate_is_the_difference_over_the_track(self, tmp_path: Path, right: float, left: float) -> None:
        sim = scouts(tmp_path, OPEN)
        sim.place(0, 500.0, 500.0, 0.0)
        sim.robots[0].turn_wheels(right, left)
        run(sim, 1.0)  # to speed
        before = float(sim.bodies.heading[0])
        sim.step()
        turned = (float(sim.bodies.heading[0]) - before + pi) % (2 * pi) - pi
        assert isclose(turned, (right - left) / TRACK * 0.1, rel_tol=1e-9, abs_tol=1e-12)

    @pytest.mark.parametrize(("right", "left", "rate"), [(40, -40, 33.73), (52, -22, 31.20)])
    def test_the_rates_of_the_thesis(self, tmp_path: Path, right: int, left: int, rate: float) -> None:
        """Tenths of inches a second at the wheels; degrees a second. The track is rounded to 0.1 mm."""
        sim = scouts(tmp_path, OPEN)
        sim.place(0, 500.0, 500.0, 0.0)
        sim.robots[0].turn_wheels(right * 0.00254, left * 0.00254)
        run(sim, 1.0)
        before = float(sim.bodies.heading[0])
        sim.step()
        assert isclose(np.degrees(sim.bodies.heading[0] - before) / 0.1, rate, rel_tol=1e-3)
        assert isclose(rate, (right - left) / (2 * PER_DEGREE) / 10, rel_tol=1e-3)

    def test_the_way_is_an_arc(self, tmp_path: Path) -> None:
        """However long a tick is, the body stays on its circle."""
        for tick in ("0.02s", "0.5s"):
            sim = scouts(tmp_path, OPEN, ('tick = "0.1s"', f'tick = "{tick}"'))
            sim.place(0, 500.0, 500.0, 0.0)
            bodies = sim.bodies
            bodies.left[0], bodies.right[0] = 0.4, 0.6
            sim.robots[0].turn_wheels(0.6, 0.4)
            radius = 0.5 / ((0.6 - 0.4) / TRACK)
            for _ in range(20):
                sim.step()
                assert isclose(hypot(sim.x[0] - 500.0, sim.y[0] - 500.0 - radius), radius, rel_tol=1e-9)

    def test_stopping_distance(self, tmp_path: Path) -> None:
        """v2 / 2a, less half a tick's way: the speed falls at the beginning of each tick."""
        sim = scouts(tmp_path, OPEN, ('tick = "0.1s"', 'tick = "0.01s"'))
        sim.place(0, 500.0, 500.0, 0.0)
        sim.robots[0].drive(1.0, 0.0)
        run(sim, 1.0)
        assert sim.bodies.speed[0] == 1.0
        begin = float(sim.x[0])
        sim.robots[0].halt()
        run(sim, 2.0)
        assert sim.bodies.speed[0] == 0.0
        assert isclose(float(sim.x[0]) - begin, 1.0**2 / (2 * 2.0) - 0.5 * 0.01 * 1.0, rel_tol=1e-9)

    def test_wheels_keep_their_limits(self, tmp_path: Path) -> None:
        sim = scouts(tmp_path, OPEN)
        sim.place(0, 500.0, 500.0, 0.0)
        sim.robots[0].turn_wheels(50.0, -30.0)
        before = 0.0
        for _ in range(20):
            sim.step()
            right = float(sim.bodies.right[0])
            assert abs(right - before) <= 2.0 * 0.1 + 1e-12
            assert max(abs(right), abs(float(sim.bodies.left[0]))) <= 1.0
            before = right

    def test_it_goes_where_it_is_sent(self, tmp_path: Path) -> None:
        sim = scouts(tmp_path, OPEN)
        sim.place(0, 500.0, 500.0, 2.0)
        sim.robots[0].go_to(507.0, 497.0)
        run(sim, 30)
        assert hypot(sim.x[0] - 507.0, sim.y[0] - 497.0) <= 0.17
        assert sim.bodies.speed[0] == 0.0


class TestSlip:
    def test_without_slip_the_encoders_are_right(self, tmp_path: Path) -> None:
        sim = scouts(tmp_path, OPEN)
        sim.place(0, 500.0, 500.0, 0.0)
        sim.robots[0].drive(0.7, 0.5)
        run(sim, 60)
        bodies = sim.bodies
        assert bodies.encoder_x[0] == bodies.x[0]
        assert bodies.encoder_heading[0] == bodies.heading[0]

    def test_a_bias_bends_the_way_and_nobody_knows(self, tmp_path: Path) -> None:
        """One wheel 1 % better than it seems: after s m straight on the body has turned by 0.01 s / track."""
        sim = scouts(tmp_path, OPEN, ("[robots.sonar]", 'slip_right = "1%"\n\n[robots.sonar]'))
        sim.place(0, 500.0, 500.0, 0.0)
        sim.bodies.left[0] = sim.bodies.right[0] = sim.bodies.speed[0] = 1.0
        sim.robots[0].drive(1.0, 0.0)
        run(sim, 10)
        assert isclose(sim.bodies.heading[0], 0.01 * 10.0 / TRACK, rel_tol=1e-9)
        radius = 1.005 * TRACK / 0.01
        assert isclose(sim.x[0], 500.0 + radius * sin(0.1 / TRACK), rel_tol=1e-9)
        assert isclose(sim.y[0], 500.0 + radius * (1.0 - cos(0.1 / TRACK)), rel_tol=1e-9)
        assert sim.robots[0].sense().values[:3] == pytest.approx((510.0, 500.0, 0.0), abs=1e-9)

    @pytest.mark.parametrize("tick", ["0.05s", "0.2s"])
    def test_noise_gathers_with_the_root_of_the_way(self, tmp_path: Path, tick: str) -> None:
        noise = ("[robots.sonar]", 'slip_noise = "5mm"\n\n[robots.sonar]')
        sim = scouts(tmp_path, OPEN, noise, ("count = 1\n", "count = 1000\n"), ('tick = "0.1s"', f'tick = "{tick}"'))
        bodies = sim.bodies
        bodies.heading[:] = bodies.encoder_heading[:] = 0.0
        bodies.x[:] = bodies.encoder_x[:] = bodies.y[:] = 300.0
        bodies.contact = None
        for body in sim.robots:
            body.drive(1.0, 0.0)
        bodies.left[:] = bodies.right[:] = 1.0
        run(sim, 9)
        # Each wheel is off by 5 mm times the root of 9; the heading by the difference of two over the track.
        spread = sqrt(2.0) * 0.005 * 3.0 / TRACK
        assert isclose(float(bodies.heading.std()), spread, rel_tol=0.06)
        assert abs(float(bodies.heading.mean())) < 4 * spread / sqrt(2000)
        assert (bodies.encoder_heading == 0.0).all()
        ahead = bodies.x - bodies.encoder_x
        assert abs(float(ahead.mean())) < 0.05


CHANGES = [
    ("2m/s2", "2m/s2"),
    ("2m/s2", "0.5m/s2"),
    ("180deg/s", "40deg/s"),
    ('tick = "0.1s"', 'tick = "0.01s"'),
    ('tick = "0.1s"', 'tick = "0.5s"'),
]
SPEEDS = [(0.0, 0.0), (1.0, 1.0), (-0.6, -0.6), (0.0, 1.0), (1.0, 0.0)]
"""Before the tumble, and wanted in it."""


@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize(
    ("change", "speed", "wanted"),
    [
        pytest.param(change, *speeds, marks=() if i == j else pytest.mark.nightly, id=f"{change[1]}-{speeds}")
        for i, change in enumerate(CHANGES)
        for j, speeds in enumerate(SPEEDS)
    ],
)
def test_a_tumble_turns_wheels_by_67_degrees(
    tmp_path: Path, machine: Machine, change: tuple[str, str], speed: float, wanted: float
) -> None:
    """Also while they speed up or brake, one of them at its limit."""
    sim = scouts(tmp_path, change, ('"12m"\nheight = "12m"', '"100m"\nheight = "100m"'), machine=machine)
    sim.place(0, 50.0, 50.0, 0.3)
    for column in (sim.bodies.speed, sim.bodies.left, sim.bodies.right):
        column[:] = speed
    sim.robots[0].drive(wanted, 0.0)
    side = sim.robots[0].tumble()
    run(sim, 12.0)
    assert sim.bodies.swing[0] == 0.0
    assert remainder(float(sim.bodies.heading[0]) - 0.3 - side * TUMBLE, 2.0 * pi) == pytest.approx(0.0, abs=1e-3)


def test_the_fence_ends_a_tumble_on_wheels(tmp_path: Path) -> None:
    """A body that has to turn back does not make up for the tumble afterwards."""
    fenced = [scouts(tmp_path, ('edge = "wall"', 'edge = "fence"'), machine=machine) for machine in ALL]
    for sim in fenced:
        for heading in (0.0, 1.0, 2.0, -1.0):
            sim.place(0, 11.9, 6.0, heading)
            sim.robots[0].drive(0.5, 0.0)
            sim.robots[0].tumble()
            run(sim, 5.0)
            assert sim.bodies.swing[0] == 0.0
    assert len({sim.state_hash() for sim in fenced}) == 1


def overlap(sim: Simulator) -> float:
    """How far the deepest pair of bodies, or a body and a solid, overlap, m."""
    bodies = sim.bodies
    x, y = bodies.x, bodies.y
    away = np.hypot(x[:, None] - x, y[:, None] - y)
    np.fill_diagonal(away, np.inf)
    deepest = 2 * 0.17 - float(away.min())
    for a, b, c, d, radius in sim.world.solids.tolist():
        line = [np.full(len(x), value) for value in (a, b, c, d)]
        deepest = max(deepest, 0.17 + radius - float(distance(x, y, *line).min()))
    return deepest


def crowd(tmp_path: Path, machine: Machine, robots: int = 200) -> Simulator:
    """One robot per 0.3 m2 in rooms, all driving about: three discs in ten parts of the floor."""
    side = f'"{sqrt(robots * 0.3):.3f}m"'
    rooms = '\n[world.rooms]\nsize = "3m"\ndoor = "1m"\n\n[[world.circles]]\ncenter = ["2m", "2m"]\nradius = "0.3m"\n'
    sim = scouts(
        tmp_path,
        ("count = 1\n", f"count = {robots}\n"),
        ('width = "12m"\nheight = "12m"', f"width = {side}\nheight = {side}"),
        ("\n[robots]\n", rooms + "\n[robots]\n"),
        ("[robots.sonar]\n", 'slip_noise = "10mm"\n'),
        machine=machine,
    )
    draw = np.random.default_rng(1)
    for body in sim.robots:
        body.drive(*draw.uniform((-1.0, -2.0), (1.0, 2.0)))
    return sim


def jostle(sim: Simulator, ticks: int) -> int:
    """Let a crowd push about, everybody driving anew now and then; gives how many contacts there were."""
    draw, contacts = np.random.default_rng(2), 0
    for tick in range(ticks):
        for number in draw.integers(0, len(sim.robots), 10):
            sim.robots[number].drive(*draw.uniform((-1.0, -2.0), (1.0, 2.0)))
        sim.step()
        contacts += int((sim.bodies.bumper > 0).sum())
        assert overlap(sim) <= 0.0, tick
    return contacts


class TestContact:
    @pytest.mark.parametrize("machine", MACHINES)
    def test_nothing_ever_overlaps(self, tmp_path: Path, machine: Machine) -> None:
        sim = crowd(tmp_path, machine)
        assert overlap(sim) <= 0.0
        before = sim.x.copy()
        assert jostle(sim, 500) > 5_000
        assert np.hypot(sim.x - before, 0.0).mean() > 0.3  # and yet it moves

    @pytest.mark.nightly
    @pytest.mark.parametrize("machine", MACHINES)
    def test_nothing_ever_overlaps_in_ten_thousand_ticks(self, tmp_path: Path, machine: Machine) -> None:
        jostle(crowd(tmp_path, machine), 10_000)

    def test_machines_agree_to_the_last_bit(self, tmp_path: Path) -> None:
        hashes = set()
        for machine in ALL:
            sim = crowd(tmp_path, machine)
            jostle(sim, 100)
            hashes.add(sim.state_hash())
        assert len(hashes) == 1

    @pytest.mark.parametrize("machine", MACHINES)
    def test_the_order_of_robots_does_not_matter(self, tmp_path: Path, machine: Machine) -> None:
        """The same crowd with its robots numbered the other way round moves in the same way."""
        one, other = crowd(tmp_path, machine), crowd(tmp_path, machine)
        for sim in (one, other):
            sim.bodies.scenario = one.scenario
        for name in ("x", "y", "heading", "encoder_x", "encoder_y", "encoder_heading", "wanted_speed", "wanted_turn"):
            getattr(other.bodies, name)[:] = getattr(one.bodies, name)[::-1]
        other.bodies.chance[:] = other.bodies.chance[::-1]
        other.bodies.numbers = other.bodies.numbers[::-1].copy()
        run(one, 20)
        run(other, 20)
        assert (one.x == other.x[::-1]).all()
        assert (one.bodies.bumper == other.bodies.bumper[::-1]).all()

    @pytest.mark.parametrize("machine", MACHINES)
    def test_a_wall_stops_the_body_where_it_touches(self, tmp_path: Path, machine: Machine) -> None:
        sim = scouts(tmp_path, machine=machine)
        sim.place(0, 10.0, 6.0, 0.0)
        sim.robots[0].drive(1.0, 0.0)
        sensed = {}
        for _ in range(50):
            sim.step()
            values = sim.robots[0].sense().values
            sensed = {s.name: v for s, v in zip(sim.model.sensors, values, strict=True)}
            if sensed["bumper"]:
                break
        assert isclose(sim.x[0], 12.0 - 0.17 - SKIN, abs_tol=1e-9)
        assert sensed["bumper"] == 1
        assert sensed["speed"] == 0.0
        assert sensed["x"] == sim.x[0]

    @pytest.mark.parametrize("machine", MACHINES)
    @pytest.mark.parametrize(("heading", "part"), [(0.0, 1), (radians(90), 7), (radians(180), 5), (radians(-90), 3)])
    def test_the_bumper_tells_where(self, tmp_path: Path, machine: Machine, heading: float, part: int) -> None:
        """Another body drives into this one from the east, whichever way it looks."""
        sim = scouts(tmp_path, ("count = 1\n", "count = 2\n"), machine=machine)
        sim.place(0, 6.0, 6.0, heading)
        sim.place(1, 6.5, 6.0, radians(180))
        sim.robots[1].drive(0.5, 0.0)
        sim.robots[0].drive(0.05 * cos(heading), 0.0)  # creeping to the east or the west
        felt = set()
        for _ in range(20):
            sim.step()
            felt.add(float(sim.bodies.bumper[0]))
        assert sim.bodies.bumper[1] == 1
        assert felt <= {0.0, float(part)}

    @pytest.mark.parametrize("machine", MACHINES)
    def test_bodies_that_touch_can_part(self, tmp_path: Path, machine: Machine) -> None:
        sim = scouts(tmp_path, ("count = 1\n", "count = 2\n"), machine=machine)
        sim.place(0, 6.0, 6.0, 0.0)
        sim.place(1, 6.6, 6.0, radians(180))
        for body in sim.robots:
            body.drive(1.0, 0.0)
        run(sim, 3)
        assert sim.x[1] - sim.x[0] < 0.45
        sim.robots[0].drive(-0.5, 0.0)  # while the other one goes on pushing
        run(sim, 2)
        assert sim.x[0] < 5.6

    @pytest.mark.parametrize("machine", MACHINES)
    def test_a_post_in_the_way(self, tmp_path: Path, machine: Machine) -> None:
        """The way ends at a circle just where Pythagoras says."""
        sim = scouts(tmp_path, machine=machine)
        sim.world.add(Circle(8.0, 6.2, 0.3))
        sim.place(0, 6.0, 6.0, 0.0)
        sim.robots[0].drive(1.0, 0.0)
        while not sim.bodies.bumper[0]:
            sim.step()
        assert isclose(sim.x[0], 8.0 - sqrt((0.47 + SKIN) ** 2 - 0.2**2), abs_tol=1e-9)
        assert sim.bodies.bumper[0] == 2  # 25 degrees to the left, in the middle between the first two parts or beyond
        assert isclose(atan2(sim.bodies.hit_y[0], sim.bodies.hit_x[0]), atan2(0.2, 8.0 - sim.x[0]), abs_tol=1e-3)

    def test_obstacles_come_and_go_while_it_runs(self, tmp_path: Path) -> None:
        sim = scouts(tmp_path)
        sim.place(0, 2.0, 6.0, 0.0)
        sim.robots[0].drive(1.0, 0.0)
        number = sim.world.add(Wall(((5.0, 5.0), (5.0, 7.0))))
        free = scouts(tmp_path).state_hash()
        assert sim.state_hash() != free
        assert sim.robots[0].sonar(0) == pytest.approx(3.0 - 0.17, abs=1e-5)
        run(sim, 6)
        assert isclose(sim.x[0], 5.0 - 0.17, abs_tol=1e-5)
        sim.world.move(number, 2.0, 0.0)
        run(sim, 5)
        assert isclose(sim.x[0], 7.0 - 0.17, abs_tol=1e-5)
        sim.world.remove(number)
        run(sim, 3)
        assert sim.x[0] > 9.0

    def test_a_full_room_is_refused(self, tmp_path: Path) -> None:
        with pytest.raises(MisuseError, match=r"1000 robots with a radius of 0\.17 m do not fit"):
            scouts(tmp_path, ("count = 1\n", "count = 1000\n"))

    def test_bodies_at_their_start_touch_nothing(self, tmp_path: Path) -> None:
        sim = scouts(tmp_path, ("count = 1\n", "count = 300\n"))
        assert overlap(sim) <= 0.0
