"""What beams hit first: the formulas, on arrays.

Everything that may be hit is looked at from the robot, in its own frame: for each thing the beams are found between
whose angles it lies, and `line_ranges` or `disc_ranges` says how far each of them goes until it hits it. Of all that
a beam hits the nearest counts, in whatever order things are looked at; so `kernels_beams`, which has the same
formulas, comes to the same bits. What a beam only touches it hits, as in `world.sight`.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf
from typing import NamedTuple, TypeVar

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.counter_rng import GOLDEN, mix
from sleepcast.simulator.scenario.scanners import LaserModel
from sleepcast.simulator.simd.formulas import TURN, arc_tangent, sine_cosine
from sleepcast.simulator.sonar.cones import Ranges
from sleepcast.simulator.sonar.noise import deviates
from sleepcast.simulator.world.grid import CellLists, Floats, Grid, Sorted, Whole, nearest_point, pairs, spread

AT_ONCE = 250
"""Robots processed at once: what their beams meet takes some ten megabytes."""
SLACK = 0.05
"""In beams: by how much farther beams are asked whether they hit something than angles say. Far more than what
rounding moves an angle by, also of what is barely touched."""
ROUGH = 1e-4
"""Rad: more than by what compiled code may be wrong about directions."""
NEARLY_HALF = np.pi - 1e-6
"""Rad: a line that seems to be this wide passes so near that all beams are asked."""
NUMBERS = 2_048
"""More than there are beams: draws of noise are counted robot by robot, in steps of so many."""

Flags = NDArray[np.bool_]


class BeamScene(NamedTuple):
    """What scanners may see.

    x, y, heading: of all robots and, on a torus, their images in the frame of the cells, m and rad
    whose: the robot of each of these, int64
    radii: of the robots' bodies, m
    grid, points: these in cells
    listed: the solids within the scanner's reach of each cell
    solids: see `world.World.solids`, in the frame of the cells
    z: of the robots, m, where some fly: then beams hit only bodies that are no more than their radius higher or lower
    tops: how high each of the solids is, m; infinite without limit
    ground: how far beams of these robots go until they meet the ground, m, shape (robots, beams); None where it is flat
    """

    x: Floats
    y: Floats
    heading: Floats
    whose: Whole
    radii: Floats
    grid: Grid
    points: Sorted
    listed: CellLists
    solids: Floats
    z: Floats | None = None
    tops: Floats | None = None
    ground: Callable[[Whole], Floats] | None = None


def scan(model: LaserModel, scene: BeamScene, which: Whole, key: int) -> Ranges:
    """What the robots `which` measure: m from their centres, shape (robots, beams), float32; inf where nothing is in
    reach, -inf where something is too near. key: of the noise of this tick."""
    measured = np.empty((len(which), model.beams), np.float32)
    for begin in range(0, len(which), AT_ONCE):
        some = which[begin : begin + AT_ONCE]
        free = np.full((len(some), model.beams), inf)
        _meet_bodies(model, scene, some, free)
        _meet_solids(model, scene, some, free)
        if scene.ground is not None:
            free = np.minimum(free, scene.ground(some))
        measured[begin : begin + AT_ONCE] = _told(model, free, some, key)
    return measured


def _told(model: LaserModel, free: Floats, which: Whole, key: int) -> Floats:
    """What is told of the ways that beams are free."""
    told = free
    if model.noise:
        robots, beams = which.astype(np.uint64), np.arange(model.beams, dtype=np.uint64)
        counters = np.add.outer(robots * np.uint64(NUMBERS), beams)
        bits: NDArray[np.uint64] = counters * np.uint64(GOLDEN) + np.uint64(key)
        noise = model.noise * deviates(mix(bits))
        told = np.minimum(np.maximum(free + noise, model.least), model.reach)
    told = np.where(free < model.least, -inf, told)
    return np.where(free > model.reach, inf, told)


def _meet_bodies(model: LaserModel, scene: BeamScene, which: Whole, free: Floats) -> None:
    """Let the beams of these robots end at others' bodies."""
    x, y, radii = scene.x, scene.y, scene.radii
    i, j = pairs(scene.grid, scene.points, x, y, far_of(model, float(radii.max(initial=0.0))), which)
    dx, dy, wide = x[j] - x[i], y[j] - y[i], radii[scene.whose[j]]
    met = (dx * dx + dy * dy <= far_of(model, wide) ** 2) & (scene.whose[j] != i)
    if scene.z is not None:
        met &= np.abs(scene.z[scene.whose[j]] - scene.z[i]) < wide
    _meet_discs(model, scene, which, free, (i[met], dx[met], dy[met], wide[met]))


