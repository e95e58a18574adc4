"""A uniform grid: which points lie near each other, and which solids lie near a cell.

Points are sorted by their cell, so that those of neighbouring cells of one row are contiguous in memory. Each cell
lists the solids near it. Where things fly, cells may lie in layers above each other, and points have a z as well.
Everything here is NumPy; `kernels` has a compiled version of the same sorting on the plane.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field
from math import cbrt, ceil, sqrt

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.records import NamedTuple, dataclass

Floats = NDArray[np.float64]
Whole = NDArray[np.int64]
Short = NDArray[np.int32]
"""Indices that are stored: of robots, solids and cells, at most some millions."""

CELLS_PER_POINT = 4
AT_ONCE = 8_192
"""Solids or cells processed at once, so that temporary arrays stay small beside the stored ones."""
LEAST_CELLS = 4_096
"""Cells that a grid may have besides `CELLS_PER_POINT` for each point: more would mostly be empty."""


@dataclass(frozen=True, slots=True)
class Grid:
    """Square cells of `size` m over a rectangle whose lower left corner is 0, 0. Points outside belong to the nearest
    cell at the edge. layers: of cubes above each other, from z = 0 on; one for all heights on the plane."""

    size: float
    columns: int
    rows: int
    layers: int = 1
    cells: int = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "cells", self.columns * self.rows * self.layers)

    def columns_of(self, x: Floats) -> Whole:
        return np.clip((x / self.size).astype(np.int64), 0, self.columns - 1)

    def rows_of(self, y: Floats) -> Whole:
        return np.clip((y / self.size).astype(np.int64), 0, self.rows - 1)

    def layers_of(self, z: Floats) -> Whole:
        return np.clip((z / self.size).astype(np.int64), 0, self.layers - 1)

    def cells_of(self, x: Floats, y: Floats, z: Floats | None = None) -> Whole:
        rows = self.rows_of(y) if z is None else self.layers_of(z) * self.rows + self.rows_of(y)
        return rows * self.columns + self.columns_of(x)


class Sorted(NamedTuple):
    """Points in the order of their cells. order: their indices; start: first entry of each cell, shape (cells + 1,)."""

    order: Short
    start: Short


class CellLists(NamedTuple):
    """Solids by cell. start: first entry of each cell, shape (cells + 1,); items: rows of the world's solids."""

    start: Short
    items: Short


def grid_over(width: float, height: float, size: float, points: int) -> Grid:
    """A grid with cells of at least `size` m; larger ones where there would be too many cells for `points`."""
    most = max(LEAST_CELLS, CELLS_PER_POINT * points)
    size = max(size, sqrt(width * height / most), max(width, height) / most)
    return Grid(size, max(1, ceil(width / size)), max(1, ceil(height / size)))


def layered_over(width: float, height: float, top: float, size: float, points: int) -> Grid:
    """As `grid_over`, in layers up to `top` m."""
    flat = grid_over(
        width, height, max(size, cbrt(width * height * top / (LEAST_CELLS + CELLS_PER_POINT * points))), points
    )
    return Grid(flat.size, flat.columns, flat.rows, max(1, ceil(top / flat.size)))


def sort(grid: Grid, x: Floats, y: Floats, z: Floats | None = None) -> Sorted:
    """The points x, y (m) by cell, those of one cell in the order of their indices. z: m, for a grid in layers."""
    cells = grid.cells_of(x, y, z)
    return Sorted(np.argsort(cells, kind="stable").astype(np.int32), starts(cells, grid.cells))


def only(points: Sorted, those: NDArray[np.bool_]) -> Sorted:
    """Of sorted points those that are marked, by their indices. The others follow at the end, where nobody looks: that
    each has its place in the order is what whoever goes through all of them relies on."""
    chosen = those[points.order]
    start = np.append(np.int32(0), np.cumsum(chosen, dtype=np.int32))[points.start]
    return Sorted(np.concatenate((points.order[chosen], points.order[~chosen])), start)


def starts(cells: Whole | Short, count: int) -> Short:
    """First entry of each of `count` cells among all entries, sorted by cell. cells: the cell of each entry."""
    start = np.zeros(count + 1, np.int32)
    np.cumsum(np.bincount(cells, minlength=count), dtype=np.int32, out=start[1:])
    return start


def pairs(
    grid: Grid, points: Sorted, x: Floats, y: Floats, reach: float, first: Whole, z: Floats | None = None
) -> tuple[Whole, Whole]:
    """All ordered pairs of different points at most `reach` m apart: two arrays of indices. points: x, y and z, sorted.
    first: indices to use as the first of a pair. z: None on the plane."""
    order, start = points
    firsts, seconds = [], []
    for inside, begin, end in _lines(grid, x[first], y[first], None if z is None else z[first], reach):
        i, index = spread(first[inside], start[begin], start[end])
        j = order[index].astype(np.int64)
        squares = (x[i] - x[j]) ** 2 + (y[i] - y[j]) ** 2
        near = (squares if z is None else squares + (z[i] - z[j]) ** 2) <= reach * reach
        near &= i != j
        firsts.append(i[near])
        seconds.append(j[near])
    return np.concatenate(firsts), np.concatenate(seconds)


