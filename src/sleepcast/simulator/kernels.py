"""Compiled kernels: sorting, sonar cones and contact for many bodies, with numba; `fast` calls them.

Sonar looks at most bodies and lines in single precision, sixteen at a time, and at the few *doubtful* ones again in
double precision: bodies that a cone's edge barely meets, lines that a cone's edge barely reaches or runs along. So no
decision and no range hangs on the last bit of a short number, and readings stay within a few micrometres of the exact
ones. Positions are taken relative to the middle of a cell, where short numbers are fine enough for any world.

Each call does a stretch of rows of cells, so that threads can share the work; every robot's numbers come out the same
whoever does them.
"""

from __future__ import annotations

from math import ceil, sqrt

import numpy as np

from sleepcast.channel import chance
from sleepcast.simulator.compiled import compiled, inlined
from sleepcast.simulator.noise import MIDDLE, SCALE

LANES = 16
F = np.float32
U = np.uint64
GOLDEN = U(chance.GOLDEN)
GRAZING = F(6e-3)
"""Metres before a body's rim within which an edge of a cone counts as barely meeting it: the range then changes by up
to four times the error of the place."""
PAST = F(2e-4)
"""Metres beyond a rim or an end within which single precision cannot tell whether it is met."""
ALONG = F(0.3)
"""Cosine between a cone's edge and the perpendicular of a line, below which the edge runs along it."""
TOUCH = F(2e-3)
"""Metres between a sonar and the line of a wall, below which their angles cannot be told in single precision."""
NEARLY = F(0.98)
"""What a squared range is taken times, to tell whether it may be the least in spite of its error."""
FAR = F(1e9)
NOTHING = 1e30
"""Metres to what is not seen; finite, because the kernels are compiled for finite numbers."""


def _folded() -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """The two sonars of a ring of sixteen that lie beside a body, by how its bearing was folded.

    Bits: 1 to the right, 2 behind, 4 more aside than ahead, 8 mirrored at 22.5 degrees. Folded, the bearing is between
    0 and 22.5 degrees; unfolded, these two angles are those of the sonars.
    """
    found = []
    for bits in range(16):
        for angle in (0.0, 22.5):
            angle = 45.0 - angle if bits & 8 else angle
            angle = 90.0 - angle if bits & 4 else angle
            angle = 180.0 - angle if bits & 2 else angle
            angle = -angle if bits & 1 else angle
            found.append(round(angle / 22.5) % 16)
    return np.array(found, np.int64)


BESIDE = _folded()
COS_225, SIN_225 = F(np.cos(np.pi / 8)), F(np.sin(np.pi / 8))
ROOT_HALF = F(np.sqrt(0.5))


@compiled
def sort(x, y, size, across, up, cells, start, order):
    """Counting sort by cell; see `grid.sort`. cells: room for the cell of each point."""
    start[:] = 0
    for i in range(x.shape[0]):
        column = min(max(int(x[i] / size), 0), across - 1)
        row = min(max(int(y[i] / size), 0), up - 1)
        cells[i] = row * across + column
        start[cells[i] + 1] += 1
    for cell in range(across * up):
        start[cell + 1] += start[cell]
    for i in range(x.shape[0]):
        order[start[cells[i]]] = i
        start[cells[i]] += 1
    for cell in range(across * up, 0, -1):
        start[cell] = start[cell - 1]
    start[0] = 0


@inlined
def disc64(ahead, aside, own, radius, cosine, sine, graze):
    """Range of a disc in one cone; see `cones.disc_range`."""
    along = ahead - own
    outside = aside * cosine - along * sine
    if outside <= 0.0:
        return max(sqrt(along * along + aside * aside) - radius, 0.0)
    forward = along * cosine + aside * sine
    if outside < radius * graze and forward > 0.0:
        return max(forward - sqrt(radius * radius - outside * outside), 0.0)
    return NOTHING


@inlined
def line64(height, begin, length, normal, tangent, own, cosine, sine, grazing):
    """Range of a line in one cone; see `cones.line_range`."""
    away = height - own * normal
    if away < 0.0:
        away, normal = -away, -normal
    first, last = normal * cosine + tangent * sine, normal * cosine - tangent * sine
    if first <= 0.0 and last <= 0.0:
        return NOTHING
    low, high = -away * grazing, away * grazing
    if first > 0.0:
        low = max(low, away * (tangent * cosine - normal * sine) / first)
    if last > 0.0:
        high = min(high, away * (tangent * cosine + normal * sine) / last)
    low, high = max(low, begin - own * tangent), min(high, begin - own * tangent + length)
    if low > high:
        return NOTHING
    foot = min(max(0.0, low), high)
    return sqrt(away * away + foot * foot)


