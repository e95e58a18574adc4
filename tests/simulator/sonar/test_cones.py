"""Sonar cones see exactly what a slow reference of other means sees, on every machine."""

from __future__ import annotations

from math import degrees, inf, pi, radians
from pathlib import Path

import numpy as np
import pytest

from machines import ALL, MACHINES
from simulator.sonar.sonar_reference import readings
from sleepcast.simulator import Simulator
from sleepcast.simulator.engine import Machine, choose
from sleepcast.simulator.sonar.cones import Cones
from sleepcast.simulator.world.world import Circle
from small_worlds import scouts

ERROR = 1e-5
"""Metres by which a reading may differ from the exact one."""

THINGS = """
[world.rooms]
size = "6m"
door = "1.5m"

[[world.polygons]]
corners = [["2m", "2m"], ["3m", "2.2m"], ["2.5m", "3.1m"]]

[[world.polygons]]
corners = [["9m", "8m"], ["9.4m", "8m"], ["9.4m", "8.4m"], ["9m", "8.4m"]]

[[world.circles]]
center = ["4m", "9m"]
radius = "0.6m"

[[world.circles]]
center = ["8m", "3m"]
radius = "0.05m"

[[world.walls]]
points = [["7m", "10m"], ["8m", "11m"], ["9m", "10.5m"]]
"""


def worst(sim: Simulator, which: list[int]) -> float:
    """The greatest difference between what these robots read and what they should, m."""
    bodies = sim.bodies
    assert bodies.sonars
    cones, solids = bodies.sonars.cones, sim.world.solids
    lines = [((a, b), (c, d)) for a, b, c, d, r in solids.tolist() if r == 0.0]
    posts = [(a, b, r) for a, b, _, _, r in solids.tolist() if r > 0.0]
    discs = list(zip(bodies.x.tolist(), bodies.y.tolist(), [cones.radius] * bodies.count, strict=True))
    greatest = 0.0
    for number, read in zip(which, bodies.sonar_ranges(which).tolist(), strict=True):
        others = [*discs[:number], *discs[number + 1 :], *posts]
        x, y, heading = bodies.x[number], bodies.y[number], bodies.heading[number]
        exact = readings(cones, float(x), float(y), float(heading), others, lines)
        greatest = max(greatest, *(abs(a - max(b, bodies.sonars.ring.least)) for a, b in zip(read, exact, strict=True)))
    return greatest


@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize(
    ("robots", "sonar"),
    [
        (60, ""),
        (240, ""),
        (60, 'incidence = "30deg"'),
        (60, 'count = 16\nbeam = "40deg"\nleast = "0m"'),
        (60, "count = 24"),
        (60, 'count = 7\nbeam = "80deg"\nrange = "3m"'),
        (60, 'count = 1\nbeam = "2deg"'),
    ],
    ids=["few", "many", "specular", "wide beams", "24 sonars", "7 sonars", "one sonar"],
)
def test_readings_are_exact(tmp_path: Path, machine: Machine, robots: int, sonar: str) -> None:
    things = ("[robots]\n", THINGS + "\n[robots]\n")
    for seed in range(2):
        sim = scouts(tmp_path, ("count = 1\n", f"count = {robots}\n"), things, more=sonar, seed=seed, machine=machine)
        assert worst(sim, list(range(0, robots, 2))) < ERROR


@pytest.mark.parametrize("machine", MACHINES)
def test_many_walls_of_many_directions_are_seen_exactly(tmp_path: Path, machine: Machine) -> None:
    """A fence of 90 pieces, more than any cell of rooms has."""
    around = np.arange(91) * (2.0 * pi / 90)
    corners = [[f"{6.0 + 4.0 * np.cos(a):.9f}m", f"{6.0 + 3.0 * np.sin(a):.9f}m"] for a in around.tolist()]
    things = ("[robots]\n", f"[[world.walls]]\npoints = {corners}\n{THINGS}\n[robots]\n")
    sim = scouts(tmp_path, ("count = 1\n", "count = 40\n"), things, machine=machine)
    assert worst(sim, list(range(0, 40, 2))) < ERROR


