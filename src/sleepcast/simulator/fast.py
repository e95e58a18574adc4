"""The machine of compiled kernels: NumPy's arrays in and out, `kernels` in between, on one or more threads.

Threads share the rows of cells, each with about as many robots; below `ALONE` robots one does everything, because
waking another one takes longer.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from itertools import pairwise
from math import cos, inf, pi, sin

import numpy as np

from sleepcast.simulator import kernels
from sleepcast.simulator.cones import Cones, Ranges
from sleepcast.simulator.contact import SKIN, Settled
from sleepcast.simulator.grid import Floats, Grid, Listed, Sorted, Whole
from sleepcast.simulator.noise import Noise

ALONE = 4_000
"""Robots up to which one thread is faster than several."""
STRETCHES = 4
"""Stretches of rows for each thread: when one thread is done early it takes over some of the rest."""
FOLDED = 16
"""Sonars of a ring whose bearings the kernel can fold."""


class NumbaMachine:
    """See `engine.Machine`. threads: None is one for each core."""

    name = "numba"

    def __init__(self, threads: int | None = None) -> None:
        self.threads = threads or len(os.sched_getaffinity(0))
        self._pool = ThreadPoolExecutor(self.threads, "kernels") if self.threads > 1 else None

    def sort(self, grid: Grid, x: Floats, y: Floats) -> Sorted:
        cells, order = np.empty(len(x), np.int64), np.empty(len(x), np.int64)
        start = np.empty(grid.cells + 1, np.int64)
        kernels.sort(x, y, grid.size, grid.across, grid.up, cells, start, order)
        return Sorted(order, start)

    def ranges(
        self,
        cones: Cones,
        grid: Grid,
        points: Sorted,
        listed: Listed,
        solids: Floats,
        pose: tuple[Floats, Floats, Floats],
        which: Whole,
    ) -> Ranges:
        x, y, heading = (values[points.order] for values in pose)
        asked = np.full(len(x), -1, np.int64)
        asked[which] = np.arange(len(which))
        found = np.empty((len(which), cones.count), np.float32)
        apart = 2.0 * pi / cones.count
        lone = cones.lone(apart) if cones.count == FOLDED else inf
        lone = lone if lone < inf else -1.0
        graze = sin(cones.incidence) if cones.incidence < pi / 2 else 1.0
        cosines, sines, axis_cos, axis_sin = np.cos(heading), np.sin(heading), np.cos(cones.axes), np.sin(cones.axes)
        lines = _with_lengths(solids)

        def stretch(first: int, last: int) -> None:
            kernels.see(
                *(x, y, cosines, sines, *points, asked, grid.size, grid.across, grid.up, lines, *listed),
                *(cones.radius, cones.most, cos(cones.half), sin(cones.half), graze, cones.grazing, lone),
                *(axis_cos, axis_sin, first, last, found),
            )

        self._share(stretch, grid, points.start)
        return found

    def settle(
        self,
        grid: Grid,
        points: Sorted,
        listed: Listed,
        solids: Floats,
        radius: float,
        place: tuple[Floats, Floats],
        way: tuple[Floats, Floats],
    ) -> Settled:
        x, y, across, up = (values[points.order] for values in (*place, *way))
        longest = float(np.sqrt(np.max(across * across + up * up, initial=0.0)))
        reach = 2.0 * radius + SKIN + 2.0 * longest
        stopped = Settled(*np.empty((3, len(x))))
        settled = Settled(*np.empty((3, len(x))))
        ways = (x, y, across, up, *points, grid.size, grid.across, grid.up)

        def at_old(first: int, last: int) -> None:
            kernels.stop_at_old(*ways, solids, *listed, radius, SKIN, reach, first, last, *stopped)

        def at_ways(first: int, last: int) -> None:
            kernels.stop_at_ways(*ways, radius, SKIN, reach, first, last, *stopped, *settled)

        self._share(at_old, grid, points.start)
        self._share(at_ways, grid, points.start)
        return settled

    def disturb(self, seen: Ranges, which: Whole, noise: Noise) -> None:
        kernels.disturb(
            *(seen, which, noise.share, noise.dropout, np.float32(noise.most)),
            *(np.uint64(noise.key), np.uint64(noise.dropout_key)),
        )

    def _share(self, work: Callable[[int, int], None], grid: Grid, start: Whole) -> None:
        """Let `work` be done for all rows of cells, in stretches of about as many robots."""
        count = int(start[-1])
        if self._pool is None or count <= ALONE:
            work(0, grid.up)
            return
        ends = start[grid.across :: grid.across]  # robots up to and with each row
        shares = np.arange(1, self.threads * STRETCHES) * (count / (self.threads * STRETCHES))
        borders = [0, *(np.searchsorted(ends, shares) + 1).tolist(), grid.up]
        jobs = [self._pool.submit(work, *pair) for pair in pairwise(borders) if pair[0] < pair[1]]
        for job in jobs:
            job.result()


def _with_lengths(solids: Floats) -> Floats:
    """As the kernel wants them: x, y, unit vector to the other end, length, radius; shape (6, n)."""
    ex, ey = solids[:, 2] - solids[:, 0], solids[:, 3] - solids[:, 1]
    length = np.sqrt(ex * ex + ey * ey)
    whole = np.where(length > 0.0, length, 1.0)
    return np.ascontiguousarray(np.stack((solids[:, 0], solids[:, 1], ex / whole, ey / whole, length, solids[:, 4])))