@inlined
def edge32(along, aside, radius, graze, cosine, sine, most):
    """A disc in one cone, in single precision: its range, and whether that is doubtful."""
    outside = aside * cosine - along * sine
    forward = along * cosine + aside * sine
    within = outside <= F(0)
    root = sqrt(max(forward * forward + outside * outside if within else radius * radius - outside * outside, F(0)))
    doubtful = (outside > graze - GRAZING) & (outside < graze + PAST)
    seen = root - radius if within else forward - root
    return (seen if (outside < graze) & (not doubtful) else most), doubtful


@compiled
def see(
    x, y, cosines, sines, order, start, asked, size, across, up, solids, listed, items,
    own, most, cosine, sine, graze, grazing, lone, axis_cos, axis_sin, first_row, last_row, out,
):  # fmt: skip
    """What robots in the rows of cells from `first_row` up to `last_row` see; see `cones.ranges`.

    asked: for each robot its row in `out`, or -1. solids: as columns x, y, unit vector, length, radius. lone: beyond
    this distance a body is seen by the two nearest of sixteen sonars only; negative where there are not sixteen.
    """
    count = axis_cos.shape[0]
    lanes = (count + LANES - 1) // LANES * LANES
    f_own, f_most, f_cos, f_sin = F(own), F(most), F(cosine), F(sine)
    f_graze, f_grazing = F(own * graze), F(min(grazing, 1e6))
    reach = own + most + own
    reach2, lone2 = F((reach + 1e-4) ** 2), F(lone * lone if lone >= 0.0 else 1e18)
    steps = ceil(reach / size)
    half = np.empty(steps + 1, np.int64)  # cells to either side that are in reach, by how many rows away
    for r in range(steps + 1):
        rows_apart = max(r - 1, 0) * size
        half[r] = ceil(sqrt(max(reach * reach - rows_apart * rows_apart, 0.0)) / size)
    room = 1024
    cx, cy, cp = np.empty(room, F), np.empty(room, F), np.empty(room, np.int32)
    bx, by, bp = np.empty(room + LANES, F), np.empty(room + LANES, F), np.empty(room + LANES, np.int32)
    d0, d1 = np.empty(room + LANES, F), np.empty(room + LANES, F)
    bits = np.empty(room + LANES, np.int32)
    close = np.empty(room + 1, np.int32)
    ax, ay = np.zeros(lanes), np.zeros(lanes)
    fx, fy = np.zeros(lanes, F), np.zeros(lanes, F)
    best, walls, exact = np.empty(lanes, F), np.empty(lanes, F), np.empty(lanes)
    unsure = np.empty(lanes, np.int32)
    for row in range(first_row, last_row):
        for column in range(across):
            cell = row * across + column
            if start[cell] == start[cell + 1]:
                continue
            middle_x, middle_y = (column + 0.5) * size, (row + 0.5) * size
            total = 0
            for r in range(max(row - steps, 0), min(row + steps, up - 1) + 1):
                left, right = max(column - half[abs(r - row)], 0), min(column + half[abs(r - row)], across - 1)
                total += start[r * across + right + 1] - start[r * across + left]
            if total > room:
                room = total
                cx, cy, cp = np.empty(room, F), np.empty(room, F), np.empty(room, np.int32)
                bx, by, bp = np.empty(room + LANES, F), np.empty(room + LANES, F), np.empty(room + LANES, np.int32)
                d0, d1 = np.empty(room + LANES, F), np.empty(room + LANES, F)
                bits = np.empty(room + LANES, np.int32)
                close = np.empty(room + 1, np.int32)
            m = 0
            for r in range(max(row - steps, 0), min(row + steps, up - 1) + 1):
                left, right = max(column - half[abs(r - row)], 0), min(column + half[abs(r - row)], across - 1)
                for p in range(start[r * across + left], start[r * across + right + 1]):
                    cx[m], cy[m], cp[m] = F(x[p] - middle_x), F(y[p] - middle_y), p
                    m += 1
            for i in range(start[cell], start[cell + 1]):
                place = asked[order[i]]
                if place < 0:
                    continue
                px, py = F(x[i] - middle_x), F(y[i] - middle_y)
                co, si = F(cosines[i]), F(sines[i])
                n, near = U(0), U(0)
                for j in range(m):
                    dx, dy = cx[j] - px, cy[j] - py
                    bx[n], by[n], bp[n] = dx, dy, cp[j]
                    n += U(dx * dx + dy * dy < reach2)
                for k in range(lanes):
                    best[k] = f_most
                    exact[k] = most
                for j0 in range(U(0), n, U(LANES)):
                    for j1 in range(LANES):
                        j = j0 + U(j1)
                        ahead, aside = bx[j] * co + by[j] * si, by[j] * co - bx[j] * si
                        bit = np.int32(1) if aside < F(0) else np.int32(0)
                        bit |= np.int32(2) if ahead < F(0) else np.int32(0)
                        ahead, aside = abs(ahead), abs(aside)
                        bit |= np.int32(4) if aside > ahead else np.int32(0)
                        a, b = max(ahead, aside), min(ahead, aside)
                        mirrored = b * COS_225 > a * SIN_225
                        bit |= np.int32(8) if mirrored else np.int32(0)
                        a, b = (
                            (a + b) * ROOT_HALF if mirrored else a,
                            (a - b) * ROOT_HALF if mirrored else b,
                        )
                        seen0, doubt0 = edge32(a - f_own, b, f_own, f_graze, f_cos, f_sin, f_most)
                        seen1, doubt1 = edge32(
                            a * COS_225 + b * SIN_225 - f_own, a * SIN_225 - b * COS_225,
                            f_own, f_graze, f_cos, f_sin, f_most,
                        )  # fmt: skip
                        alone = bx[j] * bx[j] + by[j] * by[j] > lone2
                        d0[j], d1[j] = seen0 if alone else f_most, seen1 if alone else f_most
                        bits[j] = bit | (np.int32(0) if alone & (not (doubt0 | doubt1)) else np.int32(16))
                for j in range(n):
                    pair = U(bits[j] & 15) * U(2)
                    k0, k1 = U(BESIDE[pair]), U(BESIDE[pair + U(1)])
                    best[k0] = min(best[k0], d0[j])
                    best[k1] = min(best[k1], d1[j])
                    close[near] = bp[j]
                    near += U((bits[j] >> 4) & (bp[j] != i))
                w0, w1 = listed[cell], listed[cell + 1]
                if near > 0 or w1 > w0:
                    for k in range(count):
                        ax[k] = cosines[i] * axis_cos[k] - sines[i] * axis_sin[k]
                        ay[k] = sines[i] * axis_cos[k] + cosines[i] * axis_sin[k]
                        fx[k], fy[k] = F(ax[k]), F(ay[k])
                for j in range(near):
                    dx, dy = x[close[j]] - x[i], y[close[j]] - y[i]
                    for k in range(lanes):
                        seen = disc64(
                            dx * ax[k] + dy * ay[k], abs(dy * ax[k] - dx * ay[k]), own, own, cosine, sine, graze
                        )
                        exact[k] = min(exact[k], seen)
                for k in range(lanes):
                    walls[k] = best[k] * best[k]
                for w in range(w0, w1):
                    s = items[w]
                    dx, dy = solids[0, s] - x[i], solids[1, s] - y[i]
                    ex, ey, length, radius = solids[2, s], solids[3, s], solids[4, s], solids[5, s]
                    if radius > 0.0:
                        if dx * dx + dy * dy < (own + most + radius) ** 2:
                            for k in range(count):
                                seen = disc64(
                                    dx * ax[k] + dy * ay[k], abs(dy * ax[k] - dx * ay[k]),
                                    own, radius, cosine, sine, graze,
                                )  # fmt: skip
                                exact[k] = min(exact[k], seen)
                        continue
                    height, begin = dy * ex - dx * ey, dx * ex + dy * ey
                    foot = min(max(0.0, begin), begin + length)
                    if height * height + foot * foot > (own + most) ** 2:
                        continue
                    f_height, f_begin, f_end, f_ex, f_ey = F(height), F(begin), F(begin + length), F(ex), F(ey)
                    for k0 in range(U(0), U(lanes), U(LANES)):
                        for k1 in range(LANES):
                            k = k0 + U(k1)
                            normal, tangent = fy[k] * f_ex - fx[k] * f_ey, fx[k] * f_ex + fy[k] * f_ey
                            apart = f_height - f_own * normal
                            normal = -normal if apart < F(0) else normal
                            apart = abs(apart)
                            first, last = normal * f_cos + tangent * f_sin, normal * f_cos - tangent * f_sin
                            low_bound = apart * (tangent * f_cos - normal * f_sin) / first
                            high_bound = apart * (tangent * f_cos + normal * f_sin) / last
                            low = low_bound if first > F(0) else -FAR
                            high = high_bound if last > F(0) else FAR
                            edge = f_own * tangent
                            low = max(max(low, -apart * f_grazing), f_begin - edge)
                            high = min(min(high, apart * f_grazing), f_end - edge)
                            at = min(max(F(0), low), high)
                            seen2 = apart * apart + at * at
                            seen2 = seen2 if (first > F(0)) | (last > F(0)) else FAR
                            grazed = (first > F(0)) & (first < ALONG) & (at == low_bound)
                            grazed |= (last > F(0)) & (last < ALONG) & (at == high_bound)
                            barely = (abs(high - low) < PAST) | (apart < TOUCH)
                            doubtful = (seen2 * NEARLY < walls[k]) & (grazed | barely)
                            unsure[k] = np.int32(1) if doubtful else np.int32(0)
                            walls[k] = min(walls[k], seen2 if (low <= high) & (not doubtful) else FAR)
                    any_unsure = np.int32(0)
                    for k0 in range(U(0), U(lanes), U(LANES)):
                        for k1 in range(LANES):
                            any_unsure |= unsure[k0 + U(k1)]
                    if any_unsure:
                        for k in range(count):
                            if unsure[k]:
                                normal, tangent = ay[k] * ex - ax[k] * ey, ax[k] * ex + ay[k] * ey
                                seen = line64(height, begin, length, normal, tangent, own, cosine, sine, grazing)
                                exact[k] = min(exact[k], seen)
                for k in range(count):
                    out[place, k] = min(min(best[k], sqrt(walls[k])), F(exact[k]))


