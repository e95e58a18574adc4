"""Compiled kernels of the sonars: what all cones of a ring see; `fast` calls them.

Most bodies are looked at in single precision, sixteen at a time, and only by the two cones of a ring of sixteen that
their bearing falls between; the few *doubtful* ones (near enough for more cones, or barely met by the edge of one)
again by all cones in double precision. So no decision and no range hangs on the last bit of a short number. Positions
are taken relative to the middle of a cell, where short numbers are fine enough for any world. Walls are done in double
precision: what a cone sees of a line depends on the line's direction alone but for its distance, so walls are taken by
direction, and each costs a few operations a cone.

Robots come in the order of their cells, each with a row of squared ranges of its own. Each call does a stretch of rows
of cells, so that threads can share the work; every robot's numbers come out the same whoever does them.

Loops over `LANES` are meant to become vector instructions: their bodies are large enough not to be unrolled, and their
scratch lies in one array, so that it is plain that nothing overlaps.
"""

from __future__ import annotations

from math import ceil, cos, pi, sin, sqrt

import numpy as np

from sleepcast.simulator.compiled import compiled, inlined
from sleepcast.simulator.lanes import LANES, fetch_row, keep
from sleepcast.simulator.walls import NEW_DIRECTION, ROUND, SAME_LINE

F = np.float32
I = np.int32  # noqa: E741  # as short as F
U = np.uint64
GRAZING = F(6e-3)
"""Metres before a body's rim within which an edge of a cone counts as barely meeting it: the range then changes by up
to four times the error of the place."""
PAST = F(2e-4)
"""Metres beyond a rim within which single precision cannot tell whether it is met."""
FAR = 1e9
NOTHING = 1e18
"""What is not seen, squared metres; finite, because the kernels are compiled for finite numbers."""
AWAY = F(1e9)
"""Metres to a body that is none."""
COS_225, SIN_225 = F(cos(pi / 8)), F(sin(pi / 8))
ROOT_HALF = F(sqrt(0.5))
# Scratch, in runs of LANES. Of walls, in single and in double precision: how far the transducer is off and along for a
# direction of walls, where the cone begins and ends on either side for each metre of distance, what was found, squared;
# in double precision also the axes of the cones.
OFF, ON, LOW_LEFT, HIGH_LEFT, LOW_RIGHT, HIGH_RIGHT, FOUND, AXIS_X, AXIS_Y = (LANES * run for run in range(9))
# Of bodies: squared ranges of the even and the odd one of the two cones beside a body, and the least so far of each
# cone. Whole numbers: which cones those two are, whether their ranges are doubtful, and whether those of walls are.
EVEN, ODD, LEAST = (LANES * run for run in range(3))
DOUBTFUL, UNSURE = 2 * LANES, 3 * LANES


@inlined
def disc(along, aside, radius, cosine, sine, graze):
    """Squared range of a disc in one cone; see `cones.disc_range`."""
    outside = aside * cosine - along * sine
    forward = along * cosine + aside * sine
    within = outside <= 0.0
    root = sqrt(max(along * along + aside * aside if within else radius * radius - outside * outside, 0.0))
    seen = max(root - radius if within else forward - root, 0.0)
    return seen * seen if within | ((outside < radius * graze) & (forward > 0.0)) else NOTHING


@inlined
def edge(outside, forward, radius, least, most, nothing):
    """A disc in one cone, in single precision: its squared range, and whether that is doubtful."""
    within = outside <= F(0)
    root = sqrt(max(forward * forward + outside * outside if within else radius * radius - outside * outside, F(0)))
    seen = root - radius if within else forward - root
    return (seen * seen if outside < least else nothing), (outside > least) & (outside < most)


@inlined
def bring(x, y, begin, end, middle_x, middle_y, cx, cy, cp, m):
    """Put the bodies from `begin` up to `end` among the candidates, of which there are `m` so far; gives the new m."""
    for q0 in range(U(0), end - begin, U(LANES)):
        for q1 in range(LANES):
            q = q0 + U(q1)
            cx[m + q], cy[m + q] = F(x[begin + q] - middle_x), F(y[begin + q] - middle_y)
            cp[m + q] = I(begin + q)
    return m + (end - begin)