def candidates(grid: Grid, points: Sorted, x: Floats, y: Floats, reach: float, z: Floats | None = None) -> Whole:
    """For each place x, y, z the number of `points` in cells within `reach` m: an upper bound of those within reach."""
    counts = np.zeros(len(x), np.int64)
    for inside, begin, end in _lines(grid, x, y, z, reach):
        counts[inside] += points.start[end] - points.start[begin]
    return counts


def _lines(grid: Grid, x: Floats, y: Floats, z: Floats | None, reach: float) -> Iterator[tuple[Whole, Whole, Whole]]:
    """Lines of cells along x within `reach` m of these places, layer by layer and row by row: which of the places have
    such a line, the first cell of each, and the one after its last."""
    row, cells = grid.rows_of(y), ceil(reach / grid.size)
    layer, layers = (np.zeros(len(row), np.int64), 0) if z is None else (grid.layers_of(z), cells)
    left, right = grid.columns_of(x - reach), grid.columns_of(x + reach)
    for rise in range(-layers, layers + 1):
        between = (layer + rise >= 0) & (layer + rise < grid.layers)
        for step in range(-cells, cells + 1):
            inside = np.flatnonzero(between & (row + step >= 0) & (row + step < grid.rows))
            base = ((layer[inside] + rise) * grid.rows + row[inside] + step) * grid.columns
            yield inside, base + left[inside], base + right[inside] + 1


def spread(items: Whole, begin: Whole | Short, end: Whole | Short) -> tuple[Whole, Whole]:
    """Each of `items` paired with every number from its `begin` to its `end` (exclusive): two arrays."""
    counts = (end - begin).astype(np.int64)
    total = int(counts.sum())
    skipped = np.repeat(np.cumsum(counts) - counts, counts)
    return np.repeat(items, counts), np.arange(total) - skipped + np.repeat(begin, counts)


def list_solids(grid: Grid, solids: Floats, reach: float) -> CellLists:
    """The solids within `reach` m of any point of each cell, in the order of their rows. solids: see `World.solids`."""
    pieces = [_cells_near(grid, solids, reach, at, at + AT_ONCE) for at in range(0, len(solids), AT_ONCE)]
    cells, item = (np.concatenate([np.empty(0, np.int32), *(each[i] for each in pieces)]) for i in (0, 1))
    return CellLists(starts(cells, grid.cells), item[np.argsort(cells, kind="stable")])


def _cells_near(grid: Grid, solids: Floats, reach: float, first: int, last: int) -> tuple[Short, Short]:
    """The solids in these rows, each paired with the number of every cell near it."""
    x0, y0, x1, y1, radius = solids[first:last].T
    far = reach + radius
    left, right = grid.columns_of(np.minimum(x0, x1) - far), grid.columns_of(np.maximum(x0, x1) + far)
    bottom, top = grid.rows_of(np.minimum(y0, y1) - far), grid.rows_of(np.maximum(y0, y1) + far)
    # Pair each solid with each row, then with each cell of its bounding box, then drop the cells that it misses.
    item, row = spread(np.arange(len(far)), bottom, top + 1)
    index, column = spread(np.arange(len(item)), left[item], right[item] + 1)
    item, row = item[index], row[index]
    middle_x = (column.astype(np.float64) + 0.5) * grid.size
    middle_y = (row.astype(np.float64) + 0.5) * grid.size
    away = distance(middle_x, middle_y, x0[item], y0[item], x1[item], y1[item])
    edge = (column == 0) | (row == 0) | (column == grid.columns - 1) | (row == grid.rows - 1)
    near = edge | (away <= far[item] + grid.size * sqrt(0.5))
    cells = (row * grid.columns + column)[near]
    return cells.astype(np.int32), (item[near] + first).astype(np.int32)


def distance(x: Floats, y: Floats, x0: Floats, y0: Floats, x1: Floats, y1: Floats) -> Floats:
    """Distance from each point x, y to the line from x0, y0 to x1, y1, m."""
    dx, dy = nearest_point(x, y, x0, y0, x1, y1)
    away: Floats = np.sqrt(dx * dx + dy * dy)
    return away


def nearest_point(x: Floats, y: Floats, x0: Floats, y0: Floats, x1: Floats, y1: Floats) -> tuple[Floats, Floats]:
    """Vector from each point x, y to the nearest point of a line: x and y components, m."""
    ex, ey = x1 - x0, y1 - y0
    length2 = ex * ex + ey * ey
    share = ((x - x0) * ex + (y - y0) * ey) / np.where(length2 > 0.0, length2, 1.0)
    share = np.clip(share, 0.0, 1.0)
    return x0 + share * ex - x, y0 + share * ey - y