@inlined
def mixed(counter, key):
    """See `chance.mix`."""
    bits = counter * GOLDEN + key
    bits = (bits ^ (bits >> U(30))) * U(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> U(27))) * U(0x94D049BB133111EB)
    return bits ^ (bits >> U(31))


@compiled
def disturb(seen, which, share, dropout, most, key, dropout_key):
    """See `noise.disturb`."""
    sonars = U(seen.shape[1])
    for row in range(seen.shape[0]):
        first = U(which[row]) * sonars
        for k in range(seen.shape[1]):
            lost = seen[row, k] >= most
            if share > 0.0:
                bits = mixed(first + U(k), key)
                total = (bits & U(0xFFFF)) + ((bits >> U(16)) & U(0xFFFF)) + ((bits >> U(32)) & U(0xFFFF))
                total += bits >> U(48)
                seen[row, k] *= F(1.0 + share * (float(np.int64(total) - MIDDLE) * SCALE))
            if dropout > 0.0:
                bits = mixed(first + U(k), dropout_key)
                lost = lost or float(bits >> U(11)) * 2.0**-53 < dropout
            if lost:
                seen[row, k] = most


@inlined
def off(px, py, x0, y0, x1, y1):
    """From a point to the nearest point of a line; see `grid.nearest_point`."""
    ex, ey = x1 - x0, y1 - y0
    length2 = ex * ex + ey * ey
    share = ((px - x0) * ex + (py - y0) * ey) / (length2 if length2 > 0.0 else 1.0)
    share = min(max(share, 0.0), 1.0)
    return x0 + share * ex - px, y0 + share * ey - py


