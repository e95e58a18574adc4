"""Compiled kernels, with numba, that sort bodies by cell and turn ranges into readings; `fast` calls them."""

from __future__ import annotations

from math import sqrt

import numpy as np

from sleepcast.core import counter_rng
from sleepcast.simulator.simd.compiled import compiled, inlined, part, strict, woven
from sleepcast.simulator.simd.formulas import LANES, either, sine_cosine
from sleepcast.simulator.simd.lanes import all_passed, at, put, put_by, put_some, put_turned, some
from sleepcast.simulator.simd.vectors import counted, doubles, every, least_of, most_of, root_of, shorts, singles
from sleepcast.simulator.sonar.noise import MIDDLE, SCALE

F = np.float32
I = np.int32  # noqa: E741  # as short as F
U = np.uint64
GOLDEN = U(counter_rng.GOLDEN)

BLOCK = 64
"""Robots whose readings are transposed at a time: they stay in the first-level cache."""
LINE = 8
"""Readings in one cache line."""


@compiled
def count(x, y, size, grid_columns, grid_rows, first, last, cells, counts):
    """First step of a counting sort by cell, see `grid.sort`: writes the cells of the points from `first` to `last`
    (exclusive), and counts the points of each cell in `counts`, which must be 0."""
    whole = last - (last - first) % LANES
    for i in range(first, whole, LANES):
        count_some(x, y, size, grid_columns, grid_rows, i, None, cells, counts)
    if whole < last:
        count_some(x, y, size, grid_columns, grid_rows, whole, last - whole, cells, counts)


@inlined
def count_some(x, y, size, grid_columns, grid_rows, first, most, cells, counts):
    """As `count`, for LANES points, or for at most `most`."""
    columns = most_of(least_of(some(x, first, most) / size, grid_columns - 1.0), 0.0)
    rows = most_of(least_of(some(y, first, most) / size, grid_rows - 1.0), 0.0)
    put_some(cells, first, shorts(rows) * I(grid_columns) + shorts(columns), most)
    for i in range(first, first + (LANES if most is None else most)):
        counts[U(cells[i])] += 1


@compiled
def begin(counts, start):
    """Second step: where each cell begins, and within it the points of each slice; `counts` holds their numbers."""
    total = 0
    for cell in range(counts.shape[1]):
        start[cell] = total
        for stretch in range(counts.shape[0]):
            these = counts[stretch, cell]
            counts[stretch, cell] = total
            total += these
    start[counts.shape[1]] = total


@compiled
def place(cells, first, last, places, order):
    """Third step: the sorted order. places: where the points of this slice begin in each cell; changed."""
    for i in range(first, last):
        cell = U(cells[i])
        order[U(places[cell])] = i
        places[cell] += 1


@strict
def candidates(x, y, start, size, grid_columns, grid_rows, reach, counts):
    """See `grid.candidates`: writes them into `counts`."""
    for i in range(x.shape[0]):
        first, last, left, right = cells_around(x[i], y[i], size, grid_columns, grid_rows, reach)
        counts[i] = 0
        for row in range(first, last):
            counts[i] += start[row * grid_columns + right] - start[row * grid_columns + left]


@strict
def pairs(x, y, order, start, size, grid_columns, grid_rows, reach, which, first, second):
    """See `grid.pairs`: writes the pairs of the points `which` into `first` and `second`, and returns their number."""
    sorted_x, sorted_y = np.empty(order.shape[0]), np.empty(order.shape[0])
    for k in range(order.shape[0]):
        sorted_x[k], sorted_y[k] = x[U(order[k])], y[U(order[k])]
    count = 0
    for index in range(which.shape[0]):
        i = which[index]
        own_x, own_y = x[i], y[i]
        lowest, last, left, right = cells_around(own_x, own_y, size, grid_columns, grid_rows, reach)
        for row in range(lowest, last):
            for k in range(start[row * grid_columns + left], start[row * grid_columns + right]):
                aside, above = own_x - sorted_x[U(k)], own_y - sorted_y[U(k)]
                j = order[U(k)]
                # Written whether it counts or not, and then overwritten: faster than a branch that is hard to predict.
                first[U(count)], second[U(count)] = i, j
                count += (aside * aside + above * above <= reach * reach) & (i != j)
    return count


