"""Compiled kernels of motion and contact; `steps` has the NumPy version, with the same bits.
`fast` calls these.

Bodies are processed in blocks: first what each one wants, with branches for those that do anything but DRIVE, then
the arcs, LANES bodies at a time; the end of a slice may have fewer (`most`, else None).

Loops take arrays as separate arguments, and access them before any branch: numba would count references to arrays
that are taken out of a tuple, or used in one branch only, and that costs more than everything else.

For contact, bodies are sorted by cell. Each call processes a slice of the rows of cells, so that threads can share
the work. Most bodies have nothing within reach: only their positions are read.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from sleepcast.simulator.motion.driving import (
    DRIVE,
    FORMULAS,
    GOTO,
    approach,
    bounded,
    glided,
    outside,
    slipped,
    spin_left,
    spinning,
    swing_left,
    touched_part,
    tumbling,
    turned_back,
    wheels_follow,
)
from sleepcast.simulator.motion.steps import LIFT, UNIT, UNIT_SPREAD
from sleepcast.simulator.simd.compiled import compiled, inlined, part, strict, usable, woven
from sleepcast.simulator.simd.formulas import LANES, either, shortest, sine_cosine, sine_of_rest, wrap
from sleepcast.simulator.simd.formulas import TURN as FULL
from sleepcast.simulator.simd.lanes import at, put, put_some, some
from sleepcast.simulator.simd.vectors import any_of
from sleepcast.simulator.sonar.kernels import GOLDEN, U, deviate, mixed

BLOCK = 256
"""Bodies whose data stay in the first-level cache."""
SPEED, TURN = 0, BLOCK
"""Offsets of these in a block's scratch array."""
SMALL = 0.7
"""Angles below this are nearer to 0 than to a quarter turn, rad."""

for each in FORMULAS:
    usable(each)


@woven
def wrapped(angle):
    """See `formulas.wrap`; without a division if all angles are out of range by less than a turn."""
    past = angle + np.pi
    if any_of((past < -FULL) | (past >= 2.0 * FULL)):
        return wrap(angle)
    return either(past < 0.0, angle + FULL, either(past >= FULL, angle - FULL, angle))


@woven
def short_arc(laws, left, right, heading):
    """See `driving.arc`; skips the choice of quadrant if all turns are small."""
    turn = (right - left) / laws.track
    half = turn / 2.0
    still, aside = half == 0.0, sine_of_rest(half)
    if any_of(np.abs(half) > SMALL):
        aside = sine_cosine(half)[0]
    chord = (left + right) / 2.0 * either(still, 1.0, aside / either(still, 1.0, half))
    sine, cosine = sine_cosine(heading + half)
    return chord * cosine, chord * sine, turn


@strict
def propose(bodies, laws, roam, draw_left, draw_right, proposal, first, last):
    """See `steps.propose`: for the bodies from `first` to `last` (exclusive)."""
    mode, held, wanted_speed, wanted_turn, _, _, swing = bodies[:7]
    numbers, x, y, heading, _, _, encoder_heading, wheel_mean, wheel_left, wheel_right, _, stores, uses = bodies[9:]
    out_dx, out_dy, out_turn = proposal
    slips = laws.slip_left != 0.0 or laws.slip_right != 0.0 or laws.slip_noise != 0.0
    towards = heading if slips else encoder_heading
    room = np.zeros(2 * BLOCK)
    for begin in range(first, last, BLOCK):
        end = min(begin + BLOCK, last)
        others, ends = begin, end
        if drives(mode, held, begin, end):
            others, ends = drive(laws, wanted_speed, wanted_turn, swing, x, y, stores, uses, room, begin, end)
        if others < ends:
            want(bodies, laws, roam, room, begin, others, ends)
        if laws.track == 0.0:
            glide(laws, room, x, y, heading, wheel_mean, out_dx, out_dy, out_turn, begin, end)
            continue
        set_out(
            *(laws, slips, numbers, draw_left, draw_right, room, x, y, towards, wheel_mean, wheel_left, wheel_right),
            *(out_dx, out_dy, out_turn, begin, end),
        )


