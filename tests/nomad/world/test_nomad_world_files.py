"""Worlds and setups of Nomads are read from files, and what is wrong there is told with its file, line and key."""

from __future__ import annotations

from math import pi
from pathlib import Path

import numpy as np
import pytest

from sleepcast.core.errors import MisuseError
from sleepcast.nomad.world.building import nomad_world
from sleepcast.nomad.world.nomad_world import NomadWorld
from sleepcast.nomad.world.obstacles import MAX_OBSTACLES, without_holes
from sleepcast.nomad.world.setups import SETUPS, read_setup, setup_names
from sleepcast.nomad.world.sites import ROOM, read_polygons, read_site, write_polygons
from sleepcast.robot import Corners, Pose
from sleepcast.simulator import Area, SettingsError, find_scenario, load, scenario_names
from sleepcast.simulator.engine import choose
from sleepcast.simulator.world.areas import inside
from sleepcast.simulator.world.ros_map import contours
from small_worlds import SCOUTS

WORLD = """format = 1
title = "a hall"

[world]
width = "10m"
height = "6m"

[[world.polygons]]
corners = [["4m", "1m"], ["5m", "1m"], ["5m", "2m"]]

[[world.circles]]
center = ["8m", "3m"]
radius = "0.5m"

[[world.walls]]
points = [["1m", "5m"], ["3m", "5m"]]
"""
STARTS = """
[nomad]
origin = ["1m", "2m"]

[[nomad.starts]]
x = "2m"
y = "3m"
heading = "90deg"

[[nomad.starts]]
x = "3m"
y = "3m"
"""


def save(folder: Path, text: str, name: str = "hall.toml") -> Path:
    file = folder / name
    file.write_text(text, encoding="utf-8")
    return file


def plain(world: Path | None, robots: int | None = None) -> NomadWorld:
    """The world, on the machine that is there at once."""
    return nomad_world(world, robots=robots, machine=choose("numpy"))


