"""Compiled kernels, with numba, that find for each robot what it senses of its neighbours, without arrays of pairs.

They go through the neighbours in the order in which `grid.pairs` gives them, and compute with the formulas of
`range_and_bearing.Pairs`: sums have the same bits. Where everything lies they read in the tables of `neighbourhood`.
"""

from __future__ import annotations

from math import inf, nan, sqrt

import numpy as np

from sleepcast.core.angles import CANCELLED
from sleepcast.simulator.neighbours import neighbourhood
from sleepcast.simulator.neighbours.neighbourhood import (
    ANGLE,
    AWAY,
    DIRECTION,
    DX,
    DY,
    FROM_X,
    FROM_Y,
    HEADING,
    LEAST,
    MEAN,
    MOST,
    OUTLIER,
    TOTAL,
    VALUE,
)
from sleepcast.simulator.simd.compiled import part, strict
from sleepcast.simulator.simd.formulas import arc_tangent, sine_cosine, wrap
from sleepcast.simulator.simd.lanes import long_at, put_long, put_real, put_whole, real_at, stack_room, whole_at
from sleepcast.simulator.sonar.kernels import GOLDEN, U, cells_around, deviate, mixed

I = np.int32  # noqa: E741  # as short as U
AT_ONCE = 128
"""Neighbours that are found before something is asked about them."""
(
    COUNT,
    PLACE_X,
    PLACE_Y,
    TRUE_HEADING,
    SENSED_X,
    SENSED_Y,
    SENSED_HEADING,
    SHARED,
    SHARED_NEXT,
    SHARES,
    TURNED,
    TORUS,
    WIDTH,
    HEIGHT,
    LOSS,
    NOISE,
    LOST_KEY,
    ACROSS_KEY,
    UP_KEY,
    COSINE,
    SINE,
    TURNING,
    VICINITIES,
    FIRST,
) = map(int, neighbourhood.Near)
(
    AROUND,
    STALE,
    REACH,
    SIZE,
    COLUMNS,
    ROWS,
    MARGIN,
    X,
    Y,
    WHOSE,
    CELL,
    START,
    ORDER,
    SORTED_WHOSE,
    SORTED_X,
    SORTED_Y,
) = map(int, neighbourhood.Of)


# ---- sorting


@strict
def begin(near):
    """Bodies have moved: show what they have shared in the last tick, and prepare all vicinities that are kept up to
    date."""
    shared, following = long_at(near, SHARED), long_at(near, SHARED_NEXT)
    for i in range(long_at(near, SHARES)):
        put_real(shared, i, real_at(following, i))
    for i in range(long_at(near, VICINITIES)):
        put_long(long_at(near, FIRST + i), STALE, 1)
    prepare(near)


@strict
def prepare(near):
    """Prepare all vicinities that are kept up to date and are not."""
    for i in range(long_at(near, VICINITIES)):
        prepare_one(long_at(near, FIRST + i))


@strict
def prepare_one(vicinity):
    """Sort all bodies into the cells of a vicinity, as `grid.sort` does, if they have moved; and compute the cosines
    and sines of their headings, if anybody wants them."""
    if not long_at(vicinity, STALE):
        return
    near = long_at(vicinity, AROUND)
    points = place_points(vicinity, near)
    sort_points(vicinity, points)
    if long_at(near, TURNING):
        for i in range(long_at(near, COUNT)):
            sine, cosine = sine_cosine(real_at(long_at(near, TRUE_HEADING), i))
            put_real(long_at(near, COSINE), i, cosine)
            put_real(long_at(near, SINE), i, sine)
    put_long(vicinity, STALE, 0)


@part
def place_points(vicinity, near):
    """Write all bodies and their images into the vicinity, see `torus.Cells.images`; gives their number."""
    x, y, whose, margin, count = (
        long_at(vicinity, X),
        long_at(vicinity, Y),
        long_at(vicinity, WHOSE),
        0.0,
        long_at(near, COUNT),
    )
    if long_at(near, TORUS):
        margin = real_at(vicinity, MARGIN)
    for i in range(count):
        put_real(x, i, real_at(long_at(near, PLACE_X), i) + margin)
        put_real(y, i, real_at(long_at(near, PLACE_Y), i) + margin)
        put_whole(whose, i, I(i))
    if long_at(near, TORUS):
        count = copy_points(x, y, whose, count, margin, real_at(near, WIDTH))
        count = copy_points(y, x, whose, count, margin, real_at(near, HEIGHT))
    return count


