"""Compiled kernels for all cones of a sonar ring; `fast` calls them.

Most bodies are computed in single precision, sixteen at a time, and only for the two cones of a ring of sixteen that
their bearing falls between. The few *doubtful* ones (near enough for more cones, or barely met by a cone's edge) are
computed again for all cones in double precision, so no decision and no range depends on the last bit of a
single-precision number. Positions are integers in a unit that is a tiny share of a cell: their differences are exact
in any world. See `look_at_solids` for walls and `look_closely` for doubtful bodies.

Robots are sorted by cell, and each has its own row of squared ranges. The surroundings of a cell are gathered once
for all its robots; the bodies in reach of several robots are gathered in one list before they are computed, so that
vectors are full even in sparse places. Each call processes a slice of the rows of cells, so that threads can share
the work; results do not depend on the slices.
"""

from __future__ import annotations

from math import cos, pi, sin, sqrt

import numpy as np

from sleepcast.simulator.simd.compiled import compiled, inlined, part
from sleepcast.simulator.simd.formulas import LANES, sine_cosine
from sleepcast.simulator.simd.lanes import all_passed, at, forecast, pack, pair_at, put, put_by, put_pairs
from sleepcast.simulator.simd.vectors import (
    any_of,
    either,
    every,
    how_many,
    least_of,
    like,
    minus,
    most_of,
    places,
    reals,
    root_of,
    singles,
    size_of,
    truths_of,
)
from sleepcast.simulator.world.walls import NEW_DIRECTION, ROUND, SAME_LINE

F = np.float32
I = np.int32  # noqa: E741  # as short as F
U = np.uint64
GRAZING = F(6e-3)
"""Metres inside a body's rim within which a cone's edge counts as barely meeting it: there the range error is up to
four times the position error."""
AWAY = F(1e9)
"""Distance to nothing, m or units."""
FARTHEST = F(1e17)
"""Larger than any squared distance between bodies, smaller than AWAY squared."""
ACROSS_THE_WORLD = I(-(2**31))
"""The farthest position in units."""
BATCH = 16
"""Robots whose bodies in reach are processed together: their data stay in the first-level cache."""
BLOCK = 64
"""Robots whose headings are turned into cosines and sines together: a few vectors."""
OWNER, OTHER = 26, (1 << 26) - 1
"""In the lists of bodies in reach: the shift of the robot's place in its batch, and the mask of the body's number."""
COS_225, SIN_225 = F(cos(pi / 8)), F(sin(pi / 8))
ROOT_HALF = F(sqrt(0.5))


PAST = F(2e-4)
"""Metres beyond a rim within which single precision cannot decide whether the rim is met."""
BARELY = 1e-6
"""Share of the reach within which single precision cannot decide whether the end of a wall is met: the compared values
have about eight rounding errors of 2^-24 each."""
NEXT_TO_NOTHING = 1e-30
"""Least slope between an edge and a parallel line, so that the two still intersect, far away."""
FAR = 1e9
NOTHING = 1e18
"""Squared range of nothing, m2; finite, because the kernels are compiled for finite numbers."""


@inlined
def axes(axis_cos, axis_sin, first, co, si):
    """Cosine and sine of the axes of the cones from `first` on, for a robot whose heading has this cosine and sine."""
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
    return either(within | (away <= size) | ((outside < radius * graze) & (forward > 0.0)), seen * seen, NOTHING)


@inlined
def look_closely(axis_x, axis_y, dx, dy, its, own, cosine, sine, graze):
    """Squared ranges of a disc in all cones, in double precision."""
    along = axis_x * dx + axis_y * dy - own
    return disc(along, size_of(axis_x * dy - axis_y * dx), its, cosine, sine, graze)


@inlined
def list_pieces(solids, items, begin, end, room, pieces):
    """Write the listed pieces of walls from `begin` to `end` (exclusive) into runs of `room` numbers of `pieces`: unit
    vector along their line (x, y), distance by which that passes the origin, begin and end along the line."""
    for w in range(begin, end):
        piece, place = U(items[w]), w - begin
        for run in range(5):
            pieces[U(run) * room + place] = solids[run, piece]


