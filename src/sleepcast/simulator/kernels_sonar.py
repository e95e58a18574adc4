"""Compiled kernels of the sonars: what all cones of a ring see; `fast` calls them.

Most bodies are looked at in single precision, sixteen at a time, and only by the two cones of a ring of sixteen that
their bearing falls between; the few *doubtful* ones (near enough for more cones, or barely met by the edge of one)
again by all cones in double precision. So no decision and no range hangs on the last bit of a short number. Positions
are whole numbers of a unit that is a tiny share of a cell: their differences are exact in any world. Walls are done in
double precision: what a cone sees of a line depends on the line's direction alone but for its distance, so walls are
taken by direction, and each costs a few operations a cone.

Robots come in the order of their cells, each with a row of squared ranges of its own. The bodies in reach of several
robots are put into one list before they are looked at, so that vectors are full even where there are few. Each call
does a stretch of rows of cells, so that threads can share the work; every robot's numbers come out the same whoever
does them.

Loops over `LANES` are meant to become vector instructions: their bodies are large enough not to be unrolled, and their
scratch lies in one array, so that it is plain that nothing overlaps.
"""

from __future__ import annotations

from math import cos, pi, sin, sqrt

import numpy as np

from sleepcast.simulator.compiled import compiled, inlined
from sleepcast.simulator.formulas import sine_cosine
from sleepcast.simulator.lanes import LANES, all_passed, keep, pack, pass_by
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
"""Metres, or units, to a body that is none."""
SPAN = 28
"""Units of a position in a cell, as a power of two: bodies may be some cells apart, and the unit is finer than what
single precision tells of their distance."""
BATCH = 16
"""Robots whose bodies in reach are looked at together: what they need stays in the nearest cache."""
BLOCK = 64
"""Robots whose headings are turned into cosines and sines together: a few vectors."""
OWNER, OTHER = 26, (1 << 26) - 1
"""In the lists of bodies in reach: the bits from which on the robot's place in its batch is written, and those of the
body's number."""
COS_225, SIN_225 = F(cos(pi / 8)), F(sin(pi / 8))
ROOT_HALF = F(sqrt(0.5))
# Scratch, in runs of LANES. Of walls, in single and in double precision: how far the transducer is off and along for a
# direction of walls, where the cone begins and ends on either side for each metre of distance, what was found, squared;
# in double precision also the axes of the cones.
OFF, ON, LOW_LEFT, HIGH_LEFT, LOW_RIGHT, HIGH_RIGHT, FOUND, AXIS_X, AXIS_Y = (LANES * run for run in range(9))
# Of bodies: 0 for those that are doubtful and 1 for others, squared ranges of the even and the odd one of the two
# cones beside a body, and the least so far of each cone of each robot of a batch. Whole numbers: which cones those two
# are, and whether ranges of walls are doubtful.
CERTAIN, EVEN, ODD, LEAST = (LANES * run for run in range(4))
UNSURE = 2 * LANES


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
def look_around(
    list_ahead, list_aside, number, n, lone2, cos_0, sin_0, cos_1, sin_1, off_out, off_ahead, radius, barely, past,
    nothing, short, cone, doubtful,
):  # fmt: skip
    """Let the two cones beside each of `n` bodies look at it in single precision, and put the places of those that are
    doubtful into `doubtful`; gives how many."""
    found = U(0)
    for j0 in range(U(0), n, U(LANES)):
        for j1 in range(LANES):
            j = j0 + U(j1)
            ahead, aside = list_ahead[j], list_aside[j]
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
            short[CERTAIN + j1] = F(1) if alone & (not (doubt0 | doubt1)) else F(0)
            row = I(number[j] >> I(OWNER - 4)) & I(-LANES)
            cone[j1], cone[LANES + j1] = ((sector + I(1)) & I(14)) + row, (sector | I(1)) + row
        for j in range(LANES):
            k = U(LEAST) + U(cone[j])
            short[k] = min(short[k], short[EVEN + j])
            k = U(LEAST) + U(cone[LANES + j])
            short[k] = min(short[k], short[ODD + j])
        found = pack(short, j0, doubtful, found)
    return found


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


