"""Walls in the order that the compiled sonar expects: for each cell, round solids first, then pieces of walls by
direction and by line, two pieces of one line at a time, so that what pieces have in common is computed once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.records import NamedTuple
from sleepcast.simulator.world.grid import AT_ONCE, CellLists, Floats, Short, Whole

SAME_LINE, NEW_LINE, NEW_DIRECTION, ROUND = 0, 1, 2, 3
"""What a listed solid has in common with those before it."""
SAME_ANGLE, SAME_HEIGHT = 1e-9, 1e-7
"""Tolerances, rad and m, within which pieces count as parts of one line."""
TOUCHING = 1e-9
"""Gap, m, up to which pieces of one line count as one piece."""

News = NDArray[np.int8]


class Walls(NamedTuple):
    """solids: columns with the unit vector along the line (x, y), the distance by which the line passes the origin on
        its right, where the piece begins and ends along it, and radius; for round ones x, y, 0, 0, 0, radius. m,
        shape (6, n).
    start: first entry of each cell, shape (cells + 1,)
    items: the solid of each entry, shape (entries,)
    news: for each entry SAME_LINE, NEW_LINE, NEW_DIRECTION or ROUND
    """

    solids: Floats
    start: Short
    items: Short
    news: News


def walls_of(listed: CellLists, solids: Floats) -> Walls:
    """The `listed` rows of `solids` (see `world.World.solids`)."""
    columns, direction, line = _columns(solids)
    columns, direction, line, part = _joined(columns, direction, line)
    cells = len(listed.start) - 1
    pieces = [
        _entries(listed, part, direction, line, first, min(first + AT_ONCE, cells))
        for first in range(0, cells, AT_ONCE)
    ]
    start = np.zeros(cells + 1, np.int32)
    np.cumsum(np.concatenate([counts for counts, _, _ in pieces]), dtype=np.int32, out=start[1:])
    items, news = (np.concatenate([each[i] for each in pieces]) for i in (1, 2))
    return Walls(columns, start, items, news)


def _entries(
    listed: CellLists, part: Whole, direction: Whole, line: Whole, first: int, last: int
) -> tuple[Whole, Short, News]:
    """The number of entries of each cell from `first` to `last` (exclusive), and their `items` and `news`. part: the
    joined piece that each solid belongs to."""
    start = listed.start[first : last + 1]
    cell, items = np.repeat(np.arange(last - first), np.diff(start)), part[listed.items[start[0] : start[-1]]]
    if not len(items):
        return np.zeros(last - first, np.int64), np.empty(0, np.int32), np.empty(0, np.int8)
    order = np.lexsort((items, line[items], direction[items], cell))
    cell, items = cell[order], items[order]
    once = _changes(cell) | _changes(items)
    cell, items = cell[once], items[once]
    other_direction = _changes(cell) | _changes(direction[items])
    other_line = other_direction | _changes(line[items])
    news = np.where(other_direction, NEW_DIRECTION, np.where(other_line, NEW_LINE, SAME_LINE))
    news[direction[items] < 0] = ROUND
    return np.bincount(cell, minlength=last - first), items.astype(np.int32), news.astype(np.int8)


def _joined(columns: Floats, direction: Whole, line: Whole) -> tuple[Floats, Whole, Whole, Whole]:
    """The columns with touching or overlapping pieces of one line joined; and the joined piece of each solid."""
    begin, end = columns[3:5]
    round_ = direction < 0
    order = np.lexsort((begin, line, round_))
    # Ranks of the ends, by line first: the farthest end before a piece on its line is the running maximum.
    by_end = np.lexsort((end, line, round_))
    rank = np.empty(len(order), np.int64)
    rank[by_end] = np.arange(len(order))
    farthest = np.maximum.accumulate(rank[order])
    apart = _changes(line[order]) | round_[order]
    apart[1:] |= begin[order][1:] > end[by_end[farthest[:-1]]] + TOUCHING
    part = np.empty(len(order), np.int64)
    part[order] = np.cumsum(apart) - 1
    leads = np.flatnonzero(apart)
    joined = columns.take(order[leads], axis=1)  # row by row, as kernels get all arrays: indexing gives columns
    if len(leads):
        joined[4] = np.maximum.reduceat(end[order], leads)
    return joined, direction[order[leads]], line[order[leads]], part


def _columns(solids: Floats) -> tuple[Floats, Whole, Whole]:
    """The solids as columns, the number of each one's direction (-1 for round ones) and of its line."""
    x0, y0, x1, y1, radius = solids.T
    ex, ey = x1 - x0, y1 - y0
    length = np.sqrt(ex * ex + ey * ey)
    round_ = radius > 0.0
    length[round_] = 1.0
    back = (ex < -SAME_ANGLE * length) | ((np.abs(ex) <= SAME_ANGLE * length) & (ey < 0.0))
    ex, ey = np.where(back, -ex, ex) / length, np.where(back, -ey, ey) / length
    _, first, direction = np.unique(
        np.round(np.stack((ex, ey)) / SAME_ANGLE), axis=1, return_index=True, return_inverse=True
    )
    direction = np.where(round_, -1, direction.reshape(-1))
    ex, ey = ex[first[direction]], ey[first[direction]]
    height = y0 * ex - x0 * ey
    begin, end = x0 * ex + y0 * ey, x1 * ex + y1 * ey
    _, line = np.unique(np.stack((direction, np.round(height / SAME_HEIGHT))), axis=1, return_inverse=True)
    columns = np.stack((ex, ey, height, np.minimum(begin, end), np.maximum(begin, end), radius))
    columns[:, round_] = np.stack((x0, y0, 0.0 * x0, 0.0 * x0, 0.0 * x0, radius))[:, round_]
    return columns, direction, line.reshape(-1)


def _changes(values: Whole) -> NDArray[np.bool_]:
    """Where a value differs from the previous one; always true for the first."""
    return np.append(True, values[1:] != values[:-1])
