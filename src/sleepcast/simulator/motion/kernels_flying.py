"""Compiled kernels of bodies that hover, with numba: `Flight.step` is the NumPy version, with the same bits.

They know the ground alone: no roofs and no planes. Bodies are processed in blocks: first what is no number
with a point (who goes to a place, who is held, who has run dry), then the formulas of `flying`, LANES bodies at a time;
the end of a slice may have fewer (`most`, else None).
"""

from __future__ import annotations

from math import nan

import numpy as np

from sleepcast.simulator.motion.driving import DRIVE, GOTO, bounded
from sleepcast.simulator.motion.flying import (
    AT_FENCE,
    FORMULAS,
    LANDS,
    climb_for,
    climbed,
    driven,
    fallen,
    homed,
    kept_within,
    left_of,
    lifted,
    reached,
    steered,
    turned,
    within_edges,
)
from sleepcast.simulator.motion.kernels_motion import wrapped
from sleepcast.simulator.simd.compiled import part, strict, usable, woven
from sleepcast.simulator.simd.formulas import LANES, either, rotated, shortest, sine_cosine
from sleepcast.simulator.simd.lanes import at, put, put_some, some
from sleepcast.simulator.simd.vectors import any_of, every
from sleepcast.simulator.world.roofs import GROUND

BLOCK = 256
"""Bodies whose data stay in the nearest caches."""
GOES, FREE, LANDED, WAY, CLIMB = range(0, 5 * BLOCK, BLOCK)
"""Offsets in a block's scratch array: whether bodies go to a place, whether nothing holds them, whether they have come
down; how far they have gone over the ground and, those that motors keep in the air, how far they have climbed, m."""
ROOM = 5 * BLOCK + LANES

for each in FORMULAS:
    usable(each)


@strict
def fly(bodies, laws, power, first, last):
    """See `Flight.step`: for the bodies from `first` to `last` (exclusive), all of one type that hovers. bodies:
    `flying.FlightColumns`; power: `flying.Power`."""
    mode, held, wanted_speed, wanted_turn, wanted_side, wanted_climb, target_x, target_y, target_z = bodies[:9]
    x, y, z, heading, velocity_x, velocity_y, climb_rate, armed, flying, height, speed, turn_rate = bodies[9:21]
    way_x, way_y, way_z, stores, wind_east, wind_north, anchor_x, anchor_y = bodies[21:]
    uses, ends, battery, per_second, per_climb = power
    room = np.zeros(ROOM)
    for begin in range(first, last, BLOCK):
        end = min(begin + BLOCK, last)
        note(mode, held, room, begin, end)
        for store in range(len(ends)):
            if ends[store]:
                land_empty(
                    *(stores[store], mode, wanted_speed, wanted_turn, wanted_side, wanted_climb, target_z),
                    *(room, begin, end),
                )
        set_out(
            *(laws, wanted_speed, wanted_turn, wanted_side, wanted_climb),
            *(target_x, target_y, target_z, x, y, z, heading, velocity_x, velocity_y, climb_rate, armed, flying),
            *(height, speed, turn_rate, way_x, way_y, way_z, wind_east, wind_north),
            *(anchor_x, anchor_y, room, begin, end),
        )
        stop_landed(mode, room, begin, end)
        for store in range(len(uses)):
            if uses[store] != 0.0:
                spend(stores[store], uses[store], room, begin, end)
        if battery >= 0:
            discharge(stores[battery], per_second * laws.tick, per_climb, room, begin, end)


@strict
def at_fence(bodies, laws, told, first, last):
    """How many of these bodies may be held by their fence since the tick that is over, of those that were not `told`
    of; who is not driven there any more is not. See `fences.Fences`, which looks more closely."""
    mode, held, wanted_speed, wanted_side = bodies[0], bodies[1], bodies[2], bodies[4]
    x, y, armed = bodies[9], bodies[10], bodies[16]
    left, bottom, right, top = laws.edges
    found = 0
    for i in range(first, last):
        room = min(min(x[i] - left, right - x[i]), min(y[i] - bottom, top - y[i]))
        driven = mode[i] == DRIVE and not held[i] and (wanted_speed[i] != 0.0 or wanted_side[i] != 0.0)
        if not (room <= AT_FENCE and driven and armed[i] > 0.0):
            told[i] = False
        elif not told[i]:
            found += 1
    return found


