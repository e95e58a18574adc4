"""What all cones of a ring, sixteen at a time, see of discs and walls: parts of the kernels of the sonars.

Discs are looked at in double precision. What a cone sees of a line depends on the line's direction alone but for its
distance, so walls are taken by direction, and each costs a few operations. Who stands where, and where the edges of
cones point, is worked out in double precision; the rest in single precision, which then errs by some millionths of the
range. So a reading is off by no more than that, unless an end of a wall is barely met by the edge of a cone: then all
walls are looked at again in double precision.
"""

from __future__ import annotations

import numpy as np

from sleepcast.simulator.simd.compiled import inlined, part
from sleepcast.simulator.simd.lanes import at, put
from sleepcast.simulator.simd.vectors import (
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
from sleepcast.simulator.world.walls import NEW_DIRECTION, ROUND, SAME_LINE

F = np.float32
U = np.uint64
PAST = F(2e-4)
"""Metres beyond a rim within which single precision cannot tell whether it is met."""
BARELY = 1e-6
"""The share of the reach within which single precision cannot tell whether an end of a wall is met: what is compared
there comes of about eight roundings, of a 2^24th each."""
NEXT_TO_NOTHING = 1e-30
"""What an edge that is parallel to a line turns away from it by, so that the two meet, far away."""
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
    away, size = along * along + aside * aside, radius * radius
    root = root_of(most_of(either(within, away, size - outside * outside), 0.0))
    seen = most_of(either(within, root - radius, forward - root), 0.0)
    return either(within | (away < size) | ((outside < radius * graze) & (forward > 0.0)), seen * seen, NOTHING)


@inlined
def look_closely(axis_x, axis_y, dx, dy, its, own, cosine, sine, graze):
    """What all cones see of a disc, in double precision."""
    along = axis_x * dx + axis_y * dy - own
    return disc(along, size_of(axis_x * dy - axis_y * dx), its, cosine, sine, graze)


@inlined
def list_pieces(solids, items, begin, end, room, pieces):
    """Put the pieces of walls that are listed from `begin` up to `end` side by side into runs of `room` numbers of
    `pieces`: unit vector along their line (x, y), how far that passes the origin, where they begin and end along it."""
    for w in range(begin, end):
        piece, place = U(items[w]), w - begin
        for run in range(5):
            pieces[U(run) * room + place] = solids[run, piece]


@inlined
def tell_pieces(zero, pieces, count, room, own_x, own_y, told):
    """Put into a sixth run of `pieces` how far on the left of a robot the lines of `count` pieces pass, and into runs
    of `room` numbers of `told` where these begin and end along them, in the precision of `zero`."""
    for p in range(U(0), count, U(LANES)):
        ex, ey = at(pieces, p), at(pieces, room + p)
        origin = ex * own_x + ey * own_y
        put(pieces, U(5) * room + p, at(pieces, U(2) * room + p) - (ex * own_y - ey * own_x))
        put(told, p, like(zero, at(pieces, U(3) * room + p) - origin))
        put(told, room + p, like(zero, at(pieces, U(4) * room + p) - origin))


@inlined
def turn_to(zero, normal, first, last, near, beyond, own, cosine, grazing):
    """What all cones make of a direction of walls: how far the transducer is off and along for it; how far along a line
    each edge of the cone meets it, for each metre to the line on the left, no farther than an echo comes back from; and
    whether it does so on the left, not on the right. normal: of the axes to the direction; first, last, near, beyond:
    of the edges to it and along it. In the precision of `zero`, but for `normal`."""
    real = type(zero)
    on = (near + beyond) * real(own / (2.0 * cosine))  # the axis is in the middle of its edges
    first, last = first + real(NEXT_TO_NOTHING), last + real(NEXT_TO_NOTHING)
    near, beyond = most_of(near / first, -grazing), least_of(beyond / last, grazing)
    return normal * own, on, near, beyond, first > zero, last > zero


@inlined
def meet(zero, away, near, beyond, before, after, grazing):
    """From where to where all cones see a line so far on the left of their transducers, and whether they do at all. See
    `turn_to`; where an edge does not meet it, as far as an echo comes back from."""
    right = away < zero
    before, after = before ^ right, after ^ right
    low, high = either(before, near, -grazing) * away, either(after, beyond, grazing) * away
    return either(right, high, low), either(right, low, high), before | after


@inlined
def look_along(zero, low, high, met, on, begin, end):
    """Where all cones, those that have `met` a line between `low` and `high`, see a piece of it from `begin` to `end`:
    how far its nearest point is before or behind the foot of the perpendicular, less than 0 for the foot itself, and
    how barely an edge meets an end."""
    from_, to = most_of(low, begin - on), least_of(high, end - on)
    width = to - from_
    return either((width >= zero) & met, most_of(from_, minus(to)), type(zero)(FAR)), size_of(width)


@inlined
def walls(zero, axis_x, axis_y, pieces, told, room, news, begin, count, own, cosine, sine, grazing, nothing):
    """What all cones see of `count` pieces of walls, see `tell_pieces`, those of the entries from `begin` on, and how
    barely any of them is met: squared metres and metres. In the precision of `zero`."""
    real = type(zero)
    grazing, nothing = real(grazing), real(nothing)
    # Half the opening adds to the axes' angles or is taken off, which is the same for walls along x and along y.
    cos_x, sin_x, cos_y, sin_y = axis_x * cosine, axis_x * sine, axis_y * cosine, axis_y * sine
    sum_y, rest_y = like(zero, cos_y + sin_x), like(zero, cos_y - sin_x)
    rest_x, sum_x = like(zero, cos_x - sin_y), like(zero, cos_x + sin_y)
    found, barely, none, far = every(nothing), every(nothing), every(zero), every(real(FAR))
    off, on, near, beyond, before, after = axis_x, none, none, none, none > zero, none > zero
    low, high, met, away, foot = none, none, before, none, far
    for p in range(U(0), count):
        new = news[begin + p]
        if new == NEW_DIRECTION:
            ex, ey = pieces[p], pieces[room + p]
            normal, first, last, near, beyond = axis_y, sum_y, rest_y, rest_x, sum_x
            if ex == 0.0:
                normal, first, last, near, beyond = minus(axis_x), minus(rest_x), minus(sum_x), sum_y, rest_y
            elif ey != 0.0:
                normal, tangent = axis_y * ex - axis_x * ey, axis_x * ex + axis_y * ey
                first = like(zero, normal * cosine + tangent * sine)
                last = like(zero, normal * cosine - tangent * sine)
                near = like(zero, tangent * cosine - normal * sine)
                beyond = like(zero, tangent * cosine + normal * sine)
            off, on, near, beyond, before, after = turn_to(
                zero, normal, first, last, near, beyond, own, cosine, grazing
            )
        if new != SAME_LINE:
            foot = most_of(foot, zero)
            found = least_of(found, away * away + foot * foot)
            away, foot = like(zero, pieces[U(5) * room + p] - off), far
            low, high, met = meet(zero, away, near, beyond, before, after, grazing)
        its, width = look_along(zero, low, high, met, on, told[p], told[room + p])
        foot, barely = least_of(foot, its), least_of(barely, width)
    foot = most_of(foot, zero)
    return least_of(found, away * away + foot * foot), barely


@part
def look_precisely(
    axis_cos, axis_sin, first, co, si, pieces, told, room, news, begin, count, own_x, own_y, own, cosine, sine, grazing,
    nothing, seen, place,
):  # fmt: skip
    """Put into `seen`, from `place` on, what sixteen cones from `first` on see of walls, in double precision."""
    axis_x, axis_y = axes(axis_cos, axis_sin, first, co, si)
    tell_pieces(0.0, pieces, count, room, own_x, own_y, told)
    precise, _ = walls(0.0, axis_x, axis_y, pieces, told, room, news, begin, count, own, cosine, sine, grazing, nothing)
    put(seen, place, singles(precise))


@inlined
def look_at_solids(
    axis_cos, axis_sin, first, co, si, solids, items, pieces, told, again, room, news, begin, end, own_x, own_y, own,
    cosine, sine, graze, grazing, most, seen, place,
):  # fmt: skip
    """Put into `seen`, from `place` on, what sixteen cones from `first` on see of the listed solids from `begin` up to
    `end`, squared metres, in single precision. The walls among them are `pieces`, which have room for a sixth run, see
    `list_pieces`. told, again: scratch memory."""
    nothing = most * most
    axis_x, axis_y = axes(axis_cos, axis_sin, first, co, si)
    found = every(F(nothing))
    while begin < end and news[begin] == ROUND:
        s = U(items[begin])
        round_ = look_closely(
            axis_x, axis_y, solids[0, s] - own_x, solids[1, s] - own_y, solids[5, s], own, cosine, sine, graze
        )
        found = least_of(found, singles(round_))
        begin += U(1)
    if begin < end:
        count = end - begin
        tell_pieces(F(0), pieces, count, room, own_x, own_y, told)
        lines, barely = walls(
            F(0), axis_x, axis_y, pieces, told, room, news, begin, count, own, cosine, sine, grazing, nothing
        )
        if any_of(barely < F(BARELY * (own + most))):
            look_precisely(
                axis_cos, axis_sin, first, co, si, pieces, again, room, news, begin, count, own_x, own_y, own, cosine,
                sine, grazing, nothing, seen, place,
            )  # fmt: skip
            lines = at(seen, place)
        found = least_of(found, lines)
    put(seen, place, found)