@part
def cells_around(x, y, size, grid_columns, grid_rows, reach):
    """The cells within `reach` m of a point: the first row and the one after the last, and the same of columns."""
    row, cells = min(max(int(y / size), 0), grid_rows - 1), int(np.ceil(reach / size))
    left, right = int((x - reach) / size), int((x + reach) / size)
    left, right = min(max(left, 0), grid_columns - 1), min(max(right, 0), grid_columns - 1)
    return max(row - cells, 0), min(row + cells, grid_rows - 1) + 1, left, right + 1


@compiled
def arrange(order, x, y, heading, first, last, into):
    """Write positions, and cosine and sine of the headings, into the rows of `into`, sorted by cell."""
    for i in range(first, last):
        o = U(order[i])
        into[0, i], into[1, i], into[2, i] = x[o], y[o], heading[o]
    for i in range(first, last):
        into[3, i], into[2, i] = sine_cosine(into[2, i])


@compiled
def fix(order, x, y, units, first, last, fixed_x, fixed_y):
    """Write positions (m), sorted by cell, as integers of `units` per metre into `fixed_x` and `fixed_y` (int32). They
    wrap around beyond 32 bits, which leaves differences correct."""
    for i in range(first, last):
        o = U(order[i])
        fixed_x[i], fixed_y[i] = np.int32(np.int64(x[o] * units)), np.int32(np.int64(y[o] * units))


@compiled
def enlist(order, place, rows):
    """For each robot, sorted by cell, its `place` in the request (-1: not requested)."""
    for i in range(order.shape[0]):
        rows[i] = place[order[i]]


@woven
def mixed(multiple, key):
    """See `counter_rng.mix`. multiple: the counter times `GOLDEN`; one number or LANES."""
    bits = multiple + key
    bits = (bits ^ (bits >> U(30))) * U(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> U(27))) * U(0x94D049BB133111EB)
    return bits ^ (bits >> U(31))


@woven
def deviate(bits):
    """See `noise.deviates`."""
    pairs = (bits & U(0xFFFF0000FFFF)) + ((bits >> U(16)) & U(0xFFFF0000FFFF))
    return (counted((pairs & U(0xFFFFFFFF)) + (pairs >> U(32))) - float(MIDDLE)) * SCALE


@woven
def disturbed(seen, multiple, share, dropout, most, key, dropout_key):
    """Ranges with noise, one number or LANES; see `noise.disturb`."""
    lost = seen >= most
    if share > 0.0:
        seen = seen * singles(1.0 + share * deviate(mixed(multiple, key)))
    if dropout > 0.0:
        lost = lost | (counted(mixed(multiple, dropout_key) >> U(11)) * 2.0**-53 < dropout)
    return either(lost, most, seen)


@compiled
def disturb(seen, which, share, dropout, most, key, dropout_key):
    """See `noise.disturb`."""
    sonars = U(seen.shape[1])
    for row in range(seen.shape[0]):
        multiple = U(which[row]) * sonars * GOLDEN
        for k in range(seen.shape[1]):
            seen[row, k] = disturbed(seen[row, k], multiple + U(k) * GOLDEN, share, dropout, most, key, dropout_key)


@compiled
def collect(squares, seen):
    """Ranges from their squares, whose rows may be longer."""
    for q in range(seen.shape[0]):
        for k in range(seen.shape[1]):
            seen[q, k] = sqrt(squares[q, k])


