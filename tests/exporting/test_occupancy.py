"""The world as a grid of cells."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from sleepcast.exporting.occupancy import FINEST, MAX_CELLS, TAKEN, cell_of, occupancy
from sleepcast.simulator.world.world import Area, Circle, Wall

PLACE = st.floats(-1.0, 6.0).map(lambda value: round(value, 3))


def test_what_is_solid_throughout_is_taken_inside_and_a_hole_is_free() -> None:
    square = ((1.0, 1.0), (3.0, 1.0), (3.0, 3.0), (1.0, 3.0))
    hole = ((1.5, 1.5), (2.5, 1.5), (2.5, 2.5), (1.5, 2.5))
    cell, values = occupancy(4.0, 4.0, [Area((square, hole)), Circle(3.5, 3.5, 0.3)])
    assert (cell, values.shape, values.dtype) == (FINEST, (80, 80), np.int8)
    at = {name: values[round(y / cell), round(x / cell)] for name, (x, y) in POINTS.items()}
    assert at == {"in the ring": TAKEN, "in the hole": 0, "in the disc": TAKEN, "outside": 0}


POINTS = {"in the ring": (1.2, 2.0), "in the hole": (2.0, 2.0), "in the disc": (3.5, 3.6), "outside": (0.3, 3.6)}


@given(PLACE, PLACE, PLACE, PLACE)
def test_no_point_of_a_wall_lies_in_a_free_cell(x0: float, y0: float, x1: float, y1: float) -> None:
    if (x0, y0) == (x1, y1):
        return
    cell, values = occupancy(5.0, 3.0, [Wall(((x0, y0), (x1, y1)))])
    way = np.linspace(0.0, 1.0, 1_999)
    x, y = x0 + way * (x1 - x0), y0 + way * (y1 - y0)
    inside = (x >= 0.0) & (x <= 5.0) & (y >= 0.0) & (y <= 3.0)
    column, row = np.minimum(x[inside] / cell, 99.0).astype(int), np.minimum(y[inside] / cell, 59.0).astype(int)
    free = np.count_nonzero(values[row, column] != TAKEN)
    assert free <= 2, "at most where a point lies within rounding of a side"
    assert (values == TAKEN).sum() <= 4 * (2 + abs(x1 - x0) / cell + abs(y1 - y0) / cell), "and few others are taken"


def test_a_large_world_has_larger_cells() -> None:
    assert [cell_of(size, size) for size in (25.0, 25.1, 60.0, 200.0, 5_000.0)] == [0.05, 0.1, 0.2, 0.5, 10.0]
    for width, height in ((1e6, 1.0), (3.0, 7e5), (1e7, 1e7)):
        assert occupancy(width, height, []).values.size <= MAX_CELLS
