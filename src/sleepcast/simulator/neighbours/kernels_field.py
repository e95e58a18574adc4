"""Compiled formulas of what a robot has in view; see `bodies.field_of_view`, which computes the same.

They read in the table of a neighbourhood, of which each function is given the address.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from sleepcast.simulator.neighbours.neighbourhood import ALL_SIDES, Near, Of
from sleepcast.simulator.simd.compiled import part, woven
from sleepcast.simulator.simd.formulas import sine_cosine
from sleepcast.simulator.simd.lanes import long_at, put_whole, real_at, whole_at

HEADING, PITCH, EDGE, ALL_ROUND = map(int, (Near.OWN_HEADING, Near.PITCH, Near.EDGE, Near.ALL_ROUND))
SORTED_X, SORTED_Y, SORTED_Z = map(int, (Of.SORTED_X, Of.SORTED_Y, Of.SORTED_Z))


@woven
def is_narrow(near):
    """Whether anything is out of view at all."""
    return real_at(near, EDGE) > ALL_SIDES


@woven
def direction_of(near, robot):
    """The unit vector of a robot's own direction."""
    sine, cosine = sine_cosine(real_at(long_at(near, HEADING), robot))
    pitch = long_at(near, PITCH)
    if pitch == 0:
        return cosine, sine, 0.0
    rise, level = sine_cosine(real_at(pitch, robot))
    return cosine * level, sine * level, rise


@woven
def is_in_field(near, along, away):
    """Whether a robot senses what is so far away (m), of which so much lies along its direction."""
    return along >= real_at(near, EDGE) * away or away <= real_at(near, ALL_ROUND)


@part
def in_field(vicinity, ball, near, robot, place, room, taken):
    """Keep those of so many points in a room that lie in the field of view of a robot at this place in the frame of the
    points; gives their number."""
    sorted_x, sorted_y, sorted_z = long_at(vicinity, SORTED_X), long_at(vicinity, SORTED_Y), 0
    (own_x, own_y, own_z), kept = place, 0
    ahead, aside, upwards = direction_of(near, robot)
    if ball is not None:
        sorted_z = long_at(vicinity, SORTED_Z)
    for index in range(taken):
        point = whole_at(room, index)
        at = np.int64(point)
        dx, dy = real_at(sorted_x, at) - own_x, real_at(sorted_y, at) - own_y
        squares, along = dx * dx + dy * dy, dx * ahead + dy * aside
        if ball is not None:
            dz = real_at(sorted_z, at) - own_z
            squares, along = squares + dz * dz, along + dz * upwards
        put_whole(room, kept, point)
        kept += is_in_field(near, along, sqrt(squares))
    return kept
