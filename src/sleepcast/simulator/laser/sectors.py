"""What expressions ask of a scan: the least range in a sector, and where its widest gap is.

A sector goes counter-clockwise from one angle to another, both from the heading, and belongs to it whoever lies within
1e-9 rad of its ends; from one angle to the same is one direction, and a whole turn or more is all around.
"""

from __future__ import annotations

from math import inf, nan

import numpy as np
from numpy.typing import NDArray

from sleepcast.simulator.laser.beams import Flags
from sleepcast.simulator.scenario.scanners import LaserModel
from sleepcast.simulator.simd.formulas import TURN, wrap
from sleepcast.simulator.sonar.cones import Ranges
from sleepcast.simulator.world.grid import Floats, Whole

AT_ONCE = 10_000
"""Robots whose beams are put in order at once."""
ENDS = 1e-9
"""Rad by which a beam may be beyond the end of a sector."""
EQUAL = 1e-9
"""Rad within which two gaps lie equally far from the heading."""
APART = 1.5
"""In increments: beams farther apart are no neighbours."""


def within(angles: Floats, first: Floats, last: Floats) -> Flags:
    """Whether each angle lies in the sector from `first` to `last`, rad; all broadcast."""
    wide = last - first
    wide = np.where(wide >= TURN - ENDS, TURN, np.maximum(np.mod(wide + ENDS, TURN) - ENDS, 0.0))
    inside: Flags = np.mod(angles - first + ENDS, TURN) <= wide + 2.0 * ENDS
    return inside


def least(model: LaserModel, ranges: Ranges, first: Floats, last: Floats) -> Floats:
    """Least range of the beams in the sector of each robot, m, shape (robots,); what is too near counts as nearest that
    can be measured. NaN where no beam in it returns. ranges: shape (robots, beams)."""
    angles, ranges = model.angles, np.asarray(ranges)
    if _alike(first) and _alike(last):
        chosen = np.flatnonzero(within(angles, first[:1], last[:1]))
        found = ranges[:, chosen].min(axis=1, initial=inf)
    else:
        found = np.where(within(angles, first[:, None], last[:, None]), ranges, inf).min(axis=1)
    near = np.where(found == -inf, model.least, found.astype(np.float64))
    return np.where(near == inf, nan, near)


def gap(model: LaserModel, ranges: Ranges, first: Floats, last: Floats, clear: Floats | None = None) -> Floats:
    """Bearing of the middle of the widest gap in the sector of each robot, rad from its heading, shape (robots,): of
    the longest run of neighbouring beams in it of which each is free for `clear` m, or, if that is not given, for half
    as far as the freest one in the sector. Of equally wide gaps that nearer to the heading, else the first one; 0
    where all beams all around are free. NaN where there is none."""
    found = np.full(len(ranges), nan)
    for begin in range(0, len(ranges), AT_ONCE):
        some = slice(begin, begin + AT_ONCE)
        found[some] = _gaps(model, ranges[some], first[some], last[some], None if clear is None else clear[some])
    return found


def _gaps(model: LaserModel, ranges: Ranges, first: Floats, last: Floats, clear: Floats | None) -> Floats:
    """As `gap`, for some robots."""
    angles, alike = model.angles, _alike(first) and _alike(last)
    begin, end = (first[:1, None], last[:1, None]) if alike else (first[:, None], last[:, None])
    inside = within(angles, begin, end)
    from_begin = np.mod(angles - begin + ENDS, TURN)
    order = np.argsort(from_begin, axis=1, kind="stable")
    around = inside.all(axis=1, keepdims=True) & model.closed
    if around.any():  # a gap may go on past the end of such a sector, so beams follow twice
        order = np.concatenate((order, order), axis=1)
    bearings, own = angles[order], np.take_along_axis(inside, order, axis=1)
    own[:, model.beams :] &= around
    depth = np.where(ranges == inf, model.reach, np.maximum(ranges, 0.0)).astype(np.float64)
    depth = depth[:, order[0]] if alike else np.take_along_axis(depth, order, axis=1)
    freest = np.where(own, depth, 0.0).max(axis=1)
    enough = freest / 2.0 if clear is None else clear
    free = own & (depth >= enough[:, None]) & (freest > 0.0)[:, None]
    new = np.ones(bearings.shape, np.bool_)
    new[:, 1:] = np.abs(wrap(np.diff(bearings, axis=1))) > APART * model.increment
    length = np.minimum(_lengths(free, np.broadcast_to(new, free.shape)), model.beams)
    middle = wrap(bearings - (length - 1) * (model.increment / 2.0))
    middle = np.where(around & (length == model.beams), 0.0, middle)
    widest = length.max(axis=1, initial=0)
    off = np.where(length == widest[:, None], np.round(np.abs(middle) / EQUAL), inf)
    best = np.take_along_axis(middle, off.argmin(axis=1)[:, None], axis=1)[:, 0]
    known = (widest > 0) & np.isfinite(enough)
    return np.where(known, best, nan)


def _lengths(free: Flags, new: Flags) -> Whole:
    """How many free ones stand in a row up to each one, itself included; a `new` one does not follow the one before."""
    index = np.arange(free.shape[1])
    stopped = np.where(free, np.where(new, index - 1, -1), index)
    lengths: Whole = index - np.maximum.accumulate(stopped, axis=1)
    return lengths


def _alike(values: NDArray[np.float64]) -> bool:
    return len(values) > 0 and bool((values == values[0]).all())
