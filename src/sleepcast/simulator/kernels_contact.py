"""Compiled kernels of contact: how far bodies get before they touch; see `contact` for the form in NumPy, with which
they agree to the last bit. `fast` calls them.

Bodies come in the order of their cells. Each call does a stretch of rows of cells, so that threads can share the work.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from sleepcast.simulator.compiled import compiled, inlined

U = np.uint64


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
def gather(order, x, y, across, up, first, last, into):
    """Put places and ways into the rows of `into`, in the order of the cells; gives the square of the longest way."""
    longest = 0.0
    for i in range(first, last):
        o = order[i]
        into[0, i], into[1, i], into[2, i], into[3, i] = x[o], y[o], across[o], up[o]
        longest = max(longest, across[o] * across[o] + up[o] * up[o])
    return longest


@inlined
def radius_of(radii, order, i):
    """Of the i-th body in sorted order. radii: by body, or one for all."""
    return radii[order[i]] if radii.shape[0] > 1 else radii[0]


@inlined
def comes_first(stop, hx, hy, best, best_x, best_y):
    """Whether a stop comes before the best one so far; of equals the one last in x, then y."""
    return stop < best or (stop == best and (hx > best_x or (hx == best_x and hy > best_y)))


@inlined
def lines_near(x, reach, size, most):
    """The first and the last row or column of cells within reach of x."""
    return U(max(int((x - reach) / size), 0)), U(min(int((x + reach) / size), most - 1))


@compiled
def stop_at_old(
    x, y, dx, dy, radii, order, start, size, across, up, solids, listed, items, skin, reach, first_row, last_row,
    near, free, hit_x, hit_y,
):  # fmt: skip
    """The first round of `contact.settle`, in sorted order: ways end at solids and at old places of others. near:
    whether any body is within reach."""
    for cell in range(U(first_row * across), U(last_row * across)):
        for i in range(U(start[cell]), U(start[cell + U(1)])):
            px, py, wx, wy, radius = x[i], y[i], dx[i], dy[i], radius_of(radii, order, i)
            way = sqrt(wx * wx + wy * wy) + skin
            best, best_x, best_y = 1.0, 0.0, 0.0
            for w in range(U(listed[cell]), U(listed[cell + U(1)])):
                s = U(items[w])
                x0, y0, x1, y1, limit = (
                    solids[s, 0],
                    solids[s, 1],
                    solids[s, 2],
                    solids[s, 3],
                    radius + solids[s, 4] + skin,
                )
                ox, oy = off(px, py, x0, y0, x1, y1)
                if ox * ox + oy * oy > (limit + way) ** 2:
                    continue
                stop, hx, hy = touch(px, py, wx, wy, x0, y0, x1, y1, limit)
                if stop < 1.0 and comes_first(stop, hx, hy, best, best_x, best_y):
                    best, best_x, best_y = stop, hx, hy
            other, other_x, other_y = best, 0.0, 0.0
            left, right = lines_near(px, reach, size, across)
            below, above = lines_near(py, reach, size, up)
            neighbours = 0
            for r in range(below, above + U(1)):
                for j in range(U(start[r * U(across) + left]), U(start[r * U(across) + right + U(1)])):
                    gx, gy = x[j] - px, y[j] - py
                    if gx * gx + gy * gy > reach * reach or j == i:
                        continue
                    neighbours += 1
                    stop, hx, hy = touch(
                        px, py, wx, wy, x[j], y[j], x[j], y[j], radius + radius_of(radii, order, j) + skin
                    )
                    if stop < best and comes_first(stop, hx, hy, other, other_x, other_y):
                        other, other_x, other_y = stop, hx, hy
            if other < best:
                best, best_x, best_y = other, other_x, other_y
            near[i] = neighbours > 0
            free[i], hit_x[i], hit_y[i] = best, best_x, best_y


@compiled
def stop_at_ways(
    x, y, dx, dy, radii, order, start, size, across, up, skin, reach, first_row, last_row,
    near, free, hit_x, hit_y, out_free, out_x, out_y,
):  # fmt: skip
    """The second round: ways end at what is left of the ways of others. Puts the results of those that are stopped
    where they belong."""
    for i in range(U(start[first_row * across]), U(start[last_row * across])):
        best, best_x, best_y = free[i], hit_x[i], hit_y[i]
        if near[i]:
            px, py, wx, wy, first = x[i], y[i], dx[i], dy[i], best
            mx, my = best * wx, best * wy
            left, right = lines_near(px, reach, size, across)
            below, above = lines_near(py, reach, size, up)
            for r in range(below, above + U(1)):
                for j in range(U(start[r * U(across) + left]), U(start[r * U(across) + right + U(1)])):
                    gx, gy = x[j] - px, y[j] - py
                    if gx * gx + gy * gy > reach * reach or j == i:
                        continue
                    ox, oy = free[j] * dx[j], free[j] * dy[j]
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