@part
def copy_points(along, across, whose, count, margin, size):
    """Append the images of so many points across both ends of one axis; gives the number of all."""
    total = count
    for i in range(count):
        if real_at(along, i) < 2.0 * margin:
            put_real(along, total, real_at(along, i) + size)
            put_real(across, total, real_at(across, i))
            put_whole(whose, total, whole_at(whose, i))
            total += 1
    for i in range(count):
        if real_at(along, i) >= size:
            put_real(along, total, real_at(along, i) - size)
            put_real(across, total, real_at(across, i))
            put_whole(whose, total, whole_at(whose, i))
            total += 1
    return total


@part
def sort_points(vicinity, points):
    """A counting sort of so many points by cell."""
    x, y, cell, start = long_at(vicinity, X), long_at(vicinity, Y), long_at(vicinity, CELL), long_at(vicinity, START)
    columns, rows, size = long_at(vicinity, COLUMNS), long_at(vicinity, ROWS), real_at(vicinity, SIZE)
    for i in range(columns * rows + 2):
        put_whole(start, i, I(0))
    for i in range(points):
        column = min(max(int(real_at(x, i) / size), 0), columns - 1)
        row = min(max(int(real_at(y, i) / size), 0), rows - 1)
        here = row * columns + column
        put_whole(cell, i, I(here))
        put_whole(start, here + 2, I(whole_at(start, here + 2) + 1))
    total = 0
    for i in range(2, columns * rows + 2):  # until all are placed, each cell's beginning is one further
        total += whole_at(start, i)
        put_whole(start, i, I(total))
    for i in range(points):
        here = whole_at(cell, i) + 1
        at = whole_at(start, here)
        put_whole(start, here, I(at + 1))
        put_whole(long_at(vicinity, ORDER), at, I(i))
        put_whole(long_at(vicinity, SORTED_WHOSE), at, whole_at(long_at(vicinity, WHOSE), i))
        put_real(long_at(vicinity, SORTED_X), at, real_at(x, i))
        put_real(long_at(vicinity, SORTED_Y), at, real_at(y, i))


# ---- asking


@strict
def ask_many(vicinity, quantity, fold, frame, row, robots, radius, colour, first, last, found):
    """Write what `formula` comes to for the robots from `first` to `last` (exclusive) into `found`. radius: m, one for
    each; colour: likewise, NaN for any."""
    for i in range(first, last):
        found[i] = ask(vicinity, quantity, fold, frame, row, robots[i], radius[i], colour[i])


@strict
def ask_one(question, robot, _):
    """What a `neighbourhood.question` comes to for one robot. _: the radius as it was written; the question has it
    within the reach of the sensor."""
    return ask_coloured(question, robot, _, nan)


@strict
def ask_coloured(question, robot, _, colour):
    """The same of neighbours of one colour."""
    vicinity, quantity, fold = long_at(question, 0), long_at(question, 1), long_at(question, 2)
    frame, row = long_at(question, 3), long_at(question, 4)
    return ask(vicinity, quantity, fold, frame, row, robot, real_at(question, 5), colour)


@part
def ask(vicinity, quantity, fold, frame, row, robot, radius, colour):
    """What a formula comes to for one robot, NaN for unknown."""
    if fold == OUTLIER:
        across, _, count, _ = gather(vicinity, DX, TOTAL, 0, robot, radius, colour, 0.0, 0.0)
        up, _, _, _ = gather(vicinity, DY, TOTAL, 0, robot, radius, colour, 0.0, 0.0)
        least = max(count, 1.0)
        found, _, count, _ = gather(vicinity, quantity, OUTLIER, 0, robot, radius, colour, across / least, up / least)
    else:
        found, other, count, best = gather(vicinity, quantity, fold, row, robot, radius, colour, 0.0, 0.0)
        if fold == MEAN:
            found = found / max(count, 1.0)
        elif fold == DIRECTION:
            if not sqrt(found * found + other * other) > CANCELLED * count:
                return nan
            return arc_tangent(other, found)
        elif fold in (LEAST, MOST):
            found = -best if fold == LEAST else best
    if count == 0.0 and fold != TOTAL:
        return nan
    near = long_at(vicinity, AROUND)
    if frame == FROM_X:
        return real_at(long_at(near, SENSED_X), robot) + found
    if frame == FROM_Y:
        return real_at(long_at(near, SENSED_Y), robot) + found
    return found


