"""Exact sonar cones: the nearest point of any body or solid inside a cone, for all cones of a ring.

A cone opens from the transducer's face, on the rim of the body. No rays are cast; discs and lines both have a closed
form. The nearest point of a disc lies on the line to its centre if that line is inside the cone, else on the edge of
the cone nearer to the centre, if that edge meets the disc. On a line, the cone cuts out an interval, and so does the
greatest angle of incidence, measured from the perpendicular, at which a surface still reflects an echo back; the
nearest point is the foot of the perpendicular, clamped to both intervals.

This is the NumPy version, in double precision. `kernels_sonar` has `ranges` for numba, equal up to some micrometres,
and `kernels_firing` has `look`, bit-identical.
"""

from __future__ import annotations

from functools import lru_cache
from math import cos, hypot, inf, pi, sin, tan

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.records import NamedTuple, dataclass
from sleepcast.simulator.simd.formulas import sine_cosine
from sleepcast.simulator.world.grid import CellLists, Floats, Grid, Sorted, Whole, nearest_point, pairs, spread
from sleepcast.simulator.world.walls import Walls

AT_ONCE = 500
"""Robots processed at once: their pairs with everything in reach stay in a cache of some megabytes."""

Ranges = NDArray[np.float32]


@dataclass(frozen=True, slots=True)
class Cones:
    """A ring of `count` cones, number 0 in front, then counter-clockwise, on the rim of a disc of `radius` m.

    half: half of a cone's opening, rad
    most: greatest range from the rim, m
    incidence: angle from the perpendicular beyond which a surface reflects nothing back, rad
    widest: greatest radius of any body, m, if other bodies differ in radius
    """

    count: int
    half: float
    most: float
    incidence: float
    radius: float
    widest: float = 0.0

    @property
    def reach(self) -> float:
        """Greatest distance of the centre of a visible body, m."""
        return self.radius + self.most + max(self.radius, self.widest)

    @property
    def cell(self) -> float:
        """Side of a grid cell that suits these cones: the reach plus a margin for rounding, m. Smaller cells contain
        fewer bodies out of reach, but the candidates have to be gathered for each cell."""
        return 1.0000001 * self.reach

    @property
    def axes(self) -> Floats:
        """Angles of the cones from the heading, rad, shape (count,)."""
        return np.arange(self.count, dtype=np.float64) * (2.0 * pi / self.count)

    @property
    def grazing(self) -> float:
        """Tangent of the greatest angle of incidence; large but finite if every echo comes back."""
        return min(tan(self.incidence), 1e9) if self.incidence < pi / 2 else 1e9

    @lru_cache(maxsize=16)  # noqa: B019  # a few rings exist in a process, and all are equal again and again
    def lone(self, angle: float) -> float:
        """Distance between centres, m, beyond which a body is seen only by cones whose axis is less than `angle` (rad)
        from the line to it; inf if there is none."""
        if angle <= self.half:
            return inf
        # At that distance the body touches the cone's edge from outside, t m along the edge.
        most = 0.0
        for step in range(2_001):
            t = self.most * step / 2_000
            x = self.radius + t * cos(self.half) - self.radius * sin(self.half)
            y = t * sin(self.half) + self.radius * cos(self.half)
            if np.arctan2(y, x) >= angle:
                most = max(most, hypot(x, y))
        return max(most, 2.0 * self.radius) + self.most / 1_000


Seen = CellLists | Walls


class VisibleScene(NamedTuple):
    """The visible scene.

    pose: x, y in m and heading in rad of all robots
    points: these positions, sorted in `grid`
    listed: the `solids` within `radius` + `most` of each of its cells, as World rows (for `look`) or in the form of
        the array backend (for `ranges`)
    radii: of all bodies, m; None if all are equal
    """

    cones: Cones
    grid: Grid
    points: Sorted
    listed: Seen
    solids: Floats
    pose: tuple[Floats, Floats, Floats]
    radii: Floats | None = None


def ranges(view: VisibleScene, which: Whole) -> Ranges:
    """Ranges seen by the cones of the robots with indices `which`: m from the rim, shape (len(which), count), float32;
    `most` where there is nothing."""
    cones, grid, points, listed, solids, pose, radii = view
    assert isinstance(listed, CellLists)
    seen = np.full((len(which), cones.count), cones.most, np.float32)
    row_of = np.empty(len(pose[0]), np.int64)
    for begin in range(0, len(which), AT_ONCE):
        some = which[begin : begin + AT_ONCE]
        rows = seen[begin : begin + AT_ONCE]
        row_of[some] = np.arange(len(some))
        _see_bodies(cones, grid, points, pose, some, rows, row_of, radii)
        if len(listed.items):
            _see_solids(cones, grid, listed, solids, pose, some, rows, row_of)
    return seen


