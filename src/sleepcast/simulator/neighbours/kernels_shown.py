"""Compiled kernels, with numba, that find what each robot senses of one other robot, which it names.

They compute with the formulas of `range_and_bearing`. As in `kernels_neighbours` one text is compiled for the plane and
for worlds in which something flies: what only the latter need is left out where `ball` is None.
"""

from __future__ import annotations

from math import nan, sqrt

import numpy as np

from sleepcast.simulator.neighbours import kernels_field
from sleepcast.simulator.neighbours.kernels_field import unrolled
from sleepcast.simulator.neighbours.kernels_neighbours import (
    COUNT,
    HEIGHT,
    OWN_X,
    OWN_Y,
    OWN_Z,
    PLACE_X,
    PLACE_Y,
    PLACE_Z,
    SENSED_X,
    SENSED_Y,
    SENSED_Z,
    SHARED,
    SIGHT,
    TRUE_HEADING,
    WIDTH,
    by_chance,
    chance_of,
    height_of,
    turn_of,
)
from sleepcast.simulator.neighbours.neighbourhood import AWAY, BEARING, DX, DY, DZ, HEADING, PITCH, Near
from sleepcast.simulator.simd.compiled import strict, woven
from sleepcast.simulator.simd.formulas import arc_tangent, rotated, shortest, sine_cosine
from sleepcast.simulator.simd.lanes import long_at, real_at
from sleepcast.simulator.world import kernels_sight

SEEN_PITCH = int(Near.SEEN_PITCH)


@strict
def show_many(near, quantity, row, robots, others, reach, found):
    """Write what each robot senses of another one into `found`, NaN where it does not sense it: for DX, DY and DZ the
    place at which it senses it in its own frame; as `gather`. others: numbers, perhaps of no robot. reach: m."""
    show_each(near, None, quantity, row, robots, others, reach, found)


@strict
def show_many_in_ball(near, quantity, row, robots, others, reach, found):
    """As `show_many`, where something flies."""
    show_each(near, True, quantity, row, robots, others, reach, found)


@woven
def show_each(near, ball, quantity, row, robots, others, reach, found):
    """See `show_many`."""
    count = long_at(near, COUNT)
    for i in range(len(robots)):
        found[i] = nan
        robot, number = robots[i], others[i]
        if not (number >= 0.0 and number < count):
            continue
        other = np.int64(number)
        if float(other) != number or other == robot:
            continue
        seen, way = way_to(near, ball, robot, other, reach)
        if seen:
            found[i] = quantity_of(near, ball, quantity, row, robot, other, way)


@woven
def way_to(near, ball, robot, other, reach):
    """Whether a robot senses another one, and how it senses the way to it, m, with its length, in the world's frame."""
    own_x, own_y = real_at(long_at(near, OWN_X), robot), real_at(long_at(near, OWN_Y), robot)
    seen_x, seen_y = real_at(long_at(near, PLACE_X), other), real_at(long_at(near, PLACE_Y), other)
    width, height = real_at(near, WIDTH), real_at(near, HEIGHT)
    dx, dy, dz = shortest(seen_x - own_x, width), shortest(seen_y - own_y, height), 0.0
    squares = dx * dx + dy * dy
    if ball is not None:
        dz = height_of(long_at(near, PLACE_Z), other) - height_of(long_at(near, OWN_Z), robot)
        squares = squares + dz * dz
    way = dx, dy, dz, sqrt(squares)
    if way[3] > reach:
        return False, way
    if kernels_field.is_narrow(near):
        ahead, aside, upwards = kernels_field.direction_of(near, robot)
        along = dx * ahead + dy * aside
        if ball is not None:
            along = along + dz * upwards
        if not kernels_field.is_in_field(near, along, way[3]):
            return False, way
    if long_at(long_at(near, SIGHT), kernels_sight.COUNT) > 0:
        seen_x, seen_y = unrolled(own_x, seen_x, width), unrolled(own_y, seen_y, height)
        if kernels_sight.hidden(long_at(near, SIGHT), own_x, own_y, seen_x, seen_y):
            return False, way
    return by_chance(near, ball, chance_of(near), robot, other, way)


@woven
def quantity_of(near, ball, quantity, row, robot, other, way):
    """A quantity of another robot, to which this way leads, for one that senses it."""
    dx, dy, dz, away = way
    if quantity == AWAY:
        return away
    if ball is not None:
        if quantity == DZ:
            return real_at(long_at(near, SENSED_Z), robot) + dz
        if quantity == PITCH:
            return real_at(long_at(near, SEEN_PITCH), other)
    turned, sine, cosine = turn_of(near, robot)
    if turned:
        dx, dy = rotated(dx, dy, sine, cosine)
    if quantity == DX:
        return real_at(long_at(near, SENSED_X), robot) + dx
    if quantity == DY:
        return real_at(long_at(near, SENSED_Y), robot) + dy
    if quantity == HEADING:
        across, along = sine_cosine(real_at(long_at(near, TRUE_HEADING), other))
        if turned:
            along, across = rotated(along, across, sine, cosine)
        return arc_tangent(across, along)
    if quantity == BEARING:
        return arc_tangent(dy, dx) if dx != 0.0 or dy != 0.0 else nan
    return real_at(long_at(near, SHARED), row * long_at(near, COUNT) + other)