@part
def gather(vicinity, quantity, fold, row, robot, radius, colour, middle_x, middle_y):
    """Fold a quantity of all neighbours of one robot. Gives the sum, or the value of the neighbour that is nearest, or
    farthest from the middle; the sum of the sines, where the other one is of cosines; how many they are; and the
    greatest value, or of LEAST the greatest negative one."""
    near = long_at(vicinity, AROUND)
    own_x, own_y = real_at(long_at(vicinity, X), robot), real_at(long_at(vicinity, Y), robot)
    size, columns, reach = real_at(vicinity, SIZE), long_at(vicinity, COLUMNS), real_at(vicinity, REACH)
    order, start, whose = long_at(vicinity, ORDER), long_at(vicinity, START), long_at(vicinity, SORTED_WHOSE)
    sorted_x, sorted_y = long_at(vicinity, SORTED_X), long_at(vicinity, SORTED_Y)
    shared, robots, loss, noise = long_at(near, SHARED), long_at(near, COUNT), real_at(near, LOSS), real_at(near, NOISE)
    coloured, turned, sine, cosine = colour == colour, long_at(near, TURNED), 0.0, 1.0
    if turned:
        sensed = real_at(long_at(near, SENSED_HEADING), robot)
        sine, cosine = sine_cosine(wrap(sensed - real_at(long_at(near, TRUE_HEADING), robot)))
    found, other_found, count, best = 0.0, 0.0, 0.0, -inf
    line, high, left, right = cells_around(own_x, own_y, size, columns, long_at(vicinity, ROWS), reach)
    room, k = stack_room(AT_ONCE), np.int64(whole_at(start, line * columns + left))
    while line < high:
        taken = 0
        while line < high and taken < AT_ONCE:
            stop = whole_at(start, line * columns + right)
            end = min(stop, k + AT_ONCE - taken)
            for each in range(k, end):
                dx, dy = real_at(sorted_x, each) - own_x, real_at(sorted_y, each) - own_y
                # Written whether it counts or not, and then overwritten: faster than a branch that is hard to predict.
                put_long(room, taken, each)
                taken += (dx * dx + dy * dy <= reach * reach) & (whole_at(order, each) != robot)
            k = end
            if k == stop:
                line += 1
                k = np.int64(whole_at(start, min(line, high - 1) * columns + left))
        for index in range(taken):
            at = long_at(room, index)
            dx, dy = real_at(sorted_x, at) - own_x, real_at(sorted_y, at) - own_y
            away, other = sqrt(dx * dx + dy * dy), np.int64(whole_at(whose, at))
            if away > radius or (coloured and real_at(shared, other) != colour):
                continue
            if loss > 0.0 or noise > 0.0:
                multiple = ((U(other) << U(32)) + U(robot)) * GOLDEN
                if loss > 0.0:
                    drawn = float(mixed(multiple, U(long_at(near, LOST_KEY))) >> U(11)) * 2.0**-53
                    if drawn < loss:
                        continue
                if noise > 0.0:
                    wide = noise * away
                    dx = dx + wide * deviate(mixed(multiple, U(long_at(near, ACROSS_KEY))))
                    dy = dy + wide * deviate(mixed(multiple, U(long_at(near, UP_KEY))))
                    away = sqrt(dx * dx + dy * dy)
            if turned:
                dx, dy = dx * cosine - dy * sine, dx * sine + dy * cosine
            value, across = 1.0, 0.0
            if quantity == DX:
                value = dx
            elif quantity == DY:
                value = dy
            elif quantity == AWAY:
                value = away
            elif quantity == HEADING:
                value, across = real_at(long_at(near, COSINE), other), real_at(long_at(near, SINE), other)
                if turned:
                    value, across = value * cosine - across * sine, value * sine + across * cosine
            elif quantity in (VALUE, ANGLE):
                value = real_at(shared, row * robots + other)
                if value != value:
                    continue
                if quantity == ANGLE:
                    across, value = sine_cosine(wrap(value))
            count += 1.0
            if fold in (TOTAL, MEAN, DIRECTION):
                found, other_found = found + value, other_found + across
            elif fold in (LEAST, MOST):
                value = -value if fold == LEAST else value
                best = best if best > value else value  # of 0 and -0 the later one, as NumPy
            else:
                key = -away
                if fold == OUTLIER:
                    dx, dy = dx - middle_x, dy - middle_y
                    key = sqrt(dx * dx + dy * dy)
                if key > best:
                    found, best = value, key
    return found, other_found, count, best