@part
def note(mode, held, room, first, last):
    """Write into the room who of these bodies goes to a place, and whom nothing holds."""
    for i in range(first, last):
        room[GOES + i - first] = 1.0 if mode[i] == GOTO else 0.0
        room[FREE + i - first] = 0.0 if held[i] else 1.0


@part
def land_empty(
    store, mode, wanted_speed, wanted_turn, wanted_side, wanted_climb, target_z, room, first, last
):  # fmt: skip
    """Let those of these bodies land that have used up a store, whatever holds them."""
    for i in range(first, last):
        if store[i] <= 0.0:
            mode[i], target_z[i] = DRIVE, LANDS
            wanted_speed[i] = wanted_turn[i] = wanted_side[i] = wanted_climb[i] = 0.0
            room[GOES + i - first], room[FREE + i - first] = 0.0, 1.0


@part
def set_out(
    laws, wanted_speed, wanted_turn, wanted_side, wanted_climb, target_x, target_y, target_z, x, y,
    z, heading, velocity_x, velocity_y, climb_rate, armed, flying, height, speed, turn_rate, way_x, way_y, way_z,
    wind_east, wind_north, anchor_x, anchor_y, room, begin, end,
):  # fmt: skip
    """Move these bodies through a tick."""
    whole = end - (end - begin) % LANES
    for i in range(begin, whole, LANES):
        some_set_out(
            *(laws, wanted_speed, wanted_turn, wanted_side, wanted_climb),
            *(target_x, target_y, target_z, x, y, z, heading, velocity_x, velocity_y, climb_rate, armed, flying),
            *(height, speed, turn_rate, way_x, way_y, way_z, wind_east, wind_north),
            *(anchor_x, anchor_y, room, begin, i, None),
        )
    if whole < end:
        some_set_out(
            *(laws, wanted_speed, wanted_turn, wanted_side, wanted_climb),
            *(target_x, target_y, target_z, x, y, z, heading, velocity_x, velocity_y, climb_rate, armed, flying),
            *(height, speed, turn_rate, way_x, way_y, way_z, wind_east, wind_north),
            *(anchor_x, anchor_y, room, begin, whole, end - whole),
        )