def _see_bodies(
    cones: Cones,
    grid: Grid,
    points: Sorted,
    pose: tuple[Floats, Floats, Floats],
    some: Whole,
    rows: Ranges,
    row_of: Whole,
    radii: Floats | None,
) -> None:
    x, y, heading = pose
    i, j = pairs(grid, points, x, y, cones.reach, some)
    dx, dy = x[j] - x[i], y[j] - y[i]
    cosine, sine = np.cos(heading)[i], np.sin(heading)[i]
    ahead, left = dx * cosine + dy * sine, dy * cosine - dx * sine
    apart = 2.0 * pi / cones.count
    bearing, row = np.arctan2(left, ahead) / apart, row_of[i]
    wide = np.full(len(j), cones.radius) if radii is None else radii[j]
    # A distant body is seen only by the two cones that its bearing falls between.
    far = ahead * ahead + left * left > (cones.lone(apart) ** 2 if radii is None else inf)
    close = np.flatnonzero(~far)
    first = np.floor(bearing[far]).astype(np.int64)
    beside = np.stack((first, first + 1), axis=1) % cones.count
    axis_cos, axis_sin = np.cos(cones.axes), np.sin(cones.axes)
    for chosen, number in ((far, beside), (close, np.arange(cones.count))):
        axes = axis_cos[number], axis_sin[number]
        seen = disc_range(cones, wide[chosen, None], ahead[chosen, None], left[chosen, None], *axes)
        np.minimum.at(rows, (row[chosen, None], number), seen.astype(np.float32))


def look(view: VisibleScene, which: Whole, sonars: Whole) -> Ranges:
    """Ranges seen by one cone of each of the robots `which`: m from the rim, shape (len(which),), float32; `most` where
    there is nothing. sonars: the cones' numbers."""
    seen = np.full(len(which), view.cones.most)
    for begin in range(0, len(which), AT_ONCE):
        some = slice(begin, begin + AT_ONCE)
        _look_at(view, which[some], sonars[some], seen[some])
    return seen.astype(np.float32)


def _look_at(view: VisibleScene, which: Whole, sonars: Whole, seen: Floats) -> None:
    """As `look`, for a few robots; writes into `seen`."""
    cones, grid, points, listed, solids, (x, y, heading), radii = view
    assert isinstance(listed, CellLists)
    sine, cosine = sine_cosine(heading[which])
    axis_sin, axis_cos = (each[sonars] for each in sine_cosine(cones.axes))
    ahead, aside = axis_cos * cosine - axis_sin * sine, axis_sin * cosine + axis_cos * sine
    row_of = np.empty(len(x), np.int64)
    row_of[which] = np.arange(len(which))
    i, j = pairs(grid, points, x, y, cones.reach, which)
    row = row_of[i]
    wide = cones.radius if radii is None else radii[j]
    np.minimum.at(seen, row, disc_range(cones, wide, x[j] - x[i], y[j] - y[i], ahead[row], aside[row]))
    cell = grid.cells_of(x[which], y[which])
    row, item = spread(np.arange(len(which)), listed.start[cell], listed.start[cell + 1])
    item = listed.items[item].astype(np.int64)
    round_ = solids[item, 4] > 0.0
    disc, at = solids[item[round_]], row[round_]
    dx, dy = disc[:, 0] - x[which[at]], disc[:, 1] - y[which[at]]
    np.minimum.at(seen, at, disc_range(cones, disc[:, 4], dx, dy, ahead[at], aside[at]))
    lines, at = solids[item[~round_]], row[~round_]
    of_lines = line_range(cones, ahead[at, None], aside[at, None], lines, x[which[at]], y[which[at]])
    np.minimum.at(seen, at, of_lines[:, 0])


