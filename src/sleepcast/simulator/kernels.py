"""Compiled kernels, with numba, that bring many bodies into order and make readings of ranges; `fast` calls them."""

from __future__ import annotations

from math import sqrt

import numpy as np

from sleepcast.channel import chance
from sleepcast.simulator.compiled import compiled, inlined, strict
from sleepcast.simulator.formulas import sine_cosine
from sleepcast.simulator.lanes import all_passed, pass_by
from sleepcast.simulator.noise import MIDDLE, SCALE

F = np.float32
U = np.uint64
GOLDEN = U(chance.GOLDEN)

BLOCK = 64
"""Robots whose readings are turned from rows to columns at a time: they stay in the nearest cache."""
LINE = 8
"""Numbers of a reading in a line of the caches."""


@compiled
def count(x, y, size, across, up, first, last, cells, counts):
    """The first step of a counting sort by cell, see `grid.sort`: the cells of the points from `first` up to `last`,
    and in `counts`, which is 0, how many of them lie in each."""
    for i in range(first, last):
        column = min(max(int(x[i] / size), 0), across - 1)
        row = min(max(int(y[i] / size), 0), up - 1)
        cells[i] = row * across + column
        counts[cells[i]] += 1


@compiled
def begin(counts, start):
    """The second step: where each cell begins, and in it the points of each stretch, where `counts` has said how
    many."""
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
    """The third step: the order. places: where the points of this stretch begin in each cell; changed."""
    for i in range(first, last):
        order[places[cells[i]]] = i
        places[cells[i]] += 1


@compiled
def arrange(order, x, y, heading, first, last, into):
    """Put positions, and cosine and sine of the headings, into the rows of `into`, in the order of the cells."""
    for i in range(first, last):
        o = order[i]
        into[0, i], into[1, i], into[2, i] = x[o], y[o], heading[o]
    for i in range(first, last):
        into[3, i], into[2, i] = sine_cosine(into[2, i])


@compiled
def fix(order, x, y, units, first, last, fixed_x, fixed_y):
    """Put positions (m) in the order of the cells, as whole numbers of `units` in a metre, into `fixed_x` and `fixed_y`
    (int32); beyond 32 bits they begin anew, which does not matter to their differences."""
    for i in range(first, last):
        o = order[i]
        fixed_x[i], fixed_y[i] = np.int32(np.int64(x[o] * units)), np.int32(np.int64(y[o] * units))


@compiled
def enlist(order, place, rows):
    """The `place` of each robot among those who are asked (-1: not asked), in the order of the cells."""
    for i in range(order.shape[0]):
        rows[i] = place[order[i]]


@inlined
def mixed(multiple, key):
    """See `chance.mix`. multiple: of the counter, by `GOLDEN`."""
    bits = multiple + key
    bits = (bits ^ (bits >> U(30))) * U(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> U(27))) * U(0x94D049BB133111EB)
    return bits ^ (bits >> U(31))


@inlined
def disturbed(seen, multiple, share, dropout, most, key, dropout_key):
    """A range with noise; see `noise.disturb`."""
    lost = seen >= most
    if share > 0.0:
        bits = mixed(multiple, key)
        total = (bits & U(0xFFFF)) + ((bits >> U(16)) & U(0xFFFF)) + ((bits >> U(32)) & U(0xFFFF)) + (bits >> U(48))
        seen *= F(1.0 + share * (float(np.int64(total) - MIDDLE) * SCALE))
    if dropout > 0.0:
        bits = mixed(multiple, dropout_key)
        lost |= float(bits >> U(11)) * 2.0**-53 < dropout
    return most if lost else seen


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
    """Ranges from their squares, of which there may be more in a row."""
    for q in range(seen.shape[0]):
        for k in range(seen.shape[1]):
            seen[q, k] = sqrt(squares[q, k])


@strict
def tell(seen, which, least, most, front, wanted, sensed):
    """See `noise.tell`, without noise. front: numbers of the sonars in front; wanted: which rows of `sensed` are."""
    sonars, shortest = seen.shape[1], F(least)
    told = np.empty(sonars)
    for q in range(which.shape[0]):
        for k in range(sonars):
            value = float(seen[q, k])
            value = most if value > most else value
            told[k] = least if seen[q, k] <= shortest else value
        o, nearest = which[q], told[front[0]]
        for k in range(sonars):
            if wanted[k]:
                sensed[k, o] = told[k]
        if not wanted[sonars]:
            continue
        for k in front:
            nearest = told[k] if (told[k] < nearest) | (told[k] != told[k]) else nearest
        sensed[sonars, o] = nearest


@compiled
def hear(squares, which, noise, least, most, front, wanted, sensed, edge):
    """Make readings of squared ranges, which are known: `collect`, `disturb`, `tell`, sonar by sonar for a block of
    robots. noise: share, dropout and their keys. edge: for which robot, of LINE, a line of the caches begins in all
    rows of `sensed`, or -1."""
    (share, dropout, key, dropout_key), sonars, count = noise, sensed.shape[0] - 1, which.shape[0]
    seen, multiples, told, nearest = np.empty(BLOCK, F), np.empty(BLOCK, U), np.empty(BLOCK), np.empty(BLOCK)
    ahead = np.zeros(sonars, np.bool_)
    for k in front:
        ahead[k] = wanted[sonars]
    begin, end = 0, BLOCK if edge < 0 or count == 0 else (edge - which[0]) % LINE
    while begin < count:
        end = min(end, count)
        some = which[begin:end]
        streams = edge >= 0 and end - begin == BLOCK and side_by_side(some)
        for q in range(end - begin):
            multiples[q], nearest[q] = U(some[q]) * U(sonars) * GOLDEN, most
        for k in range(sonars):
            if not (wanted[k] or ahead[k]):
                continue
            listen(squares[begin:end], k, multiples, share, dropout, key, dropout_key, least, most, seen, told)
            if ahead[k]:
                for q in range(end - begin):
                    nearest[q] = min(nearest[q], told[q])
            if wanted[k]:
                spread(told, some, sensed, k, streams)
        if wanted[sonars]:
            spread(nearest, some, sensed, sonars, streams)
        begin, end = end, end + BLOCK
    all_passed()


@inlined
def side_by_side(which):
    """Whether these are neighbours, one after the other."""
    apart = 0
    for q in range(which.shape[0]):
        apart |= which[q] - which[0] - q
    return apart == 0


@inlined
def listen(squares, k, multiples, share, dropout, key, dropout_key, least, most, seen, told):
    """What these robots read of sonar k."""
    shortest, longest, more = F(least), F(most), U(k) * GOLDEN
    for q in range(squares.shape[0]):
        seen[q] = squares[q, k]
    for q in range(squares.shape[0]):
        value = disturbed(F(sqrt(seen[q])), multiples[q] + more, share, dropout, longest, key, dropout_key)
        told[q] = least if value <= shortest else min(float(value), most)


@inlined
def spread(told, which, sensed, row, streams):
    """Put what these robots are told where they look for it."""
    if streams:
        for q in range(0, BLOCK, LINE):
            pass_by(told, q, sensed, row, which[0] + q)
    else:
        for q in range(which.shape[0]):
            sensed[row, which[q]] = told[q]