@inlined
def local_pieces(zero, pieces, count, room, own_x, own_y, local):
    """Write into a sixth run of `pieces` how far to the left of a robot the lines of `count` pieces pass, and into runs
    of `room` numbers of `local` where they begin and end along them, in the precision of `zero`."""
    for p in range(U(0), count, U(LANES)):
        ex, ey = at(pieces, p), at(pieces, room + p)
        origin = ex * own_x + ey * own_y
        put(pieces, U(5) * room + p, at(pieces, U(2) * room + p) - (ex * own_y - ey * own_x))
        put(local, p, like(zero, at(pieces, U(3) * room + p) - origin))
        put(local, room + p, like(zero, at(pieces, U(4) * room + p) - origin))


@inlined
def turn_to(zero, normal, first, last, near, beyond, own, cosine, grazing):
    """Values that all cones share for one direction of walls: how far the transducer is off and along that direction;
    how far along a line each cone edge meets it, per metre of distance on the left, limited to where echoes still come
    back; and whether it meets it on the left and not on the right. normal: of the axes to the direction; first, last,
    near, beyond: of the edges to it and along it. In the precision of `zero`, but for `normal`."""
    real = type(zero)
    on = (near + beyond) * real(own / (2.0 * cosine))  # the axis bisects the edges
    first, last = first + real(NEXT_TO_NOTHING), last + real(NEXT_TO_NOTHING)
    near, beyond = most_of(near / first, -grazing), least_of(beyond / last, grazing)
    return normal * own, on, near, beyond, first > zero, last > zero


@inlined
def meet(zero, away, near, beyond, before, after, grazing):
    """The interval of a line, that far to the left of the transducers, seen by each cone, and whether the cone sees it
    at all. See `turn_to`; where an edge misses the line, the interval ends where echoes stop coming back."""
    right = away < zero
    before, after = before ^ right, after ^ right
    low, high = either(before, near, -grazing) * away, either(after, beyond, grazing) * away
    return either(right, high, low), either(right, low, high), before | after


@inlined
def look_along(zero, low, high, met, on, begin, end):
    """For all cones that have `met` a line between `low` and `high`, where they see a piece of it from `begin` to
    `end`: the distance of its nearest point from the foot of the perpendicular, less than 0 for the foot itself, and
    how barely an edge meets an end."""
    from_, to = most_of(low, begin - on), least_of(high, end - on)
    width = to - from_
    return either((width >= zero) & met, most_of(from_, minus(to)), type(zero)(FAR)), size_of(width)


@inlined
def walls(zero, axis_x, axis_y, pieces, local, room, news, begin, count, own, cosine, sine, grazing, nothing):
    """For all cones, the nearest points of `count` pieces of walls (see `local_pieces`), the entries from `begin` on,
    and how barely any of them is met: m2 and m. In the precision of `zero`."""
    real = type(zero)
    grazing, nothing = real(grazing), real(nothing)
    # Half the opening is added to or subtracted from the axes' angles, the same for walls along x and along y.
    cos_x, sin_x, cos_y, sin_y = axis_x * cosine, axis_x * sine, axis_y * cosine, axis_y * sine
    sum_y, rest_y = like(zero, cos_y + sin_x), like(zero, cos_y - sin_x)
    rest_x, sum_x = like(zero, cos_x - sin_y), like(zero, cos_x + sin_y)
    squares, barely, none, far = every(nothing), every(nothing), every(zero), every(real(FAR))
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
            squares = least_of(squares, away * away + foot * foot)
            away, foot = like(zero, pieces[U(5) * room + p] - off), far
            low, high, met = meet(zero, away, near, beyond, before, after, grazing)
        its, width = look_along(zero, low, high, met, on, local[p], local[room + p])
        foot, barely = least_of(foot, its), least_of(barely, width)
    foot = most_of(foot, zero)
    return least_of(squares, away * away + foot * foot), barely


