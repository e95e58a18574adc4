"""Compiled kernels, with numba, of the line of sight: the formulas of `sight.crossed`, and its walk along cells for one
line after the other. Where everything lies they read in the table of `sight.SightLines`.

For many lines from one place there is a faster way: all solids around it are looked at, LANES lines at once, in
numbers of 32 bits. These say on which side of each other things lie, as areas, whose signs are certain beyond the
`DOUBT` of the list; within it, and for whoever stands in line with a wall, the walk decides. So both come to the same.
"""

from __future__ import annotations

from math import inf

import numpy as np

from sleepcast.simulator.simd.compiled import part, strict, woven
from sleepcast.simulator.simd.formulas import LANES
from sleepcast.simulator.simd.lanes import long_at, pack_at, real_at, single_at, singles_at, whole_at
from sleepcast.simulator.simd.vectors import any_of, either, every, how_many, least_of, most_of, places
from sleepcast.simulator.world import sight

COUNT, SOLIDS, START, ITEMS, COLUMNS, ROWS, SIZE, MARGIN_X, MARGIN_Y, SPANS, DOUBT = map(int, sight.Lines)
F = np.float32
I = np.int32  # noqa: E741
MOST = 128
"""Solids around a point that are looked at together."""
WIDE = MOST + LANES
"""Numbers in a row of what `look_around` writes."""
DISC = 5 * WIDE
"""Where the rows of discs begin."""
SEEN = 9 * WIDE // 2
"""Words for all rows."""


@strict
def hide(lines, x, y, to_x, to_y, first, last, found):
    """Write whether each of the points from `first` to `last` (exclusive) is hidden; see `sight.hidden`."""
    for i in range(first, last):
        found[i] = hidden(lines, x[i], y[i], to_x[i], to_y[i])


@strict
def count(lines, x, y, to_x, to_y, first, last, looked, found):
    """Write how many solids each of the lines from `first` to `last` (exclusive) touches or crosses; see
    `sight.crossings`. looked: 0 for each solid; one that several cells list is looked at once for each line"""
    for i in range(first, last):
        found[i] = crossings(lines, x[i], y[i], to_x[i], to_y[i], looked, i - first + 1)


@part
def hidden(lines, x, y, to_x, to_y):
    """Whether anything hides the point `to_x`, `to_y` from x, y; see `sight.hidden`."""
    if long_at(lines, COUNT) == 0:
        return False
    cell, ahead, each = walk(lines, x, y, to_x, to_y)
    while True:
        if met(lines, cell, x, y, to_x, to_y):
            return True
        if is_last(ahead):
            return False
        cell, ahead = step(cell, ahead, each)


@part
def crossings(lines, x, y, to_x, to_y, looked, number):
    """How many solids a line touches or crosses; see `count`. number: of the line, put down at what it looks at"""
    items, solids, found = long_at(lines, ITEMS), long_at(lines, SOLIDS), 0
    cell, ahead, each = walk(lines, x, y, to_x, to_y)
    while True:
        index, last = items_of(lines, cell)
        while index < last:
            item = np.int64(whole_at(items, index))
            if looked[item] != number:
                looked[item] = number
                found += crossed(solids, 5 * item, x, y, to_x, to_y)
            index += 1
        if is_last(ahead):
            return found
        cell, ahead = step(cell, ahead, each)


@woven
def walk(lines, x, y, to_x, to_y):
    """The cell in which a line begins; how many are left across and up, and at which share of the line the next of
    them begins; by how much each step changes the cell, and that share."""
    size, columns, rows = real_at(lines, SIZE), long_at(lines, COLUMNS), long_at(lines, ROWS)
    own_x, own_y = x + real_at(lines, MARGIN_X), y + real_at(lines, MARGIN_Y)
    column, to_column = cell_at(own_x, size, columns), cell_at(to_x + real_at(lines, MARGIN_X), size, columns)
    row, to_row = cell_at(own_y, size, rows), cell_at(to_y + real_at(lines, MARGIN_Y), size, rows)
    along_x, along_y = to_x - x, to_y - y
    step_x, left_x = (1, to_column - column) if to_column > column else (-1, column - to_column)
    step_y, left_y = (columns, to_row - row) if to_row > row else (-columns, row - to_row)
    next_x = ((column + (step_x > 0)) * size - own_x) / along_x if left_x else inf
    next_y = ((row + (step_y > 0)) * size - own_y) / along_y if left_y else inf
    each_x, each_y = size / abs(along_x) if left_x else inf, size / abs(along_y) if left_y else inf
    return row * columns + column, (left_x, left_y, next_x, next_y), (step_x, step_y, each_x, each_y)


@woven
def is_last(ahead):
    """Whether a walk ends in this cell."""
    return ahead[0] + ahead[1] == 0


@woven
def step(cell, ahead, each):
    """The next cell of a walk, and what is ahead from there."""
    left_x, left_y, next_x, next_y = ahead
    if next_x <= next_y:
        return cell + each[0], (left_x - 1, left_y, next_x + each[2] if left_x > 1 else inf, next_y)
    return cell + each[1], (left_x, left_y - 1, next_x, next_y + each[3] if left_y > 1 else inf)


@woven
def cell_at(place, size, cells):
    """The column or row of a place along one axis; see `grid.Grid`."""
    return min(max(np.int64(place / size), 0), cells - 1)