def _meet_solids(model: LaserModel, scene: BeamScene, which: Whole, free: Floats) -> None:
    """Let the beams of these robots end at what is solid."""
    x, y, listed = scene.x, scene.y, scene.listed
    cell = scene.grid.cells_of(x[which], y[which])
    i, items = spread(which, listed.start[cell], listed.start[cell + 1])
    rows = scene.solids[listed.items[items]]
    dx, dy = nearest_point(x[i], y[i], *rows[:, :4].T)
    near = dx * dx + dy * dy <= far_of(model, rows[:, 4]) ** 2
    if scene.z is not None and scene.tops is not None:
        near &= scene.z[i] < scene.tops[listed.items[items]]
    i, rows = i[near], rows[near]
    round_ = rows[:, 4] > 0.0
    at, discs = i[round_], rows[round_]
    _meet_discs(model, scene, which, free, (at, discs[:, 0] - x[at], discs[:, 1] - y[at], discs[:, 4]))
    at, lines = i[~round_], rows[~round_]
    ends = (lines[:, 0] - x[at], lines[:, 1] - y[at], lines[:, 2] - x[at], lines[:, 3] - y[at])
    _meet_lines(model, scene, which, free, at, ends)


Radius = TypeVar("Radius", float, Floats)


def far_of(model: LaserModel, radius: Radius) -> Radius:
    """How far away the middle of something with this radius may be to be hit, m, and a bit farther against rounding."""
    return (model.reach + radius) * (1.0 + 1e-9)


Discs = tuple[Whole, Floats, Floats, Floats]
"""Of each pair of a robot and a disc: the robot, the way to the middle across and up, and the radius, m."""


def _meet_discs(model: LaserModel, scene: BeamScene, which: Whole, free: Floats, discs: Discs) -> None:
    robot, dx, dy, radius = discs
    ahead, left = _turned(scene, robot, dx, dy)
    square, size = ahead * ahead + left * left, radius * radius
    middle = arc_tangent(left, ahead)
    half = arc_tangent(radius, np.sqrt(np.maximum(square - size, 0.0)))
    index, beam = _beams_between(model, middle - half, 2.0 * half, square <= size)
    ranges = disc_ranges(ahead[index], left[index], size[index], *_axes(model, beam))
    np.minimum.at(free, (_row_of(which, scene)[robot[index]], beam), ranges)


def _meet_lines(
    model: LaserModel,
    scene: BeamScene,
    which: Whole,
    free: Floats,
    robot: Whole,
    ends: tuple[Floats, Floats, Floats, Floats],
) -> None:
    """ends: the ways from each robot to both ends of its line, m."""
    first, last = _turned(scene, robot, *ends[:2]), _turned(scene, robot, *ends[2:])
    low, wide, every = line_field(*first, *last)
    index, beam = _beams_between(model, low, wide, every)
    (ahead, left), (to_ahead, to_left) = ((each[index] for each in end) for end in (first, last))
    ranges = line_ranges(ahead, left, to_ahead, to_left, *_axes(model, beam))
    np.minimum.at(free, (_row_of(which, scene)[robot[index]], beam), ranges)


def _row_of(which: Whole, scene: BeamScene) -> Whole:
    """The row of each robot that is asked for."""
    rows = np.zeros(len(scene.x), np.int64)
    rows[which] = np.arange(len(which))
    return rows


def _turned(scene: BeamScene, robot: Whole, dx: Floats, dy: Floats) -> tuple[Floats, Floats]:
    """Vectors in the frame of these robots: ahead and to the left."""
    sine, cosine = sine_cosine(scene.heading[robot])
    return dx * cosine + dy * sine, dy * cosine - dx * sine


