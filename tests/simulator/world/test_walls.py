"""Walls by direction and line, for the compiled sonar: nothing is lost, and what belongs together stands together."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sleepcast.simulator.world.grid import grid_over, list_solids
from sleepcast.simulator.world.walls import NEW_DIRECTION, NEW_LINE, ROUND, SAME_LINE, walls_of
from sleepcast.simulator.world.world import Circle, Polygon, Shape, Wall, World, boundary, rooms

SHAPES: list[Shape] = [
    boundary(24.0, 18.0),
    *rooms(24.0, 18.0, 6.0, 1.5),
    Circle(4.0, 5.0, 0.5),
    Polygon(((9.0, 9.0), (10.0, 9.5), (9.2, 10.4))),
    Circle(20.0, 3.0, 1.5),
    Wall(((12.0, 2.0), (13.0, 3.0), (14.0, 4.0))),
]


def test_every_cell_has_what_was_listed_for_it() -> None:
    """As part of a joined piece, and nothing else."""
    world = World(SHAPES)
    grid = grid_over(24.0, 18.0, 3.0, 100)
    listed = list_solids(grid, world.solids, 4.0)
    walls = walls_of(listed, world.solids)
    joined = 0
    for cell in range(grid.cells):
        entries = walls.solids[:, walls.items[walls.start[cell] : walls.start[cell + 1]]]
        solids = world.solids[listed.items[listed.start[cell] : listed.start[cell + 1]]]
        of = [np.flatnonzero(within(solid, entries)).tolist() for solid in solids]
        assert all(len(places) == 1 for places in of)
        assert {places[0] for places in of} == set(range(entries.shape[1]))
        joined += len(of) - entries.shape[1]
    assert joined > 0


def within(solid: NDArray[np.float64], entries: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which of these entries, as columns, hold a solid."""
    x0, y0, x1, y1, radius = solid
    ex, ey, height, begin, end, radii = entries
    same: NDArray[np.bool_] = (ex == x0) & (ey == y0) & (radii == radius)
    if radius == 0.0:
        same = radii == 0.0
        for x, y in ((x0, y0), (x1, y1)):
            along = x * ex + y * ey
            same &= (np.abs(y * ex - x * ey - height) < 1e-6) & (along > begin - 1e-6) & (along < end + 1e-6)
    return same


def test_what_is_new_is_said() -> None:
    world = World(SHAPES)
    grid = grid_over(24.0, 18.0, 3.0, 100)
    walls = walls_of(list_solids(grid, world.solids, 4.0), world.solids)
    for cell in range(grid.cells):
        direction: tuple[float, ...] | None = None
        line = ended = -np.inf
        for w in range(walls.start[cell], walls.start[cell + 1]):
            ex, ey, height, begin, end, radius = walls.solids[:, walls.items[w]]
            if radius:
                assert walls.news[w] == ROUND
                assert direction is None, "round ones come first"
                continue
            assert begin < end
            wanted = NEW_DIRECTION if (ex, ey) != direction else NEW_LINE if abs(height - line) > 1e-6 else SAME_LINE
            assert walls.news[w] == wanted
            assert wanted != SAME_LINE or begin > ended, "pieces that touch are one"
            direction, line, ended = (ex, ey), height, end


def test_pieces_that_touch_are_one() -> None:
    """Whichever way they were drawn, and wherever they overlap."""
    ways = [(0.0, 2.0), (4.0, 2.0), (7.0, 9.0), (8.0, 6.0), (7.2, 7.5), (9.5, 9.8)]
    level: list[Shape] = [Wall(((a, 1.0), (b, 1.0))) for a, b in ways]
    beside: list[Shape] = [Wall(((2.0, 1.5), (5.0, 1.5))), Wall(((4.0, 1.0), (4.0, 2.0))), Circle(2.0, 1.0, 0.1)]
    world = World(level + beside)
    grid = grid_over(10.0, 2.0, 10.0, 1)
    walls = walls_of(list_solids(grid, world.solids, 9.0), world.solids)
    assert walls.news.tolist() == [ROUND, NEW_DIRECTION, NEW_DIRECTION, SAME_LINE, SAME_LINE, NEW_LINE]
    pieces = walls.solids[:5, walls.items[1:]].T.tolist()
    assert pieces == [
        [0.0, 1.0, -4.0, 1.0, 2.0],
        [1.0, 0.0, 1.0, 0.0, 4.0],
        [1.0, 0.0, 1.0, 6.0, 9.0],
        [1.0, 0.0, 1.0, 9.5, 9.8],
        [1.0, 0.0, 1.5, 2.0, 5.0],
    ]


def test_a_world_of_nothing_and_one_of_posts() -> None:
    grid = grid_over(10.0, 10.0, 5.0, 10)
    for shapes in ([], [Circle(5.0, 5.0, 1.0), Circle(2.0, 2.0, 0.1)]):
        world = World(shapes)
        walls = walls_of(list_solids(grid, world.solids, 3.0), world.solids)
        assert set(walls.news.tolist()) <= {ROUND}
        assert np.isfinite(walls.solids).all()
