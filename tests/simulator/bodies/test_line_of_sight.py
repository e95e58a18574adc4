"""What walls and bodies hide: lights, pings and neighbours, in front of and behind walls, doors and what moves."""

from __future__ import annotations

from math import inf, isnan, pi
from pathlib import Path

import numpy as np
import pytest

import sleepcast as sc
from machines import ALL, MACHINES
from simulator.world.sight_reference import blocked, exactly
from sleepcast.core.settings import SettingsError
from sleepcast.loop import Swarm, step_swarm
from sleepcast.simulator import Simulator, load
from sleepcast.simulator.engine import Machine
from sleepcast.simulator.scenario.signals import LIGHT_NAMES, PING_NAMES
from sleepcast.simulator.snapshot import resume, state_of
from sleepcast.simulator.world.sight import hidden, unrolled
from small_worlds import SMALL, write
from swarms import settle

TEXT = SMALL.replace("format = 1", "format = 2").replace('"1km"', '"20m"').replace('"500m"', '"5m"')
TEXT = TEXT.replace('y = "400m"', 'y = "4m"').replace('radius = "0.5m"', 'radius = "0.25m"')
WALL = '\n[[world.walls]]\nname = "wall"\npoints = [["10m", "4m"], ["10m", "12m"]]\n'
NEAR = '\n[neighbours]\nreach = "9m"\n'
LAMPS = """
[lights.far]
x = "12m"
y = "10m"

[lights.farther]
x = "2m"
y = "10m"
reach = "7m"
"""
PINGS = '\n[pings]\nreach = "8m"\n'
PLAIN = (
    "COUNT",
    "MEAN_X",
    "MEAN_HEADING",
    "NEAREST_DIST",
    "FARTHEST_DIST",
    "OUTLIER_Y",
    "GAP",
    "CELL_X",
    "NEAREST_LOAD",
)


def world(folder: Path, more: str, *changes: tuple[str, str], machine: Machine | None = None) -> Simulator:
    """Robots 0 and 1 stand on both sides of where `WALL` is, robot 2 beyond its end, the others in a corner."""
    sim = Simulator(load(write(folder, *changes, more=more, text=TEXT)), machine=machine)
    sim.bodies.x[:], sim.bodies.y[:], sim.bodies.heading[:] = 19.0, 1.0, 0.0
    sim.bodies.x[:3], sim.bodies.y[:3] = (8.0, 12.0, 10.0), (10.0, 10.0, 13.0)
    sim.step()
    return sim


def ask(sim: Simulator, name: str, *arguments: float) -> np.ndarray:
    """What all robots get from a function."""
    many = next(each.many for each in sim.model.functions if each.name == name)
    assert many
    robots = np.arange(sim.bodies.count)
    return many(sim.robots, robots, *(np.full(robots.size, each) for each in arguments))


def sensed(sim: Simulator, robot: int, names: tuple[str, ...]) -> list[float]:
    found = {sensor.name: value for sensor, value in zip(sim.model.sensors, sim.readings([robot])[0], strict=True)}
    return [found[name] for name in names]


