"""What beams hit first, beside a reference in plain Python, on both machines and any number of threads."""

from __future__ import annotations

from math import cos, inf, pi, sin
from random import Random

import numpy as np
import pytest

from machines import ALL, MACHINES
from simulator.laser.scan_reference import images, is_told
from sleepcast.simulator import Simulator
from sleepcast.simulator.engine import Machine, choose
from sleepcast.simulator.scenario.scenario import Scenario, read_scenario

TEXT = """
format = 2
title = "scanners"
seconds = "1min"

[world]
width = "12m"
height = "12m"
{world}

[robots]
count = {count}
type = "scout"
motion = "still"

[robots.limits]
speed = "1m/s"
turn_rate = "1rad/s"
acceleration = "1m/s2"

[robots.body]
radius = "0.25m"

[laser]
{laser}
"""


def scenario(laser: str, world: str = "", count: int = 1) -> Scenario:
    return read_scenario(TEXT.format(laser=laser, world=world, count=count))


def scanned(sim: Simulator, x: float, y: float, heading: float = 0.0) -> list[float]:
    """What robot 0 measures from this pose."""
    sim.place(0, x, y, heading)
    return sim.scans(np.array([0]))[0].tolist()


WALL = '[[world.walls]]\npoints = [["8m", "4m"], ["8m", "6m"]]\n'
DISC = '[[world.circles]]\ncenter = ["8m", "5m"]\nradius = "1m"\n'


@pytest.mark.parametrize("machine", MACHINES)
class TestOneBeam:
    LASER = 'beams = 1\nfrom = "0deg"\nrange = "5m"\nleast = "0.5m"'

    @pytest.mark.parametrize(
        ("world", "x", "y", "far"),
        [
            (WALL, 5.0, 5.0, 3.0),
            (WALL, 5.0, 4.0, 3.0),  # its end, which is touched
            (WALL, 5.0, 3.999, inf),
            (WALL, 3.0, 5.0, 5.0),  # at the end of the range
            (WALL, 2.999, 5.0, inf),
            (WALL, 9.0, 5.0, inf),  # behind the robot
            (WALL, 7.5, 5.0, 0.5),
            (WALL, 7.75, 5.0, -inf),
            (WALL, 8.0, 5.0, -inf),  # in the wall
            ('[[world.walls]]\npoints = [["8m", "5m"], ["9m", "5m"]]\n', 5.0, 5.0, 3.0),  # along a wall
            ('[[world.walls]]\npoints = [["8m", "5m"], ["9m", "5m"]]\n', 8.5, 5.0, -inf),
            ('[[world.walls]]\npoints = [["8m", "5m"], ["9m", "5m"]]\n', 9.5, 5.0, inf),
            (DISC, 5.0, 5.0, 2.0),
            (DISC, 5.0, 4.0, 3.0),  # its rim, which is touched
            (DISC, 5.0, 3.999, inf),
            (DISC, 8.5, 5.0, -inf),  # in the disc
            (DISC, 10.0, 5.0, inf),
        ],
    )
    def test_of_a_wall_and_of_something_round(
        self, world: str, x: float, y: float, far: float, machine: Machine
    ) -> None:
        sim = Simulator(scenario(self.LASER, world), machine=machine)
        assert scanned(sim, x, y) == [far]

    def test_it_turns_with_the_robot(self, machine: Machine) -> None:
        sim = Simulator(scenario(self.LASER, DISC), machine=machine)
        assert scanned(sim, 8.0, 1.0, pi / 2) == pytest.approx([3.0])

    def test_another_robot_is_seen_and_hides_what_is_behind_it(self, machine: Machine) -> None:
        sim = Simulator(scenario(self.LASER, WALL, count=2), machine=machine)
        sim.place(1, 6.0, 5.0, 0.0)
        assert scanned(sim, 5.0, 5.0) == [0.75]
        sim.place(1, 8.5, 5.0, 0.0)
        assert scanned(sim, 5.0, 5.0) == [3.0]

    def test_bodies_of_several_types_are_as_wide_as_they_are(self, machine: Machine) -> None:
        text = TEXT.format(laser=self.LASER, world="", count=1)
        begin, end = text.index("[robots]"), text.index("[laser]")
        wide = text[begin:end].replace("0.25m", "1m").replace('"scout"', '"barge"')
        types = "".join(each.replace("[robots]", "[[robots]]") for each in (text[begin:end], wide))
        sim = Simulator(read_scenario(text[:begin] + types + text[end:]), machine=machine)
        sim.place(1, 9.0, 5.0, 0.0)
        assert scanned(sim, 5.0, 5.0) == [3.0]
        sim.place(1, 9.0, 5.0, pi)
        assert sim.scans(np.array([1]))[0].tolist() == pytest.approx([3.75])

    def test_what_moves_is_seen_where_it_is(self, machine: Machine) -> None:
        sim = Simulator(scenario(self.LASER, DISC), machine=machine)
        assert scanned(sim, 5.0, 5.0) == [2.0]
        sim.world.move(next(iter(sim.world.shapes)), 0.5, 0.0)
        assert sim.scans()[0].tolist() == [2.5]

    def test_around_a_torus(self, machine: Machine) -> None:
        sim = Simulator(scenario(self.LASER, 'edge = "torus"\n' + WALL, count=2), machine=machine)
        sim.place(1, 1.0, 5.0, 0.0)
        assert scanned(sim, 10.0, 5.0) == [2.75]
        sim.place(1, 1.0, 9.0, 0.0)
        assert scanned(sim, 10.0, 5.0) == [inf]