@inlined
def look_around(
    bx, by, bj, n, co, si, lone2, cos_0, sin_0, cos_1, sin_1, off_out, off_ahead, radius, barely, past, nothing,
    short, cone, cp, i, close,
):  # fmt: skip
    """Let the two cones beside each of `n` bodies look at it in single precision, and list those that are doubtful, but
    for the body `i` itself, in `close`; gives how many."""
    near = U(0)
    for j0 in range(U(0), n, U(LANES)):
        doubts = I(0)
        for j1 in range(LANES):
            j = j0 + U(j1)
            ahead, aside = bx[j] * co + by[j] * si, by[j] * co - bx[j] * si
            # The bearing is folded into 0 to 22.5 degrees; each fold mirrors the numbers of the sectors.
            sector = I(15) if aside < F(0) else I(0)
            sector ^= I(7) if ahead < F(0) else I(0)
            ahead, aside = abs(ahead), abs(aside)
            sector ^= I(3) if aside > ahead else I(0)
            a, b = max(ahead, aside), min(ahead, aside)
            mirrored = b * COS_225 > a * SIN_225
            sector ^= I(1) if mirrored else I(0)
            alone = a * a + b * b > lone2
            a, b = ((a + b) * ROOT_HALF if mirrored else a, (a - b) * ROOT_HALF if mirrored else b)
            seen0, doubt0 = edge(
                b * cos_0 - a * sin_0 + off_out, a * cos_0 + b * sin_0 - off_ahead, radius, barely, past, nothing
            )
            seen1, doubt1 = edge(
                a * sin_1 - b * cos_1 + off_out, a * cos_1 + b * sin_1 - off_ahead, radius, barely, past, nothing
            )
            short[EVEN + j1] = seen0 if alone else nothing
            short[ODD + j1] = seen1 if alone else nothing
            doubt = I(0) if alone & (not (doubt0 | doubt1)) else I(1)
            cone[EVEN + j1], cone[ODD + j1] = (sector + I(1)) & I(14), sector | I(1)
            cone[DOUBTFUL + j1] = doubt
            doubts |= doubt
        for j in range(min(n - j0, U(LANES))):
            k = U(LEAST) + U(cone[j])
            short[k] = min(short[k], short[j])
            k = U(LEAST) + U(cone[U(ODD) + j])
            short[k] = min(short[k], short[U(ODD) + j])
        if doubts:
            for j in range(min(n - j0, U(LANES))):
                close[near] = cp[U(bj[j0 + j])]
                near += U(cone[U(DOUBTFUL) + j]) & U(close[near] != i)
    return near


@inlined
def look_closely(lane, dx, dy, its, own, cosine, sine, graze):
    """Let all cones look at a disc in double precision."""
    for k in range(LANES):
        along = dx * lane[AXIS_X + k] + dy * lane[AXIS_Y + k] - own
        aside = abs(dy * lane[AXIS_X + k] - dx * lane[AXIS_Y + k])
        lane[FOUND + k] = min(lane[FOUND + k], disc(along, aside, its, cosine, sine, graze))


@inlined
def turn_to(wall, lane, ex, ey, own, cosine, sine, grazing):
    """Put into `wall` what all cones make of a direction of walls, on whose left or right side they may be: how far
    along a line, for each metre to it, their edges meet it, no farther than an echo comes back from."""
    for k in range(LANES):
        ax, ay = lane[AXIS_X + k], lane[AXIS_Y + k]
        normal, tangent = ay * ex - ax * ey, ax * ex + ay * ey
        first, last = normal * cosine + tangent * sine, normal * cosine - tangent * sine
        low, high = (tangent * cosine - normal * sine) / first, (tangent * cosine + normal * sine) / last
        wall[OFF + k], wall[ON + k] = normal * own, tangent * own
        from_left = max(low, -grazing) if first > 0.0 else -grazing
        wall[LOW_LEFT + k] = from_left if (first > 0.0) | (last > 0.0) else NOTHING
        wall[HIGH_LEFT + k] = min(high, grazing) if last > 0.0 else grazing
        from_right = max(-high, -grazing) if last < 0.0 else -grazing
        wall[LOW_RIGHT + k] = from_right if (first < 0.0) | (last < 0.0) else NOTHING
        wall[HIGH_RIGHT + k] = min(-low, grazing) if first < 0.0 else grazing


