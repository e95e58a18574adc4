"""Compiled kernels, with numba, that bring many bodies into order and make readings of ranges; `fast` calls them."""

from __future__ import annotations

from math import sqrt

import numpy as np

from sleepcast.channel import chance
from sleepcast.simulator.compiled import compiled, inlined, strict
from sleepcast.simulator.formulas import sine_cosine
from sleepcast.simulator.noise import MIDDLE, SCALE

F = np.float32
U = np.uint64
GOLDEN = U(chance.GOLDEN)
BLOCK = 64
"""Robots whose readings are turned from rows to columns at a time: they stay in the nearest cache."""


@compiled
def sort(x, y, size, across, up, cells, start, order):
    """Counting sort by cell; see `grid.sort`. cells: room for the cell of each point."""
    start[:] = 0
    for i in range(x.shape[0]):
        column = min(max(int(x[i] / size), 0), across - 1)
        row = min(max(int(y[i] / size), 0), up - 1)
        cells[i] = row * across + column
        start[cells[i] + 1] += 1
    for cell in range(across * up):
        start[cell + 1] += start[cell]
    for i in range(x.shape[0]):
        order[start[cells[i]]] = i
        start[cells[i]] += 1
    for cell in range(across * up, 0, -1):
        start[cell] = start[cell - 1]
    start[0] = 0


@compiled
def arrange(order, x, y, heading, first, last, into):
    """Put positions, and cosine and sine of the headings, into the rows of `into`, in the order of the cells."""
    for i in range(first, last):
        o = order[i]
        into[0, i], into[1, i], into[2, i] = x[o], y[o], heading[o]
    for i in range(first, last):
        into[3, i], into[2, i] = sine_cosine(into[2, i])


@compiled
def fix(x, y, units, first, last, into):
    """Put positions (m) into the rows of `into` (int32), as whole numbers of `units` in a metre; beyond 32 bits they
    begin anew, which does not matter to their differences."""
    for i in range(first, last):
        into[0, i], into[1, i] = np.int32(np.int64(x[i] * units)), np.int32(np.int64(y[i] * units))


@compiled
def enlist(order, place, rows):
    """The `place` of each robot among those who are asked (-1: not asked), in the order of the cells."""
    for i in range(order.shape[0]):
        rows[i] = place[order[i]]


@inlined
def mixed(counter, key):
    """See `chance.mix`."""
    bits = counter * GOLDEN + key
    bits = (bits ^ (bits >> U(30))) * U(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> U(27))) * U(0x94D049BB133111EB)
    return bits ^ (bits >> U(31))


@inlined
def disturbed(seen, counter, share, dropout, most, key, dropout_key):
    """A range with noise; see `noise.disturb`."""
    lost = seen >= most
    if share > 0.0:
        bits = mixed(counter, key)
        total = (bits & U(0xFFFF)) + ((bits >> U(16)) & U(0xFFFF)) + ((bits >> U(32)) & U(0xFFFF)) + (bits >> U(48))
        seen *= F(1.0 + share * (float(np.int64(total) - MIDDLE) * SCALE))
    if dropout > 0.0:
        bits = mixed(counter, dropout_key)
        lost |= float(bits >> U(11)) * 2.0**-53 < dropout
    return most if lost else seen


@compiled
def disturb(seen, which, share, dropout, most, key, dropout_key):
    """See `noise.disturb`."""
    sonars = U(seen.shape[1])
    for row in range(seen.shape[0]):
        counter = U(which[row]) * sonars
        for k in range(seen.shape[1]):
            seen[row, k] = disturbed(seen[row, k], counter + U(k), share, dropout, most, key, dropout_key)


@compiled
def collect(squares, seen):
    """Ranges from their squares, of which there may be more in a row."""
    for q in range(seen.shape[0]):
        for k in range(seen.shape[1]):
            seen[q, k] = sqrt(squares[q, k])


@strict
def tell(seen, which, least, most, front, sensed):
    """See `noise.tell`, without noise. front: numbers of the sonars in front."""
    sonars, shortest = seen.shape[1], F(least)
    told = np.empty(sonars)
    for q in range(which.shape[0]):
        for k in range(sonars):
            value = float(seen[q, k])
            value = most if value > most else value
            told[k] = least if seen[q, k] <= shortest else value
        o, nearest = which[q], told[front[0]]
        for k in range(sonars):
            sensed[k, o] = told[k]
        for k in front:
            nearest = told[k] if (told[k] < nearest) | (told[k] != told[k]) else nearest
        sensed[sonars, o] = nearest


@strict
def hear(squares, which, sonars, noisy, share, dropout, key, dropout_key, least, most, front, sensed):
    """All of these, for so many robots at a time that their ranges stay in the nearest cache."""
    room = np.empty((BLOCK, sonars), F)
    for begin in range(0, which.shape[0], BLOCK):
        some = which[begin : begin + BLOCK]
        seen = room[: some.shape[0]]
        collect(squares[begin:], seen)
        if noisy:
            disturb(seen, some, share, dropout, F(most), key, dropout_key)
        tell(seen, some, least, most, front, sensed)
