"""Compiled kernels that look, with numba, which bodies in the air may have touched in a tick.

Pairs that are near enough to touch soon are listed, and only these are looked at, until bodies have moved so far that
others may touch. That is found from where they are, not from how they came there, so the list is no state of a run:
whoever has touched is found with any list. Which of them really have is said by `bodies.crashes`, to the last bit.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from sleepcast.simulator.motion.touching import AHEAD, COUNT, OVERFLOWED, REACH, ROOM, ROUNDING
from sleepcast.simulator.simd.compiled import part, strict
from sleepcast.simulator.simd.formulas import shortest

I = np.int32  # noqa: E741  # half as much to read


@strict
def touching(bodies, pairs):
    """Mark in `pairs.touched` those bodies of which one is in the air that may have touched each other in the tick that
    is over; gives how many pairs these are, or OVERFLOWED if there is no room for all that are near. bodies:
    `touching.Airborne`; pairs: `touching.NearPairs`."""
    x, y, z, ground, way_x, way_y, way_z, radii, widest, around_x, around_y = bodies
    near, old_x, old_y, old_z, touched, numbers, lengths, points, start, order, cell = pairs
    way, gone = longest(way_x, way_y, way_z), farthest(x, y, z, old_x, old_y, old_z, around_x, around_y)
    least = 2.0 * (widest + way) + ROUNDING
    if not least + 2.0 * gone <= lengths[REACH]:
        reach = least + min(AHEAD * way, lengths[ROOM])
        numbers[COUNT] = list_pairs(x, y, z, reach, around_x, around_y, near, points, start, order, cell)
        keep(x, y, z, old_x, old_y, old_z)
        lengths[REACH] = reach if numbers[COUNT] >= 0 else -1.0
        if numbers[COUNT] < 0:
            return OVERFLOWED
    return look(
        *(x, y, z, ground, way_x, way_y, way_z, radii, around_x, around_y, near[0], near[1], touched),
        numbers[COUNT],
    )


@part
def longest(way_x, way_y, way_z):
    """The length of the longest of these ways, m; bodies on the ground have none."""
    most = 0.0
    for i in range(len(way_x)):
        square = way_x[i] * way_x[i] + way_y[i] * way_y[i] + way_z[i] * way_z[i]
        most = square if square > most else most
    return sqrt(most)


@part
def farthest(x, y, z, old_x, old_y, old_z, around_x, around_y):
    """How far the body has gone that is farthest from where it was when pairs were listed, m."""
    most = 0.0
    for i in range(len(x)):
        dx, dy = shortest(x[i] - old_x[i], around_x), shortest(y[i] - old_y[i], around_y)
        dz = height(z[i]) - old_z[i]
        square = dx * dx + dy * dy + dz * dz
        most = most if square <= most else square
    return sqrt(most)


@part
def height(z):
    """m; what does not fly is at 0."""
    return z if z == z else 0.0


@part
def keep(x, y, z, old_x, old_y, old_z):
    """Remember where bodies are."""
    for i in range(len(x)):
        old_x[i], old_y[i], old_z[i] = x[i], y[i], height(z[i])


@part
def look(
    x, y, z, ground, way_x, way_y, way_z, radii, around_x, around_y, ones, others, touched, count
):  # fmt: skip
    """Mark who may have touched, of so many pairs; gives how many pairs have."""
    found = 0
    for number in range(count):
        i, j = np.int64(ones[number]), np.int64(others[number])
        if not (z[i] > ground[i] or z[j] > ground[j]):
            continue
        dx, dy = shortest(x[j] - x[i], around_x), shortest(y[j] - y[i], around_y)
        dz = height(z[j]) - height(z[i])
        vx, vy, vz = way_x[j] - way_x[i], way_y[j] - way_y[i], way_z[j] - way_z[i]
        size, ahead = vx * vx + vy * vy + vz * vz, dx * vx + dy * vy + dz * vz
        back = min(max(ahead / size, 0.0), 1.0) if size > 0.0 else 0.0
        dx, dy, dz = dx - back * vx, dy - back * vy, dz - back * vz
        apart = radii[i] + radii[j] + ROUNDING
        if dx * dx + dy * dy + dz * dz < apart * apart:
            touched[i] = touched[j] = True
            found += 1
    return found


# ---- listing pairs


@part
def list_pairs(x, y, z, reach, around_x, around_y, near, points, start, order, cell):
    """Write all pairs of bodies within `reach` m of each other into `near`; gives how many, or OVERFLOWED. On a torus
    bodies near an edge have images, of which a pair is found from both sides."""
    count, found = len(x), 0
    total = place_points(x, y, z, reach, around_x, around_y, points, order)
    if total < 0:
        return OVERFLOWED
    left_end, wide = ends(points, 0, total)
    near_end, deep = ends(points, 1, total)
    low_end, tall = ends(points, 2, total)
    columns, rows, layers, size = cells_over(wide, deep, tall, reach, len(start) - 2)
    sort_points(points, total, left_end, near_end, low_end, size, columns, rows, layers, start, order, cell)
    line = columns * rows
    for here in range(columns * rows * layers):
        first, last = start[here], start[here + 1]
        if first == last:
            continue
        column, row, layer = here % columns, here // columns % rows, here // line
        left, right = max(column - 1, 0) - column, min(column + 1, columns - 1) - column
        for above in range(min(2, layers - layer)):
            for up in range(-1 if above else 0, 2):
                if row + up < 0 or row + up >= rows:
                    continue
                there = here + above * line + up * columns
                own = above == 0 and up == 0
                begin, end = start[there if own else there + left], start[there + right + 1]
                for one in range(first, last):
                    mine = np.int64(cell[one])
                    for other in range(max(begin, one + 1) if own else begin, end):
                        dx, dy = points[3, other] - points[3, one], points[4, other] - points[4, one]
                        dz = points[5, other] - points[5, one]
                        if dx * dx + dy * dy + dz * dz <= reach * reach:
                            its = np.int64(cell[other])
                            if mine >= count and its >= count:
                                continue
                            if found == near.shape[1]:
                                return OVERFLOWED
                            near[0, found], near[1, found] = I(mine % count), I(its % count)
                            found += 1
    return found


@part
def place_points(x, y, z, reach, around_x, around_y, points, order):
    """Write all bodies, and on a torus their images, into `points` and into `order` whose they are: a body's number,
    plus the number of all for an image. Gives how many they are, or OVERFLOWED if an axis is too short for images."""
    count = total = len(x)
    for i in range(count):
        points[0, i], points[1, i], points[2, i] = x[i], y[i], height(z[i])
        order[i] = I(i)
    if around_x == np.inf:
        return total
    if 2.0 * reach > min(around_x, around_y):
        return OVERFLOWED
    for axis in range(2):
        size, known = around_x if axis == 0 else around_y, total
        for i in range(known):
            place = points[axis, i]
            shift = size if place < reach else -size if place >= size - reach else 0.0
            if shift != 0.0:
                for each in range(3):
                    points[each, total] = points[each, i]
                points[axis, total] += shift
                order[total] = I(order[i] % count + count)
                total += 1
    return total


@part
def ends(points, axis, total):
    """The least place of so many points along an axis, and how far it is from there to the greatest one, m."""
    low = high = points[axis, 0]
    for i in range(1, total):
        low, high = min(low, points[axis, i]), max(high, points[axis, i])
    return low, high - low


@part
def cells_over(wide, deep, tall, reach, most):
    """Columns, rows and layers of cells of at least `reach` m in such a box, at most so many; and their size."""
    size = reach
    while (wide / size + 1.0) * (deep / size + 1.0) * (tall / size + 1.0) > most:
        size *= 1.25
    return int(wide / size) + 1, int(deep / size) + 1, int(tall / size) + 1, size


@part
def sort_points(points, total, left, near, low, size, columns, rows, layers, start, order, cell):
    """Sort so many points by cell: their places into the last rows of `points`, whose they are into `cell`."""
    cells = columns * rows * layers
    for here in range(cells + 2):
        start[here] = 0
    for i in range(total):
        column, row = int((points[0, i] - left) / size), int((points[1, i] - near) / size)
        layer = int((points[2, i] - low) / size)
        here = (min(layer, layers - 1) * rows + min(row, rows - 1)) * columns + min(column, columns - 1)
        cell[total + i] = I(here)
        start[here + 2] += 1
    for here in range(2, cells + 2):
        start[here] += start[here - 1]
    for i in range(total):
        here = np.int64(cell[total + i]) + 1
        at = np.int64(start[here])
        start[here] = I(at + 1)
        cell[at] = order[i]
        for axis in range(3):
            points[3 + axis, at] = points[axis, i]
