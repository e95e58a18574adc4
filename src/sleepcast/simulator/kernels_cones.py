"""What all cones of a ring, sixteen at a time, see of discs and walls: parts of the kernels of the sonars.

Discs are looked at in double precision. What a cone sees of a line depends on the line's direction alone but for its
distance, so walls are taken by direction, and each costs a few operations, in single precision; where an end of a wall
is barely met by the edge of a cone, all are looked at again in double precision.
"""

from __future__ import annotations

import numpy as np

from sleepcast.simulator.compiled import inlined
from sleepcast.simulator.lanes import at, put
from sleepcast.simulator.vectors import (
    LANES,
    any_of,
    either,
    every,
    least_of,
    like,
    minus,
    most_of,
    root_of,
    singles,
    size_of,
)
from sleepcast.simulator.walls import NEW_DIRECTION, ROUND, SAME_LINE

F = np.float32
U = np.uint64
PAST = F(2e-4)
"""Metres beyond a rim, or an end of a wall, within which single precision cannot tell whether it is met."""
FAR = 1e9
NOTHING = 1e18
"""What is not seen, squared metres; finite, because the kernels are compiled for finite numbers."""


@inlined
def axes(axis_cos, axis_sin, first, co, si):
    """Cosine and sine of the axes of the cones from `first` on of a robot whose heading has this cosine and sine."""
    axis_x = at(axis_cos, U(first)) * co - at(axis_sin, U(first)) * si
    return axis_x, at(axis_sin, U(first)) * co + at(axis_cos, U(first)) * si


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
def list_pieces(solids, items, begin, end, room, pieces):
    """Put the pieces of walls that are listed from `begin` up to `end`, two in each entry, side by side into runs of
    `room` numbers of `pieces`: unit vector along their line (x, y), how far that passes the origin, where they begin
    and end along it."""
    for w in range(begin, end):
        first, second = U(items[w, 0]), U(items[w, 1])
        for run in range(5):
            place = U(run) * room + U(2) * (w - begin)
            pieces[place] = solids[run, first]
            pieces[place + U(1)] = solids[run, second if run > 2 else first]


@inlined
def tell_pieces(zero, pieces, count, room, own_x, own_y, told):
    """Put into runs of `room` numbers of `told` how far on the left of a robot the lines of `count` pieces pass, and
    where these begin and end along them. In the precision of `zero`."""
    for p in range(U(0), count, U(LANES)):
        ex, ey = at(pieces, p), at(pieces, room + p)
        origin = ex * own_x + ey * own_y
        put(told, p, like(zero, at(pieces, U(2) * room + p) - (ex * own_y - ey * own_x)))
        put(told, room + p, like(zero, at(pieces, U(3) * room + p) - origin))
        put(told, U(2) * room + p, like(zero, at(pieces, U(4) * room + p) - origin))


@inlined
def turn_to(zero, normal, tangent, own, first, last, low, high, grazing):
    """What all cones make of a direction of walls: how far the transducer is off and along for it, and where the cone
    begins and ends, for each metre to a line on its left or right: how far along the line its edges meet it, no farther
    than an echo comes back from. normal, tangent: of the axes to the direction; first, last, low, high: these turned by
    half the opening. In the precision of `zero` and `grazing`."""
    low, high = like(zero, low / first), like(zero, high / last)
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
def look_along(zero, low, high, on, begin, end):
    """Where all cones see a piece of a line from `begin` to `end`: how far its nearest point is before or behind the
    foot of the perpendicular, less than 0 for the foot itself, and how barely an edge meets an end."""
    from_, to = most_of(low, begin - on), least_of(high, end - on)
    width = to - from_
    return either(width >= zero, most_of(from_, minus(to)), type(zero)(FAR)), size_of(width)


@inlined
def walls(zero, axis_x, axis_y, pieces, told, room, news, begin, end, own, cosine, sine, grazing, nothing):
    """What all cones see of pieces of walls, those of the entries from `begin` up to `end`, see `tell_pieces`, and how
    barely any of them is met: squared metres and metres. In the precision of `zero`."""
    real = type(zero)
    grazing, nothing = real(grazing), real(nothing)
    # Half the opening adds to the axes' angles or is taken off, which is the same for walls along x and along y.
    cos_x, sin_x, cos_y, sin_y = axis_x * cosine, axis_x * sine, axis_y * cosine, axis_y * sine
    sum_y, rest_y, rest_x, sum_x = cos_y + sin_x, cos_y - sin_x, cos_x - sin_y, cos_x + sin_y
    found, barely, none, far = every(nothing), every(nothing), every(zero), every(real(FAR))
    off, on, low_left, high_left, low_right, high_right = none, none, none, none, none, none
    low, high, away, foot = none, none, none, far
    for w in range(begin, end):
        p, new = U(2) * (w - begin), news[w]
        if new == NEW_DIRECTION:
            ex, ey = pieces[p], pieces[room + p]
            normal, tangent, first, last, near, beyond = axis_y, axis_x, sum_y, rest_y, rest_x, sum_x
            if ex == 0.0:
                normal, tangent = minus(axis_x), axis_y
                first, last, near, beyond = minus(rest_x), minus(sum_x), sum_y, rest_y
            elif ey != 0.0:
                normal, tangent = axis_y * ex - axis_x * ey, axis_x * ex + axis_y * ey
                first, last = normal * cosine + tangent * sine, normal * cosine - tangent * sine
                near, beyond = tangent * cosine - normal * sine, tangent * cosine + normal * sine
            off, on, low_left, high_left, low_right, high_right = turn_to(
                zero, normal, tangent, own, first, last, near, beyond, grazing
            )
        if new != SAME_LINE:
            foot = most_of(foot, zero)
            found = least_of(found, away * away + foot * foot)
            away, foot = told[p] - off, far
            left, away = away >= zero, size_of(away)
            low, high = either(left, low_left, low_right) * away, either(left, high_left, high_right) * away
            barely = least_of(barely, away)
        for piece in range(p, p + U(2)):
            its, width = look_along(zero, low, high, on, told[room + piece], told[U(2) * room + piece])
            foot, barely = least_of(foot, its), least_of(barely, width)
    foot = most_of(foot, zero)
    return least_of(found, away * away + foot * foot), barely


@inlined
def look_at_solids(
    axis_x, axis_y, solids, items, pieces, told, again, room, news, begin, end, own_x, own_y, own, cosine, sine, graze,
    grazing, nothing,
):  # fmt: skip
    """What all cones see of the listed solids from `begin` up to `end`, squared metres, in single precision. The walls
    among them are `pieces`, see `list_pieces`. told, again: scratch memory, in single and double precision."""
    found = every(F(nothing))
    while begin < end and news[begin] == ROUND:
        s = U(items[begin, 0])
        round_ = look_closely(
            axis_x, axis_y, solids[0, s] - own_x, solids[1, s] - own_y, solids[5, s], own, cosine, sine, graze
        )
        found = least_of(found, singles(round_))
        begin += U(1)
    if begin == end:
        return found
    count = U(2) * (end - begin)
    tell_pieces(F(0), pieces, count, room, own_x, own_y, told)
    seen, barely = walls(
        F(0), axis_x, axis_y, pieces, told, room, news, begin, end, own, cosine, sine, grazing, nothing
    )
    if any_of(barely < PAST):
        tell_pieces(0.0, pieces, count, room, own_x, own_y, again)
        precise, _ = walls(
            0.0, axis_x, axis_y, pieces, again, room, news, begin, end, own, cosine, sine, grazing, nothing
        )
        seen = singles(precise)
    return least_of(found, seen)
