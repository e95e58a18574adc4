"""Contact: how far bodies get on their way before they touch something, whatever the order they are looked at in.

Every body proposes a way, a straight line from its old place to a new one. First each way ends where the body would
touch a solid or another body's old place. Then it ends where the body would touch the way that is left to another one,
if the two do not move apart anyhow. Either way only old places and proposals are read, so no order matters; and of two
bodies at least one has kept clear of all of the other's way, so no two ever overlap.

`SKIN` is kept between things that touch, so that rounding never makes an overlap. What already overlaps (because it
was put there) may only move apart. Here is the form for NumPy; `kernels_contact` has the same for numba.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sleepcast.simulator.world.grid import Floats, Grid, Listed, Sorted, Whole, nearest_point, pairs, spread

SKIN = 1e-6
"""Metres between bodies that touch."""


class Settled(NamedTuple):
    """How bodies got on. free: the share of its way that each may go, 1 where nothing is in the way. across, up: from
    where the body is to what stopped it, m; 0, 0 where nothing did. Shape (count,)."""

    free: Floats
    across: Floats
    up: Floats


def settle(
    grid: Grid,
    points: Sorted,
    listed: Listed,
    solids: Floats,
    radii: Floats,
    place: tuple[Floats, Floats],
    way: tuple[Floats, Floats],
    settled: Settled,
) -> None:
    """Put into `settled` how far bodies with these `radii` (m; each, or one for all) at `place` (x, y; m) get on their
    `way` (across, up; m).

    points: the places, sorted in `grid`. listed: the `solids` that come within the greatest radius and the longest way
    of each of its cells.
    """
    (x, y), (dx, dy) = place, way
    clear(settled)
    radii = np.broadcast_to(radii, len(x))
    cell = grid.cells_of(x, y)
    i, item = spread(np.arange(len(x)), listed.start[cell], listed.start[cell + 1])
    lines = solids[listed.items[item]]
    stop, across, up = touch(x[i], y[i], dx[i], dy[i], lines[:, :4].T, radii[i] + lines[:, 4] + SKIN)
    _take_first(settled, i, stop, across, up)
    longest = float(np.sqrt(np.max(dx * dx + dy * dy, initial=0.0)))
    widest = 2.0 * float(radii.max(initial=0.0)) + SKIN
    i, j = pairs(grid, points, x, y, widest + 2.0 * longest, np.arange(len(x)))
    apart = radii[i] + radii[j] + SKIN
    stop, across, up = touch(x[i], y[i], dx[i], dy[i], (x[j], y[j], x[j], y[j]), apart)
    _take_first(settled, i, stop, across, up)
    left_x, left_y = settled.free * dx, settled.free * dy
    _meet(settled, i, j, place, (left_x, left_y), (dx, dy), apart)


def boxes_of(solids: Floats) -> Floats:
    """The least box round each of the `solids`: left, right, bottom and top, m, shape (solids, 4)."""
    x0, y0, x1, y1, radius = solids.T
    left, right, bottom, top = np.minimum(x0, x1), np.maximum(x0, x1), np.minimum(y0, y1), np.maximum(y0, y1)
    return np.ascontiguousarray(np.stack((left - radius, right + radius, bottom - radius, top + radius), axis=1))


def clear(settled: Settled) -> None:
    """Let nothing be in anybody's way."""
    settled.free.fill(1.0)
    settled.across.fill(0.0)
    settled.up.fill(0.0)