@inlined
def look_again(
    x, y, order, radii, solids, listed, items, news, own, common, most, cosine, sine, graze, grazing, nothing,
    axis_cos, axis_sin, i, co, si, cell, mixed, number, doubtful, begin, end, short, least, lane, wall, cone, out, row,
):  # fmt: skip
    """Let all cones of robot `i` in `cell`, whose heading has this cosine and sine, look at its doubtful bodies, those
    from `begin` up to `end`, and at solids; and put the least ranges into a row of `out`."""
    own_x, own_y = x[order[i]], y[order[i]]
    first_piece = listed[cell]
    while first_piece < listed[cell + 1] and news[first_piece] == ROUND:
        first_piece += 1
    for block in range(0, axis_cos.shape[0], LANES):
        for k in range(LANES):
            lane[AXIS_X + k] = axis_cos[block + k] * co - axis_sin[block + k] * si
            lane[AXIS_Y + k] = axis_sin[block + k] * co + axis_cos[block + k] * si
            lane[FOUND + k] = most * most
        for j in range(begin, end):
            other = U(number[doubtful[j]] & OTHER)
            radius = radii[other] if mixed else common
            dx, dy = x[order[other]] - own_x, y[order[other]] - own_y
            look_closely(lane, dx, dy, radius, own, cosine, sine, graze)
        for w in range(listed[cell], first_piece):
            s = items[w, 0]
            look_closely(lane, solids[0, s] - own_x, solids[1, s] - own_y, solids[5, s], own, cosine, sine, graze)
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
            out[row, block + k] = min(F(lane[FOUND + k]), short[least + k])


@inlined
def stop_list(ahead, aside, number, n, radii, common, mixed):
    """Put bodies that are none after the last one of a list; make those doubtful that have another radius than most."""
    for k in range(LANES):
        ahead[n + U(k)], aside[n + U(k)], number[n + U(k)] = AWAY, F(0), I(0)
    if mixed:
        for j in range(n):
            if radii[number[j] & OTHER] != common:
                ahead[j], aside[j] = F(0), F(0)


@inlined
def longer(values, used, room):
    """An array of so much room with the `used` first values of this one."""
    found = np.empty(room, values.dtype)
    for j in range(used):
        found[j] = values[j]
    return found


@inlined
def turn(heading, order, first, last, cosines, sines):
    """Put cosine and sine of the headings of robots `first` up to `last` where they are looked for."""
    for i in range(first, last):
        cosines[i - first] = heading[order[i]]
    for i in range(last - first):
        sines[i], cosines[i] = sine_cosine(cosines[i])


