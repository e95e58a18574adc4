"""Solid things: what they are made of, how they change, and the index of what is near."""

from __future__ import annotations

from math import inf, nan

import numpy as np
import pytest

from sleepcast.core.errors import MisuseError
from sleepcast.simulator.world.grid import distance, grid_over, list_solids, pairs, sort
from sleepcast.simulator.world.world import Circle, Polygon, Shape, Wall, World, boundary, rooms

SQUARE = Polygon(((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)))


def test_a_polygon_is_closed_and_a_wall_is_open() -> None:
    assert len(World([SQUARE]).solids) == 4
    assert World([Wall(SQUARE.corners)]).solids.tolist() == World([SQUARE]).solids.tolist()[:3]


def test_a_circle_is_a_line_without_a_length() -> None:
    assert World([Circle(1.0, 2.0, 0.5)]).solids.tolist() == [[1.0, 2.0, 1.0, 2.0, 0.5]]


def test_things_are_added_moved_and_removed() -> None:
    world = World([SQUARE])
    number = world.add(Circle(1.0, 1.0, 0.5))
    world.move(number, 2.0, -1.0)
    assert world.shapes[number] == Circle(3.0, 0.0, 0.5)
    first = world.version
    world.remove(1)
    assert list(world.shapes) == [number]
    assert len(world.solids) == 1
    assert world.version > first
    assert world.add(SQUARE) not in (1, number)
    world.clear()
    assert world.solids.shape == (0, 5)


@pytest.mark.parametrize(
    ("shape", "said"),
    [
        (Polygon(((0.0, 0.0), (1.0, 0.0))), "a polygon of 2 points; wanted at least 3"),
        (Wall(((0.0, 0.0),)), "a wall of 1 points"),
        (Wall(((0.0, 0.0), (nan, 1.0))), "not finite"),
        (Wall(((0.0, 0.0), (0.0, 0.0))), "the same point twice"),
        (Circle(0.0, 0.0, 0.0), "radius above 0"),
        (Circle(inf, 0.0, 1.0), "finite"),
    ],
    ids=lambda value: str(value)[:20],
)
def test_what_is_no_shape_is_refused_and_changes_nothing(shape: Shape, said: str) -> None:
    world = World([SQUARE])
    with pytest.raises(MisuseError, match=said):
        world.add(shape)
    assert len(world.solids) == 4


def test_an_unknown_number_is_refused() -> None:
    for change in (lambda world: world.remove(7), lambda world: world.move(7, 1.0, 1.0)):
        with pytest.raises(MisuseError, match="there is no obstacle 7"):
            change(World([SQUARE]))


class TestRooms:
    def test_walls_have_doors_in_their_middles(self) -> None:
        walls = rooms(24.0, 12.0, 12.0, 2.0)
        assert walls == [Wall(((12.0, 0.0), (12.0, 5.0))), Wall(((12.0, 7.0), (12.0, 12.0)))]

    def test_walls_go_from_door_to_door(self) -> None:
        walls = rooms(24.0, 24.0, 12.0, 2.0)
        assert len(walls) == 6
        assert Wall(((12.0, 7.0), (12.0, 12.0), (12.0, 17.0))) in walls
        assert Wall(((7.0, 12.0), (12.0, 12.0), (17.0, 12.0))) in walls

    def test_a_side_too_short_for_its_door_is_left_out(self) -> None:
        walls = rooms(31.0, 24.0, 12.0, 8.0)
        assert Wall(((12.0, 10.0), (12.0, 12.0), (12.0, 14.0))) in walls
        assert all(x <= 24.0 for wall in walls for x, _ in wall.points)

    @pytest.mark.parametrize("length", [5.0, 30.0, 31.0, 100.0])
    def test_rooms_fill_the_world(self, length: float) -> None:
        marks = {x for wall in rooms(length, length, 12.0, 2.0) for x, _ in wall.points if x not in (0.0, length)}
        wide = np.diff(sorted({0.0, length, *(12.0 * i for i in range(1, 9) if 12.0 * i in marks)}))
        assert wide.min() >= 5.0
        assert wide.max() <= 18.0

    def test_a_room_of_the_size_of_the_world_has_no_walls(self) -> None:
        assert rooms(12.0, 12.0, 12.0, 2.0) == []


class TestGrid:
    def test_pairs_are_those_within_reach(self) -> None:
        draw = np.random.default_rng(1)
        x, y = draw.uniform(0, 30, 300), draw.uniform(0, 20, 300)
        for size, reach in ((1.0, 2.7), (5.0, 2.7), (50.0, 4.0)):
            grid = grid_over(30.0, 20.0, size, 300)
            first = np.array([3, 200, 7])
            i, j = pairs(grid, sort(grid, x, y), x, y, reach, first)
            near = np.hypot(x[:, None] - x, y[:, None] - y) <= reach
            np.fill_diagonal(near, False)
            assert set(zip(i.tolist(), j.tolist(), strict=True)) == {
                (a, b) for a in first.tolist() for b in np.flatnonzero(near[a]).tolist()
            }

    def test_a_cell_lists_all_that_comes_near(self) -> None:
        draw = np.random.default_rng(2)
        world = World([boundary(30.0, 20.0), *rooms(30.0, 20.0, 6.0, 1.0), Circle(8.0, 8.0, 2.5)])
        grid = grid_over(30.0, 20.0, 1.3, 10)
        listed = list_solids(grid, world.solids, 2.0)
        x, y = draw.uniform(0, 30, 500), draw.uniform(0, 20, 500)
        cells = grid.cells_of(x, y)
        for number, row in enumerate(world.solids.tolist()):
            line = [np.full(500, value) for value in row[:4]]
            near = distance(x, y, *line) <= 2.0 + row[4]
            for cell in set(cells[near].tolist()):
                assert number in listed.items[listed.start[cell] : listed.start[cell + 1]]
        assert len(listed.items) < 0.5 * grid.cells * len(world.solids)

    def test_a_vast_world_has_a_bounded_grid(self) -> None:
        grid = grid_over(1e7, 1e3, 0.5, 100)
        assert grid.cells < 20_000
