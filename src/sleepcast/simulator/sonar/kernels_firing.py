"""The compiled kernel for sonars that fire one after the other: only the cone that fires is computed.

From the bodies in the cells around a cone, and the solids visible from the robot's cell, it first selects those that
come near the cone, sixteen at a time in single precision. These few are computed in double precision, formula by
formula as in `cones.look` and `firing.fire`, with the same bits: the minimum of the ranges depends neither on their
order nor on things that are missed.
"""

from __future__ import annotations

from math import sqrt

import numpy as np

from sleepcast.simulator.simd.compiled import inlined, strict
from sleepcast.simulator.simd.formulas import LANES
from sleepcast.simulator.simd.lanes import at, pack
from sleepcast.simulator.simd.vectors import how_many, least_of, minus, most_of, places, size_of
from sleepcast.simulator.sonar.crosstalk import QUICKEST, SOUND
from sleepcast.simulator.sonar.fields import AWAY
from sleepcast.simulator.sonar.kernels import GOLDEN, F, U, disturbed

I = np.int32  # noqa: E741  # as short as F
MARGIN, SHARE = 1e-4, 1e-6
"""Margin for rounding within which things that miss a cone are selected too: m, and a share of the largest number."""


@inlined
def disc(dx, dy, ax, ay, radius, own, cosine, sine, graze, nearest):
    """Range of a disc in a cone, or `nearest` if that is smaller; see `cones.disc_range`."""
    along = dx * ax + dy * ay - own
    aside = abs(dy * ax - dx * ay)
    outside, forward = aside * cosine - along * sine, along * cosine + aside * sine
    within = outside <= 0.0
    # This branch is unpredictable: computing both cases is faster than a mispredicted jump.
    away, size = along * along + aside * aside, radius * radius
    root = sqrt(away if within else max(size - outside * outside, 0.0))
    seen = max(root - radius if within else forward - root, 0.0)
    met = within | (away <= size) | ((outside < radius * graze) & (forward > 0.0))
    return min(nearest, seen) if met else nearest


@inlined
def line(dx, dy, ex, ey, length, ax, ay, own, cosine, sine, grazing, nearest):
    """Range of a line in a cone, or `nearest` if that is smaller; see `cones.line_range`."""
    height, begin = dy * ex - dx * ey, dx * ex + dy * ey
    normal, tangent = ay * ex - ax * ey, ax * ex + ay * ey
    away = height - own * normal
    if away < 0.0:
        normal, away = -normal, -away
    begin -= own * tangent
    first, last = normal * cosine + tangent * sine, normal * cosine - tangent * sine
    if away < nearest and (first > 0.0 or last > 0.0):
        low, high = -away * grazing, away * grazing
        if first > 0.0:
            low = max(away * (tangent * cosine - normal * sine) / first, low)
        if last > 0.0:
            high = min(away * (tangent * cosine + normal * sine) / last, high)
        low, high = max(low, begin), min(high, begin + length)
        foot = min(max(0.0, low), high)
        if low <= high:
            nearest = min(nearest, sqrt(away * away + foot * foot))
    return nearest


@inlined
def near_bodies(x, y, begin, end, fx, fy, ax, ay, cosine, sine, far, wide, chosen, n):
    """Select the bodies from `begin` to `end` (exclusive), and a few more, that come near a cone at fx, fy."""
    for j in range(U(begin), U(end), U(LANES)):
        dx, dy = at(x, j) - fx, at(y, j) - fy
        along, aside = dx * ax + dy * ay, size_of(dy * ax - dx * ay)
        here = (aside * cosine - along * sine < wide) & (along < far) & (along > -wide)
        pack(chosen, n, places() + I(j), here)
        n += how_many(here)
    return n


@inlined
def near_solids(x0, y0, x1, y1, breadth, w, fx, fy, ax, ay, cosine, sine, far, chosen):
    """Select those of w solids that come near a cone at fx, fy."""
    n = U(0)
    for j in range(U(0), w, U(LANES)):
        dx0, dy0, dx1, dy1, wide = at(x0, j) - fx, at(y0, j) - fy, at(x1, j) - fx, at(y1, j) - fy, at(breadth, j)
        along0, aside0 = (dx0 * ax + dy0 * ay), (dy0 * ax - dx0 * ay)
        along1, aside1 = (dx1 * ax + dy1 * ay), (dy1 * ax - dx1 * ay)
        left = least_of(aside0 * cosine - along0 * sine, aside1 * cosine - along1 * sine)
        right = least_of(minus(aside0) * cosine - along0 * sine, minus(aside1) * cosine - along1 * sine)
        here = (left < wide) & (right < wide)
        here = here & (least_of(along0, along1) < wide + far) & (most_of(along0, along1) > minus(wide))
        pack(chosen, n, places() + I(j), here)
        n += how_many(here)
    return n


@inlined
def cell_of(position, size, cells):
    """The row or column of a coordinate; see `grid.Grid`."""
    return min(max(int(position / size), 0), cells - 1)


