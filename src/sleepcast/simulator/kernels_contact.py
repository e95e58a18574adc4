"""Compiled kernels of contact: how far bodies get before they touch; see `contact` for the form in NumPy, with which
they agree to the last bit. `fast` calls them.

Bodies come in the order of their cells. Each call does a stretch of rows of cells, so that threads can share the work.
"""

from __future__ import annotations

from math import sqrt

from sleepcast.simulator.compiled import compiled, inlined


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
    x, y, dx, dy, order, start, size, across, up, solids, listed, items, radii, skin, reach, first_row, last_row,
    free, hit_x, hit_y,
):  # fmt: skip
    """The first round of `contact.settle`, in sorted order: ways end at solids and at old places of others."""
    for row in range(first_row, last_row):
        for column in range(across):
            cell = row * across + column
            for i in range(start[cell], start[cell + 1]):
                best, best_x, best_y, radius = 1.0, 0.0, 0.0, radii[i]
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
                        stop, hx, hy = touch(
                            x[i], y[i], dx[i], dy[i], x[j], y[j], x[j], y[j], radius + radii[j] + skin
                        )  # fmt: skip
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
    x, y, dx, dy, order, start, size, across, up, radii, skin, reach, first_row, last_row,
    free, hit_x, hit_y, out_free, out_x, out_y,
):  # fmt: skip
    """The second round, which puts its results where they belong: ways end at what is left of the ways of others."""
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
                        apart = radii[i] + radii[j] + skin
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
