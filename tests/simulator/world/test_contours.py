"""Outlines of cells and the inside of areas: both told apart from bitmaps by other means."""

from __future__ import annotations

import tracemalloc
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from sleepcast.core.errors import MisuseError
from sleepcast.simulator.world.areas import inside
from sleepcast.simulator.world.ros_map import Corner, contours
from sleepcast.simulator.world.world import Area, Circle, Point
from small_worlds import simulator

Cells = NDArray[np.bool_]


def bitmaps() -> list[Cells]:
    draw = np.random.default_rng(4)
    shapes = [(int(draw.integers(1, 12)), int(draw.integers(1, 12))) for _ in range(200)]
    return [draw.random(shape) < draw.random() for shape in shapes]


def sides(line: list[Corner]) -> list[tuple[Corner, Corner]]:
    return list(zip(line, line[1:] + line[:1], strict=True))


def filled(lines: list[list[Corner]], shape: tuple[int, ...]) -> Cells:
    """The cells that have an odd number of upright sides on their left."""
    crossings = np.zeros(shape, int)
    for line in lines:
        for (column, row), (other_column, other_row) in sides(line):
            if column == other_column:
                crossings[min(row, other_row) : max(row, other_row), column:] += 1
    return crossings % 2 == 1


def test_outlines_enclose_the_solid_cells_and_nothing_else() -> None:
    for solid in bitmaps():
        assert (filled(contours(solid), solid.shape) == solid).all()


def test_outlines_run_along_borders_and_only_there() -> None:
    for solid in bitmaps():
        border = sum(int(np.abs(np.diff(np.pad(solid, 1).astype(int), axis=axis)).sum()) for axis in (0, 1))
        lines = [side for line in contours(solid) for side in sides(line)]
        assert sum(abs(a[0] - b[0]) + abs(a[1] - b[1]) for a, b in lines) == border


def test_no_corner_could_be_left_out() -> None:
    for solid in bitmaps():
        for line in contours(solid):
            level = [a[1] == b[1] for a, b in sides(line)]
            assert all(here != there for here, there in zip(level, level[1:] + level[:1], strict=True))


def test_cells_that_touch_at_a_corner_are_apart() -> None:
    for solid in (np.eye(2, dtype=bool), np.eye(2, dtype=bool)[::-1]):
        assert [len(line) for line in contours(solid)] == [4, 4]


def test_a_hole_has_an_outline_of_its_own() -> None:
    ring = np.ones((3, 4), bool)
    ring[1, 1:3] = False
    assert sorted(map(sorted, contours(ring))) == [
        [(0, 0), (0, 3), (4, 0), (4, 3)],
        [(1, 1), (1, 2), (3, 1), (3, 2)],
    ]


def test_a_chessboard_of_many_pixels_is_counted_not_listed() -> None:
    """A picture of a few kilobytes, whose outlines would be millions of corners."""
    board = np.indices((1_200, 1_200)).sum(0) % 2 == 0
    tracemalloc.start()
    try:
        with pytest.raises(MisuseError, match="have 2880000 sides; at most"):
            contours(board)
        assert tracemalloc.get_traced_memory()[1] < 64 * 1024**2
    finally:
        tracemalloc.stop()


def test_nothing_solid_has_no_outline() -> None:
    assert contours(np.zeros((3, 3), bool)) == []


def area_of(solid: Cells) -> Area:
    return Area(tuple(tuple((float(x), float(y)) for x, y in line) for line in contours(solid)))


class TestInside:
    @pytest.mark.parametrize("shift", [0.5, 0.0], ids=["middles", "corners"])
    def test_it_is_told_for_every_cell(self, shift: float) -> None:
        for solid in bitmaps():
            up, across = solid.shape
            row, column = np.mgrid[-1 : up + 1, -1 : across + 1]
            found = inside(area_of(solid), column.ravel() + shift, row.ravel() + shift)
            assert (found.reshape(row.shape) == np.pad(solid, 1)).all()

    def test_of_a_ragged_map(self) -> None:
        draw = np.random.default_rng(1)
        solid = draw.random((300, 200)) < 0.4
        x, y = draw.uniform(0, 200, 20_000), draw.uniform(0, 300, 20_000)
        assert (inside(area_of(solid), x, y) == solid[y.astype(int), x.astype(int)]).all()

    def test_of_slanting_sides(self) -> None:
        star: tuple[Point, ...] = ((0.0, 0.0), (10.0, 2.0), (4.0, 4.0), (3.0, 9.0))
        draw = np.random.default_rng(2)
        x, y = draw.uniform(-1, 11, 2_000), draw.uniform(-1, 10, 2_000)
        # The same by the sum of the angles under which the sides are seen.
        ways = np.array(star)[:, 0, None] - x + 1j * (np.array(star)[:, 1, None] - y)
        turned = np.angle(np.roll(ways, -1, axis=0) / ways).sum(axis=0)
        assert (inside(Area((star,)), x, y) == (np.abs(turned) > 1.0)).all()

    def test_of_a_disc(self) -> None:
        x, y = np.array([1.0, 2.9, 3.0, 1.0]), np.array([1.0, 1.0, 1.0, 3.5])
        assert inside(Circle(1.0, 1.0, 2.0), x, y).tolist() == [True, True, False, False]


def test_no_robot_starts_in_a_disc_though_nothing_would_stop_it(tmp_path: Path) -> None:
    disc = '[[world.circles]]\ncenter = ["500m", "500m"]\nradius = "400m"\n\n[robots]\n'
    sim = simulator(tmp_path, ("[robots]\n", disc), ("count = 20", "count = 500"))
    assert np.hypot(sim.x - 500.0, sim.y - 500.0).min() >= 400.0