@pytest.mark.parametrize("machine", MACHINES)
def test_edges_of_cones_may_be_parallel_to_walls(tmp_path: Path, machine: Machine) -> None:
    """Robots that look along walls, and whose cones are as wide as what lies between two: every edge is parallel to
    some wall, and some are so to the last bit."""
    things = ("[robots]\n", THINGS + "\n[robots]\n")
    for incidence in ("90deg", "60deg"):
        more = f'beam = "45deg"\nincidence = "{incidence}"'
        sim = scouts(tmp_path, ("count = 1\n", "count = 48\n"), things, more=more, machine=machine)
        for number in range(48):
            sim.place(number, float(sim.bodies.x[number]), float(sim.bodies.y[number]), pi / 8 * (number % 16))
        assert worst(sim, list(range(48))) < ERROR


@pytest.mark.nightly
@pytest.mark.parametrize("machine", MACHINES)
def test_readings_are_exact_in_a_hundred_thousand_poses(tmp_path: Path, machine: Machine) -> None:
    things = ("[robots]\n", THINGS + "\n[robots]\n")
    for seed in range(1_000):
        sim = scouts(tmp_path, ("count = 1\n", "count = 100\n"), things, seed=seed, machine=machine)
        assert worst(sim, list(range(100))) < ERROR


@pytest.mark.parametrize("machine", MACHINES)
def test_a_hole_is_no_wall(tmp_path: Path, machine: Machine) -> None:
    """Ranges by hand: 6 m to a wall less the radius, and through a door to the one behind."""
    rooms = ('edge = "wall"\n', 'edge = "wall"\n[world.rooms]\nsize = "6m"\ndoor = "2m"\n')
    sim = scouts(tmp_path, rooms, ("count = 1\n", "count = 2\n"), more='range = "20m"\nbeam = "2deg"', machine=machine)
    sim.place(0, 3.0, 3.0, 0.0)
    sim.place(1, 3.0, 4.5, 0.0)
    first, second = sim.bodies.sonar_ranges()
    assert first[[0, 4, 8, 12]] == pytest.approx([9.0 - 0.17, 1.5 - 0.34, 3.0 - 0.17, 3.0 - 0.17], abs=ERROR)
    assert second[[0, 4, 8, 12]] == pytest.approx([3.0 - 0.17, 7.5 - 0.17, 3.0 - 0.17, 1.5 - 0.34], abs=ERROR)


@pytest.mark.parametrize("machine", MACHINES)
def test_a_mirror_is_seen_only_from_before_it(tmp_path: Path, machine: Machine) -> None:
    """The wall ahead is met at angles up to a cone's half and more; the cones aside meet it too obliquely."""
    sim = scouts(tmp_path, more='incidence = "20deg"', machine=machine)
    sim.place(0, 11.0, 6.0, 0.0)
    seen = sim.bodies.sonar_ranges()[0]
    assert seen[0] == pytest.approx(0.83, abs=ERROR)
    # Turned by 22.5 degrees, a cone that is 12.5 degrees to each side still holds rays within 20 of the perpendicular.
    assert seen[1] < 6.0
    assert seen[15] < 6.0
    assert seen[2] == seen[14] == pytest.approx(255 * 0.0254)


@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize("sonar", ["", "count = 24", 'incidence = "30deg"'])
def test_who_is_in_something_solid_sees_it_all_round(tmp_path: Path, machine: Machine, sonar: str) -> None:
    """A disc is put over some robots, and robots without bumpers stand in each other."""
    crowded = ("count = 1\n", "count = 150\n"), ("bumpers = 8\n", ""), ('"12m"\nheight = "12m"', '"4m"\nheight = "4m"')
    sim = scouts(tmp_path, *crowded, more=sonar, machine=machine)
    sim.world.add(Circle(1.0, 1.0, 0.9))
    within = np.flatnonzero(np.hypot(sim.x - 1.0, sim.y - 1.0) < 0.7).tolist()
    assert len(within) > 5
    assert (sim.bodies.sonar_ranges(within) == 6 * 0.0254).all()
    assert worst(sim, list(range(150))) < ERROR
    ring = sim.bodies.rings[0]
    view = ring._view((sim.x, sim.y, sim.bodies.heading), alone=True)
    seen = machine.look(view, np.arange(150), np.arange(150) % ring.cones.count)
    every = machine.ranges(ring._view((sim.x, sim.y, sim.bodies.heading)), np.arange(150))
    assert seen == pytest.approx(every[np.arange(150), np.arange(150) % ring.cones.count], abs=ERROR)