class TestWorlds:
    def test_an_empty_room_of_whole_cells_with_the_origin_in_its_middle(self) -> None:
        world = plain(None)
        assert world.size == (ROOM, ROOM)
        assert world.origin == (ROOM / 2, ROOM / 2)
        assert pytest.approx(30 * 24 * 0.0254) == ROOM

    def test_the_origin_lies_in_the_middle(self, tmp_path: Path) -> None:
        world = plain(save(tmp_path, WORLD))
        assert world.observe(0).real == Pose(0.0, 0.0, 0.0, 0.0)
        triangle, disc, wall = world.solids()
        assert np.allclose(triangle, ((-1.0, -2.0), (0.0, -2.0), (0.0, -1.0)))
        assert len(disc) == 24
        assert disc[0] == pytest.approx((3.5, 0.0))
        assert np.allclose(wall, ((-4.0, 2.0), (-2.0, 2.0)))

    def test_or_where_the_file_says_and_robots_start_there(self, tmp_path: Path) -> None:
        world = plain(save(tmp_path, WORLD + STARTS))
        assert world.count == 2
        assert world.observe(0).real == pytest.approx((1.0, 1.0, pi / 2, pi / 2))
        assert world.observe(1).believed == pytest.approx((2.0, 1.0, 0.0, 0.0))
        assert world.solids()[0][0] == pytest.approx((3.0, -1.0))

    def test_more_robots_than_starts_find_their_own_and_fewer_take_the_first(self, tmp_path: Path) -> None:
        file = save(tmp_path, WORLD + STARTS)
        world = plain(file, 3)
        assert world.observe(1).real[:2] == pytest.approx((2.0, 1.0))
        assert world.observe(2).real[:2] == pytest.approx((0.0, 0.0))
        assert plain(file, 1).count == 1

    def test_robots_that_find_a_place_are_on_the_origins_side_of_every_polygon(self, tmp_path: Path) -> None:
        block = '[[world.polygons]]\ncorners = [["3m", "3m"], ["9m", "3m"], ["9m", "9m"], ["3m", "9m"]]\n'
        hall = f'format = 1\n[world]\nwidth = "12m"\nheight = "12m"\n{block}[nomad]\norigin = '
        for origin, within in (('["6m", "6m"]', True), ('["1.5m", "1.5m"]', False)):
            world = plain(save(tmp_path, hall + origin), 12)
            for robot in range(12):
                x, y = (place - world.solids()[0][0][0] for place in world.observe(robot).real[:2])
                assert (0.0 < x < 6.0 and 0.0 < y < 6.0) is within

    def test_its_edge_is_solid_whatever_the_file_calls_it(self, tmp_path: Path) -> None:
        for edge in ("fence", "wall"):
            world = plain(save(tmp_path, WORLD.replace('height = "6m"', f'height = "6m"\nedge = "{edge}"')))
            assert len(world.solids()) == 3
            assert world.along(0, (0.0, 0.0), (-9.0, 0.0)) == pytest.approx((-5.0 + 0.17, 0.0, 0.0), abs=1e-5)

    def test_of_a_scenario_only_the_world_is_taken(self, tmp_path: Path) -> None:
        text = SCOUTS + '\n[world.rooms]\nsize = "4m"\ndoor = "1m"\n' + STARTS
        file = save(tmp_path, text, "scenario.toml")
        assert plain(tmp_path).count == 2
        assert load(file).robots.count == 1
        assert plain(file).size == (12.0, 12.0)

    @pytest.mark.parametrize("name", scenario_names())
    def test_every_scenario_is_a_world(self, name: str) -> None:
        scenario = find_scenario(name)
        site = read_site(scenario.path, robots=scenario.robots.count)
        assert (site.width, site.height) == (scenario.width, scenario.height)
        walled = 0 if scenario.fenced or scenario.torus else 1
        assert len(site.shapes) == len(scenario.shapes) - walled

    @pytest.mark.parametrize(
        ("old", "new", "said"),
        [
            ("format = 1", "format = 9", r"hall\.toml:1: format: format 9 is newer"),
            ('title = "a hall"', 'tilte = "a hall"', r"hall\.toml:2: tilte: unknown key.*title"),
            ('width = "10m"', 'width = "10kg"', r"hall\.toml:5: world\.width: wanted a length"),
            ('x = "2m"', 'x = "12m"', r"hall\.toml:22: nomad\.starts\[0\]\.x: wanted a length"),
            ('heading = "90deg"', 'head = "90deg"', r"hall\.toml:24: nomad\.starts\[0\]\.head: unknown key"),
            ('origin = ["1m", "2m"]', 'origin = "1m"', r"hall\.toml:19: nomad\.origin: wanted a list of x and y"),
            ('x = "3m"', 'x = "2.2m"', r"hall\.toml:26: nomad\.starts\[1\]: no robot fits here"),
            ('x = "2m"', 'x = "8.1m"', r"hall\.toml:21: nomad\.starts\[0\]: no robot fits here"),
        ],
    )
    def test_mistakes(self, tmp_path: Path, old: str, new: str, said: str) -> None:
        assert old in WORLD + STARTS
        with pytest.raises(SettingsError, match=said):
            plain(save(tmp_path, (WORLD + STARTS).replace(old, new)))

    def test_a_file_that_is_not_there(self, tmp_path: Path) -> None:
        for name in ("none.toml", "none.yaml", "none.txt"):
            with pytest.raises(SettingsError, match=name):
                plain(tmp_path / name)


class TestPolygons:
    TEXT = "# two obstacles\n4 100 -50 200 -50 200 50 100 50  # a box\n\n3 -100 0 -150 50.5 -150 -50\n"

    def test_tenths_of_inches_round_the_origin(self, tmp_path: Path) -> None:
        world = plain(save(tmp_path, self.TEXT, "obstacles.map"))
        box, triangle = world.solids()
        assert np.allclose(box, ((0.254, -0.127), (0.508, -0.127), (0.508, 0.127), (0.254, 0.127)))
        assert triangle[1] == pytest.approx((-0.381, 0.12827))
        assert world.size == (ROOM, ROOM)

    def test_the_world_grows_with_them(self, tmp_path: Path) -> None:
        world = plain(save(tmp_path, "3 0 50000 10 50000 10 50010\n", "far.map"))
        half = world.size[1] / 2
        assert half > 127.0
        assert half / (24 * 0.0254) == pytest.approx(round(half / (24 * 0.0254)))

    def test_an_empty_file_is_an_empty_room(self, tmp_path: Path) -> None:
        assert list(plain(save(tmp_path, "# nothing\n", "obstacles.map")).solids()) == []

    @pytest.mark.parametrize(
        ("text", "said"),
        [
            ("3 0 0 1 1\n", r"o\.map:1: wanted x and y of 3 corners, 6 numbers, not 4"),
            ("\n2 0 0 1 1\n", r"o\.map:2: wanted the number of corners first, from 3 to 10000, not 2"),
            ("2.5 0 0 1 1\n", r"not 2\.5"),
            ("3 0 0 1 1 x 5\n", r'o\.map:1: wanted numbers, n x1 y1 \.\.\. xn yn, not "x"'),
            ("3 0 0 1 1 nan 5\n", "beyond the world"),
            ("3 0 0 1 1 1e12 5\n", "beyond the world"),
            ("3 0 0 0 0 1 5\n", "the same corner twice"),
        ],
    )
    def test_mistakes(self, tmp_path: Path, text: str, said: str) -> None:
        with pytest.raises(SettingsError, match=said):
            plain(save(tmp_path, text, "o.map"))