@part
def look_precisely(
    axis_cos, axis_sin, first, co, si, pieces, local, room, news, begin, count, own_x, own_y, own, cosine, sine,
    grazing, nothing, seen, place,
):  # fmt: skip
    """Write into `seen`, from `place` on, the squared ranges of walls in the sixteen cones from `first` on, in double
    precision."""
    axis_x, axis_y = axes(axis_cos, axis_sin, first, co, si)
    local_pieces(0.0, pieces, count, room, own_x, own_y, local)
    precise, _ = walls(
        0.0, axis_x, axis_y, pieces, local, room, news, begin, count, own, cosine, sine, grazing, nothing
    )
    put(seen, place, singles(precise))


@inlined
def look_at_solids(
    axis_cos, axis_sin, first, co, si, solids, items, pieces, local, again, room, news, begin, end, own_x, own_y, own,
    cosine, sine, graze, grazing, most, seen, place,
):  # fmt: skip
    """Write into `seen`, from `place` on, the squared ranges (m2) of the listed solids from `begin` to `end`
    (exclusive) in the sixteen cones from `first` on, in single precision. The walls among them are `pieces`, which have
    room for a sixth run, see `list_pieces`. local, again: scratch memory."""
    nothing = most * most
    axis_x, axis_y = axes(axis_cos, axis_sin, first, co, si)
    squares = every(F(nothing))
    while begin < end and news[begin] == ROUND:
        s = U(items[begin])
        round_ = look_closely(
            axis_x, axis_y, solids[0, s] - own_x, solids[1, s] - own_y, solids[5, s], own, cosine, sine, graze
        )
        squares = least_of(squares, singles(round_))
        begin += U(1)
    if begin < end:
        count = end - begin
        local_pieces(F(0), pieces, count, room, own_x, own_y, local)
        lines, barely = walls(
            F(0), axis_x, axis_y, pieces, local, room, news, begin, count, own, cosine, sine, grazing, nothing
        )
        if any_of(barely < F(BARELY * (own + most))):
            look_precisely(
                axis_cos, axis_sin, first, co, si, pieces, again, room, news, begin, count, own_x, own_y, own, cosine,
                sine, grazing, nothing, seen, place,
            )  # fmt: skip
            lines = at(seen, place)
        squares = least_of(squares, lines)
    put(seen, place, squares)


@inlined
def edge(outside, forward, radius, least, most, nothing):
    """Squared ranges of discs in one cone each, in single precision, and whether they are doubtful."""
    within = outside <= F(0)
    aside = outside * outside
    root = root_of(most_of(either(within, forward * forward + aside, radius * radius - aside), F(0)))
    seen = either(within, root - radius, forward - root)
    return either(outside < least, seen * seen, nothing), (outside > least) & (outside < most)


@inlined
def look_around(
    list_ahead, list_aside, number, n, lone2, cos_0, sin_0, cos_1, sin_1, off_out, off_ahead, radius, barely, past,
    nothing, pairs, whose, doubtful,
):  # fmt: skip
    """Compute each of `n` bodies for the two cones beside it, in single precision, and write the places of the doubtful
    ones into `doubtful`; returns their number. For each body, `pairs` gets the squared ranges of the even and the odd
    cone, and `whose` the two cones as bits, with the robot in the bits above."""
    doubts = U(0)
    for j0 in range(U(0), n, U(LANES)):
        ahead, aside = at(list_ahead, j0), at(list_aside, j0)
        # The bearing is folded into 0 to 22.5 degrees; each fold mirrors the numbers of the sectors.
        sector = either(aside < F(0), every(I(15)), I(0)) ^ either(ahead < F(0), every(I(7)), I(0))
        ahead, aside = size_of(ahead), size_of(aside)
        sector = sector ^ either(aside > ahead, every(I(3)), I(0))
        a, b = most_of(ahead, aside), least_of(ahead, aside)
        mirrored = b * COS_225 > a * SIN_225
        sector = sector ^ either(mirrored, every(I(1)), I(0))
        alone = a * a + b * b > lone2
        a, b = either(mirrored, (a + b) * ROOT_HALF, a), either(mirrored, (a - b) * ROOT_HALF, b)
        seen0, doubt0 = edge(
            b * cos_0 - a * sin_0 + off_out, a * cos_0 + b * sin_0 - off_ahead, radius, barely, past, nothing
        )
        seen1, doubt1 = edge(
            a * sin_1 - b * cos_1 + off_out, a * cos_1 + b * sin_1 - off_ahead, radius, barely, past, nothing
        )
        put_pairs(pairs, U(2) * j0, either(alone, seen0, nothing), either(alone, seen1, nothing))
        beside = (every(I(1)) << ((sector + I(1)) & I(14))) | (every(I(1)) << (sector | I(1)))
        put(whose, j0, beside | (at(number, j0) >> I(OWNER) << I(LANES)))
        doubt = (either(alone, every(I(0)), I(1)) > I(0)) | doubt0 | doubt1
        pack(doubtful, doubts, places() + I(j0), doubt)
        doubts += how_many(doubt)
    return doubts