@pytest.mark.parametrize("machine", MACHINES)
def test_a_wide_world_with_few_robots_costs_no_precision(tmp_path: Path, machine: Machine) -> None:
    """Its cells are far larger than what sonars reach."""
    wide = ("count = 1\n", 'count = 40\nx = ["9km", "9.012km"]\ny = ["7km", "7.012km"]\n')
    for sonar in ("", "count = 24"):
        size = ('"12m"\nheight = "12m"', '"9000km"\nheight = "9000km"')
        assert worst(scouts(tmp_path, wide, size, more=sonar, machine=machine), list(range(40))) < ERROR


@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize("count", [7, 16, 24])
def test_sonars_of_any_reach_see_what_is_there(tmp_path: Path, machine: Machine, count: int) -> None:
    """To what single precision tells of such a range."""
    size, many = ('"12m"\nheight = "12m"', '"200km"\nheight = "200km"'), ("count = 1\n", "count = 40\n")
    large = ('radius = "0.17m"', 'radius = "10m"')
    sim = scouts(tmp_path, size, many, large, more=f'count = {count}\nrange = "100km"', machine=machine)
    assert worst(sim, list(range(40))) < 1e5 * 3e-7


def test_the_grid_does_not_matter(tmp_path: Path) -> None:
    """A robot reads the same whoever else is asked."""
    for machine in ALL:
        sim = scouts(tmp_path, ("count = 1\n", "count = 150\n"), machine=machine)
        every = sim.bodies.sonar_ranges()
        again = scouts(tmp_path, ("count = 1\n", "count = 150\n"), machine=machine)
        some = again.bodies.sonar_ranges([140, 3, 77])
        assert (some == every[[140, 3, 77]]).all()


def test_threads_do_not_matter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("numba")
    monkeypatch.setattr("sleepcast.simulator.fast.LIGHT", 0)  # whatever threads may share, they do
    seen = []
    for threads in (1, 2, 3):
        sim = scouts(
            tmp_path,
            ("count = 1\n", "count = 6000\n"),
            ('"12m"\nheight = "12m"', '"150m"\nheight = "150m"'),
            machine=choose("numba", threads),
        )
        for _ in range(3):
            sim.step()
        seen.append((sim.bodies.sonar_ranges().tobytes(), sim.state_hash()))
    assert seen[0] == seen[1] == seen[2]


class TestLone:
    """Beyond a certain distance a body is seen by few cones; the machines rely on it."""

    @pytest.mark.parametrize("steps", [1.0, 1.5])
    def test_bodies_beyond_are_not_seen_aside(self, steps: float) -> None:
        cones = Cones(16, radians(12.5), 6.477, pi / 2, 0.17)
        angle = steps * 2.0 * pi / 16
        beyond = cones.lone(angle)
        assert 2 * 0.17 <= beyond < 1.5
        for away in np.linspace(beyond, cones.reach, 200):
            at = (away * np.cos(angle), away * np.sin(angle), 0.17)
            assert readings(cones, 0.0, 0.0, 0.0, [at], [])[0] == cones.most, (degrees(angle), away)

    def test_the_bound_is_tight(self) -> None:
        cones = Cones(16, radians(12.5), 6.477, pi / 2, 0.17)
        angle = 2.0 * pi / 16
        just_within = cones.lone(angle) - 0.02
        at = (just_within * np.cos(angle), just_within * np.sin(angle), 0.17)
        assert readings(cones, 0.0, 0.0, 0.0, [at], [])[0] < cones.most

    def test_overlapping_beams_are_never_alone(self) -> None:
        assert Cones(16, radians(40), 6.0, pi / 2, 0.17).lone(radians(22.5)) == inf