def disc_range(
    cones: Cones, radius: float | Floats, dx: Floats, dy: Floats, axis_cos: Floats, axis_sin: Floats
) -> Floats:
    """Range of a disc of `radius` m whose centre is at `dx`, `dy` (m, from the robot's centre) in a cone whose axis
    has this cosine and sine in the same frame; inf if it is not visible. All arrays broadcast."""
    along = dx * axis_cos + dy * axis_sin - cones.radius
    aside = np.abs(dy * axis_cos - dx * axis_sin)
    outside = aside * cos(cones.half) - along * sin(cones.half)
    forward = along * cos(cones.half) + aside * sin(cones.half)
    within = outside <= 0.0
    cut = np.sqrt(np.maximum(radius * radius - outside * outside, 0.0))
    seen = np.where(within, np.sqrt(along * along + aside * aside) - radius, forward - cut)
    # The transducer itself is in the disc; on the rim, too, as where two robots are at exactly one place.
    amid = along * along + aside * aside <= radius * radius
    met = within | amid | ((outside < radius * sin(cones.incidence)) & (forward > 0.0))
    visible: Floats = np.where(met, np.maximum(seen, 0.0), inf)
    return visible


def _see_solids(
    cones: Cones,
    grid: Grid,
    listed: CellLists,
    solids: Floats,
    pose: tuple[Floats, Floats, Floats],
    some: Whole,
    rows: Ranges,
    row_of: Whole,
) -> None:
    x, y, heading = pose
    cell = grid.cells_of(x[some], y[some])
    i, item = spread(some, listed.start[cell], listed.start[cell + 1])
    item = listed.items[item].astype(np.int64)
    far = cones.radius + cones.most + solids[item, 4]
    dx, dy = nearest_point(x[i], y[i], *solids[item, :4].T)
    near = dx * dx + dy * dy <= far * far
    i, item = i[near], item[near]
    round_ = solids[item, 4] > 0.0
    axes = heading[some, None] + cones.axes
    cosines, sines = np.cos(axes), np.sin(axes)
    seen = np.empty((len(i), cones.count))
    lines, robot = item[~round_], i[~round_]
    which = row_of[robot]
    seen[~round_] = line_range(cones, cosines[which], sines[which], solids[lines], x[robot], y[robot])
    middle = solids[item[round_]]
    dx, dy = middle[:, 0] - x[i[round_]], middle[:, 1] - y[i[round_]]
    turned = heading[i[round_]]
    ahead = dx * np.cos(turned) + dy * np.sin(turned)
    left = dy * np.cos(turned) - dx * np.sin(turned)
    along = np.cos(cones.axes), np.sin(cones.axes)
    seen[round_] = disc_range(cones, middle[:, 4, None], ahead[:, None], left[:, None], *along)
    np.minimum.at(rows, row_of[i], seen.astype(np.float32))


def line_range(cones: Cones, axis_cos: Floats, axis_sin: Floats, solids: Floats, x: Floats, y: Floats) -> Floats:
    """Ranges of lines in cones: cosine and sine of the cones' axes (world frame), shape (n, count), of robots at x, y;
    row by row with the lines `solids`. inf if a line is not visible."""
    ex, ey = solids[:, 2] - solids[:, 0], solids[:, 3] - solids[:, 1]
    length = np.sqrt(ex * ex + ey * ey)
    ex, ey = ex / length, ey / length
    dx, dy = solids[:, 0] - x, solids[:, 1] - y
    height, begin = (dy * ex - dx * ey)[:, None], (dx * ex + dy * ey)[:, None]
    normal, tangent = axis_sin * ex[:, None] - axis_cos * ey[:, None], axis_cos * ex[:, None] + axis_sin * ey[:, None]
    away = height - cones.radius * normal  # from the transducer to the line
    normal = np.where(away < 0.0, -normal, normal)
    away = np.abs(away)
    cosine, sine = cos(cones.half), sin(cones.half)
    first, last = normal * cosine + tangent * sine, normal * cosine - tangent * sine
    with np.errstate(divide="ignore", invalid="ignore"):
        low = np.where(first > 0.0, away * (tangent * cosine - normal * sine) / first, -inf)
        high = np.where(last > 0.0, away * (tangent * cosine + normal * sine) / last, inf)
    begin = begin - cones.radius * tangent
    low = np.maximum(np.maximum(low, -away * cones.grazing), begin)
    high = np.minimum(np.minimum(high, away * cones.grazing), begin + length[:, None])
    foot = np.minimum(np.maximum(0.0, low), high)
    met = (low <= high) & ((first > 0.0) | (last > 0.0))
    visible: Floats = np.where(met, np.sqrt(away * away + foot * foot), inf)
    return visible