@strict
def fire(field, beam, shots, first_row, last_row):
    """Fire all due sonars of the robots in these rows of cells; see `firing.fire`.

    field, beam, shots: see `fields`.
    """
    (
        px,
        py,
        cosines,
        sines,
        short_x,
        short_y,
        order,
        radii,
        start,
        listed,
        items,
        solids,
        size,
        grid_columns,
        grid_rows,
    ) = field
    own, cosine, sine, tangent, most, widest, graze, grazing, axis_cos, axis_sin = beam
    dues, turns, orders, lengths, pauses, readings, first, until, least, noisy, share, dropout, key, dropout_key = shots
    robots, sonars = readings.shape
    arranged, alike = lengths.shape[0] > 1, radii.shape[0] == 1
    short_cos, short_sin, nothing = F(cosine), F(sine), F(most)
    margin = F(MARGIN + SHARE * (size * max(grid_columns, grid_rows) + most))
    wide, aside = F(widest) + margin, most * tangent
    chosen, room = np.empty(len(order) + LANES, I), 1024
    x0, y0, x1, y1 = np.empty(room, F), np.empty(room, F), np.empty(room, F), np.empty(room, F)
    breadth, pieces, chosen_pieces = np.empty(room, F), np.empty(room, I), np.empty(room, I)
    for row in range(first_row, last_row):
        for cell in range(row * grid_columns, (row + 1) * grid_columns):
            if start[cell] == start[cell + 1]:
                continue
            total = listed[cell + 1] - listed[cell]
            if total + LANES > room:
                room = 2 * total + LANES
                x0, y0, x1, y1 = np.empty(room, F), np.empty(room, F), np.empty(room, F), np.empty(room, F)
                breadth, pieces, chosen_pieces = np.empty(room, F), np.empty(room, I), np.empty(room, I)
            w = U(0)
            for k in range(listed[cell], listed[cell + 1]):
                s = items[k]
                x0[w], y0[w] = F(solids[s, 0]), F(solids[s, 1])
                x1[w], y1[w] = (
                    F(solids[s, 0] + solids[s, 2] * solids[s, 4]),
                    F(solids[s, 1] + solids[s, 3] * solids[s, 4]),
                )
                breadth[w], pieces[w] = F(solids[s, 5]) + margin, s
                w += U(1)
            for q in range(LANES):
                x0[w + U(q)], y0[w + U(q)], x1[w + U(q)], y1[w + U(q)], breadth[w + U(q)] = AWAY, AWAY, AWAY, AWAY, F(0)
            for me in range(start[cell], start[cell + 1]):
                robot = order[me] - first
                if robot < 0 or robot >= robots:
                    continue
                its = robot if arranged else 0
                length, pause, due, turn = lengths[its], pauses[its], dues[robot], turns[robot]
                own_x, own_y = px[me], py[me]
                while due < until and length > 0:
                    sonar = np.int64(orders[its, turn])
                    ax = axis_cos[sonar] * cosines[me] - axis_sin[sonar] * sines[me]
                    ay = axis_sin[sonar] * cosines[me] + axis_cos[sonar] * sines[me]
                    from_x, from_y = own_x + own * ax, own_y + own * ay
                    to_x, to_y, aside_x, aside_y = (
                        from_x + most * ax,
                        from_y + most * ay,
                        aside * abs(ay),
                        aside * abs(ax),
                    )
                    left = cell_of(min(from_x, to_x - aside_x) - widest, size, grid_columns)
                    right = cell_of(max(from_x, to_x + aside_x) + widest, size, grid_columns)
                    bottom = cell_of(min(from_y, to_y - aside_y) - widest, size, grid_rows)
                    top = cell_of(max(from_y, to_y + aside_y) + widest, size, grid_rows)
                    fx, fy, sx, sy = F(from_x), F(from_y), F(ax), F(ay)
                    far, nearest, n = nothing + wide, most, U(0)
                    for r in range(bottom, top + 1):
                        begin, end = start[r * grid_columns + left], start[r * grid_columns + right + 1]
                        n = near_bodies(
                            short_x,
                            short_y,
                            begin,
                            end,
                            fx,
                            fy,
                            sx,
                            sy,
                            short_cos,
                            short_sin,
                            far,
                            wide,
                            chosen,
                            n,
                        )
                    for q in range(n):
                        j = chosen[q]
                        if j != me:
                            radius = radii[0 if alike else j]
                            nearest = disc(
                                px[j] - own_x, py[j] - own_y, ax, ay, radius, own, cosine, sine, graze, nearest
                            )
                    far = F(nearest)
                    n = near_solids(
                        x0, y0, x1, y1, breadth, w, fx, fy, sx, sy, short_cos, short_sin, far, chosen_pieces
                    )
                    for q in range(n):
                        s = pieces[chosen_pieces[q]]
                        dx, dy, radius = solids[s, 0] - own_x, solids[s, 1] - own_y, solids[s, 5]
                        if radius > 0.0:
                            nearest = disc(dx, dy, ax, ay, radius, own, cosine, sine, graze, nearest)
                        else:
                            nearest = line(
                                dx, dy, solids[s, 2], solids[s, 3], solids[s, 4], ax, ay, own, cosine, sine, grazing,
                                nearest,
                            )  # fmt: skip
                    seen = F(nearest)
                    if noisy:
                        multiple = (U(robot) * U(sonars) + U(sonar)) * GOLDEN
                        seen = disturbed(seen, multiple, share, dropout, nothing, key, dropout_key)
                    seen = min(max(seen, F(least)), nothing)
                    readings[robot, sonar] = seen
                    due += max(pause + 2.0 * float(seen) / SOUND, QUICKEST)
                    turn = turn + 1 if turn + 1 < length else 0
                dues[robot], turns[robot] = due, turn