@pytest.mark.parametrize("machine", MACHINES)
class TestNeighbours:
    def test_a_wall_hides_and_its_end_does_not_hide_what_is_beyond(self, tmp_path: Path, machine: Machine) -> None:
        sim = world(tmp_path, WALL + NEAR, machine=machine)
        assert ask(sim, "COUNT", 5.0)[:3].tolist() == [1, 1, 2]
        assert ask(sim, "RANK_DIST", 1, 5.0)[0] == pytest.approx(13**0.5)
        assert ask(sim, "FARTHEST_DIST", 5.0)[0] == pytest.approx(13**0.5)
        assert ask(sim, "COUNT", 5.0, 0.0)[:3].tolist() == [1, 1, 2], "also of one colour"
        near, robots = sim.senses._near, np.array([0, 1, 2])
        assert near
        first, others = near.neighbours(robots, 9, np.full(3, 5.0))
        assert (first.tolist(), others.tolist()) == ([0, 1, 2, 4], [2, 2, 0, 1])
        assert np.isnan(near.shown("distance", robots, np.array([1.0, 0.0, 0.0]))).tolist() == [True, True, False]

    def test_a_wall_of_very_short_pieces_hides(self, tmp_path: Path, machine: Machine) -> None:
        pieces = ", ".join(f'["{10.0 + 1e-5 * (each % 2)}m", "{9.998 + 1e-4 * each}m"]' for each in range(41))
        wall = f"\n[[world.walls]]\npoints = [{pieces}]\n"
        assert ask(world(tmp_path, wall + NEAR, machine=machine), "COUNT", 9.0)[:3].tolist() == [1.0, 1.0, 2.0]

    def test_a_wall_that_moves_hides_where_it_is(self, tmp_path: Path, machine: Machine) -> None:
        sim = world(tmp_path, WALL + NEAR, machine=machine)
        number = next(iter(sim.world.shapes))
        sim.world.move(number, 4.0, 0.0)
        assert ask(sim, "COUNT", 5.0)[:3].tolist() == [2, 2, 2], "at once"
        assert ask(sim, "RANK_DIST", 2, 5.0)[0] == 4.0
        sim.world.move(number, -4.0, 0.0)
        sim.step()
        assert ask(sim, "COUNT", 5.0)[:3].tolist() == [1, 1, 2]
        assert ask(sim, "RANK_DIST", 2, 5.0)[0] == pytest.approx(13**0.5)
        sim.world.clear()
        assert ask(sim, "COUNT", 5.0)[:3].tolist() == [2, 2, 2]

    def test_an_event_moves_it(self, tmp_path: Path, machine: Machine) -> None:
        event = '\n[[events]]\nat = "0.3s"\nremove = "wall"\n'
        sim = world(tmp_path, WALL + NEAR + event, machine=machine)
        found = [ask(sim, "COUNT", 5.0)[0]]
        for _ in range(2):
            sim.step()
            found.append(ask(sim, "COUNT", 5.0)[0])
        assert found == [1, 1, 2]

    def test_nothing_is_hidden_where_the_scenario_says_so(self, tmp_path: Path, machine: Machine) -> None:
        through = "\n[sight]\nneighbours = false\n"
        assert ask(world(tmp_path, WALL + NEAR + through, machine=machine), "COUNT", 5.0)[0] == 2

    def test_nor_in_a_scenario_of_format_1(self, tmp_path: Path, machine: Machine) -> None:
        sim = world(tmp_path, WALL + NEAR, ("format = 2", "format = 1"), machine=machine)
        assert ask(sim, "COUNT", 5.0)[0] == 2

    def test_the_edge_hides_if_it_is_a_wall_and_a_fence_does_not(self, tmp_path: Path, machine: Machine) -> None:
        for edge, seen in (("fence", 1), ("wall", 0)):
            sim = world(tmp_path, NEAR, ('height = "20m"', f'height = "20m"\nedge = "{edge}"'), machine=machine)
            sim.bodies.x[3:5], sim.bodies.y[3:5] = (0.0, 2.0), 3.0
            sim.bodies.x[5:] = 10.0
            sim.bodies.forget()
            sim.senses.step()
            assert ask(sim, "COUNT", 3.0)[4] == seen


ROOMS = '\n[world.rooms]\nsize = "5m"\ndoor = "1.5m"\n'
DISCS = "".join(
    f'\n[[world.circles]]\ncenter = ["{x}m", "{y}m"]\nradius = "0.4m"\n'
    for x, y in ((2.5, 2.5), (7.5, 13), (12, 3), (19.9, 9))
)
LINE = '\n[[world.walls]]\npoints = [["1m", "18m"], ["6m", "13m"], ["8m", "19m"]]\n'
WORLDS = {
    "plain": "",
    "torus": 'height = "20m"\nedge = "torus"',
    "noisy": '[noise]\nx = "0.1m"\nheading = "5deg"\n\n[radio]',
}


