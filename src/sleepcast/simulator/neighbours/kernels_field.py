"""Compiled formulas of what a robot has in view, and what hides neighbours; see `bodies.field_of_view` and
`world.sight`, which compute the same.

They read in the table of a neighbourhood, of which each function is given the address.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from sleepcast.simulator.neighbours.neighbourhood import ALL_SIDES, Near, Of
from sleepcast.simulator.simd.compiled import part, woven
from sleepcast.simulator.simd.formulas import LANES, sine_cosine
from sleepcast.simulator.simd.lanes import (
    long_at,
    pack_at,
    put_reals,
    put_whole,
    real_at,
    single_at,
    singles_at,
    stack_room,
    whole_at,
    wholes_at,
)
from sleepcast.simulator.simd.vectors import any_of, how_many, places
from sleepcast.simulator.world import kernels_sight

I = np.int32  # noqa: E741  # as short as U
AT_ONCE = 128
"""Neighbours that are found before something is asked about them."""
ROW = AT_ONCE + LANES
ROOM, WAYS = ROW // 2, ROW
"""Words for their indices, 32 bits each, with room for LANES more; and for two such rows."""
OWN_X, OWN_Y, HEADING, PITCH = map(int, (Near.OWN_X, Near.OWN_Y, Near.OWN_HEADING, Near.PITCH))
EDGE, ALL_ROUND, SIGHT, TORUS = map(int, (Near.EDGE, Near.ALL_ROUND, Near.SIGHT, Near.TORUS))
PLACE_X, PLACE_Y, WIDTH, HEIGHT = map(int, (Near.X, Near.Y, Near.WIDTH, Near.HEIGHT))
WALLS, SORTED_WHOSE = int(Of.WALLS), int(Of.SORTED_WHOSE)
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


@woven
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


# ---- what hides neighbours


@woven
def around(vicinity, near, robot, within, seen):
    """What hides neighbours around a robot, see `kernels_sight.look_around`; walls are -1 where each line has to be
    walked along."""
    if long_at(long_at(near, SIGHT), kernels_sight.COUNT) == 0:
        return 0, 0
    walls = long_at(vicinity, WALLS)
    if walls == 0:
        return -1, 0
    x, y = real_at(long_at(near, OWN_X), robot), real_at(long_at(near, OWN_Y), robot)
    return kernels_sight.look_around(walls, x, y, within, seen)


@woven
def visible(vicinity, near, robot, seen, walls, discs, room, ways, taken):
    """Keep those of so many points in a room that nothing hides from a robot; gives their number. seen, walls, discs:
    see `around`; ways: x and y of the way to each point, float32, in two rows"""
    if walls < 0:
        return walked(vicinity, near, robot, room, 0, taken, 0)
    kept, doubt, depths = 0, np.float32(real_at(long_at(vicinity, WALLS), kernels_sight.DOUBT)), stack_room(LANES)
    for first in range(0, taken, LANES):
        depth = kernels_sight.depth(seen, walls, discs, singles_at(ways, first), singles_at(ways, first + ROW))
        there = places() < I(taken - first)
        if any_of(there & (np.abs(depth) <= doubt)):
            put_reals(depths, 0, depth)
            for index in range(first, min(first + LANES, taken)):
                one = single_at(depths, index - first)
                if abs(one) <= doubt:
                    kept = walked(vicinity, near, robot, room, index, index + 1, kept)
                else:
                    put_whole(room, kept, whole_at(room, index))
                    kept += one < np.float32(0.0)
        else:
            clear = there & (depth < np.float32(0.0))
            pack_at(room, kept, wholes_at(room, first), clear)
            kept += np.int64(how_many(clear))
    return kept


@part
def walked(vicinity, near, robot, room, first, last, kept):
    """Keep those points in a room from `first` to `last` (exclusive) that nothing hides, after so many that are kept;
    gives their number together. For each one the cells between are looked at."""
    x, y = real_at(long_at(near, OWN_X), robot), real_at(long_at(near, OWN_Y), robot)
    for index in range(first, last):
        point = whole_at(room, index)
        seen_x, seen_y = place_of(vicinity, near, x, y, np.int64(point))
        put_whole(room, kept, point)
        kept += not kernels_sight.hidden(long_at(near, SIGHT), x, y, seen_x, seen_y)
    return kept


@woven
def place_of(vicinity, near, x, y, point):
    """Where a sorted point is seen from x, y, in the world's frame."""
    if not long_at(near, TORUS):
        return real_at(long_at(vicinity, SORTED_X), point), real_at(long_at(vicinity, SORTED_Y), point)
    other = np.int64(whole_at(long_at(vicinity, SORTED_WHOSE), point))
    seen_x, seen_y = real_at(long_at(near, PLACE_X), other), real_at(long_at(near, PLACE_Y), other)
    return unrolled(x, seen_x, real_at(near, WIDTH)), unrolled(y, seen_y, real_at(near, HEIGHT))


@part
def unrolled(place, seen, around):
    """See `sight.unrolled`."""
    way, half = seen - place, around / 2.0
    return seen - around if way > half else (seen + around if way < -half else seen)
