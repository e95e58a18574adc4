"""Walls by direction and line, for the compiled sonar: nothing is lost, and what belongs together stands together."""

from __future__ import annotations

import numpy as np
import pytest

from sleepcast.simulator.grid import grid_over, list_solids
from sleepcast.simulator.walls import NEW_DIRECTION, NEW_LINE, ROUND, SAME_LINE, walls_of
from sleepcast.simulator.world import Circle, Polygon, Shape, Wall, World, edge, rooms

SHAPES: list[Shape] = [
    edge(24.0, 18.0),
    *rooms(24.0, 18.0, 6.0, 1.5),
    Circle(4.0, 5.0, 0.5),
    Polygon(((9.0, 9.0), (10.0, 9.5), (9.2, 10.4))),
    Circle(20.0, 3.0, 1.5),
    Wall(((12.0, 2.0), (13.0, 3.0), (14.0, 4.0))),
]


def test_every_cell_has_what_was_listed_for_it() -> None:
    world = World(SHAPES)
    grid = grid_over(24.0, 18.0, 3.0, 100)
    listed = list_solids(grid, world, 4.0)
    walls = walls_of(listed, world.solids)
    nothing = len(world.solids)
    for cell in range(grid.cells):
        entries = walls.items[walls.start[cell] : walls.start[cell + 1]]
        there = sorted(number for number in entries.ravel().tolist() if number != nothing)
        assert there == sorted(listed.items[listed.start[cell] : listed.start[cell + 1]].tolist())


def test_what_is_new_is_said() -> None:
    world = World(SHAPES)
    grid = grid_over(24.0, 18.0, 3.0, 100)
    walls = walls_of(list_solids(grid, world, 4.0), world.solids)
    for cell in range(grid.cells):
        direction: tuple[float, ...] | None = None
        line: float | None = None
        for w in range(walls.start[cell], walls.start[cell + 1]):
            one, other = walls.items[w]
            ex, ey, height, begin, end, radius = walls.solids[:, one]
            if radius:
                assert walls.news[w] == ROUND
                assert direction is None, "round ones come first"
                continue
            assert begin < end
            wanted = (
                NEW_DIRECTION
                if (ex, ey) != direction
                else NEW_LINE
                if abs(height - (line or 0.0)) > 1e-6
                else SAME_LINE
            )
            assert walls.news[w] == wanted
            direction, line = (ex, ey), height
            if other < len(world.solids):
                assert tuple(walls.solids[:2, other]) == (ex, ey)
                assert walls.solids[2, other] == pytest.approx(height, abs=1e-6)


def test_pieces_of_one_wall_share_their_entries() -> None:
    world = World([Wall(((0.0, 1.0), (2.0, 1.0))), Wall(((6.0, 1.0), (4.0, 1.0))), Wall(((8.0, 1.0), (9.0, 1.0)))])
    grid = grid_over(10.0, 2.0, 10.0, 1)
    walls = walls_of(list_solids(grid, world, 9.0), world.solids)
    assert walls.items.tolist() == [[0, 1], [2, 3]]
    assert walls.news.tolist() == [NEW_DIRECTION, SAME_LINE]
    assert walls.solids[3:5].T.tolist() == [[0.0, 2.0], [4.0, 6.0], [8.0, 9.0], [1e8, -1e8]]


def test_a_world_of_nothing_and_one_of_posts() -> None:
    grid = grid_over(10.0, 10.0, 5.0, 10)
    for shapes in ([], [Circle(5.0, 5.0, 1.0), Circle(2.0, 2.0, 0.1)]):
        world = World(shapes)
        walls = walls_of(list_solids(grid, world, 3.0), world.solids)
        assert set(walls.news.tolist()) <= {ROUND}
        assert np.isfinite(walls.solids).all()
