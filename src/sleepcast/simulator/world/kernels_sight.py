"""Compiled kernels, with numba, of the line of sight: the formulas of `sight.crossed`, and its walk along cells for one
line after the other. Where everything lies they read in the table of `sight.SightLines`."""

from __future__ import annotations

from math import inf

import numpy as np

from sleepcast.simulator.simd.compiled import part, strict, woven
from sleepcast.simulator.simd.lanes import long_at, real_at, whole_at
from sleepcast.simulator.world import sight

COUNT, SOLIDS, START, ITEMS, COLUMNS, ROWS, SIZE, MARGIN_X, MARGIN_Y = map(int, sight.Lines)


@strict
def hide(lines, x, y, to_x, to_y, first, last, found):
    """Write whether each of the points from `first` to `last` (exclusive) is hidden; see `sight.hidden`."""
    for i in range(first, last):
        found[i] = hidden(lines, x[i], y[i], to_x[i], to_y[i])


@part
def hidden(lines, x, y, to_x, to_y):
    """Whether anything hides the point `to_x`, `to_y` from x, y; see `sight.hidden`."""
    if long_at(lines, COUNT) == 0:
        return False
    size, columns, rows = real_at(lines, SIZE), long_at(lines, COLUMNS), long_at(lines, ROWS)
    own_x, own_y = x + real_at(lines, MARGIN_X), y + real_at(lines, MARGIN_Y)
    column, to_column = cell_at(own_x, size, columns), cell_at(to_x + real_at(lines, MARGIN_X), size, columns)
    row, to_row = cell_at(own_y, size, rows), cell_at(to_y + real_at(lines, MARGIN_Y), size, rows)
    if column == to_column and row == to_row:
        return met(lines, row * columns + column, x, y, to_x, to_y)
    along_x, along_y = to_x - x, to_y - y
    step_x, left_x = (1, to_column - column) if to_column > column else (-1, column - to_column)
    step_y, left_y = (1, to_row - row) if to_row > row else (-1, row - to_row)
    next_x = ((column + (step_x > 0)) * size - own_x) / along_x if left_x else inf
    next_y = ((row + (step_y > 0)) * size - own_y) / along_y if left_y else inf
    each_x, each_y = size / abs(along_x) if left_x else inf, size / abs(along_y) if left_y else inf
    while True:
        if met(lines, row * columns + column, x, y, to_x, to_y):
            return True
        if left_x + left_y == 0:
            return False
        if next_x <= next_y:
            column, left_x = column + step_x, left_x - 1
            next_x = next_x + each_x if left_x else inf
        else:
            row, left_y = row + step_y, left_y - 1
            next_y = next_y + each_y if left_y else inf


@woven
def cell_at(place, size, cells):
    """The column or row of a place along one axis; see `grid.Grid`."""
    return min(max(np.int64(place / size), 0), cells - 1)


@woven
def cell_of(lines, x, y):
    """The cell of a place."""
    size = real_at(lines, SIZE)
    column = cell_at(x + real_at(lines, MARGIN_X), size, long_at(lines, COLUMNS))
    return cell_at(y + real_at(lines, MARGIN_Y), size, long_at(lines, ROWS)) * long_at(lines, COLUMNS) + column


@woven
def items_of(lines, cell):
    """The first item that a cell lists, and the one after the last."""
    start = long_at(lines, START)
    return whole_at(start, cell), whole_at(start, cell + 1)


@woven
def beyond(solids, at, x, y, within):
    """Whether a solid is a wall that is certainly farther away than the root of `within`."""
    x0, y0, x1, y1 = real_at(solids, at), real_at(solids, at + 1), real_at(solids, at + 2), real_at(solids, at + 3)
    away, far = side(x0, y0, x1, y1, x, y), within * (1.0 + sight.SLACK)
    long_x, long_y = x1 - x0, y1 - y0
    return away * away > far * (long_x * long_x + long_y * long_y) and real_at(solids, at + 4) == 0.0


@part
def met(lines, cell, x, y, to_x, to_y):
    """Whether a line touches or crosses one of the solids that a cell lists."""
    items, solids = long_at(lines, ITEMS), long_at(lines, SOLIDS)
    (index, last), found = items_of(lines, cell), False
    while index < last and not found:
        found = crossed(solids, 5 * np.int64(whole_at(items, index)), x, y, to_x, to_y)
        index += 1
    return found


@woven
def crossed(solids, at, x, y, to_x, to_y):
    """Whether a line touches or crosses a solid, whose numbers lie from `at` on; see `sight.crossed`."""
    x0, y0, x1, y1 = real_at(solids, at), real_at(solids, at + 1), real_at(solids, at + 2), real_at(solids, at + 3)
    radius = real_at(solids, at + 4)
    if radius > 0.0:
        return disc_crossed(x0, y0, radius * radius, x, y, to_x, to_y)
    apart = (max(x0, x1) < min(x, to_x)) | (min(x0, x1) > max(x, to_x))
    apart |= (max(y0, y1) < min(y, to_y)) | (min(y0, y1) > max(y, to_y))
    one, other = side(x, y, to_x, to_y, x0, y0), side(x, y, to_x, to_y, x1, y1)
    apart |= (one > 0.0) & (other > 0.0) | (one < 0.0) & (other < 0.0)
    one, other = side(x0, y0, x1, y1, x, y), side(x0, y0, x1, y1, to_x, to_y)
    return not apart | (one > 0.0) & (other > 0.0) | (one < 0.0) & (other < 0.0)


@part
def disc_crossed(middle_x, middle_y, square, x, y, to_x, to_y):
    """The same of a disc. square: of its radius"""
    along_x, along_y = to_x - x, to_y - y
    from_x, from_y, before_x, before_y = middle_x - x, middle_y - y, middle_x - to_x, middle_y - to_y
    if from_x * from_x + from_y * from_y <= square or before_x * before_x + before_y * before_y <= square:
        return True
    if not (from_x * along_x + from_y * along_y > 0.0 and before_x * along_x + before_y * along_y < 0.0):
        return False
    away = side(x, y, to_x, to_y, middle_x, middle_y)
    return away * away <= square * (along_x * along_x + along_y * along_y)


@woven
def side(x, y, to_x, to_y, point_x, point_y):
    """See `sight._side`."""
    return (x - point_x) * (to_y - point_y) - (y - point_y) * (to_x - point_x)