class TestMaps:
    def test_a_map_of_ros_keeps_its_own_origin(self, tmp_path: Path) -> None:
        pytest.importorskip("yaml")
        pytest.importorskip("PIL")
        rows = ["0 0 0 0 0 0", *["0 254 254 254 254 0"] * 4, "0 0 0 0 0 0"]
        (tmp_path / "room.pgm").write_text("P2\n6 6\n255\n" + "\n".join(rows), encoding="utf-8")
        yaml = "image: room.pgm\nresolution: 0.5\norigin: [-1.0, -2.0, 0.0]\nnegate: 0\n"
        file = save(tmp_path, yaml + "occupied_thresh: 0.65\nfree_thresh: 0.196\n", "room.yaml")
        world = plain(file)
        assert world.size == pytest.approx((3.0, 3.0))
        assert world.origin == pytest.approx((1.0, 2.0))
        found = world.along(0, (0.0, 0.0), (-3.0, 0.0))
        assert found is not None
        assert found.x == pytest.approx(-0.5 + 0.17, abs=1e-5)
        assert world.area == pytest.approx((-1.0, -2.0, 2.0, 1.0))
        (walls,) = world.solids()
        assert len(walls) == 4 + 4 + 2
        assert _area(walls) == pytest.approx(3.0 * 3.0 - 2.0 * 2.0)
        world.zero(0)
        assert world.observe(0).real[:2] == (0.0, 0.0)


def _area(corners: Corners) -> float:
    """m2 inside a polygon, more than 0 if its corners go round counter-clockwise."""
    x, y = np.array(corners).T
    return float(np.sum(x * np.roll(y, -1) - y * np.roll(x, -1)) / 2.0)


class TestKeyholes:
    OUTER = ((0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0))

    @staticmethod
    def square(x: float, y: float, side: float) -> tuple[tuple[float, float], ...]:
        return ((x, y), (x, y + side), (x + side, y + side), (x + side, y))

    def test_a_plain_area_is_itself(self) -> None:
        assert without_holes(Area((self.OUTER,))) == [self.OUTER]

    def test_holes_are_cut_out_and_islands_in_them_stand_alone(self) -> None:
        holes = [self.square(1.0, 1.0, 3.0), self.square(5.0, 5.0, 4.0), self.square(1.0, 6.0, 2.0)]
        island = self.square(6.0, 6.0, 1.0)
        found = without_holes(Area((holes[1], self.OUTER, island, *holes[::2])))
        assert sorted(map(_area, found)) == pytest.approx([1.0, 100.0 - 9.0 - 16.0 - 4.0])

    @pytest.mark.parametrize("seed", range(5))
    def test_what_is_solid_stays_so(self, seed: int) -> None:
        """Random cells: a point is inside one of the polygons, by the even-odd rule, if it is inside the area."""
        chance = np.random.default_rng(seed)
        solid = chance.random((12, 15)) < 0.6
        area = Area(tuple(tuple((float(x), float(y)) for x, y in line) for line in contours(solid)))
        x, y = chance.uniform(0.0, 15.0, 2_000), chance.uniform(0.0, 12.0, 2_000)
        times = sum(inside(Area((corners,)), x, y).astype(int) for corners in without_holes(area))
        assert (times == inside(area, x, y)).all()