@pytest.mark.parametrize("errors", ["", "loss = 0.2\nnoise = 0.1\n"], ids=["exact", "wrong"])
@pytest.mark.parametrize("around", WORLDS)
def test_all_machines_sense_the_same_and_just_what_is_not_hidden(around: str, errors: str, tmp_path: Path) -> None:
    changed = {"plain": (), "torus": (('height = "20m"', WORLDS["torus"]),), "noisy": (("[radio]", WORLDS["noisy"]),)}
    more = f'{ROOMS}{DISCS}{LINE}\n[neighbours]\nreach = "9m"\n{errors}\n[neighbours.shares]\nload = "kg"\n'
    sonars = (
        ('sonars = 16\nsonar_range = "100m"', ""),
        ("count = 20", "count = 90"),
        ('speed = "5m/s"', 'speed = "1m/s"'),
    )
    scenario = load(write(tmp_path, *sonars, *changed[around], more=more, text=TEXT))
    drawn = np.random.default_rng(8)
    places, headings, loads = drawn.uniform(0.0, 20.0, (2, 90)), drawn.uniform(-pi, pi, 90), drawn.uniform(0.0, 9.0, 90)
    found = []
    for machine in ALL:
        sim = Simulator(scenario, machine=machine)
        sim.step()
        sim.bodies.x[:], sim.bodies.y[:], sim.bodies.heading[:] = (*places, headings)
        sim.bodies.moved()
        near = sim.senses._near
        assert near
        near.share(1, np.arange(90), loads)
        near.step()
        found += [ask(sim, name, radius) for radius in (1.0, 3.0, 8.0) for name in PLAIN]
        found += [ask(sim, "RANK_DIST", 2, radius) for radius in (1.0, 3.0, 8.0)]
    results = np.array(found).reshape(len(ALL), -1)
    results[np.isnan(results)] = np.nan
    assert all(each.tobytes() == results[0].tobytes() for each in results)
    if errors:
        return
    size = (20.0, 20.0) if scenario.torus else (inf, inf)
    solids = exactly(sim.world.solids.tolist(), size)
    x, y = sim.bodies.x.tolist(), sim.bodies.y.tolist()
    for index, radius in enumerate((1.0, 3.0, 8.0)):
        counts = [
            sum(
                (x[i] - to_x) ** 2 + (y[i] - to_y) ** 2 <= radius**2 and not blocked((x[i], y[i], to_x, to_y), solids)
                for j in range(90)
                if j != i
                for to_x in _images(x[j], size[0])
                for to_y in _images(y[j], size[1])
            )
            for i in range(0, 90, 3)
        ]
        assert found[index * len(PLAIN)][::3].tolist() == counts
        assert sum(counts) > 0


def _images(place: float, side: float) -> list[float]:
    return [place] if side == inf else [place, place - side, place + side]


def solids_by_chance(drawn: np.random.Generator, whole: bool) -> np.ndarray:
    """Short and long lines, along the axes and aslant, and small and large discs; with whole numbers many of them touch
    each other, robots, and what these look at."""
    rows = np.zeros((36, 5))
    rows[:, :2] = drawn.uniform(-2.0, 22.0, (36, 2))
    rows[:, 2:4] = rows[:, :2] + drawn.normal(0.0, 3.0, (36, 2))
    rows[:2, 2:4] += 50.0
    rows[np.arange(12, 24), np.where(drawn.random(12) < 0.5, 2, 3)] = np.nan
    rows[:, 2:4] = np.where(np.isnan(rows[:, 2:4]), rows[:, :2], rows[:, 2:4])
    if whole:
        rows = np.round(rows)
    rows[28:, 2:4], rows[28:, 4] = (
        rows[28:, :2],
        [1, 1, 1, 1, 1, 1, 2, 6] if whole else [0.01, 0.1, 0.2, 0.3, 0.4, 1, 2, 6],
    )
    return rows[(rows[:, 4] > 0.0) | (rows[:, :2] != rows[:, 2:4]).any(axis=1)]


def looking_around(folder: Path, edge: str) -> Simulator:
    """300 robots on the fastest machine."""
    changes = [('sonars = 16\nsonar_range = "100m"', ""), ("count = 20", "count = 300"), ('"5m/s"', '"1m/s"')]
    changes += [('height = "20m"', WORLDS["torus"])] if edge == "torus" else []
    sim = Simulator(load(write(folder, *changes, more='\n[neighbours]\nreach = "9m"\n', text=TEXT)), machine=ALL[-1])
    sim.step()
    return sim


@pytest.mark.parametrize("edge", ["plain", "torus"])
@pytest.mark.parametrize("whole", [True, False], ids=["whole numbers", "any numbers"])
def test_all_around_the_same_is_hidden_as_along_each_line(whole: bool, edge: str, tmp_path: Path) -> None:
    sim, drawn, robots = looking_around(tmp_path, edge), np.random.default_rng([3, whole]), np.arange(300)
    size = 20.0 if edge == "torus" else inf
    first, second = np.nonzero(~np.eye(300, dtype=bool))
    pairs = seen = 0
    for radius in (1.0, 2.0, 8.0, 8.0, 8.0):
        sim.bodies.sight.walls.put(solids_by_chance(drawn, whole))
        places = drawn.uniform(0.0, 20.0, (2, 300))
        places[:, :4] = [[-1.0, 21.0, 10.0, -3.0], [5.0, 5.0, 21.0, -3.0]] if edge == "plain" else 10.0
        sim.bodies.x[:], sim.bodies.y[:] = np.floor(places) if whole else places
        sim.bodies.moved()
        x, y, near = sim.bodies.x, sim.bodies.y, sim.senses._near
        assert near
        near.step()
        to_x, to_y = unrolled(x[first], x[second], size), unrolled(y[first], y[second], size)
        close = (to_x - x[first]) ** 2 + (to_y - y[first]) ** 2 <= radius**2
        lines = x[first], y[first], to_x, to_y
        clear = ~hidden(sim.bodies.sight.walls, *(each[close] for each in lines))
        begin, others = near.neighbours(robots, 299, np.full(300, radius))
        assert begin.tolist() == [0, *np.cumsum(np.bincount(first[close][clear], minlength=300))]
        assert np.array_equal(others, second[close][clear])
        pairs, seen = pairs + int(close.sum()), seen + int(clear.sum())
    assert pairs > 50_000
    assert 0.1 * pairs < seen < 0.9 * pairs, "neither all nor nothing is seen"