@part
def drives(mode, held, first, last):
    """Whether all of these bodies do nothing but DRIVE."""
    others = 0
    for i in range(first, last):
        others += np.int64((mode[i] != DRIVE) | held[i])
    return others == 0


@part
def drive(laws, wanted_speed, wanted_turn, swing, x, y, stores, uses, room, first, last):
    """Write into `room` what bodies in DRIVE mode want, within the limits. Returns the range that contains all bodies
    that may want something else, or are too few at the end."""
    whole = last - (last - first) % LANES
    others, ends = (whole, last) if whole < last else (last, first)
    for i in range(first, whole, LANES):
        special = at(swing, i) != 0.0
        if laws.margin >= 0.0:
            special = special | outside(laws, at(x, i), at(y, i))
        put(room, SPEED + i - first, at(wanted_speed, i))
        put(room, TURN + i - first, at(wanted_turn, i))
        if any_of(special):
            others, ends = min(others, i), max(ends, i + LANES)
    for store in range(uses.shape[0]):
        if uses[store] != 0.0:
            row = stores[store]
            for i in range(first, whole, LANES):
                empty, q = at(row, i) <= 0.0, i - first
                put(room, SPEED + q, either(empty, 0.0, at(room, SPEED + q)))
                put(room, TURN + q, either(empty, 0.0, at(room, TURN + q)))
    return others, ends


@part
def want(bodies, laws, roam, room, begin, first, last):
    """Write into the `room` of the block starting at `begin` the speed and turn rate that each of the bodies from
    `first` to `last` (exclusive) wants, within the limits."""
    mode, held, wanted_speed, wanted_turn, target_x, target_y, swing, roaming, chance = bodies[:9]
    x, y, heading, encoder_x, encoder_y, encoder_heading, _, wheel_left, wheel_right, _, stores, uses = bodies[10:]
    for i in range(first, last):
        speed, turn = wanted_speed[i], wanted_turn[i]
        if mode[i] == GOTO:
            dx = shortest(target_x[i] - encoder_x[i], laws.around_x)
            dy = shortest(target_y[i] - encoder_y[i], laws.around_y)
            speed, turn = approach(laws, dx, dy, encoder_heading[i])
        elif mode[i] != DRIVE:
            drawn = float(mixed(chance[i], roam) >> U(11)) * UNIT - 0.5
            roaming[i] = roaming[i] * laws.retained + drawn * (UNIT_SPREAD * laws.strayed)
            speed, turn = laws.roam_speed, roaming[i]
        moves = not held[i]
        for store in range(uses.shape[0]):
            if uses[store] != 0.0 and stores[store, i] <= 0.0:
                moves = False
        swings = swing[i] != 0.0 and moves
        if swings:
            turn = tumbling(laws, swing[i]) if laws.track != 0.0 else spinning(laws, swing[i])
        if laws.margin >= 0.0 and mode[i] != GOTO and speed != 0.0 and outside(laws, x[i], y[i]):
            turn = turned_back(laws, x[i], y[i], heading[i], speed, turn)
        if swings and laws.track != 0.0:
            swing[i] = swing_left(laws, swing[i], wheel_left[i], wheel_right[i], speed, turn)
        elif swings:
            swing[i] = spin_left(laws, swing[i])
        room[SPEED + i - begin], room[TURN + i - begin] = (speed, turn) if moves else (0.0, 0.0)


