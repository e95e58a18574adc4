"""What all cones of a ring, sixteen at a time, see of discs and walls: parts of the kernels of the sonars.

Discs are looked at in double precision. What a cone sees of a line depends on the line's direction alone but for its
distance, so walls are taken by direction, and each costs a few operations, in single precision; where an end of a wall
is barely met by the edge of a cone, all are looked at again in double precision.
"""

from __future__ import annotations

import numpy as np

from sleepcast.simulator.compiled import inlined
from sleepcast.simulator.vectors import any_of, either, every, least_of, like, minus, most_of, root_of, singles, size_of
from sleepcast.simulator.walls import NEW_DIRECTION, ROUND, SAME_LINE

F = np.float32
U = np.uint64
PAST = F(2e-4)
"""Metres beyond a rim, or an end of a wall, within which single precision cannot tell whether it is met."""
FAR = 1e9
NOTHING = 1e18
"""What is not seen, squared metres; finite, because the kernels are compiled for finite numbers."""


@inlined
def disc(along, aside, radius, cosine, sine, graze):
    """Squared range of a disc in all cones; see `cones.disc_range`."""
    outside = aside * cosine - along * sine
    forward = along * cosine + aside * sine
    within = outside <= 0.0
    root = root_of(most_of(either(within, along * along + aside * aside, radius * radius - outside * outside), 0.0))
    seen = most_of(either(within, root - radius, forward - root), 0.0)
    return either(within | ((outside < radius * graze) & (forward > 0.0)), seen * seen, NOTHING)


@inlined
def look_closely(axis_x, axis_y, dx, dy, its, own, cosine, sine, graze):
    """What all cones see of a disc, in double precision."""
    along = axis_x * dx + axis_y * dy - own
    return disc(along, size_of(axis_x * dy - axis_y * dx), its, cosine, sine, graze)


@inlined
def turn_to(zero, axis_x, axis_y, ex, ey, own, cosine, sine, grazing):
    """What all cones make of a direction of walls: how far the transducer is off and along for it, and where the cone
    begins and ends, for each metre to a line on its left or right: how far along the line its edges meet it, no farther
    than an echo comes back from. In the precision of `zero` and `grazing`."""
    normal, tangent = axis_y * ex - axis_x * ey, axis_x * ex + axis_y * ey
    first, last = normal * cosine + tangent * sine, normal * cosine - tangent * sine
    low = like(zero, (tangent * cosine - normal * sine) / first)
    high = like(zero, (tangent * cosine + normal * sine) / last)
    first, last = like(zero, first), like(zero, last)
    nothing, none, all_ = type(zero)(NOTHING), every(-grazing), every(grazing)
    low_left = either(first > zero, most_of(low, -grazing), none)
    low_left = either((first > zero) | (last > zero), low_left, nothing)
    high_left = either(last > zero, least_of(high, grazing), all_)
    low_right = either(last < zero, most_of(minus(high), -grazing), none)
    low_right = either((first < zero) | (last < zero), low_right, nothing)
    high_right = either(first < zero, least_of(minus(low), grazing), all_)
    return like(zero, normal * own), like(zero, tangent * own), low_left, high_left, low_right, high_right


@inlined
def walls(zero, axis_x, axis_y, solids, items, news, begin, end, own_x, own_y, own, cosine, sine, grazing, nothing):
    """What all cones see of the listed pieces of walls from `begin` up to `end`, each of which is two pieces of a line,
    and how barely any of them is met: squared metres and metres. In the precision of `zero`."""
    real = type(zero)
    grazing, nothing = real(grazing), real(nothing)
    ex, ey, origin, height = 0.0, 0.0, 0.0, 0.0
    found, barely = every(nothing), every(nothing)
    off, on, low_left, high_left, low_right, high_right = found, found, found, found, found, found
    for w in range(begin, end):
        s, t, new = U(items[w, 0]), U(items[w, 1]), news[w]
        if new == NEW_DIRECTION:
            ex, ey = solids[0, s], solids[1, s]
            origin = own_x * ex + own_y * ey
            off, on, low_left, high_left, low_right, high_right = turn_to(
                zero, axis_x, axis_y, ex, ey, own, cosine, sine, grazing
            )
        if new != SAME_LINE:
            height = solids[2, s] - (own_y * ex - own_x * ey)
        away = real(height) - off
        left, away = away >= zero, size_of(away)
        low, high = either(left, low_left, low_right) * away, either(left, high_left, high_right) * away
        low1, high1 = most_of(low, real(solids[3, s] - origin) - on), least_of(high, real(solids[4, s] - origin) - on)
        low2, high2 = most_of(low, real(solids[3, t] - origin) - on), least_of(high, real(solids[4, t] - origin) - on)
        at1, at2 = least_of(most_of(low1, zero), high1), least_of(most_of(low2, zero), high2)
        at1, at2 = either(low1 <= high1, size_of(at1), real(FAR)), either(low2 <= high2, size_of(at2), real(FAR))
        foot = least_of(at1, at2)
        found = least_of(found, away * away + foot * foot)
        barely = least_of(least_of(barely, away), least_of(size_of(high1 - low1), size_of(high2 - low2)))
    return found, barely


@inlined
def look_at_solids(
    axis_x, axis_y, solids, items, news, begin, end, own_x, own_y, own, cosine, sine, graze, grazing, nothing
):
    """What all cones see of the listed solids from `begin` up to `end`, squared metres, in single precision."""
    found = every(F(nothing))
    while begin < end and news[begin] == ROUND:
        s = U(items[begin, 0])
        disc_seen = look_closely(
            axis_x, axis_y, solids[0, s] - own_x, solids[1, s] - own_y, solids[5, s], own, cosine, sine, graze
        )
        found = least_of(found, singles(disc_seen))
        begin += U(1)
    if begin == end:
        return found
    seen, barely = walls(
        F(0), axis_x, axis_y, solids, items, news, begin, end, own_x, own_y, own, cosine, sine, grazing, nothing
    )
    if any_of(barely < PAST):
        again, _ = walls(
            0.0, axis_x, axis_y, solids, items, news, begin, end, own_x, own_y, own, cosine, sine, grazing, nothing
        )
        seen = singles(again)
    return least_of(found, seen)