@woven
def placed(lines, x, y):
    """The cell of a place, and the way there from its middle, m, as numbers of 32 bits."""
    size, columns, rows = real_at(lines, SIZE), long_at(lines, COLUMNS), long_at(lines, ROWS)
    x, y = x + real_at(lines, MARGIN_X), y + real_at(lines, MARGIN_Y)
    column, row = cell_at(x, size, columns), cell_at(y, size, rows)
    return row * columns + column, F(x - (column + 0.5) * size), F(y - (row + 0.5) * size)


@woven
def items_of(lines, cell):
    """The first item that a cell lists, and the one after the last."""
    start = long_at(lines, START)
    return whole_at(start, cell), whole_at(start, cell + 1)


@part
def look_around(lines, x, y, within, seen):
    """Write the solids around x, y as they lie from there, in 32 bits, see `see_walls` and `see_discs`. Gives
    how many there are of both; walls are -1 if any of them is in doubt. within: the square of how far is looked, m2"""
    cell, off_x, off_y = placed(lines, x, y)
    (item, last), walls, discs = items_of(lines, cell), 0, 0
    if item < last and (max(abs(off_x), abs(off_y)) > F(0.501 * real_at(lines, SIZE)) or last - item > MOST):
        return -1, 0
    while item < last and walls >= 0 and discs >= 0:
        count, spans = min(last - item, LANES), long_at(lines, SPANS) + 20 * np.int64(item)
        x0, y0 = singles_at(spans, 0) - off_x, singles_at(spans, count) - off_y
        x1, y1 = singles_at(spans, 2 * count) - off_x, singles_at(spans, 3 * count) - off_y
        radius, there, doubt = singles_at(spans, 4 * count), places() < I(count), F(real_at(lines, DOUBT))
        walls = see_walls(x0, y0, x1, y1, there & (radius == F(0.0)), F(1.002 * within), doubt, seen, walls)
        discs = see_discs(x0, y0, radius, there & (radius > F(0.0)), doubt, seen, discs)
        item += LANES
    return (-1, 0) if walls < 0 or discs < 0 else (walls, discs)


@woven
def see_walls(x0, y0, x1, y1, there, square, doubt, seen, walls):
    """Write walls after so many others: x and y of both ends, counter-clockwise, and twice the area between them and
    0, 0. Leaves out those that are certainly farther away than the root of a number. Gives how many there are now; -1
    where the area might be of either sign."""
    turn, long_x, long_y = x0 * y1 - y0 * x1, x1 - x0, y1 - y0
    back, area = turn < F(0.0), np.abs(turn)
    away = most_of(area - doubt, F(0.0))  # of short walls the area may be of any sign
    near = there & (away * away <= square * (long_x * long_x + long_y * long_y))
    near = near & reached(x0, x1, square) & reached(y0, y1, square)
    if any_of(near & (area <= doubt)):
        return -1
    pack_at(seen, walls, either(back, x1, x0), near)
    pack_at(seen, walls + WIDE, either(back, y1, y0), near)
    pack_at(seen, walls + 2 * WIDE, either(back, x0, x1), near)
    pack_at(seen, walls + 3 * WIDE, either(back, y0, y1), near)
    pack_at(seen, walls + 4 * WIDE, area, near)
    return walls + np.int64(how_many(near))


@woven
def reached(one, other, square):
    """Whether lines between these places along an axis come as near to 0 as the root of a number."""
    low, high = least_of(one, other), most_of(one, other)
    return (low * np.abs(low) <= square) & (high * np.abs(high) >= -square)


@woven
def see_discs(x, y, radius, there, doubt, seen, discs):
    """Write discs, from DISC on, after so many others: x and y of the middle, the radius, and its square less that of
    the distance. Gives how many there are now; -1 where 0, 0 might lie within one."""
    if not any_of(there):
        return discs
    past = radius * radius - (x * x + y * y)
    if any_of(there & (past >= -doubt)):
        return -1
    pack_at(seen, DISC + discs, x, there)
    pack_at(seen, DISC + discs + WIDE, y, there)
    pack_at(seen, DISC + discs + 2 * WIDE, radius, there)
    pack_at(seen, DISC + discs + 3 * WIDE, past, there)
    return discs + np.int64(how_many(there))


@woven
def depth(seen, walls, discs, x, y):
    """How deep points x, y lie behind any of the solids that `look_around` has written, m2: above its doubt where they
    are certainly hidden, and below the negative of it where they certainly are not."""
    deepest = every(F(-inf))
    for each in range(walls):
        one = y * single_at(seen, each) - x * single_at(seen, each + WIDE)
        other = x * single_at(seen, each + 3 * WIDE) - y * single_at(seen, each + 2 * WIDE)
        deepest = most_of(deepest, least_of(least_of(one, other), one + other - single_at(seen, each + 4 * WIDE)))
    if discs:
        square = x * x + y * y
        away = np.sqrt(square)
        for each in range(DISC, DISC + discs):
            disc_x, disc_y = single_at(seen, each), single_at(seen, each + WIDE)
            along, aside = x * disc_x + y * disc_y, np.abs(y * disc_x - x * disc_y)
            left = square - along
            beside = least_of(least_of(along, left), away * single_at(seen, each + 2 * WIDE) - aside)
            deepest = most_of(deepest, most_of(beside, along - left + single_at(seen, each + 3 * WIDE)))
    return deepest


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