@inlined
def look_at(wall, cone, height, begin, end, begin2, end2, zero, nothing, past):
    """Let all cones look at two pieces of a line that passes `height` to the left, each from its `begin` to its `end`
    along the line's direction."""
    for k in range(LANES):
        away, on = height - wall[OFF + k], wall[ON + k]
        low_left, low_right = wall[LOW_LEFT + k], wall[LOW_RIGHT + k]
        high_left, high_right = wall[HIGH_LEFT + k], wall[HIGH_RIGHT + k]
        low, high = (low_left if away >= zero else low_right), (high_left if away >= zero else high_right)
        away = abs(away)
        low, high = low * away, high * away
        low1, high1 = max(low, begin - on), min(high, end - on)
        low2, high2 = max(low, begin2 - on), min(high, end2 - on)
        at1, at2 = min(max(zero, low1), high1), min(max(zero, low2), high2)
        at1, at2 = (at1 if low1 <= high1 else nothing), (at2 if low2 <= high2 else nothing)
        at = min(abs(at1), abs(at2))
        wall[FOUND + k] = min(wall[FOUND + k], away * away + at * at)
        barely = (abs(high1 - low1) < past) | (abs(high2 - low2) < past) | (away < past)
        cone[UNSURE + k] |= I(1) if barely else I(0)


@inlined
def walls(
    wall, lane, cone, solids, items, news, begin, end, own_x, own_y, own, cosine, sine, grazing, zero, nothing, past
):
    """Let all cones look at the listed pieces of walls from `begin` up to `end`."""
    ex, ey, origin, height = 0.0, 0.0, 0.0, 0.0
    for w in range(begin, end):
        s, t, new = items[w, 0], items[w, 1], news[w]
        if new == NEW_DIRECTION:
            ex, ey = solids[0, s], solids[1, s]
            origin = own_x * ex + own_y * ey
            turn_to(wall, lane, ex, ey, own, cosine, sine, grazing)
        if new != SAME_LINE:
            height = solids[2, s] - (own_y * ex - own_x * ey)
        real = wall.dtype.type
        look_at(
            wall, cone, real(height), real(solids[3, s] - origin), real(solids[4, s] - origin),
            real(solids[3, t] - origin), real(solids[4, t] - origin), zero, nothing, past,
        )  # fmt: skip