@pytest.mark.parametrize("edge", ["plain", "torus"])
def test_everybody_senses_the_same_in_any_order(edge: str, tmp_path: Path) -> None:
    sim = looking_around(tmp_path, edge)
    sim.bodies.sight.walls.put(solids_by_chance(np.random.default_rng(4), whole=False))
    many = next(each.many for each in sim.model.functions if each.name == "MEAN_X")
    assert many
    robots, radii = np.arange(300), np.linspace(1.0, 8.0, 300)
    backwards = many(sim.robots, robots[::-1], radii[::-1])[::-1]
    assert many(sim.robots, robots, radii).tobytes() == backwards.tobytes()


class TestLights:
    def test_the_nearest_one_that_is_visible_is_seen(self, tmp_path: Path) -> None:
        sim = world(tmp_path, WALL + LAMPS)
        assert sensed(sim, 0, LIGHT_NAMES[:2]) == [1.0, 6.0], "the near one is behind the wall"
        assert sensed(sim, 1, LIGHT_NAMES[:2]) == [1.0, 0.0]
        sim.world.clear()
        sim.step()
        assert sensed(sim, 0, LIGHT_NAMES[:2]) == [1.0, 4.0]

    def test_without_a_visible_one_nothing_is_known(self, tmp_path: Path) -> None:
        sim = world(tmp_path, WALL + LAMPS.replace("7m", "1m"))
        flag, distance = sensed(sim, 0, LIGHT_NAMES[:2])
        assert flag == 0.0
        assert isnan(distance)

    def test_they_shine_through_where_it_says_so_and_in_format_1(self, tmp_path: Path) -> None:
        assert sensed(world(tmp_path, WALL + LAMPS + "\n[sight]\nlights = false\n"), 0, LIGHT_NAMES)[1] == 4.0
        assert sensed(world(tmp_path, WALL + LAMPS, ("format = 2", "format = 1")), 0, LIGHT_NAMES)[1] == 4.0

    def test_bodies_hide_them_if_it_says_so_but_not_from_themselves(self, tmp_path: Path) -> None:
        for more, distance in (("", 4.0), ("\n[sight]\nbodies_hide = true\n", 6.0)):
            sim = world(tmp_path, LAMPS + more)
            sim.bodies.x[1], sim.bodies.y[1] = 10.0, 10.25  # touches the line
            sim.bodies.forget()
            sim.senses.step()
            assert sensed(sim, 0, LIGHT_NAMES)[1] == distance
            assert sensed(sim, 1, LIGHT_NAMES)[0] == 1.0

    def test_on_a_torus_they_are_seen_across_the_edge_unless_a_wall_is_there(self, tmp_path: Path) -> None:
        edge, lamp = ('height = "20m"', 'height = "20m"\nedge = "torus"'), '\n[lights.lamp]\nx = "1m"\ny = "5m"\n'
        small = ('sonar_range = "100m"', 'sonar_range = "5m"'), ('speed = "5m/s"', 'speed = "1m/s"')
        for where, flag in ((0.5, 0.0), (10.0, 1.0)):
            wall = f'\n[[world.walls]]\npoints = [["{where}m", "0m"], ["{where}m", "20m"]]\n'
            sim = world(tmp_path, wall + lamp, edge, *small)
            sim.bodies.x[0], sim.bodies.y[0] = 18.0, 5.0
            sim.bodies.forget()
            sim.senses.step()
            assert sensed(sim, 0, LIGHT_NAMES)[0] == flag