@compiled
def see(
    x, y, heading, order, fixed_x, fixed_y, radii, rows, start, size, across, up, solids, listed, items, news,
    own, common, reach, most, cosine, sine, graze, grazing, lone, unit, mixed, forward, axis_cos, axis_sin,
    first_row, last_row, close, out,
):  # fmt: skip
    """What robots in the rows of cells from `first_row` up to `last_row` see, squared; see `cones.ranges`.

    x, y, heading: of all robots, whose `order` is that of their cells; all else is sorted. fixed_x, fixed_y: x and y in
    units of `unit` m, with LANES more at the end. rows: for each its row in `out`, or -1 if nobody asks. size: of a
    cell, at least the reach. solids, listed, items, news: see `walls.Walls`. own: radius of those who look; common: the
    usual radius (bodies of others cost more; if there are none, `mixed` says so, and radii is not read); reach: how far
    a middle may be. lone: beyond this distance a body of the common radius is seen by the two nearest of sixteen sonars
    only; negative where there are not sixteen. forward: whether nobody asks for cones that look behind. axis_cos,
    axis_sin: of the cones, as many as a row of `out` is long: a multiple of LANES. close: is made False for those who
    find nobody within `lone`.
    """
    count = axis_cos.shape[0]
    nothing = F(most * most)
    reach2, lone2 = F(((reach + 1e-4) / unit) ** 2), F(lone * lone if lone >= 0.0 else AWAY)
    half = np.arctan2(sine, cosine)
    # What a cone that looks aside or ahead meets is at most so far behind, and those who are close count anyhow.
    aslant = F(sine / cosine)
    behind = -F(max(common * (1.0 + sine / cosine), lone) + 0.01) if forward else -AWAY
    cos_0, sin_0, cos_1, sin_1 = F(cosine), F(sine), F(cos(pi / 8 - half)), F(sin(pi / 8 - half))
    off_out, off_ahead, radius = F(own * sine), F(own * cosine), F(common)
    barely, past = F(common * graze) - GRAZING, F(common * graze) + PAST
    room = 1024
    ahead, aside, number, doubtful = np.empty(room, F), np.empty(room, F), np.empty(room, I), np.empty(room, I)
    lane, wall = np.zeros(9 * LANES), np.zeros(7 * LANES, F)
    short, cone = np.empty((3 + BATCH) * LANES, F), np.zeros(3 * LANES, I)
    batch, cells = np.empty(BATCH, np.int64), np.empty(BATCH, np.int64)
    cosines, sines, turned = np.empty(BLOCK), np.empty(BLOCK), np.empty(2 * BATCH)
    held, n, last = 0, U(0), start[last_row * across] - 1
    ready = block = start[first_row * across]
    for row in range(first_row, last_row):
        below, above = max(row - 1, 0), min(row + 1, up - 1)
        for column in range(across):
            cell = row * across + column
            if start[cell] == start[cell + 1]:
                continue
            left, right = max(column - 1, 0), min(column + 1, across - 1) + 1
            total = 0
            for r in range(below, above + 1):
                total += start[r * across + right] - start[r * across + left]
            if np.int64(n) + BATCH * total + 2 * LANES > room:
                room = 2 * (np.int64(n) + BATCH * total + LANES)
                ahead, aside, number = longer(ahead, n, room), longer(aside, n, room), longer(number, n, room)
                doubtful = np.empty(room, I)
            for i in range(start[cell], start[cell + 1]):
                if i == ready:
                    block, ready = ready, min(ready + BLOCK, last + 1)
                    turn(heading, order, block, ready, cosines, sines)
                if rows[i] >= 0:
                    for k in range(LANES):
                        short[LEAST + held * LANES + k] = nothing
                    co, si = cosines[i - block], sines[i - block]
                    for r in range(below, above + 1):
                        begin, end = U(start[r * across + left]), U(start[r * across + right])
                        for j0 in range(begin, end, U(LANES)):
                            n = keep(
                                fixed_x, fixed_y, j0, end, U(i), fixed_x[i], fixed_y[i], F(co) * F(unit),
                                F(si) * F(unit), reach2, aslant, behind, I(held << OWNER), ahead, aside, number, n,
                            )  # fmt: skip
                    batch[held], cells[held] = i, cell
                    turned[held], turned[BATCH + held] = co, si
                    held += 1
                if held < BATCH and i < last:
                    continue
                stop_list(ahead, aside, number, n, radii, common, mixed)
                doubts = look_around(
                    ahead, aside, number, n, lone2, cos_0, sin_0, cos_1, sin_1, off_out, off_ahead,
                    radius, barely, past, nothing, short, cone, doubtful,
                )  # fmt: skip
                done = U(0)
                for b in range(held):
                    me, its, mine = batch[b], cells[b], done
                    while done < doubts and number[doubtful[done]] >> OWNER == b:
                        done += U(1)
                    close[me] = mine != done
                    if mine == done and listed[its] == listed[its + 1] and count == LANES:
                        pass_by(short, LEAST + b * LANES, out, rows[me], 0)
                    else:
                        look_again(
                            x, y, order, radii, solids, listed, items, news, own, common, most, cosine, sine, graze,
                            grazing, nothing, axis_cos, axis_sin, me, turned[b], turned[BATCH + b], its, mixed, number,
                            doubtful, mine, done, short, LEAST + b * LANES, lane, wall, cone, out, rows[me],
                        )  # fmt: skip
                held, n = 0, U(0)
    all_passed()
