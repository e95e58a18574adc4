"""Compiled kernels, with numba, that find what each robot senses of one other robot, which it names.

They compute with the formulas of `range_and_bearing`. As in `kernels_neighbours` one text is compiled for the plane and
for worlds in which something flies: what only the latter need is left out where `ball` is None.
"""

from __future__ import annotations

from math import nan, sqrt

import numpy as np

from sleepcast.simulator.neighbours import kernels_field
from sleepcast.simulator.neighbours.kernels_neighbours import height_of, unrolled
from sleepcast.simulator.neighbours.neighbourhood import AWAY, BEARING, DX, DY, DZ, HEADING, PITCH, Near
from sleepcast.simulator.simd.compiled import strict, woven
from sleepcast.simulator.simd.formulas import arc_tangent, shortest, sine_cosine, wrap
from sleepcast.simulator.simd.lanes import long_at, real_at
from sleepcast.simulator.sonar.kernels import GOLDEN, U, deviate, mixed
from sleepcast.simulator.world import kernels_sight

COUNT, SHARED, TURNED, SIGHT, SEEN_PITCH = map(int, (Near.COUNT, Near.SHARED, Near.TURNED, Near.SIGHT, Near.SEEN_PITCH))
PLACE_X, PLACE_Y, PLACE_Z, TRUE_HEADING = map(int, (Near.X, Near.Y, Near.Z, Near.HEADING))
SENSED_X, SENSED_Y, SENSED_Z, SENSED_HEADING = map(
    int, (Near.SENSED_X, Near.SENSED_Y, Near.SENSED_Z, Near.SENSED_HEADING)
)
OWN_X, OWN_Y, OWN_Z, OWN_HEADING = map(int, (Near.OWN_X, Near.OWN_Y, Near.OWN_Z, Near.OWN_HEADING))
WIDTH, HEIGHT, LOSS, NOISE = map(int, (Near.WIDTH, Near.HEIGHT, Near.LOSS, Near.NOISE))
LOST_KEY, ACROSS_KEY, UP_KEY, ABOVE_KEY = map(int, (Near.LOST_KEY, Near.ACROSS_KEY, Near.UP_KEY, Near.ABOVE_KEY))


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
        seen, dx, dy, dz, away = way_to(near, ball, robot, other, reach)
        if seen:
            found[i] = quantity_of(near, ball, quantity, row, robot, other, (dx, dy, dz, away))


@woven
def way_to(near, ball, robot, other, reach):
    """Whether a robot senses another one, and the way to it as it is sensed, with its length, in the world's frame."""
    own_x, own_y = real_at(long_at(near, OWN_X), robot), real_at(long_at(near, OWN_Y), robot)
    seen_x, seen_y = real_at(long_at(near, PLACE_X), other), real_at(long_at(near, PLACE_Y), other)
    width, height = real_at(near, WIDTH), real_at(near, HEIGHT)
    dx, dy, dz = shortest(seen_x - own_x, width), shortest(seen_y - own_y, height), 0.0
    squares = dx * dx + dy * dy
    if ball is not None:
        dz = height_of(long_at(near, PLACE_Z), other) - height_of(long_at(near, OWN_Z), robot)
        squares = squares + dz * dz
    away = sqrt(squares)
    if away > reach:
        return False, dx, dy, dz, away
    if kernels_field.is_narrow(near):
        ahead, aside, upwards = kernels_field.direction_of(near, robot)
        along = dx * ahead + dy * aside
        if ball is not None:
            along = along + dz * upwards
        if not kernels_field.is_in_field(near, along, away):
            return False, dx, dy, dz, away
    if long_at(long_at(near, SIGHT), kernels_sight.COUNT) > 0:
        seen_x, seen_y = unrolled(own_x, seen_x, width), unrolled(own_y, seen_y, height)
        if kernels_sight.hidden(long_at(near, SIGHT), own_x, own_y, seen_x, seen_y):
            return False, dx, dy, dz, away
    loss, noise = real_at(near, LOSS), real_at(near, NOISE)
    if loss > 0.0 or noise > 0.0:
        multiple = ((U(other) << U(32)) + U(robot)) * GOLDEN
        if loss > 0.0 and float(mixed(multiple, U(long_at(near, LOST_KEY))) >> U(11)) * 2.0**-53 < loss:
            return False, dx, dy, dz, away
        if noise > 0.0:
            wide = noise * away
            dx = dx + wide * deviate(mixed(multiple, U(long_at(near, ACROSS_KEY))))
            dy = dy + wide * deviate(mixed(multiple, U(long_at(near, UP_KEY))))
            squares = dx * dx + dy * dy
            if ball is not None:
                dz = dz + wide * deviate(mixed(multiple, U(long_at(near, ABOVE_KEY))))
                squares = squares + dz * dz
            away = sqrt(squares)
    return True, dx, dy, dz, away


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
    turned, sine, cosine = long_at(near, TURNED), 0.0, 1.0
    if turned:
        sensed_heading, own_heading = long_at(near, SENSED_HEADING), long_at(near, OWN_HEADING)
        sine, cosine = sine_cosine(wrap(real_at(sensed_heading, robot) - real_at(own_heading, robot)))
        dx, dy = dx * cosine - dy * sine, dx * sine + dy * cosine
    if quantity == DX:
        return real_at(long_at(near, SENSED_X), robot) + dx
    if quantity == DY:
        return real_at(long_at(near, SENSED_Y), robot) + dy
    if quantity == HEADING:
        across, along = sine_cosine(real_at(long_at(near, TRUE_HEADING), other))
        if turned:
            along, across = along * cosine - across * sine, along * sine + across * cosine
        return arc_tangent(across, along)
    if quantity == BEARING:
        return arc_tangent(dy, dx) if dx != 0.0 or dy != 0.0 else nan
    return real_at(long_at(near, SHARED), row * long_at(near, COUNT) + other)