@strict
def tell(seen, which, least, most, front, wanted, sensed):
    """See `noise.tell`, without noise. front: numbers of the front sonars; wanted: the requested rows of `sensed`."""
    sonars, shortest = seen.shape[1], F(least)
    reported = np.empty(sonars)
    for q in range(which.shape[0]):
        for k in range(sonars):
            value = float(seen[q, k])
            value = most if value > most else value
            reported[k] = least if seen[q, k] <= shortest else value
        o, nearest = which[q], reported[front[0]]
        for k in range(sonars):
            if wanted[k]:
                sensed[k, o] = reported[k]
        if not wanted[sonars]:
            continue
        for k in front:
            nearest = reported[k] if (reported[k] < nearest) | (reported[k] != reported[k]) else nearest
        sensed[sonars, o] = nearest


@compiled
def hear(squares, which, noise, least, most, front, wanted, sensed, edge):
    """Turn squared ranges into readings: `collect`, `disturb` and `tell`, sonar by sonar for a block of robots. noise:
    share, dropout and their keys. edge: the robot, modulo LINE, at which a cache line begins in all rows of `sensed`,
    or -1."""
    (share, dropout, key, dropout_key), sonars, count = noise, sensed.shape[0] - 1, which.shape[0]
    room, multiples = np.empty(squares.shape[1] * BLOCK + 2 * LINE, F), np.zeros(BLOCK, U)
    turned = room[-room.ctypes.data % 64 // 4 :]
    reported, nearest = np.empty(LANES), np.full(LANES, most)
    ahead = np.zeros(sonars, np.bool_)
    for k in front:
        ahead[k] = wanted[sonars]
    begin, end = 0, BLOCK if edge < 0 or count == 0 else (edge - which[0]) % LINE
    while begin < count:
        end = min(end, count)
        some = which[begin:end]
        streams = edge >= 0 and end - begin == BLOCK and side_by_side(some)
        for q in range(end - begin):
            multiples[q] = U(some[q]) * U(sonars) * GOLDEN
        turn_over(squares, begin, end, turned)
        for q in range(0, end - begin, LANES):
            for k in range(sonars):
                if not (wanted[k] or ahead[k]):
                    continue
                more = U(k) * GOLDEN
                value = listen(
                    *(at(turned, k * BLOCK + q), at(multiples, q), share, dropout, key + more, dropout_key + more),
                    *(least, most),
                )
                if ahead[k]:
                    put(nearest, 0, least_of(at(nearest, 0), value))
                if wanted[k]:
                    spread(value, some, q, sensed, k, streams, reported)
            if wanted[sonars]:
                spread(at(nearest, 0), some, q, sensed, sonars, streams, reported)
                put(nearest, 0, every(most))
        begin, end = end, end + BLOCK
    all_passed()


@inlined
def turn_over(squares, begin, end, turned):
    """Transpose the squared ranges of a block of robots to rows by sonar, LANES at a time."""
    for q in range(0, end - begin, LANES):
        for k in range(0, squares.shape[1], LANES):
            put_turned(squares, begin + q, k, end - 1, turned, k * BLOCK + q, BLOCK)


@inlined
def side_by_side(which):
    """Whether these indices are consecutive."""
    apart = 0
    for q in range(which.shape[0]):
        apart |= which[q] - which[0] - q
    return apart == 0


@inlined
def listen(squared, multiple, share, dropout, key, dropout_key, least, most):
    """Readings of one sonar of LANES robots."""
    value = disturbed(root_of(squared), multiple, share, dropout, F(most), key, dropout_key)
    return either(value <= F(least), least, least_of(doubles(value), most))


@inlined
def spread(values, which, first, sensed, row, streams, reported):
    """Store the readings of the robots from `first` on in the sensor table."""
    if streams:
        put_by(sensed, row, which[0] + first, values)
        return
    put(reported, 0, values)
    for q in range(min(which.shape[0] - first, LANES)):
        sensed[row, which[first + q]] = reported[q]
