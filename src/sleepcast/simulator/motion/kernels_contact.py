"""Compiled kernels of contact: how far bodies get before they touch; see `contact` for the form in NumPy, with which
they agree to the last bit. `fast` calls them.

Bodies come in the order of their cells. Each call does a stretch of rows of cells, so that threads can share the work.
Most bodies have nothing within reach: nothing but their place is read.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from sleepcast.simulator.simd.compiled import compiled, inlined

U = np.uint64
FAR = 1e9
"""Metres to nothing."""
LITTLE = 1e-6
"""Metres by which is looked farther than needed, so that rounding never hides anything."""


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
def gather(order, x, y, way_x, way_y, first, last, into):
    """Put places into the rows of `into`, in the order of the cells; gives the square of the longest way of as many
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
    """Of the i-th body in sorted order. radii: by body, or one for all."""
    return radii[order[i]] if radii.shape[0] > 1 else radii[0]


@inlined
def comes_first(stop, hx, hy, best, best_x, best_y):
    """Whether a stop comes before the best one so far; of equals the one last in x, then y."""
    return stop < best or (stop == best and (hx > best_x or (hx == best_x and hy > best_y)))


@inlined
def lines_near(x, reach, inverse, most):
    """The first and the last row or column of cells within reach of x. inverse: of the side of a cell."""
    return U(max(int((x - reach) * inverse), 0)), U(min(int((x + reach) * inverse), most - 1))


@inlined
def from_boxes(boxes, items, first, last, px, py):
    """How far a point is, across or up, from the nearest of the boxes of listed solids, from the `first` up to the
    `last`; a negative number within one."""
    least = FAR
    for w in range(first, last):
        s = U(items[w])
        across, up = max(boxes[s, 0] - px, px - boxes[s, 1]), max(boxes[s, 2] - py, py - boxes[s, 3])
        least = min(least, max(across, up))
    return least


@inlined
def anybody_near(x, y, px, py, start, reach, inverse, across, up):
    """Whether any other body is within reach of the one at px, py."""
    found = 0
    left, right = lines_near(px, reach + LITTLE, inverse, across)
    below, above = lines_near(py, reach + LITTLE, inverse, up)
    for r in range(below, above + U(1)):
        for j in range(U(start[r * U(across) + left]), U(start[r * U(across) + right + U(1)])):
            gx, gy = x[j] - px, y[j] - py
            found += np.int64(gx * gx + gy * gy <= reach * reach)
    return found > 1  # itself is one


@compiled
def stop_at_old(
    x, y, way_x, way_y, radii, order, start, size, across, up, solids, boxes, listed, items, skin, longest, reach,
    first_row, last_row, close, near, free, hit_x, hit_y, out_free, out_x, out_y,
):  # fmt: skip
    """The first round of `contact.settle`, in sorted order: ways end at solids and at old places of others. way_x,
    way_y: by body; longest: of them, m. boxes: round the solids, see `contact.boxes_of`. close: False where it is known
    that nobody is within reach. near: whether any body is; where there is none, this round is the last, and puts the
    results where they belong."""
    inverse = 1.0 / size
    for cell in range(U(first_row * across), U(last_row * across)):
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
                near[i] = anybody_near(x, y, px, py, start, reach, inverse, across, up)
            if near[i]:
                wx, wy, other, other_x, other_y = way_x[order[i]], way_y[order[i]], best, 0.0, 0.0
                left, right = lines_near(px, reach + LITTLE, inverse, across)
                below, above = lines_near(py, reach + LITTLE, inverse, up)
                for r in range(below, above + U(1)):
                    for j in range(U(start[r * U(across) + left]), U(start[r * U(across) + right + U(1)])):
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
    x, y, way_x, way_y, radii, order, start, size, across, up, skin, reach, first_row, last_row,
    near, free, hit_x, hit_y, out_free, out_x, out_y,
):  # fmt: skip
    """The second round, for bodies that others are near: ways end at what is left of the ways of others. Puts the
    results of those that are stopped where they belong."""
    inverse = 1.0 / size
    for i in range(U(start[first_row * across]), U(start[last_row * across])):
        if not near[i]:
            continue
        best, best_x, best_y, first = free[i], hit_x[i], hit_y[i], free[i]
        px, py, wx, wy = x[i], y[i], way_x[order[i]], way_y[order[i]]
        mx, my = best * wx, best * wy
        left, right = lines_near(px, reach + LITTLE, inverse, across)
        below, above = lines_near(py, reach + LITTLE, inverse, up)
        for r in range(below, above + U(1)):
            for j in range(U(start[r * U(across) + left]), U(start[r * U(across) + right + U(1)])):
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
