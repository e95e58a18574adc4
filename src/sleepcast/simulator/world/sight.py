"""Line of sight: whether something solid lies between two points.

The line goes from centre to centre, and what it only touches hides as well: the end of a wall, a corner, the rim of a
disc. `crossed` is the one definition. To ask it of few solids alone, all of them lie in cells of their own
(`SightLines`), and a line is looked at in the cells that it passes. Every cell lists a bit more than what lies in it,
so that rounding on the way never misses anything; therefore the compiled walk of `kernels_sight`, which looks at the
same cells in another order, comes to the same bits.

All formulas change only their sign if the ends of the line are exchanged: in a plain world, who sees is seen.

Where robots fly, solids hide between two heights, and only lines that are between these somewhere on their way through
them (`Levels`).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from enum import IntEnum
from math import ceil, inf, log, sqrt

import numpy as np
from numpy.typing import NDArray

from sleepcast.simulator.simd.formulas import LANES
from sleepcast.simulator.world.grid import CellLists, Floats, Grid, Short, Whole, grid_over, list_solids, spread
from sleepcast.simulator.world.torus import PLAIN, Around
from sleepcast.simulator.world.world import World

Flags = NDArray[np.bool_]
Singles = NDArray[np.float32]
Ends = tuple[Floats, Floats, Floats, Floats]
"""x, y of the beginnings of lines, and of their ends, m."""
Levels = tuple[Floats, Floats]
"""z of the beginnings of lines, and of their ends; or for solids, above and below which heights they hide; m."""

SLACK = 1e-6
"""By how much, in sides of a cell, cells list what lies beyond them: far more than what rounding moves a line by."""
AT_ONCE = 65_536
"""Lines that are looked at together."""
BESIDE = 1.5
"""How many times as far as anybody looks spans go."""
HUGE = 2.0**24
"""Times as large as that, a world is too large for it."""
SPREAD = 2.0**0.5
"""How much larger the reach is for which new lists of solids are made."""
MOST_WIDE = 8
"""Reaches for which such lists are kept."""
LONG = 64
"""Solids in a list on average, up to which such lists are used. Each takes 24 bytes."""


class Lines(IntEnum):
    """The words of the table of solids that hide, 64 bits each: numbers, addresses, and numbers with a point."""

    COUNT = 0
    """Solids; with none nothing is hidden."""
    SOLIDS = 1
    """Five numbers with a point for each."""
    START = 2
    """First item of each cell, int32, as the items are."""
    ITEMS = 3
    COLUMNS = 4
    ROWS = 5
    SIZE = 6
    """Of a cell, m, with a point, as the margins are."""
    MARGIN_X = 7
    MARGIN_Y = 8
    SPANS = 9
    """What of each item lies near its cell, see `spans`."""
    DOUBT = 10
    """m2, with a point: areas that are computed with spans are wrong by less; infinite where nothing is known of it."""


def crossed(x: Floats, y: Floats, to_x: Floats, to_y: Floats, solids: Floats) -> Flags:
    """Whether each line from x, y to `to_x`, `to_y` (m) touches or crosses its solid. solids: rows of
    `world.World.solids`, one for each line; each is either a line or a disc."""
    x0, y0, x1, y1, radius = solids.T
    apart = np.maximum(x0, x1) < np.minimum(x, to_x)
    apart |= np.minimum(x0, x1) > np.maximum(x, to_x)
    apart |= np.maximum(y0, y1) < np.minimum(y, to_y)
    apart |= np.minimum(y0, y1) > np.maximum(y, to_y)
    sides = (
        _side(x, y, to_x, to_y, x0, y0),
        _side(x, y, to_x, to_y, x1, y1),
        _side(x0, y0, x1, y1, x, y),
        _side(x0, y0, x1, y1, to_x, to_y),
    )
    for one, other in (sides[:2], sides[2:]):
        apart |= ((one > 0.0) & (other > 0.0)) | ((one < 0.0) & (other < 0.0))
    round_: Flags = radius > 0.0
    met: Flags = np.logical_not(apart)
    if not round_.any():
        return met
    along_x, along_y, square = to_x - x, to_y - y, radius * radius
    from_x, from_y, before_x, before_y = x0 - x, y0 - y, x0 - to_x, y0 - to_y
    beside = (from_x * along_x + from_y * along_y > 0.0) & (before_x * along_x + before_y * along_y < 0.0)
    touched = beside & (sides[0] * sides[0] <= square * (along_x * along_x + along_y * along_y))
    touched |= from_x * from_x + from_y * from_y <= square
    touched |= before_x * before_x + before_y * before_y <= square
    return np.where(round_, touched, met)


def _side(x: Floats, y: Floats, to_x: Floats, to_y: Floats, point_x: Floats, point_y: Floats) -> Floats:
    """Above 0 where a point lies to the left of a line, below 0 to its right, 0 on it."""
    turn: Floats = (x - point_x) * (to_y - point_y) - (y - point_y) * (to_x - point_x)
    return turn


def unrolled(place: Floats, seen: Floats, around: float) -> Floats:
    """Where what stands at `seen` is seen from `place`, along one axis, m: the nearest image on a torus of this size,
    itself in a plain world."""
    way, half = seen - place, around / 2.0
    return np.where(way > half, seen - around, np.where(way < -half, seen + around, seen))


class SolidsByCell:
    """Solids by cell. table: for compiled code, see `Lines`; it stays where it is

    solids: rows in the world's frame, with all images on a torus
    margin: of the strip around the world that cells cover, across and up, m
    """

    def __init__(self) -> None:
        self.table = np.zeros(len(Lines), np.int64)
        self.solids = np.empty((0, 5))

    def fill(self, solids: Floats, grid: Grid, margin: tuple[float, float], reach: float) -> None:
        """List in each cell all solids within `reach` m of it."""
        self.solids, self.grid, self.margin = solids, grid, margin
        self.listed: CellLists = list_solids(grid, solids + np.array((*margin, *margin, 0.0)), reach)
        table, reals = self.table, self.table.view(np.float64)
        table[Lines.COUNT], table[Lines.SOLIDS] = len(solids), solids.ctypes.data
        table[Lines.START], table[Lines.ITEMS] = (each.ctypes.data for each in self.listed)
        table[Lines.COLUMNS], table[Lines.ROWS], reals[Lines.SIZE] = grid.columns, grid.rows, grid.size
        reals[Lines.MARGIN_X], reals[Lines.MARGIN_Y] = margin

    def __bool__(self) -> bool:
        """Whether anything hides."""
        return len(self.solids) > 0

    def span(self, reach: float, size: tuple[float, float]) -> None:
        """Let compiled code look along lines of at most `reach` m in numbers of 32 bits. size: of the world, m

        Places from a robot, across and up, are at most `most`. They are wrong by 2^-23 of it, areas between two of them
        by six times 2^-23 of its square, and differences and sums of these by less than 32 times as much: the doubt. In
        numbers of 64 bits, by which `crossed` decides, the same is wrong by far less in all but enormous worlds.
        """
        self.spans = spans(self, reach)
        most = 1.5 * self.grid.size + BESIDE * reach
        wide = max(*size, float(np.abs(self.solids).max(initial=0.0)))
        self.table[Lines.SPANS] = self.spans.ctypes.data
        self.table.view(np.float64)[Lines.DOUBT] = 2.0**-18 * most * most if wide < HUGE * most else inf

    @property
    def address(self) -> int:
        return int(self.table.ctypes.data)


def spans(lines: SolidsByCell, reach: float) -> Singles:
    """What of each listed solid lies near its cell, from the middle of the cell, m: five numbers each, as in
    `world.World.solids`, an infinite radius for a disc that is too large for them. Those of a cell lie together, up to
    LANES of each number in a row."""
    start, items = lines.listed
    found = np.zeros(5 * (len(items) + LANES), np.float32)
    counts = np.diff(start)
    cells = np.repeat(np.arange(len(counts), dtype=np.int32), counts)
    for begin in range(0, len(items), AT_ONCE):
        cell = cells[begin : begin + AT_ONCE]
        place = np.arange(begin, begin + len(cell)) - start[cell]
        first = place - place % LANES
        at = 5 * (start[cell] + first) + place % LANES
        for row in _spans_of(lines, cell, items[begin : begin + AT_ONCE], reach):
            found[at] = row
            at += np.minimum(counts[cell] - first, LANES)
    return found


def _spans_of(lines: SolidsByCell, cells: Short, items: Short, reach: float) -> Iterator[Floats]:
    """The five numbers of these solids in these cells. Whatever lies too far away becomes a wall far away."""
    grid, (margin_x, margin_y) = lines.grid, lines.margin
    row, column = np.divmod(cells, grid.columns)
    x0, y0, x1, y1, radius = lines.solids[items].T
    middle_x, middle_y = (column + 0.5) * grid.size - margin_x, (row + 0.5) * grid.size - margin_y
    x0, y0, x1, y1 = x0 - middle_x, y0 - middle_y, x1 - middle_x, y1 - middle_y
    near, far = 0.5 * grid.size + reach, 0.5 * grid.size + BESIDE * reach
    begin, end = _inside(x0, y0, x1, y1, near + radius)
    gone = begin > end
    begin, end = _inside(x0, y0, x1, y1, np.where(radius > 0.0, inf, far))
    for place, way, share, beyond in (
        *((x0, x1 - x0, begin, far), (y0, y1 - y0, begin, -far)),
        *((x0, x1 - x0, end, far), (y0, y1 - y0, end, far)),
    ):
        yield np.where(gone, beyond, place + share * way)
    yield np.where(gone, 0.0, np.where(radius > far - near, inf, radius))


def _inside(x0: Floats, y0: Floats, x1: Floats, y1: Floats, half: Floats) -> tuple[Floats, Floats]:
    """Which part of each line lies within a square of its own around 0, 0: where it begins and ends as shares of the
    line; the beginning is beyond the end if none does. half: of its side, m"""
    begin, end = np.zeros(len(x0)), np.ones(len(x0))
    for place, to in ((x0, x1), (y0, y1)):
        way = to - place
        level = way == 0.0
        low, high = (-half - place) / np.where(level, 1.0, way), (half - place) / np.where(level, 1.0, way)
        low, high = np.minimum(low, high), np.maximum(low, high)
        begin = np.where(level, np.where(np.abs(place) > half, 2.0, begin), np.maximum(begin, low))
        end = np.where(level, end, np.minimum(end, high))
    return begin, end


class SightLines(SolidsByCell):
    """The solids that hide, in cells that list what lies in them. size: of the world, m; around: see `torus`.

    version: counts the changes
    rows: of the solids that were put, for each one here: on a torus there are images, too
    levels: between which heights these solids hide, None if at any
    """

    def __init__(self, size: tuple[float, float], around: Around = PLAIN) -> None:
        super().__init__()
        self._size, self._around = size, around
        # On a torus what is seen lies less than half a world away.
        self._beyond = (0.0, 0.0) if around == PLAIN else (size[0] / 2.0, size[1] / 2.0)
        self._world_version, self.version = -1, 0
        self._wide: dict[float, SolidsByCell] = {}
        self.put(np.empty((0, 5)))

    def keep_up(self, world: World) -> None:
        """Take over what has changed in the world."""
        if self._world_version != world.version:
            self._world_version = world.version
            solids, tops = joined_by_top(world.solids, world.tops)
            self.put(solids, None if tops is None else (np.full(len(tops), -inf), tops))

    def put(self, solids: Floats, levels: Levels | None = None) -> None:
        """Let these rows of `world.World.solids` hide, between these heights."""
        self.version += 1
        self.levels = levels
        self._wide.clear()
        images, self.rows = self._images(solids)
        across, up = self._covered
        grid = self._grid(sqrt(across * up / max(len(images), 1)), len(images))
        self.fill(images, grid, self._beyond, SLACK * grid.size)

    def around(self, reach: float) -> SolidsByCell | None:
        """The solids in cells that list all within `reach` m, and a bit beyond: whoever looks no farther needs to look
        at one cell alone. None if these lists would be long; and if that is half a torus, where it is a matter of
        rounding which image is the nearest."""
        if 2.001 * reach > min(self._around):
            return None
        wide = SPREAD ** ceil(log(max(reach, 1e-9) * (1.0 - SLACK), SPREAD)) * (1.0 + SLACK)  # few different ones
        if wide not in self._wide:
            if len(self._wide) == MOST_WIDE:
                self._wide.clear()
            made = self._wide[wide] = SolidsByCell()
            made.fill(self.solids, self._grid(wide, 4 * len(self.solids)), self._beyond, wide * (1.0 + SLACK))
            made.span(wide, self._size)
        found = self._wide[wide]
        return found if len(found.listed.items) <= LONG * found.grid.cells else None

    @property
    def _covered(self) -> tuple[float, float]:
        """Width and height of the rectangle that cells cover, m."""
        return self._size[0] + 2.0 * self._beyond[0], self._size[1] + 2.0 * self._beyond[1]

    def _grid(self, cell: float, count: int) -> Grid:
        return grid_over(*self._covered, cell, count)

    def _images(self, solids: Floats) -> tuple[Floats, Whole]:
        """These solids and on a torus their images within half a world around it, in the world's frame; and the row of
        each."""
        if self._around == PLAIN:
            return np.ascontiguousarray(solids), np.arange(len(solids))
        width, height = self._around
        shifts = [(i * width, j * height) for i in (0, 1, -1) for j in (0, 1, -1)]
        rows = np.concatenate([solids + np.array((x, y, x, y, 0.0)) for x, y in shifts])
        near = np.ones(len(rows), bool)
        for first, side, beyond in ((0, width, self._beyond[0]), (1, height, self._beyond[1])):
            places, radius = rows[:, first:4:2], rows[:, 4]
            near &= (places.max(axis=1) + radius >= -beyond) & (places.min(axis=1) - radius <= side + beyond)
        return np.ascontiguousarray(rows[near]), np.tile(np.arange(len(solids)), len(shifts))[near]


def joined(solids: Floats) -> Floats:
    """These rows with pieces of wall joined that lie on one line along an axis and touch: mazes, rooms and maps have
    many short ones."""
    upright = (solids[:, 4] == 0.0) & (solids[:, 0] == solids[:, 2])
    level = (solids[:, 4] == 0.0) & (solids[:, 1] == solids[:, 3]) & ~upright
    rows = [solids[~(upright | level)]]
    for which, line, along in ((upright, 0, 1), (level, 1, 0)):
        pieces = solids[which]
        begin, end = np.sort(pieces[:, [along, along + 2]], axis=1).T
        order = np.lexsort((begin, pieces[:, line]))
        places, begin, end = pieces[order, line], begin[order], end[order]
        new = np.diff(places, prepend=np.nan) != 0.0
        # The farthest end so far on each line: ranks by line first make it a running maximum.
        by_end = np.lexsort((end, np.cumsum(new)))
        rank = np.empty(len(order), np.int64)
        rank[by_end] = np.arange(len(order))
        farthest = end[by_end[np.maximum.accumulate(rank)]]
        new[1:] |= begin[1:] > farthest[:-1]
        leads = np.flatnonzero(new)
        made = np.zeros((len(leads), 5))
        made[:, line] = made[:, line + 2] = places[leads]
        made[:, along] = begin[leads]
        made[:, along + 2] = np.maximum.reduceat(end, leads) if len(leads) else leads
        rows.append(made)
    return np.concatenate(rows)


def joined_by_top(solids: Floats, tops: Floats | None) -> tuple[Floats, Floats | None]:
    """As `joined`, of things that are as high as `tops` says, m (None: without limit): only equally high ones."""
    if tops is None:
        return joined(solids), None
    heights = np.unique(tops)
    rows = [joined(solids[tops == top]) for top in heights]
    return np.concatenate(rows), np.repeat(heights, [len(each) for each in rows])


def hidden(
    lines: SightLines,
    x: Floats,
    y: Floats,
    to_x: Floats,
    to_y: Floats,
    passing: Sequence[Whole] = (),
    levels: Levels | None = None,
) -> Flags:
    """Whether anything hides each point `to_x`, `to_y` from x, y, m; in the world's frame, on a torus `unrolled`.
    passing: rows of the solids that were put, one for each line, which do not hide it; levels: of the lines, None on
    the ground."""
    found = np.zeros(len(x), bool)
    for _, _, which in _hits(lines, (x, y, to_x, to_y), passing, levels, found):
        found[which] = True
    return found


def stops(
    lines: SightLines,
    x: Floats,
    y: Floats,
    to_x: Floats,
    to_y: Floats,
    passing: Sequence[Whole] = (),
    levels: Levels | None = None,
) -> Floats:
    """At which share of each line, 0 to 1, the first thing lies that hides its end; infinite where nothing does, as
    `hidden` says."""
    found = np.full(len(x), inf)
    for ends, items, which in _hits(lines, (x, y, to_x, to_y), passing, levels):
        np.minimum.at(found, which, _stretches(ends, lines.solids[items])[0])
    return found


def _hits(
    lines: SightLines, every: Ends, passing: Sequence[Whole], levels: Levels | None, done: Flags | None = None
) -> Iterator[tuple[Ends, Whole, Whole]]:
    """What hides something on each line, from cell to cell: the ends of the line, the row of the solid, and the index
    of the line. passing, levels: as for `hidden`; done: as for `_met`."""
    for first in range(0, len(every[0]) if lines else 0, AT_ONCE):
        some = slice(first, first + AT_ONCE)
        ends = every[0][some], every[1][some], every[2][some], every[3][some]
        for which, items in _met(lines, ends, None if done is None else done[some]):
            hit = crossed(*_some(ends, which), lines.solids[items])
            for rows in passing:
                hit &= lines.rows[items] != rows[first + which]
            if levels is not None and lines.levels is not None:
                met = np.flatnonzero(hit)
                hit[met] = _between(lines, levels, first + which[met], _some(ends, which[met]), items[met])
            yield _some(ends, which[hit]), items[hit], first + which[hit]


def _between(lines: SightLines, levels: Levels, which: Whole, ends: Ends, items: Whole) -> Flags:
    """Whether each of these lines is between the heights of its solid anywhere on its way through it. which: their
    indices; items: the rows of the solids."""
    assert lines.levels is not None
    z, to_z = (each[which] for each in levels)
    at_first, at_last = (z + share * (to_z - z) for share in _stretches(ends, lines.solids[items]))
    low, high = (each[lines.rows[items]] for each in lines.levels)
    between: Flags = (np.minimum(at_first, at_last) < high) & (np.maximum(at_first, at_last) > low)
    return between


def _stretches(ends: Ends, solids: Floats) -> tuple[Floats, Floats]:
    """At which share of each line it first meets its solid, which it touches or crosses, and at which it leaves it."""
    x, y, to_x, to_y = ends
    x0, y0, x1, y1, radius = solids.T
    along_x, along_y = to_x - x, to_y - y
    square = along_x * along_x + along_y * along_y
    before, beside = (x0 - x) * along_x + (y0 - y) * along_y, (x0 - x) * along_y - (y0 - y) * along_x
    turn, end = along_x * (y1 - y0) - along_y * (x1 - x0), (x1 - x) * along_x + (y1 - y) * along_y
    half = np.sqrt(np.maximum(radius * radius * square - beside * beside, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        wall = ((x0 - x) * (y1 - y0) - (y0 - y) * (x1 - x0)) / turn
        nearest, farthest = np.minimum(before, end) / square, np.maximum(before, end) / square  # of a wall along it
        disc, beyond = (before - half) / square, (before + half) / square
    first = np.where(radius > 0.0, disc, np.where(turn == 0.0, nearest, wall))
    last = np.where(radius > 0.0, beyond, np.where(turn == 0.0, farthest, wall))
    first, last = (np.clip(np.nan_to_num(each), 0.0, 1.0) for each in (first, last))
    return first, np.where(square == 0.0, 1.0, last)  # a line without length meets it at once, and never leaves it


def crossings(
    lines: SightLines, x: Floats, y: Floats, to_x: Floats, to_y: Floats, levels: Levels | None = None
) -> Whole:
    """How many solids each line touches or crosses; see `hidden`."""
    counts = np.zeros(len(x), np.int64)
    if not lines:
        return counts
    for first in range(0, len(x), AT_ONCE):
        some = slice(first, first + AT_ONCE)
        ends = x[some], y[some], to_x[some], to_y[some]
        met = [which * len(lines.solids) + items for which, items in _met(lines, ends)]
        which, items = np.divmod(np.unique(np.concatenate(met)), len(lines.solids))
        hit = crossed(*_some(ends, which), lines.solids[items])
        if levels is not None and lines.levels is not None:
            hit &= _between(lines, levels, first + which, _some(ends, which), items)
        counts[some] = np.bincount(which[hit], minlength=len(ends[0]))
    return counts


def _some(ends: Ends, which: Whole) -> Ends:
    x, y, to_x, to_y = ends
    return x[which], y[which], to_x[which], to_y[which]


def _met(lines: SightLines, ends: Ends, done: Flags | None = None) -> Iterator[tuple[Whole, Whole]]:
    """The solids that each line may meet, from cell to cell: for each of them the index of the line and the row of the
    solid. done: lines that need not be followed any more, looked at before each step."""
    x, y, to_x, to_y = ends
    grid, (margin_x, margin_y) = lines.grid, lines.margin
    columns, to_columns = grid.columns_of(x + margin_x), grid.columns_of(to_x + margin_x)
    rows, to_rows = grid.rows_of(y + margin_y), grid.rows_of(to_y + margin_y)
    steps_x, steps_y = np.sign(to_columns - columns), np.sign(to_rows - rows)
    left_x, left_y = np.abs(to_columns - columns), np.abs(to_rows - rows)
    next_x, each_x = _borders(grid, columns, steps_x, x + margin_x, to_x - x)
    next_y, each_y = _borders(grid, rows, steps_y, y + margin_y, to_y - y)
    active = np.arange(len(x))
    while active.size:
        cell = rows[active] * grid.columns + columns[active]
        which, index = spread(active, lines.listed.start[cell], lines.listed.start[cell + 1])
        yield which, lines.listed.items[index].astype(np.int64)
        going = left_x[active] + left_y[active] > 0
        if done is not None:
            going &= ~done[active]
        active = active[going]
        sideways = next_x[active] <= next_y[active]
        for which, cells, steps, left, following, each in (
            (active[sideways], columns, steps_x, left_x, next_x, each_x),
            (active[~sideways], rows, steps_y, left_y, next_y, each_y),
        ):
            cells[which] += steps[which]
            left[which] -= 1
            following[which] = np.where(left[which] > 0, following[which] + each[which], inf)


def _borders(grid: Grid, cells: Whole, steps: Whole, place: Floats, along: Floats) -> tuple[Floats, Floats]:
    """Along one axis: at which share of each line its next cell begins, infinite for lines that stay in theirs, and
    which share of it lies in a whole cell."""
    going = steps != 0
    way = np.where(going, along, 1.0)
    border = (cells + (steps > 0)) * grid.size
    return np.where(going, (border - place) / way, inf), np.where(going, grid.size / np.abs(way), inf)