class TestSetups:
    def test_those_that_come_along(self) -> None:
        assert setup_names() == ["ideal", "noisy", "nomad200"]
        ideal, noisy, nomad = map(read_setup, setup_names())
        assert ideal.steers is noisy.steers is False
        assert nomad.steers
        assert ideal.infrared is None
        assert ideal.robots.ring is not None
        assert (ideal.robots.ring.noise, ideal.robots.ring.dropout) == (0.0, 0.0)
        assert noisy.robots.ring is not None
        assert min(noisy.robots.ring.noise, noisy.robots.ring.dropout, pi / 2 - noisy.robots.ring.incidence) > 0.0
        assert nomad.speeds == pytest.approx((0.508, pi / 4, pi / 4))

    def test_own_ones_by_their_file(self, tmp_path: Path) -> None:
        text = (SETUPS / "ideal.toml").read_text(encoding="utf-8").replace('radius = "0.17m"', 'radius = "0.3m"')
        file = save(tmp_path, text, "wide.toml")
        assert nomad_world(setup=file, machine=choose("numpy")).radius(0) == 0.3

    def test_no_such_setup(self) -> None:
        with pytest.raises(MisuseError, match=r'no setup "noisi" \(did you mean noisy\?\)'):
            nomad_world(setup="noisi")

    @pytest.mark.parametrize(
        ("old", "new", "said"),
        [
            ("format = 1", "format = 2", r"own\.toml:2: format: format 2 is newer"),
            ('speed = "20in/s"', 'speed = "20in"', r"own\.toml:6: limits\.speed: wanted a speed"),
            ('ramp = "0.75s"', 'ramp = "0s"', r"own\.toml:\d+: steering\.ramp: wanted"),
            ("[infrared]", "[infrard]", r"own\.toml:\d+: infrard: unknown key \(did you mean infrared\?\)"),
            ('pause = "4ms"', "", r"own\.toml:\d+: sonar: wanted sonars that fire one after the other"),
            ('[wheels]\ntrack = "0.3m"', "", r"own\.toml:1: wheels: is missing"),
            ('range = "24in"', 'range = "-1in"', r"own\.toml:\d+: infrared\.range"),
        ],
    )
    def test_mistakes(self, tmp_path: Path, old: str, new: str, said: str) -> None:
        text = (SETUPS / "nomad200.toml").read_text(encoding="utf-8")
        assert old in text
        with pytest.raises(SettingsError, match=said):
            read_setup(save(tmp_path, text.replace(old, new), "own.toml"))

    def test_crosstalk_is_an_option(self) -> None:
        for wanted in (True, False):
            world = nomad_world(crosstalk=wanted, machine=choose("numpy"))
            ring = world.setup.robots.ring
            assert ring is not None
            assert (ring.crosstalk is not None) is wanted


def test_polygons_are_written_as_they_are_read(tmp_path: Path) -> None:
    polygons: list[Corners] = [
        [(2.0, 0.0), (3.0, 0.0), (3.0, 1.234567)],
        [(-200.0, 1e-9), (-100.0, -1e-9), (-100.0, 300.0), (-100.0, 300.000001)],  # the last corner is there once
    ]
    wall: Corners = [(1.0, 5.0), (3.0, 5.0)]
    text = write_polygons("a\nhall", [*polygons, wall])
    assert text.splitlines() == [
        "# a hall: n x1 y1 ... xn yn, in tenths of an inch",
        "3 787.4 0 1181.1 0 1181.1 486.05",
        "3 -78740.16 0 -39370.08 0 -39370.08 118110.24",
        "# a wall without width: 2 393.7 1968.5 1181.1 1968.5",
    ]
    again = list(read_polygons("again", text))
    assert [len(corners) for corners in again] == [3, 3]
    assert np.asarray(again[0]) == pytest.approx(np.asarray(polygons[0]), abs=3e-5)
    file = tmp_path / "world.txt"
    file.write_text(text)
    shown = nomad_world(file).solids()
    for each, wanted in zip(shown, again, strict=True):
        assert np.asarray(each) == pytest.approx(np.asarray(wanted), abs=1e-6)


def test_a_world_is_filled_whole_or_not_at_all() -> None:
    world = nomad_world(None)
    box: Corners = [(1.0, 1.0), (2.0, 1.0), (2.0, 2.0)]
    assert world.add(box)
    before = world.solids()
    flat: Corners = [(0.0, 0.0), (1.0, 0.0), (2.0, 0.0)]
    for wrong in ([box, flat], [box] * (MAX_OBSTACLES + 1)):
        assert not world.fill(wrong)
        assert world.solids() == before
    other: Corners = [(3.0, 3.0), (4.0, 3.0), (4.0, 4.0)]
    assert world.fill([other, box])
    assert [corners[0] for corners in world.solids()] == [pytest.approx((3.0, 3.0)), pytest.approx((1.0, 1.0))]
    assert world.remove(other)
    assert world.add(other)