@part
def set_out(
    laws, slips, numbers, draw_left, draw_right, room, x, y, towards, wheel_mean, wheel_left, wheel_right,
    out_dx, out_dy, out_turn, begin, end,
):  # fmt: skip
    """Let the wheels follow what is wanted, and propose the resulting displacement."""
    whole = end - (end - begin) % LANES
    for i in range(begin, whole, LANES):
        some_set_out(
            *(laws, slips, numbers, draw_left, draw_right, room, x, y, towards, wheel_mean, wheel_left, wheel_right),
            *(out_dx, out_dy, out_turn, begin, i, None),
        )
    if whole < end:
        some_set_out(
            *(laws, slips, numbers, draw_left, draw_right, room, x, y, towards, wheel_mean, wheel_left, wheel_right),
            *(out_dx, out_dy, out_turn, begin, whole, end - whole),
        )


@woven
def some_set_out(
    laws, slips, numbers, draw_left, draw_right, room, x, y, towards, wheel_mean, wheel_left, wheel_right,
    out_dx, out_dy, out_turn, begin, i, most,
):  # fmt: skip
    """As `set_out`, for at most `most` bodies from `i` on."""
    speed, turn = at(room, SPEED + i - begin), at(room, TURN + i - begin)
    left, right = wheels_follow(laws, some(wheel_left, i, most), some(wheel_right, i, most), speed, turn)
    put_some(wheel_left, i, left, most)
    put_some(wheel_right, i, right, most)
    put_some(wheel_mean, i, (left + right) / 2.0, most)
    left, right, multiples = left * laws.tick, right * laws.tick, some(numbers, i, most) * GOLDEN
    if slips:
        left = slipped(laws, left, laws.slip_left, deviate(mixed(multiples, draw_left)))
        right = slipped(laws, right, laws.slip_right, deviate(mixed(multiples, draw_right)))
    dx, dy, turned = short_arc(laws, left, right, some(towards, i, most))
    own_x, own_y = some(x, i, most), some(y, i, most)
    put_some(out_dx, i, bounded(own_x + dx, laws.left, laws.right) - own_x, most)
    put_some(out_dy, i, bounded(own_y + dy, laws.bottom, laws.top) - own_y, most)
    put_some(out_turn, i, turned, most)


@part
def glide(laws, room, x, y, heading, speed, out_dx, out_dy, out_turn, begin, end):
    """As `set_out`, for bodies without wheels."""
    whole = end - (end - begin) % LANES
    for i in range(begin, whole, LANES):
        some_glide(laws, room, x, y, heading, speed, out_dx, out_dy, out_turn, begin, i, None)
    if whole < end:
        some_glide(laws, room, x, y, heading, speed, out_dx, out_dy, out_turn, begin, whole, end - whole)


@woven
def some_glide(laws, room, x, y, heading, speed, out_dx, out_dy, out_turn, begin, i, most):
    """As `glide`, for at most `most` bodies from `i` on."""
    wanted, turn, before = at(room, SPEED + i - begin), at(room, TURN + i - begin), some(speed, i, most)
    after, dx, dy, turned = glided(laws, before, wanted, turn, some(heading, i, most))
    own_x, own_y = some(x, i, most), some(y, i, most)
    put_some(speed, i, after, most)
    put_some(out_dx, i, bounded(own_x + dx, laws.left, laws.right) - own_x, most)
    put_some(out_dy, i, bounded(own_y + dy, laws.bottom, laws.top) - own_y, most)
    put_some(out_turn, i, turned, most)


@strict
def commit(bodies, laws, proposal, free, hit_x, hit_y, first, last):
    """See `steps.commit`: for the bodies from `first` to `last` (exclusive)."""
    x, y, heading, encoder_x, encoder_y, encoder_heading, speed, left, right, bumper, stores, uses = bodies[10:]
    dx, dy, turn = proposal
    for begin in range(first, last, BLOCK):
        end = min(begin + BLOCK, last)
        for store in range(uses.shape[0]):
            if uses[store] != 0.0:
                spend(laws, speed, free, uses[store], stores[store], begin, end)
        if laws.track != 0.0:
            believe(laws, encoder_x, encoder_y, encoder_heading, left, right, free, begin, end)
        feel(laws, heading, speed, left, right, bumper, free, hit_x, hit_y, begin, end)
        arrive(x, y, heading, dx, dy, turn, free, begin, end)


