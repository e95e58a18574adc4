"""Outlines of what is solid on a grid of cells: closed lines along the borders of cells, corner by corner, exactly.

Where two solid cells touch at a corner only, each keeps that corner to itself. Along every row and every column of the
grid corners come in pairs, the ends of a side. So a corner has one neighbour across and one up or down, and the
outlines are what comes of going to the one and the other in turn.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Corner = tuple[int, int]

SOUTH_WEST, SOUTH_EAST, NORTH_WEST, NORTH_EAST = 1, 2, 4, 8
"""Which of the four cells round a point of the grid are solid, added up."""
RISING = SOUTH_WEST + NORTH_EAST
FALLING = SOUTH_EAST + NORTH_WEST
CORNERS = np.array([bin(code).count("1") % 2 == 1 or code in (RISING, FALLING) for code in range(16)])


def corners_of(solid: NDArray[np.bool_]) -> tuple[NDArray[np.int64], NDArray[np.int64], NDArray[np.uint8]]:
    """Column, row and surroundings of each corner, row by row from the bottom. solid: shape (rows, columns), the row at
    the bottom first. A point at which two solid cells touch is two corners."""
    cells = np.pad(solid, 1).astype(np.uint8)
    round_ = cells[:-1, :-1] * SOUTH_WEST
    round_ += cells[:-1, 1:] * SOUTH_EAST
    round_ += cells[1:, :-1] * NORTH_WEST
    round_ += cells[1:, 1:] * NORTH_EAST
    row, column = np.nonzero(CORNERS[round_])
    code = round_[row, column]
    times = 1 + ((code == RISING) | (code == FALLING))
    return np.repeat(column, times), np.repeat(row, times), np.repeat(code, times)


def outlines(solid: NDArray[np.bool_]) -> list[list[Corner]]:
    """The closed lines round all that is solid, holes included: for each its corners (column, row), no three of them in
    one line. solid: as above."""
    column, row, code = corners_of(solid)
    count = len(column)
    numbers = np.arange(count)
    # Of two corners at one point the first goes left and the second right; it is the lower one where solids rise.
    second = np.zeros(count, bool)
    second[1:] = (column[1:] == column[:-1]) & (row[1:] == row[:-1])
    upwards = np.lexsort((second ^ (code == FALLING), row, column))
    beside = numbers ^ 1
    above = np.empty(count, np.int64)
    above[upwards] = upwards[numbers ^ 1]
    return _rounds(list(zip(column.tolist(), row.tolist(), strict=True)), beside.tolist(), above.tolist())


def _rounds(corners: list[Corner], beside: list[int], above: list[int]) -> list[list[Corner]]:
    """The corners in the order in which one walks along them, beginning with the lowest one of each line."""
    seen = bytearray(len(corners))
    found = []
    for first in range(len(corners)):
        here, line = first, []
        while not seen[here]:
            there = beside[here]
            seen[here] = seen[there] = 1
            line += [corners[here], corners[there]]
            here = above[there]
        if line:
            found.append(line)
    return found
