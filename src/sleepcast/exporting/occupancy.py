"""The solid things of a world as a grid of cells, for programs that plan on one.

A cell is taken if a line passes through it or its middle lies in something solid throughout. Lines are drawn on the
safe side: a cell that one only touches at a corner may be taken, too.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import ceil
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sleepcast.simulator.world.areas import inside
from sleepcast.simulator.world.world import Area, Circle, Shape, rows_of

FINEST = 0.05
"""m of a cell at least, as most maps of robots have it."""
MAX_CELLS = 250_000
"""Cells of a grid: 500 x 500; a larger world has larger cells."""
TAKEN = 100
"""The value of a cell that is taken, of 100."""


class OccupancyCells(NamedTuple):
    """A grid from 0, 0 of the world. cell: m; values: 0 or TAKEN, int8, shape (rows from the south, columns)."""

    cell: float
    values: NDArray[np.int8]


def occupancy(width: float, height: float, shapes: Iterable[Shape]) -> OccupancyCells:
    """The cells of a world of this size, m, that these take. Raises MisuseError for an invalid shape."""
    cell = cell_of(width, height)
    columns, rows = max(1, ceil(width / cell - 1e-9)), max(1, ceil(height / cell - 1e-9))
    taken = np.zeros((rows, columns), bool)
    middle_x, middle_y = np.meshgrid((np.arange(columns) + 0.5) * cell, (np.arange(rows) + 0.5) * cell)
    for shape in shapes:
        if isinstance(shape, Area | Circle):
            taken |= inside(shape, middle_x.ravel(), middle_y.ravel()).reshape(taken.shape)
        for x0, y0, x1, y1, _ in rows_of(shape):
            _draw(taken, x0 / cell, y0 / cell, x1 / cell, y1 / cell)
    return OccupancyCells(cell, np.where(taken, np.int8(TAKEN), np.int8(0)))


def cell_of(width: float, height: float) -> float:
    """The side of a cell, m: 0.05, 0.1, 0.2, 0.5, 1 and so on, as fine as `MAX_CELLS` allow."""
    size, steps = FINEST, (2.0, 2.0, 2.5)
    step = 0
    while ceil(width / size) * ceil(height / size) > MAX_CELLS:
        size, step = size * steps[step % 3], step + 1
    return round(size, 12)


def _draw(taken: NDArray[np.bool_], x0: float, y0: float, x1: float, y1: float) -> None:
    """Take the cells on the way from one point to another, in cells: a point in each stretch between two crossings."""
    rows, columns = taken.shape
    cuts = [np.array([0.0, 1.0])]
    for start, end, most in ((x0, x1, columns), (y0, y1, rows)):
        if start != end:
            low, high = sorted((start, end))
            sides = np.arange(max(0, ceil(low)), min(most, int(high)) + 1)
            cuts.append((sides - start) / (end - start))
    at = np.sort(np.concatenate(cuts).clip(0.0, 1.0))
    middle = (at[1:] + at[:-1]) / 2.0
    for way in (middle, at):  # the crossings as well: what lies on a side takes the cell beyond it
        x, y = x0 + way * (x1 - x0), y0 + way * (y1 - y0)
        within = (x >= 0.0) & (x <= columns) & (y >= 0.0) & (y <= rows)
        column, row = np.floor(x[within]).astype(np.int64), np.floor(y[within]).astype(np.int64)
        # Beyond the world's edge there is no cell, so a wall on it takes those within.
        taken[np.minimum(row, rows - 1), np.minimum(column, columns - 1)] = True