@inlined
def touch_point(across, up, dx, dy, apart):
    """See `contact.touch`: for a point."""
    towards = dx * across + dy * up
    rest = across * across + up * up - apart * apart
    root = towards * towards - (dx * dx + dy * dy) * rest
    if towards <= 0.0 or root < 0.0:
        return 2.0
    stop = rest / (towards + sqrt(root))
    return stop if stop < 1.0 else 2.0


@compiled
def touch(px, py, dx, dy, x0, y0, x1, y1, apart):
    """See `contact.touch`."""
    across, up = off(px, py, x0, y0, x1, y1)
    if across * across + up * up < apart * apart:
        stop = 0.0 if dx * across + dy * up > 0.0 else 2.0
    else:
        stop = min(touch_point(x0 - px, y0 - py, dx, dy, apart), touch_point(x1 - px, y1 - py, dx, dy, apart))
        ex, ey = x1 - x0, y1 - y0
        length2 = ex * ex + ey * ey
        height, rate = ex * (py - y0) - ey * (px - x0), ex * dy - ey * dx
        sign = -1.0 if height < 0.0 else 1.0
        if rate * sign < 0.0:
            side = (height * sign - apart * sqrt(length2)) / -(rate * sign)
            along = (px + side * dx - x0) * ex + (py + side * dy - y0) * ey
            if 0.0 <= side < 1.0 and 0.0 <= along <= length2:
                stop = min(stop, side)
    gone = stop if stop < 1.0 else 0.0
    across, up = off(px + gone * dx, py + gone * dy, x0, y0, x1, y1)
    return stop, across, up