@part
def spend(laws, speed, free, use, store, first, last):
    """Subtract from a store what each body's path uses up."""
    whole = last - (last - first) % LANES
    for i in range(first, whole, LANES):
        some_spend(laws, speed, free, use, store, i, None)
    if whole < last:
        some_spend(laws, speed, free, use, store, whole, last - whole)


@woven
def some_spend(laws, speed, free, use, store, i, most):
    """As `spend`, for at most `most` bodies from `i` on."""
    used = np.abs(some(speed, i, most)) * laws.tick * some(free, i, most)
    rest = some(store, i, most) - used * use
    put_some(store, i, either(rest < 0.0, 0.0, rest), most)


@part
def believe(laws, x, y, heading, left, right, free, first, last):
    """Update the odometry: bodies move as their wheels have turned, as far as they are free to."""
    whole = last - (last - first) % LANES
    for i in range(first, whole, LANES):
        some_believe(laws, x, y, heading, left, right, free, i, None)
    if whole < last:
        some_believe(laws, x, y, heading, left, right, free, whole, last - whole)


@woven
def some_believe(laws, x, y, heading, left, right, free, i, most):
    """As `believe`, for at most `most` bodies from `i` on."""
    share, towards = some(free, i, most), some(heading, i, most)
    wheel_left, wheel_right = some(left, i, most) * laws.tick, some(right, i, most) * laws.tick
    dx, dy, turn = short_arc(laws, wheel_left, wheel_right, towards)
    put_some(x, i, some(x, i, most) + share * dx, most)
    put_some(y, i, some(y, i, most) + share * dy, most)
    put_some(heading, i, wrapped(towards + turn), most)


@part
def feel(laws, heading, speed, left, right, bumper, free, hit_x, hit_y, first, last):
    """Let the bumpers report what stopped their bodies, if anything did."""
    feels = laws.parts != 0.0
    touched = False
    for i in range(first, last):
        touched |= (free[i] < 1.0) | (feels & (bumper[i] != 0.0))
    if not touched:  # the most common case
        return
    for i in range(first, last):
        if free[i] < 1.0:
            if feels:
                bumper[i] = touched_part(laws, hit_x[i], hit_y[i], heading[i])
            if laws.slides == 0.0:
                speed[i], left[i], right[i] = 0.0, 0.0, 0.0
        elif feels and bumper[i] != 0.0:
            bumper[i] = 0.0


@part
def arrive(x, y, heading, dx, dy, turn, free, first, last):
    """Move the bodies as far as they are free to."""
    whole = last - (last - first) % LANES
    for i in range(first, whole, LANES):
        some_arrive(x, y, heading, dx, dy, turn, free, i, None)
    if whole < last:
        some_arrive(x, y, heading, dx, dy, turn, free, whole, last - whole)


@woven
def some_arrive(x, y, heading, dx, dy, turn, free, i, most):
    """As `arrive`, for at most `most` bodies from `i` on."""
    share = some(free, i, most)
    put_some(x, i, some(x, i, most) + share * some(dx, i, most), most)
    put_some(y, i, some(y, i, most) + share * some(dy, i, most), most)
    put_some(heading, i, wrapped(some(heading, i, most) + some(turn, i, most)), most)