class TestPings:
    def heard(self, folder: Path, more: str, *changes: tuple[str, str], between: bool = False) -> list[float]:
        """Which of robots 0, 1 and 2 hear robot 1. between: whether robot 3 stands between 1 and 0"""
        sim = world(folder, PINGS + more, *changes)
        if between:
            sim.bodies.x[3], sim.bodies.y[3] = 10.0, 9.75
        sim.ping(1, 5.0)
        sim.step()
        return [sensed(sim, robot, PING_NAMES)[0] for robot in (0, 1, 2)]

    def test_walls_hide_them_in_format_2_unless_it_says_otherwise(self, tmp_path: Path) -> None:
        assert self.heard(tmp_path, WALL) == [0, 0, 1]
        assert self.heard(tmp_path, "") == [1, 0, 1]
        assert self.heard(tmp_path, WALL + "\n[sight]\npings = false\n") == [1, 0, 1]
        assert self.heard(tmp_path, WALL, ("format = 2", "format = 1")) == [1, 0, 1]

    def test_bodies_hide_them_if_it_says_so_but_not_the_sender_or_the_hearer(self, tmp_path: Path) -> None:
        assert self.heard(tmp_path, "", between=True) == [1, 0, 1]
        assert self.heard(tmp_path, "\n[sight]\nbodies_hide = true\n", between=True) == [0, 0, 1]


class TestScenarios:
    def test_what_a_format_1_file_cannot_say(self, tmp_path: Path) -> None:
        with pytest.raises(SettingsError, match=r"sight: .*write format = 2"):
            world(tmp_path, "\n[sight]\nlights = true\n", ("format = 2", "format = 1"))

    @pytest.mark.parametrize("line", ["lights = 1", "radio = true"])
    def test_a_mistake_is_told(self, tmp_path: Path, line: str) -> None:
        with pytest.raises(SettingsError, match=r"sight\."):
            world(tmp_path, f"\n[sight]\n{line}\n")

    def test_what_is_sensed_through_walls_only_for_its_format_is_told(self, tmp_path: Path) -> None:
        def sentence(more: str, version: int) -> str:
            return load(write(tmp_path, ("format = 2", f"format = {version}"), more=more, text=TEXT)).sees_through_walls

        assert "sense lights and neighbours through walls. With format = 2" in sentence(WALL + LAMPS + NEAR, 1)
        assert sentence(WALL + LAMPS + NEAR, 2) == sentence(WALL, 1) == sentence(NEAR, 1) == ""

    def test_a_snapshot_goes_on_the_same(self, tmp_path: Path) -> None:
        sim = world(tmp_path, WALL + LAMPS + NEAR + PINGS)
        sim.world.move(next(iter(sim.world.shapes)), 1.0, 1.0)
        again = resume(state_of(sim))
        for each in (sim, again):
            each.ping(1, 1.0)
            each.step()
        assert again.scenario.sight == sim.scenario.sight
        assert again.state_hash() == sim.state_hash()
        assert ask(again, "COUNT", 5.0).tolist() == ask(sim, "COUNT", 5.0).tolist()


class TestRuns:
    RULE = "(RULE gather (WHEN (> (COUNT 3m) 0) (GOTO (MEAN_X 3m) (MEAN_Y 3m))))"
    TEXT = TEXT.replace('sonars = 16\nsonar_range = "100m"', "") + ROOMS + LINE + NEAR

    def test_quiet_ticks_come_to_the_same_as_single_ones(self) -> None:
        pytest.importorskip("numba")
        found = []
        for how in (quietly, singly):
            for text in (self.TEXT, self.TEXT.replace("format = 2", "format = 1")):
                fleet = sc.open(text, seed=2, threads=1)
                fleet.send(self.RULE, everybody=True, wait=0)
                how(fleet.swarm, 5)
                how(fleet.swarm, 40)
                number = next(iter(fleet.world.shapes))
                fleet.world.remove(number)
                how(fleet.swarm, 20)
                assert (fleet.swarm.quiet.ticks > 40) == (how is quietly)
                found.append(fleet.swarm.simulator.state_hash())
        assert found[:2] == found[2:]
        assert found[0] != found[1]

    def test_worlds_of_a_batch_equal_the_run_alone(self) -> None:
        together = sc.open_many(self.TEXT, seeds=2, quiet=True)
        together.send(self.RULE, everybody=True, wait=0)
        together.run(3, quiet=True)
        for number in (0, 1):
            alone = sc.open(self.TEXT, seed=number + 1, threads=1)
            alone.send(self.RULE, everybody=True, wait=0)
            assert alone.run(3, quiet=True).snapshot() == together[number].snapshot()


def quietly(swarm: Swarm, ticks: int) -> None:
    """Let so many ticks pass, as many at once as may be, with native rules."""
    while ticks:
        ticks -= swarm.advance(ticks)
        settle(swarm)


def singly(swarm: Swarm, ticks: int) -> None:
    """Let so many ticks pass, one by one."""
    for _ in range(ticks):
        step_swarm(swarm)
