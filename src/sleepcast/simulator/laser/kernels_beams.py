"""Compiled kernels, with numba, of what beams hit first: the formulas of `beams`, one robot after the other.

Which beams are asked is found with rougher directions than there: it changes nothing, as long as none is left out.
"""

from __future__ import annotations

from math import ceil, floor, inf, sqrt

import numpy as np

from sleepcast.simulator.laser.beams import NUMBERS
from sleepcast.simulator.simd.compiled import part, strict, woven
from sleepcast.simulator.simd.formulas import LANES, TURN, sine_cosine
from sleepcast.simulator.simd.lanes import at, put
from sleepcast.simulator.simd.vectors import either, most_of, root_of
from sleepcast.simulator.sonar.kernels import GOLDEN, U, deviate, mixed
from sleepcast.simulator.world.kernels_sight import cell_at

NEARLY_HALF = np.pi - 1e-3
"""See `beams.NEARLY_HALF`; directions are rougher here."""


@strict
def scan(scene, beams, limits, key, which, first, last, measured):
    """Write what the robots of `which` from `first` to `last` (exclusive) measure; see `beams.scan`.

    scene: the arrays of `beams.BeamScene`, and the size of a cell, columns and rows
    beams: angle of the first one, increment, by how many more beams are asked on each side, and cosines and sines of
        all, padded with LANES zeros
    limits: least, reach, noise, and how far away what has no radius, and the largest body, may be to be hit
    """
    x, y, heading, whose, radii, order, start, listed, items, solids, size, columns, rows = scene
    least, reach, noise, far, farthest = limits
    free = np.empty(len(beams[3]))
    for r in range(first, last):
        i = which[r]
        for k in range(len(free)):
            free[U(k)] = inf
        sine, cosine = sine_cosine(heading[i])
        left, right = cell_at(x[i] - farthest, size, columns), cell_at(x[i] + farthest, size, columns)
        for row in range(cell_at(y[i] - farthest, size, rows), cell_at(y[i] + farthest, size, rows) + 1):
            for p in range(start[row * columns + left], start[row * columns + right + 1]):
                j = order[p]
                dx, dy, radius = x[j] - x[i], y[j] - y[i], radii[whose[j]]
                if dx * dx + dy * dy <= (far + radius) * (far + radius) and whose[j] != i:
                    meet_disc(free, beams, dx * cosine + dy * sine, dy * cosine - dx * sine, radius)
        cell = cell_at(y[i], size, rows) * columns + cell_at(x[i], size, columns)
        for p in range(listed[cell], listed[cell + 1]):
            x0, y0, x1, y1, radius = solids[items[p]]
            if out_of_reach(x0 - x[i], y0 - y[i], x1 - x[i], y1 - y[i], far + radius):
                continue
            ahead, aside = (x0 - x[i]) * cosine + (y0 - y[i]) * sine, (y0 - y[i]) * cosine - (x0 - x[i]) * sine
            if radius > 0.0:
                meet_disc(free, beams, ahead, aside, radius)
                continue
            to_ahead, to_aside = (x1 - x[i]) * cosine + (y1 - y[i]) * sine, (y1 - y[i]) * cosine - (x1 - x[i]) * sine
            meet_line(free, beams, ahead, aside, to_ahead, to_aside)
        tell(free, least, reach, noise, U(i) * U(NUMBERS), key, measured[r])


@woven
def out_of_reach(x0, y0, x1, y1, far):
    """Whether a solid is certainly too far away."""
    return (min(x0, x1) > far) | (max(x0, x1) < -far) | (min(y0, y1) > far) | (max(y0, y1) < -far)


@woven
def tell(free, least, reach, noise, counter, key, measured):
    """Write what is told of the ways that beams are free; see `beams._told`."""
    for k in range(len(measured)):
        way = free[U(k)]
        told = way
        if noise > 0.0:
            told = min(max(way + noise * deviate(mixed((counter + U(k)) * GOLDEN, key)), least), reach)
        told = -inf if way < least else told
        measured[U(k)] = inf if way > reach else told


@woven
def stretches(beams, low, wide):
    """The beams from nearly the angle `low` on, nearly over `wide`: the first one, the one after the last, and the one
    after the last of those around, past beam 0; see `beams._beams_between`."""
    first, increment, margin, count = beams[0], beams[1], beams[2], len(beams[3]) - LANES
    from_ = low - first
    from_ = from_ - TURN * floor(from_ / TURN)
    begin = bounded(ceil(from_ / increment - margin), count)
    end = bounded(floor((from_ + wide) / increment + margin) + 1.0, count)
    again = bounded(floor((from_ + wide - TURN) / increment + margin) + 1.0, count)
    return begin, end, min(again, begin)