@compiled
def stop_at_old(
    x, y, dx, dy, order, start, size, across, up, solids, listed, items, radius, skin, reach, first_row, last_row,
    free, hit_x, hit_y,
):  # fmt: skip
    """The first round of `contact.settle`, in sorted order: ways end at solids and at old places of others."""
    apart = 2.0 * radius + skin
    for row in range(first_row, last_row):
        for column in range(across):
            cell = row * across + column
            for i in range(start[cell], start[cell + 1]):
                best, best_x, best_y = 1.0, 0.0, 0.0
                for w in range(listed[cell], listed[cell + 1]):
                    s = items[w]
                    stop, hx, hy = touch(
                        x[i], y[i], dx[i], dy[i], solids[s, 0], solids[s, 1], solids[s, 2], solids[s, 3],
                        radius + solids[s, 4] + skin,
                    )  # fmt: skip
                    if stop < best or (stop == best and best < 1.0 and (hx > best_x or (hx == best_x and hy > best_y))):
                        best, best_x, best_y = stop, hx, hy
                round_best, round_x, round_y = best, 0.0, 0.0
                left, right = max(int((x[i] - reach) / size), 0), min(int((x[i] + reach) / size), across - 1)
                below, above = max(int((y[i] - reach) / size), 0), min(int((y[i] + reach) / size), up - 1)
                for r in range(below, above + 1):
                    for j in range(start[r * across + left], start[r * across + right + 1]):
                        gx, gy = x[j] - x[i], y[j] - y[i]
                        if j == i or gx * gx + gy * gy > reach * reach:
                            continue
                        stop, hx, hy = touch(x[i], y[i], dx[i], dy[i], x[j], y[j], x[j], y[j], apart)
                        if stop < round_best or (
                            stop == round_best
                            and round_best < best
                            and (hx > round_x or (hx == round_x and hy > round_y))
                        ):
                            round_best, round_x, round_y = stop, hx, hy
                if round_best < best:
                    best, best_x, best_y = round_best, round_x, round_y
                free[i], hit_x[i], hit_y[i] = best, best_x, best_y


@compiled
def stop_at_ways(
    x, y, dx, dy, order, start, size, across, up, radius, skin, reach, first_row, last_row,
    free, hit_x, hit_y, out_free, out_x, out_y,
):  # fmt: skip
    """The second round, which puts its results where they belong: ways end at what is left of the ways of others."""
    apart = 2.0 * radius + skin
    for row in range(first_row, last_row):
        for column in range(across):
            cell = row * across + column
            for i in range(start[cell], start[cell + 1]):
                best, best_x, best_y = free[i], hit_x[i], hit_y[i]
                mx, my = best * dx[i], best * dy[i]
                first = best
                left, right = max(int((x[i] - reach) / size), 0), min(int((x[i] + reach) / size), across - 1)
                below, above = max(int((y[i] - reach) / size), 0), min(int((y[i] + reach) / size), up - 1)
                for r in range(below, above + 1):
                    for j in range(start[r * across + left], start[r * across + right + 1]):
                        gx, gy = x[j] - x[i], y[j] - y[i]
                        if j == i or gx * gx + gy * gy > reach * reach:
                            continue
                        ox, oy = free[j] * dx[j], free[j] * dy[j]
                        if (ox == 0.0 and oy == 0.0) or (mx * gx + my * gy <= 0.0 and ox * gx + oy * gy >= 0.0):
                            continue
                        hx, hy = off(x[i], y[i], x[j], y[j], x[j] + ox, y[j] + oy)
                        if hx * hx + hy * hy < apart * apart:
                            stop = 0.0
                        else:
                            stop, hx, hy = touch(x[i], y[i], dx[i], dy[i], x[j], y[j], x[j] + ox, y[j] + oy, apart)
                        if stop < best or (
                            stop == best and best < first and (gx > best_x or (gx == best_x and gy > best_y))
                        ):
                            best, best_x, best_y = stop, gx, gy
                o = order[i]
                out_free[o], out_x[o], out_y[o] = best, best_x, best_y
