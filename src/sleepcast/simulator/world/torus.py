"""A torus: a world without edges, where a body that leaves on one side comes in on the opposite one.

`around` is the width and the height of a torus, m, and infinite for a plain world, so that the same formulas serve
both. What is near a body across an edge is found by images: copies, shifted by the size of the world, of everything
near an edge. They lie in a strip around the world, which the cells cover as well. Lengths in m.
"""

from __future__ import annotations

from math import inf

import numpy as np

from sleepcast.core.records import NamedTuple, dataclass
from sleepcast.simulator.world.grid import Floats, Grid, Whole, grid_over, layered_over

Around = tuple[float, float]
PLAIN: Around = (inf, inf)


def wrap_position(x: Floats, around: float) -> None:
    """Move positions that lie beyond an edge to the opposite one, in place."""
    gone = np.flatnonzero((x < 0.0) | (x >= around))
    inside = np.mod(x[gone], around)
    x[gone] = np.where(inside < around, inside, 0.0)  # a tiny negative number is rounded to `around`


class Images(NamedTuple):
    """Points in the frame of the cells: first the points themselves, then their images. of: the index of each one's
    point."""

    x: Floats
    y: Floats
    of: Whole | slice

    def whose(self, indices: Whole) -> Whole:
        """The points to which these points or images belong."""
        return indices if isinstance(self.of, slice) else self.of[indices]


@dataclass(frozen=True, slots=True)
class Cells:
    """The cells of a world, and of a strip of `margin` (across, up) around it in which images lie."""

    grid: Grid
    around: Around
    margin: tuple[float, float]

    def placed(self, x: Floats, y: Floats) -> tuple[Floats, Floats]:
        """These places in the frame of the cells."""
        return (x, y) if self.around == PLAIN else (x + self.margin[0], y + self.margin[1])

    def images(self, x: Floats, y: Floats) -> Images:
        """These points and their images; in a plain world, the points alone."""
        if self.around == PLAIN:
            return Images(x, y, slice(None))
        of, places = np.arange(len(x)), [*self.placed(x, y)]
        for axis, (size, margin) in enumerate(zip(self.around, self.margin, strict=True)):
            low, high = np.flatnonzero(places[axis] < 2.0 * margin), np.flatnonzero(places[axis] >= size)
            copied = np.concatenate((low, high))
            shifted = [each[copied] for each in places]
            shifted[axis] += np.repeat((size, -size), (len(low), len(high)))
            places, of = [np.concatenate(each) for each in zip(places, shifted, strict=True)], np.append(of, of[copied])
        return Images(places[0], places[1], of)

    def solids(self, solids: Floats) -> tuple[Floats, Whole]:
        """These rows of `world.World.solids` and their images in the frame of the cells, and the row of each."""
        if self.around == PLAIN:
            return solids, np.arange(len(solids))
        (width, height), (margin_x, margin_y) = self.around, self.margin
        shifts = [(i * width + margin_x, j * height + margin_y) for i in (0, 1, -1) for j in (0, 1, -1)]
        rows = np.concatenate([solids + np.array((x, y, x, y, 0.0)) for x, y in shifts])
        x, y, radius = rows[:, 0:4:2], rows[:, 1:4:2], rows[:, 4]
        near = (x.max(axis=1) + radius >= 0.0) & (x.min(axis=1) - radius <= width + 2.0 * margin_x)
        near &= (y.max(axis=1) + radius >= 0.0) & (y.min(axis=1) - radius <= height + 2.0 * margin_y)
        return np.ascontiguousarray(rows[near]), np.tile(np.arange(len(solids)), len(shifts))[near]


def cells_over(size: Around, around: Around, cell: float, reach: float, points: int, top: float | None = None) -> Cells:
    """Cells of at least `cell` for so many points in a world of this `size`. reach: greatest distance at which anything
    is looked for, on a torus less than half its width and height. top: m up to which cells lie in layers, None on the
    plane."""
    margin = (0.0, 0.0) if around == PLAIN else (reach, reach)
    width, height = size[0] + 2.0 * margin[0], size[1] + 2.0 * margin[1]
    if top is None:
        return Cells(grid_over(width, height, cell, points), around, margin)
    return Cells(layered_over(width, height, top, cell, points), around, margin)