@inlined
def put_together(pairs, whose, n, nothing, least):
    """Keep the minimum of what the cones of each robot see of `n` bodies. Bodies are taken from sixteen places in turn,
    because consecutive bodies of the same robot would have to wait for each other's result."""
    vectors = (n + U(LANES - 1)) // U(LANES)
    for step in range(vectors):
        for place in range(LANES):
            j = U(place) * vectors + U(step)
            its = whose[j]
            row = U(its >> I(LANES)) * U(LANES)
            put(least, row, least_of(at(least, row), either(truths_of(its), pair_at(pairs, U(2) * j), nothing)))


@inlined
def stop_list(ahead, aside, number, n, radii, common, mixed):
    """Pad a list with far-away bodies; mark those as doubtful whose radius differs from the common one."""
    put(ahead, n, every(AWAY))
    put(aside, n, every(F(0)))
    put(number, n, every(I(0)))
    if mixed:
        for j in range(n):
            if radii[number[j] & OTHER] != common:
                ahead[j], aside[j] = F(0), F(0)


@inlined
def copy(values, used, into):
    """Copy the first `used` values into a larger array."""
    for j in range(used):
        into[j] = values[j]


@inlined
def turn(values, order, first, last, into):
    """Gather the `values` of the robots from `first` to `last` in sorted order, and prefetch those of as many following
    ones."""
    for i in range(first, last):
        into[i - first] = values[order[i]]
    for i in range(last, min(last + BLOCK, order.shape[0])):
        forecast(values, order[i])


@inlined
def list_near(fixed_x, fixed_y, start, grid_columns, below, above, left, right, near_x, near_y, near_number):
    """List the bodies in the cells from `left` to `right` of the rows from `below` to `above`; returns their number. A
    few padding entries follow."""
    n = U(0)
    for row in range(below, above + 1):
        begin, end = U(start[row * grid_columns + left]), U(start[row * grid_columns + right])
        for j0 in range(begin, end, U(LANES)):
            at_n = n + (j0 - begin)
            put(near_x, at_n, at(fixed_x, j0))
            put(near_y, at_n, at(fixed_y, j0))
            put(near_number, at_n, places() + I(j0))
        n += end - begin
    return n


@inlined
def keep_near(
    near_x, near_y, near_number, near, me, own_x, own_y, co, si, limit, behind, mark, ahead, aside, number, n
):  # fmt: skip
    """Append to the list of a batch, from `n` on, those of the `near` listed bodies that are in reach and not too far
    behind: their distances ahead and aside, and their numbers with the robot's `mark`; returns the new n. co, si: of
    the heading, times the unit."""
    for j0 in range(U(0), near, U(LANES)):
        dx, dy = reals(at(near_x, j0) - own_x), reals(at(near_y, j0) - own_y)
        its = at(near_number, j0)
        along, sideways = dx * co + dy * si, dy * co - dx * si
        chosen = (dx * dx + dy * dy < limit) & (along > behind) & (its != me)
        pack(ahead, n, along, chosen)
        pack(aside, n, sideways, chosen)
        pack(number, n, its + mark, chosen)
        n += how_many(chosen)
    return n