@compiled
def see(
    x, y, cosines, sines, radii, rows, start, size, across, up, solids, listed, items, news,
    own, common, reach, most, cosine, sine, graze, grazing, lone, mixed, axis_cos, axis_sin, first_row, last_row, out,
):  # fmt: skip
    """What robots in the rows of cells from `first_row` up to `last_row` see, squared; see `cones.ranges`.

    x, y, cosines, sines, radii: of all robots, sorted, with LANES more at the end. rows: for each its row in `out`, or
    -1. solids, listed, items, news: see `walls.Walls`. own: radius of those who look; common: the usual radius (bodies
    of others cost more, and `mixed` says whether there are any); reach: how far a middle may be. lone: beyond this
    distance a body of the common radius is seen by the two nearest of sixteen sonars only; negative where there are
    not sixteen. axis_cos, axis_sin: of the cones, as many as a row of `out` is long: a multiple of LANES.
    """
    count = axis_cos.shape[0]
    folds = lone >= 0.0
    nothing = F(most * most)
    reach2, lone2 = F((reach + 1e-4) ** 2), F(lone * lone if folds else AWAY)
    half = np.arctan2(sine, cosine)
    cos_0, sin_0, cos_1, sin_1 = F(cosine), F(sine), F(cos(pi / 8 - half)), F(sin(pi / 8 - half))
    off_out, off_ahead, radius = F(own * sine), F(own * cosine), F(common)
    barely, past = F(common * graze) - GRAZING, F(common * graze) + PAST
    steps = ceil(reach / size)
    width = np.empty(steps + 1, np.int64)  # cells to either side that are in reach, by how many rows away
    for r in range(steps + 1):
        between = max(r - 1, 0) * size
        width[r] = ceil(sqrt(max(reach * reach - between * between, 0.0)) / size)
    room = 1024
    cx, cy, cp = np.empty(room, F), np.empty(room, F), np.empty(room, I)
    bx, by, bj = np.empty(room, F), np.empty(room, F), np.empty(room, I)
    close, unlike = np.empty(room, I), np.empty(room, I)
    lane, wall = np.zeros(9 * LANES), np.zeros(7 * LANES, F)
    short, cone = np.empty(3 * LANES, F), np.zeros(4 * LANES, I)
    for row in range(first_row, last_row):
        for column in range(across):
            cell = row * across + column
            if start[cell] == start[cell + 1]:
                continue
            total = 0
            for r in range(max(row - steps, 0), min(row + steps, up - 1) + 1):
                left, right = max(column - width[abs(r - row)], 0), min(column + width[abs(r - row)], across - 1)
                total += start[r * across + right + 1] - start[r * across + left]
            if total + 2 * LANES > room:
                room = total + 2 * LANES
                cx, cy, cp = np.empty(room, F), np.empty(room, F), np.empty(room, I)
                bx, by, bj = np.empty(room, F), np.empty(room, F), np.empty(room, I)
                close, unlike = np.empty(room, I), np.empty(room, I)
            middle_x, middle_y = (column + 0.5) * size, (row + 0.5) * size
            m, others = U(0), U(0)
            first_piece = listed[cell]
            while first_piece < listed[cell + 1] and news[first_piece] == ROUND:
                first_piece += 1
            for r in range(max(row - steps, 0), min(row + steps, up - 1) + 1):
                left, right = max(column - width[abs(r - row)], 0), min(column + width[abs(r - row)], across - 1)
                begin, end = U(start[r * across + left]), U(start[r * across + right + 1])
                m = bring(x, y, begin, end, middle_x, middle_y, cx, cy, cp, m)
            if mixed or not folds:
                for j in range(m):
                    if not folds or radii[cp[j]] != common:
                        unlike[others] = cp[j]
                        others += U(1)
                        cx[j] = AWAY
            for j in range(LANES):
                cx[m + U(j)] = AWAY
            for i in range(start[cell], start[cell + 1]):
                place = rows[i]
                if place < 0:
                    continue
                fetch_row(out, place)
                own_x, own_y, co, si = x[i], y[i], cosines[i], sines[i]
                px, py, short_co, short_si = F(own_x - middle_x), F(own_y - middle_y), F(co), F(si)
                n = U(0)
                for j0 in range(U(0), m, U(LANES)):
                    n = keep(cx, cy, j0, px, py, reach2, bx, by, bj, n)
                for k in range(LANES):
                    short[LEAST + k] = nothing
                near = look_around(
                    bx, by, bj, n, short_co, short_si, lone2, cos_0, sin_0, cos_1, sin_1, off_out, off_ahead,
                    radius, barely, past, nothing, short, cone, cp, i, close,
                )  # fmt: skip
                for j in range(others):
                    dx, dy = x[unlike[j]] - own_x, y[unlike[j]] - own_y
                    close[near] = unlike[j]
                    near += U(dx * dx + dy * dy <= reach * reach) & U(unlike[j] != i)
                for block in range(0, count, LANES):
                    for k in range(LANES):
                        lane[AXIS_X + k] = axis_cos[block + k] * co - axis_sin[block + k] * si
                        lane[AXIS_Y + k] = axis_sin[block + k] * co + axis_cos[block + k] * si
                        lane[FOUND + k] = most * most
                    for j in range(near):
                        other = U(close[j])
                        look_closely(lane, x[other] - own_x, y[other] - own_y, radii[other], own, cosine, sine, graze)
                    for w in range(listed[cell], first_piece):
                        s = items[w, 0]
                        dx, dy = solids[0, s] - own_x, solids[1, s] - own_y
                        look_closely(lane, dx, dy, solids[5, s], own, cosine, sine, graze)
                    if first_piece < listed[cell + 1]:
                        for k in range(LANES):
                            wall[FOUND + k], cone[UNSURE + k] = nothing, I(0)
                        walls(
                            wall, lane, cone, solids, items, news, first_piece, listed[cell + 1],
                            own_x, own_y, own, cosine, sine, grazing, F(0), F(FAR), PAST,
                        )  # fmt: skip
                        unsure = I(0)
                        for k in range(LANES):
                            unsure |= cone[UNSURE + k]
                        if unsure:
                            walls(
                                lane, lane, cone, solids, items, news, first_piece, listed[cell + 1],
                                own_x, own_y, own, cosine, sine, grazing, 0.0, FAR, 0.0,
                            )  # fmt: skip
                        else:
                            for k in range(LANES):
                                lane[FOUND + k] = min(lane[FOUND + k], wall[FOUND + k])
                    for k in range(LANES):
                        out[place, block + k] = min(F(lane[FOUND + k]), short[LEAST + k])
                        short[LEAST + k] = nothing
