"""Mazes: a world of square cells with a way from each to every other, drawn from a seed.

The way through a perfect maze is the walk of somebody who goes on into a cell never seen before as long as there is one
beside this, and else turns back: long winding corridors, and exactly one way from each cell to every other. A share of
the walls that are left may then be opened, so that there are loops. Walls in one line are one wall: a ray, or a robot,
meets few of them.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.counter_rng import key, uniform
from sleepcast.core.errors import MisuseError
from sleepcast.simulator.world.world import Wall

MAX_CELLS = 1_000_000
"""Of one maze: about as many solids as fit into a world. So many are drawn in three seconds."""

Open = NDArray[np.bool_]


def maze(width: float, height: float, cell: float, loops: float, seed: int) -> list[Wall]:
    """The walls within a rectangle of `width` by `height` m, parted into cells of about `cell` m; none at its edge.

    loops: the share, 0..1, of a perfect maze's walls that are open. Equal arguments give equal mazes. Raises
    MisuseError for more than MAX_CELLS.
    """
    across, up = max(1, round(width / cell)), max(1, round(height / cell))
    if across * up > MAX_CELLS:
        raise MisuseError(f"a maze of {across} by {up} cells; at most {MAX_CELLS} cells fit: make them larger")
    to_right, to_top = _ways(across, up, seed)
    _open_more(to_right, loops, key(seed, "maze", "across"))
    _open_more(to_top, loops, key(seed, "maze", "up"))
    x: list[float] = np.linspace(0.0, width, across + 1).tolist()
    y: list[float] = np.linspace(0.0, height, up + 1).tolist()
    upright = [Wall(((x[i], y[a]), (x[i], y[b]))) for i, a, b in _lines(~to_right.T)]
    level = [Wall(((x[a], y[i]), (x[b], y[i]))) for i, a, b in _lines(~to_top)]
    return upright + level


def _ways(across: int, up: int, seed: int) -> tuple[Open, Open]:
    """A perfect maze: whether each cell is open to the one on its right, shape (up, across - 1), and to the one above
    it, shape (up - 1, across)."""
    wide = across + 2  # a border of cells seen already spares the question whether there is a cell at all
    steps = np.array([1, -1, wide, -wide])
    drawn = uniform(key(seed, "maze", "ways"), np.arange(4 * wide * (up + 2), dtype=np.uint64)).reshape(-1, 4)
    order: list[list[int]] = steps[np.argsort(drawn, axis=1)].tolist()
    border = np.ones((up + 2, wide), np.uint8)
    border[1:-1, 1:-1] = 0
    seen = bytearray(border.tobytes())
    from_right, from_below = bytearray(len(seen)), bytearray(len(seen))
    here = wide + 1
    seen[here] = 1
    way = [here]
    while way:
        here = way[-1]
        untried = order[here]
        while untried:
            step = untried.pop()
            there = here + step
            if not seen[there]:
                seen[there] = 1
                if abs(step) == 1:
                    from_right[min(here, there)] = 1
                else:
                    from_below[min(here, there)] = 1
                way.append(there)
                break
        else:
            way.pop()
    right, top = (np.frombuffer(each, bool).reshape(up + 2, wide).copy() for each in (from_right, from_below))
    return right[1:-1, 1:-2], top[1:-2, 1:-1]


def _open_more(ways: Open, share: float, chance: int) -> None:
    """Open so large a share of what is closed."""
    ways |= uniform(chance, np.arange(ways.size, dtype=np.uint64)).reshape(ways.shape) < share


def _lines(closed: Open) -> list[tuple[int, int, int]]:
    """Where walls stand, closed pieces in one row as one: the row's number, from 1, and where it begins and ends."""
    change = np.diff(np.pad(closed, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    rows, begin = np.nonzero(change == 1)
    _, end = np.nonzero(change == -1)
    return [(row + 1, a, b) for row, a, b in zip(rows.tolist(), begin.tolist(), end.tolist(), strict=True)]