@compiled
def see(
    x, y, heading, order, fixed_x, fixed_y, radii, rows, start, size, grid_columns, grid_rows, solids, listed, items,
    news, own, common, reach, most, cosine, sine, graze, grazing, lone, unit, mixed, forward, axis_cos, axis_sin,
    first_row, last_row, beside, close, out,
):  # fmt: skip
    """Squared ranges seen by the robots in the rows of cells from `first_row` to `last_row` (exclusive); see
    `cones.ranges`.

    x, y, heading: of all robots, whose cell order is `order`; everything else is sorted by it
    fixed_x, fixed_y: x and y in units of `unit` m, padded with LANES
    rows: the row of each robot in `out`, or -1 if not requested
    size: of a cell, at least the reach
    solids, listed, items, news: see `walls.Walls`
    own: radius of the looking robots
    common: the most common radius (other bodies cost more; unless `mixed`, there are none and radii is not read)
    reach: greatest distance of a centre
    lone: beyond this distance a body of the common radius is seen only by the two nearest of sixteen sonars; negative
        if all are computed in double precision, because there are not sixteen or the units are coarse
    forward: whether cones that look behind are not needed
    axis_cos, axis_sin: of the cones, padded to the length of a row of `out`, a multiple of LANES
    close: set to False for robots with no other one within `beside` m, which is at most `lone`
    """
    count = axis_cos.shape[0]
    nothing = F(most * most)
    reach2, lone2 = F(((reach + 1e-4) / unit + 2.0) ** 2), F(lone * lone) if lone >= 0.0 else FARTHEST
    half = np.arctan2(sine, cosine)
    # Cones that look aside or ahead meet bodies at most this far behind; `close` must count bodies behind too.
    behind = -F(max(common + reach * sine, beside) + 0.01) if forward else -AWAY
    cos_0, sin_0, cos_1, sin_1 = F(cosine), F(sine), F(cos(pi / 8 - half)), F(sin(pi / 8 - half))
    off_out, off_ahead, radius = F(own * sine), F(own * cosine), F(common)
    barely, past = F(common * graze) - GRAZING, F(common * graze) + PAST
    room, near_room, pieces_room = 1024, 256, 4 * LANES
    ahead, aside, number, doubtful = np.empty(room, F), np.empty(room, F), np.empty(room, I), np.empty(room, I)
    far_x, far_y = np.empty(room), np.empty(room)
    near_x, near_y, near_number = np.empty(near_room, I), np.empty(near_room, I), np.empty(near_room, I)
    least, pairs, whose = np.empty(BATCH * count, F), np.empty(2 * room, F), np.empty(room, I)
    pieces, local, again = np.zeros(6 * pieces_room), np.empty(2 * pieces_room, F), np.empty(2 * pieces_room)
    batch = np.empty(BATCH, np.int64)
    cosines, sines, turned = np.empty(BLOCK), np.empty(BLOCK), np.empty(2 * BATCH)
    own_x, own_y = np.empty(BLOCK), np.empty(BLOCK)
    held, n, last = 0, U(0), start[last_row * grid_columns] - 1
    ready = block = start[first_row * grid_columns]
    walled = items.shape[0] > 0
    for row in range(first_row, last_row):
        below, above = max(row - 1, 0), min(row + 1, grid_rows - 1)
        for column in range(grid_columns):
            cell = row * grid_columns + column
            if start[cell] == start[cell + 1]:
                continue
            left, right = max(column - 1, 0), min(column + 1, grid_columns - 1) + 1
            total, near, walls_from, walls_to = 0, U(0), U(listed[cell]), U(listed[cell + 1])
            for r in range(below, above + 1):
                total += start[r * grid_columns + right] - start[r * grid_columns + left]
            if total + 2 * LANES > near_room:
                near_room = 2 * total + 2 * LANES
                near_x, near_y, near_number = np.empty(near_room, I), np.empty(near_room, I), np.empty(near_room, I)
            if np.int64(n) + BATCH * total + 2 * LANES > room:
                room = 2 * (np.int64(n) + BATCH * total + LANES)
                narrow = ahead, aside, number
                ahead, aside, number = np.empty(room, F), np.empty(room, F), np.empty(room, I)
                copy(narrow[0], n, ahead)
                copy(narrow[1], n, aside)
                copy(narrow[2], n, number)
                doubtful, far_x, far_y = np.empty(room, I), np.empty(room), np.empty(room)
                pairs, whose = np.empty(2 * room, F), np.empty(room, I)
            if walls_from < walls_to:
                first_wall = walls_from
                while first_wall < walls_to and news[first_wall] == ROUND:
                    first_wall += U(1)
                if walls_to - first_wall > U(pieces_room):
                    pieces_room = (np.int64(walls_to - first_wall) // LANES + 1) * 2 * LANES
                    pieces, local, again = (
                        np.zeros(6 * pieces_room),
                        np.empty(2 * pieces_room, F),
                        np.empty(2 * pieces_room),
                    )
                list_pieces(solids, items, first_wall, walls_to, U(pieces_room), pieces)
            for i in range(start[cell], start[cell + 1]):
                if i == ready:
                    block, ready = ready, min(ready + BLOCK, last + 1)
                    turn(heading, order, block, ready, cosines)
                    for k in range(ready - block):
                        sines[k], cosines[k] = sine_cosine(cosines[k])
                    if walled:
                        turn(x, order, block, ready, own_x)
                        turn(y, order, block, ready, own_y)
                if rows[i] >= 0:
                    co, si = cosines[i - block], sines[i - block]
                    for k in range(0, count, LANES):
                        place = U(held * count + k)
                        if walls_from < walls_to:
                            look_at_solids(
                                axis_cos, axis_sin, k, co, si, solids, items, pieces, local, again,
                                U(pieces_room), news, walls_from, walls_to, own_x[i - block], own_y[i - block],
                                own, cosine, sine, graze, grazing, most, least, place,
                            )  # fmt: skip
                        else:
                            put(least, place, every(nothing))
                    if near == U(0):
                        near = list_near(
                            fixed_x,
                            fixed_y,
                            start,
                            grid_columns,
                            below,
                            above,
                            left,
                            right,
                            near_x,
                            near_y,
                            near_number,
                        )
                        put(near_x, near, every(fixed_x[i]) + ACROSS_THE_WORLD)
                        put(near_y, near, every(fixed_y[i]))
                    n = keep_near(
                        near_x, near_y, near_number, near, I(i), fixed_x[i], fixed_y[i], F(co) * F(unit),
                        F(si) * F(unit), reach2, behind, I(held << OWNER), ahead, aside, number, n,
                    )  # fmt: skip
                    batch[held] = i
                    turned[held], turned[BATCH + held] = co, si
                    held += 1
                if held < BATCH and i < last:
                    continue
                stop_list(ahead, aside, number, n, radii, common, mixed)
                doubts = look_around(
                    ahead, aside, number, n, lone2, cos_0, sin_0, cos_1, sin_1, off_out, off_ahead,
                    radius, barely, past, nothing, pairs, whose, doubtful,
                )  # fmt: skip
                for d in range(doubts):
                    its = number[doubtful[d]]
                    for place in (order[batch[its >> OWNER]], order[its & OTHER]):
                        forecast(x, place)
                        forecast(y, place)
                put_together(pairs, whose, n, nothing, least)
                for b in range(held):
                    close[batch[b]] = False
                for d in range(doubts):
                    its = number[doubtful[d]]
                    o, other = order[batch[its >> OWNER]], order[its & OTHER]
                    far_x[d], far_y[d] = x[other] - x[o], y[other] - y[o]
                for d in range(doubts):
                    its = number[doubtful[d]]
                    b, wide = its >> OWNER, radii[its & OTHER] if mixed else common
                    close[batch[b]] |= far_x[d] * far_x[d] + far_y[d] * far_y[d] < beside * beside
                    for k in range(0, count, LANES):
                        axis_x, axis_y = axes(axis_cos, axis_sin, k, turned[b], turned[BATCH + b])
                        squares = look_closely(axis_x, axis_y, far_x[d], far_y[d], wide, own, cosine, sine, graze)
                        place = U(b * count + k)
                        put(least, place, least_of(at(least, place), singles(squares)))
                for b in range(held):
                    for k in range(0, count, LANES):
                        put_by(out, rows[batch[b]], k, at(least, U(b * count + k)))
                held, n = 0, U(0)
    all_passed()