@strict
def slide(bodies, laws, proposal, free, hit_x, hit_y, first, last):
    """See `steps.slide`: turn the proposals of bodies that slide, once they have moved as far as they are free to, into
    the ways that they still want to go, 0 for all that nothing has stopped. Returns whether anything has stopped any
    of them."""
    x, y = bodies[10:12]
    dx, dy, _ = proposal
    touched = 0
    for i in range(first, last):
        way_x, way_y = 0.0, 0.0
        if free[i] < 1.0:
            touched = 1
            rest, to_x, to_y = 1.0 - free[i], hit_x[i], hit_y[i]
            way_x, way_y = rest * dx[i], rest * dy[i]
            away = sqrt(to_x * to_x + to_y * to_y)
            away = away if away > 0.0 else 1.0
            to_x, to_y = to_x / away, to_y / away
            towards = way_x * to_x + way_y * to_y
            towards = (0.0 if towards < 0.0 else towards) + LIFT * sqrt(way_x * way_x + way_y * way_y)
            way_x, way_y = way_x - towards * to_x, way_y - towards * to_y
        dx[i] = bounded(x[i] + way_x, laws.left, laws.right) - x[i]
        dy[i] = bounded(y[i] + way_y, laws.bottom, laws.top) - y[i]
    return touched


@strict
def displace(bodies, laws, proposal, free, before, first, last):
    """See `Bodies.displace`: move bodies that something has stopped `before` by the free share of their ways."""
    x, y, heading, encoder_x, encoder_y, encoder_heading = bodies[10:16]
    dx, dy, _ = proposal
    for i in range(first, last):
        if before[i] >= 1.0:
            continue
        way_x, way_y = free[i] * dx[i], free[i] * dy[i]
        if laws.track != 0.0:
            sine, cosine = sine_cosine(encoder_heading[i] - heading[i])
            encoder_x[i] += way_x * cosine - way_y * sine
            encoder_y[i] += way_x * sine + way_y * cosine
        x[i] += way_x
        y[i] += way_y


# ---- contact: how far bodies get before they touch


FAR = 1e9
"""Distance to nothing, m."""
LITTLE = 1e-6
"""Extra search distance, m, so that rounding never hides anything."""


@inlined
def off(px, py, x0, y0, x1, y1):
    """Vector from a point to the nearest point of a line; see `grid.nearest_point`."""
    ex, ey = x1 - x0, y1 - y0
    length2 = ex * ex + ey * ey
    share = ((px - x0) * ex + (py - y0) * ey) / (length2 if length2 > 0.0 else 1.0)
    share = min(max(share, 0.0), 1.0)
    return x0 + share * ex - px, y0 + share * ey - py


@inlined
def touch_point(gap_x, gap_y, dx, dy, apart):
    """See `steps.touch`: for a point."""
    towards = dx * gap_x + dy * gap_y
    rest = gap_x * gap_x + gap_y * gap_y - apart * apart
    root = towards * towards - (dx * dx + dy * dy) * rest
    if towards <= 0.0 or root < 0.0:
        return 2.0
    stop = rest / (towards + sqrt(root))
    return stop if stop < 1.0 else 2.0


@compiled
def touch(px, py, dx, dy, x0, y0, x1, y1, apart):
    """See `steps.touch`."""
    gap_x, gap_y = off(px, py, x0, y0, x1, y1)
    if gap_x * gap_x + gap_y * gap_y < apart * apart:
        stop = 0.0 if dx * gap_x + dy * gap_y > 0.0 else 2.0
    else:
        stop = min(touch_point(x0 - px, y0 - py, dx, dy, apart), touch_point(x1 - px, y1 - py, dx, dy, apart))
        ex, ey = x1 - x0, y1 - y0
        length2 = ex * ex + ey * ey
        height, rate = ex * (py - y0) - ey * (px - x0), ex * dy - ey * dx
        sign = -1.0 if height < 0.0 else 1.0
        if rate * sign < 0.0:
            side = max((height * sign - apart * sqrt(length2)) / -(rate * sign), 0.0)
            along = (px + side * dx - x0) * ex + (py + side * dy - y0) * ey
            if side < 1.0 and 0.0 <= along <= length2:
                stop = min(stop, side)
    gone = stop if stop < 1.0 else 0.0
    gap_x, gap_y = off(px + gone * dx, py + gone * dy, x0, y0, x1, y1)
    return stop, gap_x, gap_y