@woven
def bounded(number, count):
    """A number as a whole one from 0 to `count`."""
    return np.int64(min(max(number, 0.0), float(count)))


@woven
def direction(dy, dx):
    """Nearly the angle of the vector `dx`, `dy`: off by less than ROUGH (Hastings's polynomial)."""
    along, aside = abs(dx), abs(dy)
    high = max(along, aside)
    t = min(along, aside) / (high if high > 0.0 else 1.0)
    z = t * t
    angle = t * (0.9998660 + z * (-0.3302995 + z * (0.1801410 + z * (-0.0851330 + z * 0.0208351))))
    angle = np.pi / 2.0 - angle if aside > along else angle
    angle = np.pi - angle if dx < 0.0 else angle
    return -angle if dy < 0.0 else angle


@woven
def meet_disc(free, beams, ahead, left, radius):
    """Let beams end at a disc."""
    square = radius * radius
    away = ahead * ahead + left * left
    if away <= square:
        for k in range(len(free)):
            free[U(k)] = 0.0
        return
    share = radius / sqrt(away)
    # At least the arc sine of it, by its series, or by its chord.
    half = share + 0.2 * share * share * share if share < 0.5 else np.pi / 2.0 * share
    begin, end, again = stretches(beams, direction(left, ahead) - half, 2.0 * half)
    disc_between(free, beams[3], beams[4], ahead, left, square, begin, end)
    if again > 0:
        disc_between(free, beams[3], beams[4], ahead, left, square, 0, again)


@woven
def disc_between(free, axis_cos, axis_sin, ahead, left, square, begin, end):
    """See `beams.disc_ranges`. Some beams more are asked, since several at once take no longer than one."""
    for k in range(U(begin), U(end), U(LANES)):
        cosine, sine, before = at(axis_cos, k), at(axis_sin, k), at(free, k)
        aside, along = cosine * left - sine * ahead, cosine * ahead + sine * left
        rest = square - aside * aside
        way = along - root_of(most_of(rest, 0.0))
        way = either(way > 0.0, way, 0.0)
        put(free, k, either((rest >= 0.0) & (along > 0.0) & (way < before), way, before))


@part
def meet_line(free, beams, ahead, left, to_ahead, to_left):
    """Let beams end at a line."""
    turn = ahead * to_left - left * to_ahead
    one, other = direction(left, ahead), direction(to_left, to_ahead)
    between = other - one
    between = between - TURN * floor((between + np.pi) / TURN)
    begin, end, again = 0, len(free) - LANES, 0
    if abs(between) <= NEARLY_HALF and turn != 0.0:
        begin, end, again = stretches(beams, other if between < 0.0 else one, abs(between))
    line_between(free, beams[3], beams[4], ahead, left, to_ahead, to_left, turn, begin, end)
    if again > 0:
        line_between(free, beams[3], beams[4], ahead, left, to_ahead, to_left, turn, 0, again)
    if turn == 0.0:
        along_line(free, beams[3], beams[4], ahead, left, to_ahead, to_left)


@woven
def line_between(free, axis_cos, axis_sin, ahead, left, to_ahead, to_left, turn, begin, end):
    """See `beams.line_ranges`."""
    for k in range(U(begin), U(end), U(LANES)):
        cosine, sine, before = at(axis_cos, k), at(axis_sin, k), at(free, k)
        one, other = cosine * left - sine * ahead, cosine * to_left - sine * to_ahead
        way = turn / (other - one)
        hit = ((one <= 0.0) & (other >= 0.0)) | ((one >= 0.0) & (other <= 0.0))
        hit = hit & (way >= 0.0) & (way < before)
        put(free, k, either(hit, either(way > 0.0, way, 0.0), before))


@part
def along_line(free, axis_cos, axis_sin, ahead, left, to_ahead, to_left):
    """Let beams end that go along a line."""
    for k in range(len(free) - LANES):
        one = axis_cos[k] * left - axis_sin[k] * ahead
        other = axis_cos[k] * to_left - axis_sin[k] * to_ahead
        if one == 0.0 and other == 0.0:
            near = axis_cos[k] * ahead + axis_sin[k] * left
            far = axis_cos[k] * to_ahead + axis_sin[k] * to_left
            if max(near, far) >= 0.0:
                free[k] = min(free[k], max(min(near, far), 0.0))