class TestManyBeams:
    def test_a_whole_turn_has_no_beam_twice(self) -> None:
        model = scenario('beams = 4\nrange = "5m"').laser
        assert model
        assert model.angles.tolist() == pytest.approx([-pi, -pi / 2, 0.0, pi / 2])
        assert model.closed

    def test_a_part_of_a_turn_has_beams_at_both_ends(self) -> None:
        model = scenario('beams = 3\nfrom = "-90deg"\nto = "90deg"\nrange = "5m"').laser
        assert model
        assert model.angles.tolist() == pytest.approx([-pi / 2, 0.0, pi / 2])
        assert model.last == pytest.approx(pi / 2)
        assert not model.closed

    @pytest.mark.parametrize("edge", ["fence", "wall", "torus"])
    @pytest.mark.parametrize("case", range(8))
    def test_random_worlds(self, edge: str, case: int) -> None:
        random = Random(f"{edge} {case}")
        spec = scenario(_laser(random), f'edge = "{edge}"\n' + _things(random), count=12)
        sims = [Simulator(spec, 1, machine) for machine in ALL]
        poses = [(random.uniform(0, 12), random.uniform(0, 12), random.uniform(-pi, pi)) for _ in range(12)]
        for sim in sims:
            for number, pose in enumerate(poses):
                sim.place(number, *pose)
        told = sims[0].scans()
        assert all((sim.scans() == told).all() for sim in sims[1:])
        assert spec.laser
        angles, least, reach = spec.laser.angles.tolist(), spec.laser.least, spec.laser.reach
        for number, (x, y, heading) in enumerate(poses):
            others = [(a, b, a, b, 0.25) for i, (a, b, _) in enumerate(poses) if i != number]
            rows = images([*sims[0].world.solids.tolist(), *others], spec.around)
            for beam, angle in enumerate(angles):
                seen = float(told[number, beam])
                assert is_told(seen, x, y, heading + angle, rows, least, reach), (number, beam, seen)

    def test_robots_at_one_place_are_too_near(self) -> None:
        for machine in ALL:
            sim = Simulator(scenario('beams = 9\nrange = "5m"\nleast = "1cm"', count=2), machine=machine)
            sim.place(0, 5.0, 5.0, 1.0)
            sim.place(1, 5.0, 5.0, 2.0)
            assert (sim.scans() == -inf).all()


def _laser(random: Random) -> str:
    first = random.uniform(-180, 180)
    wide = random.choice([360.0, 270.0, random.uniform(1, 360)])
    beams = random.choice([1, 2, 17, 90])
    return f'beams = {beams}\nfrom = "{first}deg"\nto = "{first + wide}deg"\nrange = "5m"\nleast = "0.2m"'


def _things(random: Random) -> str:
    def place() -> str:
        # Many at the same few places, so that corners and ends are met.
        return f'["{random.choice([random.uniform(0, 12), random.randint(0, 12)])}m", "{random.uniform(0, 12)}m"]'

    walls = [f"[[world.walls]]\npoints = [{place()}, {place()}, {place()}]\n" for _ in range(6)]
    discs = [f'[[world.circles]]\ncenter = {place()}\nradius = "{random.uniform(0.01, 0.5)}m"\n' for _ in range(6)]
    middle = [random.uniform(2, 10) for _ in range(2)]
    corners = ", ".join(f'["{middle[0] + cos(a)}m", "{middle[1] + sin(a)}m"]' for a in (0.1, 2.2, 4.3))
    return "".join([*walls, *discs, f"[[world.polygons]]\ncorners = [{corners}]\n"])


class TestNoise:
    LASER = 'beams = 1080\nrange = "8m"\nleast = "0.2m"\nnoise = "2cm"'
    ROOMS = 'edge = "wall"\nrooms = { size = "4m", door = "1m" }\n'

    def test_it_has_the_deviation_and_is_the_same_again(self) -> None:
        exact = Simulator(scenario(self.LASER.replace("2cm", "0cm"), self.ROOMS, count=30), 3).scans()
        sims = [Simulator(scenario(self.LASER, self.ROOMS, count=30), 3, machine) for machine in ALL]
        noisy = sims[0].scans()
        assert all((sim.scans() == noisy).all() for sim in sims)
        assert (np.isfinite(noisy) == np.isfinite(exact)).all()
        off = noisy[np.isfinite(exact)] - exact[np.isfinite(exact)]
        assert off.std() == pytest.approx(0.02, rel=0.03)
        assert abs(off.mean()) < 0.001

    def test_it_differs_from_tick_to_tick_and_between_seeds(self) -> None:
        one, other = (Simulator(scenario(self.LASER, self.ROOMS, count=2), seed) for seed in (3, 4))
        before = one.scans()
        for sim in (one, other):
            sim.place(0, 5.0, 5.0, 0.0)
            sim.place(1, 7.0, 5.0, 0.0)
        assert (one.scans()[0] != other.scans()[0]).any()
        one.step()
        assert (one.scans() != before).any()

    @pytest.mark.skipif(ALL[-1].name == "numpy", reason="NumPy works on one thread")
    def test_any_number_of_threads_and_any_order_of_asking(self) -> None:
        spec = scenario(self.LASER, self.ROOMS, count=60)
        sims = [Simulator(spec, 3, choose("numba", threads)) for threads in (1, 2, 5)]
        told = sims[0].scans()
        assert (sims[1].scans() == told).all()
        some = np.array([7, 3, 3, 59])
        assert (sims[2].scans(some) == told[some]).all()
        assert (sims[2].scans() == told).all()
