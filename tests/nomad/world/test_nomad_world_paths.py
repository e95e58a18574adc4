"""Obstacles by their corners, and where bodies on their way would touch them."""

from __future__ import annotations

from math import atan2, cos, hypot, inf, nan, pi, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from machines import ALL
from sleepcast.core.errors import MisuseError
from sleepcast.nomad.world.building import nomad_world
from sleepcast.nomad.world.nomad_world import NomadWorld
from sleepcast.nomad.world.obstacles import MAX_OBSTACLES
from sleepcast.nomad.world.paths import first_along, first_round
from sleepcast.robot import Axes, Corners, Pose
from sleepcast.simulator.world.grid import distance

BOX = [(1.0, -0.5), (2.0, -0.5), (2.0, 0.5), (1.0, 0.5)]
RADIUS = 0.17


@pytest.fixture
def world() -> NomadWorld:
    return nomad_world(machine=ALL[-1])


class TestObstacles:
    def test_an_empty_room_shows_nothing(self, world: NomadWorld) -> None:
        assert list(world.solids()) == []

    def test_what_was_put_up_is_shown_where_it_is(self, world: NomadWorld) -> None:
        assert world.add(BOX)
        (shown,) = world.solids()
        assert np.allclose(shown, BOX)

    @pytest.mark.parametrize("first", range(4))
    @pytest.mark.parametrize("sense", [1, -1])
    def test_it_is_known_by_its_corners(self, world: NomadWorld, first: int, sense: int) -> None:
        world.add(BOX)
        same = [(x + 0.0012, y - 0.0012) for x, y in (BOX[first:] + BOX[:first])[::sense]]
        assert world.remove(same)
        assert not world.remove(same)
        assert list(world.solids()) == []

    def test_others_are_not_it(self, world: NomadWorld) -> None:
        world.add(BOX)
        assert not world.remove(BOX[:3])
        assert not world.remove([(x + 0.01, y) for x, y in BOX])
        crossed = [BOX[0], BOX[2], BOX[1], BOX[3]]
        assert not world.remove(crossed)
        assert len(world.solids()) == 1

    def test_a_moved_one_is_known_by_its_new_corners(self, world: NomadWorld) -> None:
        world.add(BOX)
        assert world.move(BOX, 0.254, -0.0254)
        moved = [(x + 0.254, y - 0.0254) for x, y in BOX]
        assert not world.move(BOX, 1.0, 0.0)
        assert world.remove(moved)

    @pytest.mark.parametrize("far", [nan, inf, 1e8])
    def test_nothing_moves_to_nowhere(self, world: NomadWorld, far: float) -> None:
        world.add(BOX)
        assert not world.move(BOX, far, 0.0)
        assert world.remove(BOX)

    def test_clear_leaves_the_edge(self, world: NomadWorld) -> None:
        world.add(BOX)
        world.clear()
        assert list(world.solids()) == []
        assert world.along(0, (0.0, 0.0), (100.0, 0.0)) is not None

    @pytest.mark.parametrize(
        "corners",
        [
            [],
            [(0.0, 0.0)],
            [(0.0, 0.0), (1.0, 0.0)],
            [(1.0, 1.0)] * 5,
            [(0.0, 0.0), (1.0, 1.0), (2.0, 2.0)],
            [(0.0, 0.0), (1.0, 0.0), (1.0, nan)],
            [(0.0, 0.0), (1.0, 0.0), (1.0, inf)],
            [(0.0, 0.0), (1e9, 0.0), (1.0, 1.0)],
            [(cos(i), sin(i)) for i in range(1001)],
        ],
    )
    def test_what_is_no_polygon_is_refused(self, world: NomadWorld, corners: Corners) -> None:
        assert not world.add(corners)
        assert not world.remove(corners)
        assert not world.move(corners, 1.0, 1.0)
        assert list(world.solids()) == []

    def test_a_closed_list_of_corners_is_the_same_polygon(self, world: NomadWorld) -> None:
        assert world.add([*BOX, BOX[0]])
        assert world.remove(BOX)

    def test_a_world_is_full_at_last_and_has_room_again(self, world: NomadWorld) -> None:
        triangles = [[(0.001 * i, 3.0), (0.001 * i + 0.5, 3.0), (0.001 * i, 3.5)] for i in range(MAX_OBSTACLES)]
        assert all(map(world.add, triangles))
        assert not world.add(BOX)
        assert world.remove(triangles[500])
        assert world.add(BOX)
        world.clear()
        assert world.add(BOX)

    def test_sides_are_bounded_together(self, world: NomadWorld) -> None:
        ring = [(3.0 + cos(2 * pi * i / 1000), sin(2 * pi * i / 1000)) for i in range(1000)]
        assert [world.add([(x, y + 0.002 * n) for x, y in ring]) for n in range(22)] == [True] * 20 + [False] * 2

    def test_sonars_see_what_changes(self, world: NomadWorld) -> None:
        def front() -> float:
            for _ in range(40):
                world.step()
            return world.observe(0).sonars[0]

        assert front() == pytest.approx(6.477)
        world.add(BOX)
        assert front() == pytest.approx(1.0 - RADIUS, abs=1e-5)
        world.move(BOX, 0.5, 0.0)
        assert front() == pytest.approx(1.5 - RADIUS, abs=1e-5)
        world.clear()
        assert front() == pytest.approx(6.477)