@woven
def some_set_out(
    laws, wanted_speed, wanted_turn, wanted_side, wanted_climb, target_x, target_y, target_z, x, y,
    z, heading, velocity_x, velocity_y, climb_rate, armed, flying, height, speed, turn_rate, way_x, way_y, way_z,
    wind_east, wind_north, anchor_x, anchor_y, room, begin, i, most,
):  # fmt: skip
    """As `set_out`, for at most `most` bodies from `i` on."""
    own_x, own_y, own_z, on = some(x, i, most), some(y, i, most), some(z, i, most), some(armed, i, most)
    climb, old_rate = some(wanted_climb, i, most), some(climb_rate, i, most)
    target = either(climb != 0.0, nan, some(target_z, i, most))
    goes, turns = at(room, GOES + i - begin) != 0.0, at(room, GOES + i - begin) == 0.0
    up = ((own_z > GROUND) | (target > GROUND)) & (on > 0.0)
    falls = (own_z > GROUND) & (on == 0.0)
    moves, ahead = up & (at(room, FREE + i - begin) != 0.0), target != LANDS
    turn = turned(laws, moves & turns & ahead, some(wanted_turn, i, most))
    towards = wrapped(some(heading, i, most) + turn)
    east, north = driven(laws, towards, some(wanted_speed, i, most), some(wanted_side, i, most))
    if any_of(goes):
        dx = shortest(some(target_x, i, most) - own_x, laws.around_x)
        dy = shortest(some(target_y, i, most) - own_y, laws.around_y)
        to_east, to_north = homed(laws, dx, dy)
        east, north = either(goes, to_east, east), either(goes, to_north, north)
    east, north = within_edges(laws, own_x, own_y, east, north)
    east, north = either(moves & ahead, east, 0.0), either(moves & ahead, north, 0.0)
    if len(anchor_x):
        east, north = against_wind(
            *(laws, own_x, own_y, up, goes & moves & ahead, east, north),
            *(wind_east, wind_north, anchor_x, anchor_y, i, most),
        )
    east, north = steered(laws, (some(velocity_x, i, most), some(velocity_y, i, most)), (east, north))
    east, north = either(up, east, 0.0), either(up, north, 0.0)
    wanted = climb_for(laws, target, target - own_z, climbed(laws, some(height, i, most), own_z - GROUND, climb))
    rate = lifted(laws, old_rate, either(moves, wanted, 0.0))
    rate = either(up, rate, either(falls, fallen(laws, old_rate), 0.0))
    dx, dy, dz = east * laws.tick, north * laws.tick, rate * laws.tick
    dz = either(falls, (old_rate + rate) / 2.0 * laws.tick, dz)
    put(room, WAY + i - begin, np.sqrt(dx * dx + dy * dy))
    put(room, CLIMB + i - begin, either(up, left_of(dz, 0.0), -1.0))
    new_x, new_y = kept_within(laws, own_x, own_y, dx, dy)
    new_z = own_z + dz
    landed = (up | falls) & (new_z <= GROUND)
    put(room, LANDED + i - begin, either(landed, every(1.0), 0.0))
    if any_of(landed):
        new_z, on, rate = either(landed, GROUND, new_z), either(landed, 0.0, on), either(landed, 0.0, rate)
        east, north, target = either(landed, 0.0, east), either(landed, 0.0, north), either(landed, nan, target)
        put_some(wanted_speed, i, either(landed, 0.0, some(wanted_speed, i, most)), most)
        put_some(wanted_turn, i, either(landed, 0.0, some(wanted_turn, i, most)), most)
        put_some(wanted_side, i, either(landed, 0.0, some(wanted_side, i, most)), most)
        put_some(wanted_climb, i, either(landed, 0.0, climb), most)
        if len(anchor_x):
            put_some(anchor_x, i, either(landed, nan, some(anchor_x, i, most)), most)
            put_some(anchor_y, i, either(landed, nan, some(anchor_y, i, most)), most)
    put_some(target_z, i, target, most)
    put_some(way_x, i, new_x - own_x, most)
    put_some(way_y, i, new_y - own_y, most)
    put_some(way_z, i, new_z - own_z, most)
    put_some(x, i, new_x, most)
    put_some(y, i, new_y, most)
    put_some(z, i, new_z, most)
    put_some(heading, i, towards, most)
    put_some(velocity_x, i, east, most)
    put_some(velocity_y, i, north, most)
    put_some(climb_rate, i, rate, most)
    put_some(armed, i, on, most)
    sine, cosine = sine_cosine(-towards)
    along, _ = rotated(east, north, sine, cosine)
    put_some(speed, i, bounded(along, -laws.speed, laws.speed), most)
    put_some(turn_rate, i, turn / laws.tick, most)
    new_height = new_z - GROUND
    put_some(height, i, new_height, most)
    put_some(flying, i, either((new_height > 0.0) & (on > 0.0), every(1.0), 0.0), most)


@woven
def against_wind(
    laws, own_x, own_y, up, on_the_way, east, north, wind_east, wind_north, anchor_x, anchor_y, i,
    most,
):  # fmt: skip
    """See `Flight._against_wind`."""
    still = either(on_the_way, every(1.0), 0.0) == 0.0
    rests = up & still & (east == 0.0) & (north == 0.0)
    at_x, at_y = some(anchor_x, i, most), some(anchor_y, i, most)
    held = rests & (at_x == at_x)
    put_some(anchor_x, i, either(held, at_x, either(rests, own_x, nan)), most)
    put_some(anchor_y, i, either(held, at_y, either(rests, own_y, nan)), most)
    dx = either(held, shortest(at_x - own_x, laws.around_x), 0.0)
    dy = either(held, shortest(at_y - own_y, laws.around_y), 0.0)
    back_x, back_y = homed(laws, dx, dy)
    east, north = either(held, back_x, east), either(held, back_y, north)
    return reached(laws, (some(wind_east, i, most), some(wind_north, i, most)), east, north)


@part
def stop_landed(mode, room, first, last):
    """Let those of these bodies that have come down go nowhere any more."""
    for i in range(first, last):
        if room[LANDED + i - first] != 0.0:
            mode[i] = DRIVE


@part
def spend(store, use, room, first, last):
    """Let a store lose what the ways of these bodies take of it."""
    for i in range(first, last):
        rest = store[i] - room[WAY + i - first] * use
        store[i] = 0.0 if rest < 0.0 else rest


@part
def discharge(store, hovering, climbing, room, first, last):
    """Let a battery lose what these bodies use up in the air: `hovering` in a tick, `climbing` for a metre."""
    for i in range(first, last):
        climb = room[CLIMB + i - first]
        rest = store[i] - ((hovering + climbing * climb) if climb >= 0.0 else 0.0)
        store[i] = 0.0 if rest < 0.0 else rest