@compiled
def gather(order, x, y, way_x, way_y, first, last, into):
    """Write positions into the rows of `into`, sorted by cell; returns the square of the longest way of these
    bodies."""
    longest = 0.0
    for i in range(first, last):
        longest = max(longest, way_x[i] * way_x[i] + way_y[i] * way_y[i])
    for i in range(first, last):
        o = U(order[i])
        into[0, i], into[1, i] = x[o], y[o]
    return longest


@inlined
def radius_of(radii, order, i):
    """Radius of the i-th body in sorted order. radii: by body, or one for all."""
    return radii[order[i]] if radii.shape[0] > 1 else radii[0]


@inlined
def comes_first(stop, hx, hy, best, best_x, best_y):
    """Whether a stop comes before the best one so far; of equal ones the last in x, then y, wins."""
    return stop < best or (stop == best and (hx > best_x or (hx == best_x and hy > best_y)))


@inlined
def lines_near(x, reach, inverse, most):
    """The first and the last row or column of cells within reach of x. inverse: 1 / side of a cell."""
    return U(max(int((x - reach) * inverse), 0)), U(min(int((x + reach) * inverse), most - 1))


@inlined
def from_boxes(boxes, items, first, last, px, py):
    """Distance of a point, in x or in y, from the nearest of the boxes of the listed solids `first` to `last`; negative
    inside a box."""
    least = FAR
    for w in range(first, last):
        s = U(items[w])
        beside, above = max(boxes[s, 0] - px, px - boxes[s, 1]), max(boxes[s, 2] - py, py - boxes[s, 3])
        least = min(least, max(beside, above))
    return least


@inlined
def anybody_near(x, y, px, py, start, reach, inverse, grid_columns, grid_rows):
    """Whether another body is within reach of the one at px, py."""
    near_ones = 0
    left, right = lines_near(px, reach + LITTLE, inverse, grid_columns)
    below, above = lines_near(py, reach + LITTLE, inverse, grid_rows)
    for r in range(below, above + U(1)):
        for j in range(U(start[r * U(grid_columns) + left]), U(start[r * U(grid_columns) + right + U(1)])):
            gx, gy = x[j] - px, y[j] - py
            near_ones += np.int64(gx * gx + gy * gy <= reach * reach)
    return near_ones > 1  # one of them is the body itself