class TestStraight:
    def test_a_free_way(self, world: NomadWorld) -> None:
        world.add(BOX)
        assert world.along(0, (0.0, 0.0), (0.0, 3.0)) is None
        assert world.along(0, (0.0, 0.7), (3.0, 0.7)) is None

    def test_a_side_ahead(self, world: NomadWorld) -> None:
        world.add(BOX)
        found = world.along(0, (0.0, 0.2), (3.0, 0.2))
        assert found is not None
        assert found == pytest.approx((1.0 - RADIUS, 0.2, pi), abs=1e-5)

    def test_a_corner_beside(self, world: NomadWorld) -> None:
        """The middle then lies a radius from the corner: down by 0.1, and so by the root of r2 - 0.1^2 before it."""
        world.add(BOX)
        found = world.along(0, (0.0, 0.6), (3.0, 0.6))
        assert found is not None
        x = 1.0 - np.sqrt(RADIUS**2 - 0.1**2)
        assert found == pytest.approx((x, 0.6, atan2(0.1, x - 1.0)), abs=1e-5)

    def test_where_it_would_touch_it_does_touch(self, world: NomadWorld) -> None:
        world.add([(1.0, -0.3), (1.4, 0.4), (0.9, 0.8)])
        found = world.along(0, (0.0, 0.0), (2.0, 0.5))
        assert found is not None
        world.place(0, Pose(0.0, 0.0, atan2(0.5, 2.0), 0.0))
        world.set_speeds(0, Axes(0.4, 0.4))
        for _ in range(300):
            world.step()
        real = world.observe(0).real
        assert (real.x, real.y) == pytest.approx(found[:2], abs=1e-5)
        touched = world.observe(0).touched[0] + real.heading
        assert cos(touched - found.normal) == pytest.approx(-1.0, abs=1e-6)

    def test_what_it_overlaps_already_it_touches_at_once(self, world: NomadWorld) -> None:
        world.add(BOX)
        assert world.along(0, (0.9, 0.0), (-3.0, 0.0)) == pytest.approx((0.9, 0.0, pi))

    def test_other_robots_are_in_the_way(self) -> None:
        world = nomad_world(robots=2)
        world.place(1, Pose(2.0, 0.0, 0.0, 0.0))
        found = world.along(0, (0.0, 0.0), (5.0, 0.0))
        assert found == pytest.approx((2.0 - 2 * RADIUS, 0.0, pi), abs=1e-5)

    def test_the_edge_is_in_the_way(self, world: NomadWorld) -> None:
        found = world.along(0, (0.0, 0.0), (0.0, -1000.0))
        assert found == pytest.approx((0.0, RADIUS - world.size[1] / 2.0, pi / 2), abs=1e-5)

    @pytest.mark.parametrize("odd", [nan, inf])
    def test_ways_are_numbers(self, world: NomadWorld, odd: float) -> None:
        with pytest.raises(MisuseError, match="not finite"):
            world.along(0, (0.0, 0.0), (odd, 0.0))
        with pytest.raises(MisuseError, match="not finite"):
            world.round(0, (0.0, 0.0), 1.0, 0.0, odd)