def _meet(
    settled: Settled,
    i: Whole,
    j: Whole,
    place: tuple[Floats, Floats],
    left: tuple[Floats, Floats],
    way: tuple[Floats, Floats],
    apart: Floats,
) -> None:
    """Let ways end where they touch the way that is `left` to others."""
    (x, y), (dx, dy) = place, left
    across, up = x[j] - x[i], y[j] - y[i]
    moves = (dx[j] != 0.0) | (dy[j] != 0.0)
    parting = (dx[i] * across + dy[i] * up <= 0.0) & (dx[j] * across + dy[j] * up >= 0.0)
    some = np.flatnonzero(moves & ~parting)
    i, j, apart = i[some], j[some], apart[some]
    line = (x[j], y[j], x[j] + dx[j], y[j] + dy[j])
    stop, across, up = touch(x[i], y[i], way[0][i], way[1][i], line, apart)
    across, up = nearest_point(x[i], y[i], *line)
    stop = np.where(across * across + up * up < apart * apart, 0.0, stop)
    _take_first(settled, i, stop, x[j] - x[i], y[j] - y[i])


def touch(
    x: Floats,
    y: Floats,
    dx: Floats,
    dy: Floats,
    line: tuple[Floats, Floats, Floats, Floats] | Floats,
    apart: float | Floats,
) -> tuple[Floats, Floats, Floats]:
    """The share of the way dx, dy from x, y after which a point first comes within `apart` of a line (x and y of one
    end and of the other), 2 where it does not; and from where it then is to the nearest point of the line. From nearer
    than that it may go on if it does not come still nearer."""
    x0, y0, x1, y1 = line
    across, up = nearest_point(x, y, x0, y0, x1, y1)
    inside = across * across + up * up < apart * apart
    ends = np.minimum(_touch_point(x0 - x, y0 - y, dx, dy, apart), _touch_point(x1 - x, y1 - y, dx, dy, apart))
    stop = np.minimum(ends, _touch_side(x, y, dx, dy, line, apart))
    stop = np.where(inside, np.where(dx * across + dy * up > 0.0, 0.0, 2.0), stop)
    gone = np.where(stop < 1.0, stop, 0.0)
    return stop, *nearest_point(x + gone * dx, y + gone * dy, x0, y0, x1, y1)


def _touch_point(across: Floats, up: Floats, dx: Floats, dy: Floats, apart: float | Floats) -> Floats:
    """The same for a point, which lies `across` and `up`; only from outside."""
    towards = dx * across + dy * up
    rest = across * across + up * up - apart * apart
    root = towards * towards - (dx * dx + dy * dy) * rest
    with np.errstate(divide="ignore", invalid="ignore"):
        stop = rest / (towards + np.sqrt(root))
    return np.where((towards > 0.0) & (root >= 0.0) & (stop < 1.0), stop, 2.0)


def _touch_side(
    x: Floats,
    y: Floats,
    dx: Floats,
    dy: Floats,
    line: tuple[Floats, Floats, Floats, Floats] | Floats,
    apart: float | Floats,
) -> Floats:
    """The same for the two sides of a line, without its ends; only from outside."""
    x0, y0, x1, y1 = line
    ex, ey = x1 - x0, y1 - y0
    length2 = ex * ex + ey * ey
    length = np.sqrt(length2)
    height = ex * (y - y0) - ey * (x - x0)  # times length, as are the next two
    rate = ex * dy - ey * dx
    sign = np.where(height < 0.0, -1.0, 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        stop = (height * sign - apart * length) / -(rate * sign)
        along = (x + stop * dx - x0) * ex + (y + stop * dy - y0) * ey
    met = (rate * sign < 0.0) & (stop >= 0.0) & (stop < 1.0) & (along >= 0.0) & (along <= length2)
    return np.where(met, stop, 2.0)


def _take_first(settled: Settled, i: Whole, stop: Floats, across: Floats, up: Floats) -> None:
    """Shorten ways by stops; of those that come first and together, the one last in x, then y, is what stopped."""
    some = np.flatnonzero(stop < settled.free[i])
    some = some[np.lexsort((up[some], across[some], -stop[some]))]
    # The last assignment stands: the smallest stop, and among equals the greatest across, then up.
    settled.free[i[some]] = stop[some]
    settled.across[i[some]] = across[some]
    settled.up[i[some]] = up[some]
