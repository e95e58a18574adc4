"""The scene and the sonars that fire one after the other, in the form that `kernels_firing` expects."""

from __future__ import annotations

from collections.abc import Callable
from math import cos, pi, sin, tan

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.arrays import Arena
from sleepcast.core.records import NamedTuple
from sleepcast.simulator.simd.cached import CachedKernels
from sleepcast.simulator.simd.formulas import LANES, sine_cosine
from sleepcast.simulator.sonar.cones import Cones, Ranges, VisibleScene
from sleepcast.simulator.sonar.firing import Firing, Tick
from sleepcast.simulator.sonar.noise import Noise
from sleepcast.simulator.world.grid import CellLists, Floats, Short, Whole

kernels = CachedKernels("sonar.kernels")
AWAY = np.float32(1e9)
"""Coordinates and range of nothing, m."""
SPAN = 28
"""log2 of the number of position units per cell: bodies may be some cells apart, and the unit is finer than the
single-precision error of their distance."""


class SonarField(NamedTuple):
    """The scene as the kernel expects it.

    x, y, cosines, sines: of all bodies, sorted by cell
    short_x, short_y: x and y in single precision, padded with LANES far-away entries
    order: the bodies' indices
    radii: of the sorted bodies, shape (count,), or (1,) if all are equal
    start: first body of each cell
    listed, items: the solids visible from each cell
    solids: see `solid_columns`
    size: of a cell, m
    columns, rows: numbers of cells
    """

    x: Floats
    y: Floats
    cosines: Floats
    sines: Floats
    short_x: Ranges
    short_y: Ranges
    order: Short
    radii: Floats
    start: Short
    listed: Short
    items: Short
    solids: Floats
    size: float
    columns: int
    rows: int


class Beam(NamedTuple):
    """The cones of one ring.

    own: distance from the robot's centre to its transducers, m
    cosine, sine, tangent: of half the opening
    most: greatest range, m
    widest: greatest radius of any body, m
    graze: sine of the greatest angle of incidence
    grazing: its tangent
    axis_cos, axis_sin: of the axes, shape (sonars,)
    """

    own: float
    cosine: float
    sine: float
    tangent: float
    most: float
    widest: float
    graze: float
    grazing: float
    axis_cos: Floats
    axis_sin: Floats


class Shots(NamedTuple):
    """The arrays that pings of one tick read and change; see `firing.Firing` and `firing.Tick`.

    first: index of the robot in row 0
    least: m
    noisy: whether there is noise; share, dropout and their keys
    """

    due: Floats
    turn: Whole
    order: NDArray[np.int8]
    length: Whole
    pause: Floats
    readings: NDArray[np.float32]
    first: int
    until: float
    least: float
    noisy: bool
    share: float
    dropout: float
    key: np.uint64
    dropout_key: np.uint64


def solid_columns(solids: Floats) -> Floats:
    """The solids (see `world.World.solids`) as rows of x, y, unit vector along the line (two numbers), length, and 0;
    round ones as x, y, 0, 0, 0, radius. Shape (n, 6)."""
    x0, y0, x1, y1, radius = solids.T
    ex, ey = x1 - x0, y1 - y0
    length = np.sqrt(ex * ex + ey * ey)
    apart = np.where(radius > 0.0, 1.0, length)
    return np.ascontiguousarray(np.stack((x0, y0, ex / apart, ey / apart, length, radius), axis=1))


class Fields:
    """Builds the field of a view; whatever depends on the solids alone is cached until they change."""

    def __init__(self) -> None:
        self._known: Floats | None = None
        self._solids: Floats = np.empty((0, 6))

    def of(
        self, view: VisibleScene, share: Callable[[int, Callable[[int, int], None]], object], arena: Arena
    ) -> SonarField:
        """The field for all cones. view: with the solids inside its cells. share: distributes work among threads.
        arena: where it lies, until the next task."""
        assert isinstance(view.listed, CellLists)
        if self._known is not view.solids:
            self._known, self._solids = view.solids, solid_columns(view.solids)
        order, start = view.points
        sorted_poses = arena.take(np.float64, 4, len(order))
        short = arena.take(np.float32, 2, len(order) + LANES)

        def work(first: int, last: int) -> None:
            kernels.arrange(order, *view.pose, first, last, sorted_poses)
            short[:, first:last] = sorted_poses[:2, first:last]

        share(len(order), work)
        short[:, start[-1] :] = AWAY  # also of whoever is in no cell: kernels read LANES at once
        radii = np.array([view.cones.radius]) if view.radii is None else view.radii[order]
        listed, grid = view.listed, view.grid
        x, y, cosines, sines = sorted_poses
        return SonarField(
            *(x, y, cosines, sines, short[0], short[1], order, radii, start),
            *(listed.start, listed.items, self._solids, grid.size, grid.columns, grid.rows),
        )


def beam_of(cones: Cones) -> Beam:
    """The cones of a ring."""
    sine, cosine = sine_cosine(cones.axes)
    return Beam(
        own=cones.radius,
        cosine=cos(cones.half),
        sine=sin(cones.half),
        tangent=tan(cones.half),
        most=cones.most,
        widest=max(cones.radius, cones.widest),
        graze=sin(cones.incidence) if cones.incidence < pi / 2 else 1.0,
        grazing=cones.grazing,
        axis_cos=cosine,
        axis_sin=sine,
    )


def shots_of(firing: Firing, tick: Tick) -> Shots:
    """The pings of a tick."""
    noise = tick.noise or Noise(0.0, 0.0, 0.0, 0, 0)
    return Shots(
        *(firing.due, firing.turn, firing.order, firing.length, firing.pause, tick.readings),
        *(tick.first, tick.until, tick.least, tick.noise is not None),
        *(noise.share, noise.dropout, np.uint64(noise.key), np.uint64(noise.dropout_key)),
    )


def one_of_each(view: VisibleScene, which: Whole, sonars: Whole) -> tuple[Shots, Ranges]:
    """Pings of one sonar of each of the robots `which`, and the array for their ranges, shape (robots, sonars)."""
    count = len(view.pose[0])
    due, order = np.ones(count), np.zeros((count, 1), np.int8)
    due[which], order[which, 0] = 0.0, sonars
    ranges = np.empty((count, view.cones.count), np.float32)
    turn, length = np.zeros(count, np.int64), np.ones(count, np.int64)
    nothing = np.uint64(0)
    shots = Shots(*(due, turn, order, length, np.ones(count), ranges, 0, 1.0, 0.0, False, 0.0, 0.0, nothing, nothing))
    return shots, ranges