class TestRound:
    def test_a_free_way(self, world: NomadWorld) -> None:
        world.add(BOX)
        assert world.round(0, (0.0, 0.0), 0.5, 0.0, 10.0) is None
        assert world.round(0, (0.0, 0.0), 1.5, 1.0, 5.0) is None

    @pytest.mark.parametrize("end", [pi / 2, 2 * pi, 100.0])
    def test_from_below(self, world: NomadWorld, end: float) -> None:
        """The bottom side of the box is met where the middle is a radius below it."""
        world.add(BOX)
        found = world.round(0, (0.0, 0.0), 1.5, -pi / 2, end)
        y = -0.5 - RADIUS
        assert found == pytest.approx((np.sqrt(1.5**2 - y * y), y, -pi / 2), abs=1e-5)

    def test_from_above_and_clockwise(self, world: NomadWorld) -> None:
        world.add(BOX)
        found = world.round(0, (0.0, 0.0), 1.5, pi / 2, -pi / 2)
        y = 0.5 + RADIUS
        assert found == pytest.approx((np.sqrt(1.5**2 - y * y), y, pi / 2), abs=1e-5)

    def test_turning_on_the_spot_touches_nothing_new(self, world: NomadWorld) -> None:
        world.add(BOX)
        assert world.round(0, (0.0, 0.0), 0.0, 0.0, 3.0) is None
        assert world.round(0, (0.95, 0.0), 0.0, 0.0, 3.0) == pytest.approx((0.95, 0.0, pi))

    def test_other_robots_are_in_the_way(self) -> None:
        world = nomad_world(robots=2)
        world.place(1, Pose(0.0, 2.0, 0.0, 0.0))
        found = world.round(0, (0.0, 0.0), 2.0, 0.0, pi)
        assert found is not None
        assert hypot(found.x, found.y - 2.0) == pytest.approx(2 * RADIUS, abs=1e-5)
        assert found.x > 0.0


number = st.floats(-3.0, 3.0).map(lambda value: round(value, 3))
thing = st.tuples(number, number, number, number, st.sampled_from([0.0, 0.1, 0.5]))


class TestAgainstManySmallSteps:
    """The first touch on a way is where walking along it in small steps first finds one."""

    @settings(max_examples=60, deadline=None)
    @given(st.lists(thing, min_size=1, max_size=4), number, number, number, number)
    def test_straight(
        self, rows: list[tuple[float, float, float, float, float]], x: float, y: float, u: float, v: float
    ) -> None:
        things = np.array(rows)
        share = np.linspace(0.0, 1.0, 4001)
        self.compare(things, x + share * (u - x), y + share * (v - y), first_along(things, RADIUS, (x, y), (u, v)))

    @settings(max_examples=60, deadline=None)
    @given(st.lists(thing, min_size=1, max_size=4), number, number, st.floats(0.01, 3.0), number, st.floats(-6.2, 6.2))
    def test_round(
        self,
        rows: list[tuple[float, float, float, float, float]],
        x: float,
        y: float,
        orbit: float,
        begin: float,
        sweep: float,
    ) -> None:
        things = np.array(rows)
        angles = begin + np.linspace(0.0, 1.0, 8001) * sweep
        found = first_round(things, RADIUS, (x, y), orbit, begin, begin + sweep)
        self.compare(things, x + orbit * np.cos(angles), y + orbit * np.sin(angles), found)

    @staticmethod
    def compare(
        things: np.ndarray[tuple[int, ...], np.dtype[np.float64]],
        x: np.ndarray[tuple[int, ...], np.dtype[np.float64]],
        y: np.ndarray[tuple[int, ...], np.dtype[np.float64]],
        found: tuple[float, float, float] | None,
    ) -> None:
        gap = np.min([distance(x, y, *row[:4]) - row[4] - RADIUS for row in things], axis=0)
        step = float(np.hypot(np.diff(x), np.diff(y)).max(initial=0.0))
        touched = np.flatnonzero(gap < -1e-5)
        if found is None:
            assert not len(touched)
            return
        here = min(distance(np.array(found[0]), np.array(found[1]), *row[:4]) - row[4] - RADIUS for row in things)
        assert here <= 1e-5
        before = np.flatnonzero(np.hypot(x - found[0], y - found[1]) <= 1.5 * step + 1e-6)
        assert len(before)
        assert not len(touched) or before[0] <= touched[0] + 1