@compiled
def stop_at_old(
    x, y, way_x, way_y, radii, order, start, size, grid_columns, grid_rows, solids, boxes, listed, items, skin, longest,
    reach, first_row, last_row, close, near, free, hit_x, hit_y, out_free, out_x, out_y,
):  # fmt: skip
    """First round of `steps.settle`, in sorted order: ways end at solids and at old positions of others.

    way_x, way_y: by body
    longest: the longest way, m
    boxes: around the solids, see `steps.boxes_of`
    close: False if no body is known to be within reach
    near: set to whether there is one; if not, this round is the last, and writes the results
    """
    inverse = 1.0 / size
    for cell in range(U(first_row * grid_columns), U(last_row * grid_columns)):
        first_item, last_item = U(listed[cell]), U(listed[cell + U(1)])
        for i in range(U(start[cell]), U(start[cell + U(1)])):
            near[i] = close[i]
            if not close[i] and first_item == last_item:
                continue
            px, py, radius = x[i], y[i], radius_of(radii, order, i)
            best, best_x, best_y = 1.0, 0.0, 0.0
            far = radius + skin + longest + LITTLE
            beside = from_boxes(boxes, items, first_item, last_item, px, py) <= far
            if not beside and not near[i]:
                continue
            for w in range(first_item, last_item if beside else first_item):
                s = U(items[w])
                x0, y0, x1, y1, limit = (
                    solids[s, 0],
                    solids[s, 1],
                    solids[s, 2],
                    solids[s, 3],
                    radius + solids[s, 4] + skin,
                )
                wx, wy = way_x[order[i]], way_y[order[i]]
                way = sqrt(wx * wx + wy * wy) + skin
                ox, oy = off(px, py, x0, y0, x1, y1)
                if ox * ox + oy * oy > (limit + way) ** 2:
                    continue
                stop, hx, hy = touch(px, py, wx, wy, x0, y0, x1, y1, limit)
                if stop < 1.0 and comes_first(stop, hx, hy, best, best_x, best_y):
                    best, best_x, best_y = stop, hx, hy
            if near[i]:
                near[i] = anybody_near(x, y, px, py, start, reach, inverse, grid_columns, grid_rows)
            if near[i]:
                wx, wy, other, other_x, other_y = way_x[order[i]], way_y[order[i]], best, 0.0, 0.0
                left, right = lines_near(px, reach + LITTLE, inverse, grid_columns)
                below, above = lines_near(py, reach + LITTLE, inverse, grid_rows)
                for r in range(below, above + U(1)):
                    for j in range(U(start[r * U(grid_columns) + left]), U(start[r * U(grid_columns) + right + U(1)])):
                        gx, gy = x[j] - px, y[j] - py
                        if gx * gx + gy * gy > reach * reach or j == i:
                            continue
                        apart = radius + radius_of(radii, order, j) + skin
                        stop, hx, hy = touch(px, py, wx, wy, x[j], y[j], x[j], y[j], apart)
                        if stop < best and comes_first(stop, hx, hy, other, other_x, other_y):
                            other, other_x, other_y = stop, hx, hy
                if other < best:
                    best, best_x, best_y = other, other_x, other_y
                free[i], hit_x[i], hit_y[i] = best, best_x, best_y
            elif best < 1.0:
                o = order[i]
                out_free[o], out_x[o], out_y[o] = best, best_x, best_y


@compiled
def stop_at_ways(
    x, y, way_x, way_y, radii, order, start, size, grid_columns, grid_rows, skin, reach, first_row, last_row,
    near, free, hit_x, hit_y, out_free, out_x, out_y,
):  # fmt: skip
    """Second round, for bodies with others near: ways end at the remaining ways of others. Writes the results of the
    bodies that are stopped."""
    inverse = 1.0 / size
    for i in range(U(start[first_row * grid_columns]), U(start[last_row * grid_columns])):
        if not near[i]:
            continue
        best, best_x, best_y, first = free[i], hit_x[i], hit_y[i], free[i]
        px, py, wx, wy = x[i], y[i], way_x[order[i]], way_y[order[i]]
        mx, my = best * wx, best * wy
        left, right = lines_near(px, reach + LITTLE, inverse, grid_columns)
        below, above = lines_near(py, reach + LITTLE, inverse, grid_rows)
        for r in range(below, above + U(1)):
            for j in range(U(start[r * U(grid_columns) + left]), U(start[r * U(grid_columns) + right + U(1)])):
                gx, gy = x[j] - px, y[j] - py
                if gx * gx + gy * gy > reach * reach or j == i:
                    continue
                ox, oy = free[j] * way_x[order[j]], free[j] * way_y[order[j]]
                if (ox == 0.0 and oy == 0.0) or (mx * gx + my * gy <= 0.0 and ox * gx + oy * gy >= 0.0):
                    continue
                apart = radius_of(radii, order, i) + radius_of(radii, order, j) + skin
                hx, hy = off(px, py, x[j], y[j], x[j] + ox, y[j] + oy)
                if hx * hx + hy * hy < apart * apart:
                    stop = 0.0
                else:
                    stop, hx, hy = touch(px, py, wx, wy, x[j], y[j], x[j] + ox, y[j] + oy, apart)
                if stop < first and comes_first(stop, gx, gy, best, best_x, best_y):
                    best, best_x, best_y = stop, gx, gy
        if best < 1.0:
            o = order[i]
            out_free[o], out_x[o], out_y[o] = best, best_x, best_y