def _axes(model: LaserModel, beams: Whole) -> tuple[Floats, Floats]:
    sine, cosine = sine_cosine(model.angles)
    return cosine[beams], sine[beams]


def line_field(ahead: Floats, left: Floats, to_ahead: Floats, to_left: Floats) -> tuple[Floats, Floats, Flags]:
    """Where a line lies as a robot sees it: the least angle from its heading, and how wide it is, rad; and whether all
    beams are to be asked."""
    one, other = arc_tangent(left, ahead), arc_tangent(to_left, to_ahead)
    between = other - one
    between = between - TURN * np.floor((between + np.pi) / TURN)
    wide = np.abs(between)
    every = (wide > NEARLY_HALF) | (ahead * to_left - left * to_ahead == 0.0)
    return np.where(between < 0.0, other, one), wide, every


def _beams_between(model: LaserModel, low: Floats, wide: Floats, every: Flags) -> tuple[Whole, Whole]:
    """The beams from each angle `low` on, over `wide`, or `every` one: pairs of the index of the angle and a beam."""
    from_ = low - model.first
    from_ = from_ - TURN * np.floor(from_ / TURN)
    begin = _bounded(np.ceil(from_ / model.increment - SLACK), model)
    end = _bounded(np.floor((from_ + wide) / model.increment + SLACK) + 1.0, model)
    again = _bounded(np.floor((from_ + wide - TURN) / model.increment + SLACK) + 1.0, model)  # around, past beam 0
    begin, end, again = np.where(every, 0, begin), np.where(every, model.beams, end), np.where(every, 0, again)
    again = np.minimum(again, begin)  # no beam twice
    index = np.arange(len(low))
    stretches = spread(index, begin, np.maximum(begin, end)), spread(index, np.zeros_like(again), again)
    return np.concatenate([each[0] for each in stretches]), np.concatenate([each[1] for each in stretches])


def _bounded(numbers: Floats, model: LaserModel) -> Whole:
    """Numbers as whole ones from 0 to that of beams."""
    return np.minimum(np.maximum(numbers, 0.0), model.beams).astype(np.int64)


def disc_ranges(ahead: Floats, left: Floats, square: Floats, axis_cos: Floats, axis_sin: Floats) -> Floats:
    """How far beams go until they hit a disc, m; inf if they miss it.

    ahead, left: of its middle, m
    square: of its radius, m2
    axis_cos, axis_sin: of the beams' angles
    """
    aside = axis_cos * left - axis_sin * ahead
    along = axis_cos * ahead + axis_sin * left
    rest = square - aside * aside
    way = along - np.sqrt(np.maximum(rest, 0.0))
    hit = np.where((rest >= 0.0) & (along > 0.0), np.where(way > 0.0, way, 0.0), inf)
    return np.where(ahead * ahead + left * left <= square, 0.0, hit)


def line_ranges(
    ahead: Floats, left: Floats, to_ahead: Floats, to_left: Floats, axis_cos: Floats, axis_sin: Floats
) -> Floats:
    """How far beams go until they hit a line, m; inf if they miss it. The line goes from `ahead`, `left` to `to_ahead`,
    `to_left`, m."""
    one, other = axis_cos * left - axis_sin * ahead, axis_cos * to_left - axis_sin * to_ahead
    between = ((one <= 0.0) & (other >= 0.0)) | ((one >= 0.0) & (other <= 0.0))
    turn = ahead * to_left - left * to_ahead
    with np.errstate(divide="ignore", invalid="ignore"):
        way = turn / (other - one)
    hit = np.where(between & (way >= 0.0), np.where(way > 0.0, way, 0.0), inf)
    along = (one == 0.0) & (other == 0.0) & (turn == 0.0)
    if not along.any():
        return hit
    near, far = axis_cos * ahead + axis_sin * left, axis_cos * to_ahead + axis_sin * to_left
    least = np.minimum(near, far)
    end = np.where(least > 0.0, least, np.where(np.maximum(near, far) >= 0.0, 0.0, inf))
    return np.where(along, end, hit)
