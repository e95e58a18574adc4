"""One tick of many bodies, in NumPy: what each proposes, and how far it gets before it touches something.

Every body proposes a way, a straight line from its old position to a new one. First each way ends where the body
would touch a solid or another body's old position. Then it ends where the body would touch the remaining way of
another one, unless the two move apart. Both steps read only old positions and proposals, so their order does not
matter; and of two bodies at least one keeps clear of the other's whole way, so no two ever overlap.

Things that touch keep a gap of `SKIN`, so that rounding never makes them overlap. Bodies that already overlap,
because they were placed there, may only move apart. `kernels_motion` has the compiled version for bodies on wheels,
bit-identical.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.counter_rng import GOLDEN, mix
from sleepcast.core.records import NamedTuple
from sleepcast.simulator.motion.driving import (
    DRIVE,
    GOTO,
    WANDER,
    Laws,
    approach,
    arc,
    bounded,
    glided,
    outside,
    slipped,
    spin_left,
    spinning,
    swing_left,
    touched_part,
    tumbling,
    turned_back,
    wheels_follow,
)
from sleepcast.simulator.simd.formulas import either, shortest, wrap
from sleepcast.simulator.sonar.noise import deviates
from sleepcast.simulator.world.grid import CellLists, Floats, Grid, Sorted, Whole, nearest_point, pairs, spread

UNIT = 2.0**-53
UNIT_SPREAD = np.sqrt(12.0)
"""Scales a uniform draw of width 1 to standard deviation 1."""


class BodyColumns(NamedTuple):
    """The state of bodies of one type, as `bodies.Bodies` describes it, changed in place. uses: how much of each store
    a metre takes, shape (stores,)."""

    mode: NDArray[np.int8]
    held: NDArray[np.bool_]
    wanted_speed: Floats
    wanted_turn: Floats
    target_x: Floats
    target_y: Floats
    swing: Floats
    roaming: Floats
    chance: NDArray[np.uint64]
    numbers: NDArray[np.uint64]
    x: Floats
    y: Floats
    heading: Floats
    encoder_x: Floats
    encoder_y: Floats
    encoder_heading: Floats
    speed: Floats
    left: Floats
    right: Floats
    bumper: Floats
    stores: Floats
    uses: Floats


class Displacement(NamedTuple):
    """The displacement of each body in this tick, if nothing is in its way: in x and y, m, and turn, rad. Shape
    (count,)."""

    dx: Floats
    dy: Floats
    turn: Floats

    def of(self, which: slice) -> Displacement:
        """The proposals of some of the bodies."""
        return Displacement(*(each[which] for each in self))


class Draws(NamedTuple):
    """Random bits for this tick, 64 each. roam: for wandering; left, right: for the slip of wheels."""

    roam: int
    left: int
    right: int


def propose(bodies: BodyColumns, laws: Laws, draws: Draws, proposal: Displacement) -> None:
    """Change the speeds of the wheels, and propose the resulting displacement."""
    speed, turn = wanted(bodies, laws, draws)
    turn, moves = overridden(bodies, laws, bodies.heading, speed, turn)
    speed, turn = np.where(moves, speed, 0.0), np.where(moves, turn, 0.0)
    if laws.track:
        _roll(bodies, laws, draws, speed, turn, proposal)
    else:
        _glide(bodies, laws, speed, turn, proposal)
    within_edges(bodies, laws, proposal)


def overridden(
    bodies: BodyColumns, laws: Laws, course: Floats, speed: Floats, turn: Floats
) -> tuple[Floats, NDArray[np.bool_]]:
    """The turn rate that each body wants, changed in place by a tumble or by the fence, and whether it may move at all.
    course: direction in which it goes at a `speed` above 0, rad."""
    moves = ~(bodies.held | _empty(bodies))
    # Few bodies cost as much as their NumPy calls do; what concerns none of them is left out.
    swinging = np.flatnonzero((bodies.swing != 0.0) & moves)
    if swinging.size:
        turn[swinging] = _tumbling(laws, bodies.swing[swinging])
    if laws.margin >= 0.0:
        near = np.flatnonzero(outside(laws, bodies.x, bodies.y) & (bodies.mode != GOTO) & (speed != 0.0))
        if near.size:
            pose = bodies.x[near], bodies.y[near], course[near]
            turn[near] = turned_back(laws, *pose, speed[near], turn[near])
    if swinging.size:
        _swing(bodies, laws, swinging, speed[swinging], turn[swinging])
    return turn, moves


def within_edges(bodies: BodyColumns, laws: Laws, proposal: Displacement) -> None:
    """Shorten the proposed ways so that no body passes an edge."""
    proposal.dx[:] = bounded(bodies.x + proposal.dx, laws.left, laws.right) - bodies.x
    proposal.dy[:] = bounded(bodies.y + proposal.dy, laws.bottom, laws.top) - bodies.y


def commit(bodies: BodyColumns, laws: Laws, proposal: Displacement, settled: Settled) -> None:
    """Move the bodies as far as they are free to, and let bumpers report what stopped them."""
    free = settled.free
    touched = np.flatnonzero(free < 1.0)
    if laws.parts:
        bodies.bumper[:] = 0.0
        hit_x, hit_y = settled.hit_x[touched], settled.hit_y[touched]
        bodies.bumper[touched] = touched_part(laws, hit_x, hit_y, bodies.heading[touched])
    used = np.abs(bodies.speed) * laws.tick * free
    bodies.x[:] += free * proposal.dx
    bodies.y[:] += free * proposal.dy
    bodies.heading[:] = wrap(bodies.heading + proposal.turn)
    if laws.track:
        left, right = bodies.left * laws.tick, bodies.right * laws.tick
        seen_dx, seen_dy, seen_turn = arc(laws, left, right, bodies.encoder_heading)
        bodies.encoder_x[:] += free * seen_dx
        bodies.encoder_y[:] += free * seen_dy
        bodies.encoder_heading[:] = wrap(bodies.encoder_heading + seen_turn)
    if not laws.slides:
        for speed in (bodies.speed, bodies.left, bodies.right):
            speed[touched] = 0.0
    for row, use in zip(bodies.stores, bodies.uses, strict=True):
        if use:
            rest = row - used * use
            row[:] = np.where(rest < 0.0, 0.0, rest)


def wanted(bodies: BodyColumns, laws: Laws, draws: Draws) -> tuple[Floats, Floats]:
    """Wanted speed and turn rate of each body, before overrides and limits."""
    drives = bodies.mode == DRIVE
    speed, turn = np.where(drives, bodies.wanted_speed, laws.roam_speed), np.where(drives, bodies.wanted_turn, 0.0)
    roams = np.flatnonzero(bodies.mode == WANDER)
    if roams.size:
        bits = mix(bodies.chance[roams] + np.uint64(draws.roam))
        drawn = (bits >> np.uint64(11)).astype(np.float64) * UNIT - 0.5
        bodies.roaming[roams] = bodies.roaming[roams] * laws.retained + drawn * (UNIT_SPREAD * laws.strayed)
        turn[roams] = bodies.roaming[roams]
    goes = np.flatnonzero(bodies.mode == GOTO)
    if goes.size:
        to_x = shortest(bodies.target_x[goes] - bodies.encoder_x[goes], laws.around_x)
        to_y = shortest(bodies.target_y[goes] - bodies.encoder_y[goes], laws.around_y)
        speed[goes], turn[goes] = approach(laws, to_x, to_y, bodies.encoder_heading[goes])
    return speed, turn


def _empty(bodies: BodyColumns) -> NDArray[np.bool_]:
    """Whether each body has run out of something that driving uses up."""
    empty = np.zeros(len(bodies.x), bool)
    for row, use in zip(bodies.stores, bodies.uses, strict=True):
        if use:
            empty |= row <= 0.0
    return empty


def _tumbling(laws: Laws, swing: Floats) -> Floats:
    """The turn rates of tumbling bodies."""
    return tumbling(laws, swing) if laws.track else spinning(laws, swing)


def _swing(bodies: BodyColumns, laws: Laws, swinging: Whole, speed: Floats, turn: Floats) -> None:
    """Store the rest of the swing of these bodies, after a tick in which they want that speed and turn rate."""
    swing = bodies.swing[swinging]
    if laws.track:
        wheels = bodies.left[swinging], bodies.right[swinging]
        bodies.swing[swinging] = swing_left(laws, swing, *wheels, speed, turn)
    else:
        bodies.swing[swinging] = spin_left(laws, swing)


def _roll(bodies: BodyColumns, laws: Laws, draws: Draws, speed: Floats, turn: Floats, proposal: Displacement) -> None:
    """Steps of bodies on wheels; odometry is updated in `commit`."""
    bodies.left[:], bodies.right[:] = wheels_follow(laws, bodies.left, bodies.right, speed, turn)
    bodies.speed[:] = (bodies.left + bodies.right) / 2.0
    left, right = bodies.left * laws.tick, bodies.right * laws.tick
    towards = bodies.encoder_heading
    if laws.slips:
        drawn = [deviates(mix(bodies.numbers * np.uint64(GOLDEN) + np.uint64(draw))) for draw in draws[1:]]
        left = slipped(laws, left, laws.slip_left, drawn[0])
        right = slipped(laws, right, laws.slip_right, drawn[1])
        towards = bodies.heading
    proposal.dx[:], proposal.dy[:], proposal.turn[:] = arc(laws, left, right, towards)


def _glide(bodies: BodyColumns, laws: Laws, speed: Floats, turn: Floats, proposal: Displacement) -> None:
    """Steps of bodies without wheels, whose odometry is exact."""
    bodies.speed[:], *way = glided(laws, bodies.speed, speed, turn, bodies.heading)
    proposal.dx[:], proposal.dy[:], proposal.turn[:] = way


# ---- contact: how far bodies get before they touch something, independent of their order


SKIN = 1e-6
"""Gap between bodies that touch, m."""
LIFT = 1e-9
"""Share of a way by which a sliding body moves off what it slides along, so that rounding does not stop it."""


class Settled(NamedTuple):
    """Results of contact. free: the share of its way that each body may go, 1 if nothing is in the way. hit_x, hit_y:
    vector from the body to what stopped it, m; 0, 0 if nothing did. Shape (count,)."""

    free: Floats
    hit_x: Floats
    hit_y: Floats


def settle(
    grid: Grid,
    points: Sorted,
    listed: CellLists,
    solids: Floats,
    radii: Floats,
    positions: tuple[Floats, Floats],
    way: tuple[Floats, Floats],
    settled: Settled,
) -> None:
    """Write into `settled` how far bodies with these `radii` (m; each, or one for all) at `positions` (x, y; m) get on
    their `way` (dx, dy; m).

    points: the positions, sorted in `grid`. listed: the `solids` within the greatest radius plus the longest way of
    each of its cells.
    """
    (x, y), (dx, dy) = positions, way
    clear(settled)
    radii = np.broadcast_to(radii, len(x))
    cell = grid.cells_of(x, y)
    i, item = spread(np.arange(len(x)), listed.start[cell], listed.start[cell + 1])
    if i.size:
        lines = solids[listed.items[item]]
        stop, hit_x, hit_y = touch(x[i], y[i], dx[i], dy[i], lines[:, :4].T, radii[i] + lines[:, 4] + SKIN)
        _take_first(settled, i, stop, hit_x, hit_y)
    longest = float(np.sqrt(np.max(dx * dx + dy * dy, initial=0.0)))
    widest = 2.0 * float(radii.max(initial=0.0)) + SKIN
    i, j = pairs(grid, points, x, y, widest + 2.0 * longest, np.arange(len(x)))
    if not i.size:
        return
    apart = radii[i] + radii[j] + SKIN
    stop, hit_x, hit_y = touch(x[i], y[i], dx[i], dy[i], (x[j], y[j], x[j], y[j]), apart)
    _take_first(settled, i, stop, hit_x, hit_y)
    left_x, left_y = settled.free * dx, settled.free * dy
    _meet(settled, i, j, positions, (left_x, left_y), (dx, dy), apart)


def slide(proposal: Displacement, settled: Settled, which: Whole) -> tuple[Floats, Floats]:
    """The ways, in x and y, m, that the bodies `which`, once stopped, still want to go along what stopped them: the
    rest of their ways without the part towards it."""
    rest = 1.0 - settled.free[which]
    dx, dy = rest * proposal.dx[which], rest * proposal.dy[which]
    hit_x, hit_y = settled.hit_x[which], settled.hit_y[which]
    away = np.sqrt(hit_x * hit_x + hit_y * hit_y)
    away = either(away > 0.0, away, 1.0)
    hit_x, hit_y = hit_x / away, hit_y / away
    towards = dx * hit_x + dy * hit_y
    towards = either(towards < 0.0, 0.0, towards) + LIFT * np.sqrt(dx * dx + dy * dy)
    return dx - towards * hit_x, dy - towards * hit_y


def boxes_of(solids: Floats) -> Floats:
    """The bounding box of each of the `solids`: left, right, bottom and top, m, shape (solids, 4)."""
    x0, y0, x1, y1, radius = solids.T
    left, right, bottom, top = np.minimum(x0, x1), np.maximum(x0, x1), np.minimum(y0, y1), np.maximum(y0, y1)
    return np.ascontiguousarray(np.stack((left - radius, right + radius, bottom - radius, top + radius), axis=1))


def clear(settled: Settled) -> None:
    """Reset: nothing is in any body's way."""
    settled.free.fill(1.0)
    settled.hit_x.fill(0.0)
    settled.hit_y.fill(0.0)


def _meet(
    settled: Settled,
    i: Whole,
    j: Whole,
    positions: tuple[Floats, Floats],
    left: tuple[Floats, Floats],
    way: tuple[Floats, Floats],
    apart: Floats,
) -> None:
    """End ways where they touch the ways `left` to others."""
    (x, y), (dx, dy) = positions, left
    gap_x, gap_y = x[j] - x[i], y[j] - y[i]
    moves = (dx[j] != 0.0) | (dy[j] != 0.0)
    parting = (dx[i] * gap_x + dy[i] * gap_y <= 0.0) & (dx[j] * gap_x + dy[j] * gap_y >= 0.0)
    some = np.flatnonzero(moves & ~parting)
    i, j, apart = i[some], j[some], apart[some]
    line = (x[j], y[j], x[j] + dx[j], y[j] + dy[j])
    stop, gap_x, gap_y = touch(x[i], y[i], way[0][i], way[1][i], line, apart)
    gap_x, gap_y = nearest_point(x[i], y[i], *line)
    stop = np.where(gap_x * gap_x + gap_y * gap_y < apart * apart, 0.0, stop)
    _take_first(settled, i, stop, x[j] - x[i], y[j] - y[i])


def touch(
    x: Floats,
    y: Floats,
    dx: Floats,
    dy: Floats,
    line: tuple[Floats, Floats, Floats, Floats] | Floats,
    apart: float | Floats,
) -> tuple[Floats, Floats, Floats]:
    """The share of the way dx, dy from x, y after which a point first comes within `apart` of a line (x and y of one
    end and of the other), 2 if it does not; and the vector from there to the nearest point of the line. A point that
    starts closer than `apart` may move on if it does not get closer still."""
    x0, y0, x1, y1 = line
    gap_x, gap_y = nearest_point(x, y, x0, y0, x1, y1)
    inside = gap_x * gap_x + gap_y * gap_y < apart * apart
    ends = np.minimum(_touch_point(x0 - x, y0 - y, dx, dy, apart), _touch_point(x1 - x, y1 - y, dx, dy, apart))
    stop = np.minimum(ends, _touch_side(x, y, dx, dy, line, apart))
    stop = np.where(inside, np.where(dx * gap_x + dy * gap_y > 0.0, 0.0, 2.0), stop)
    gone = np.where(stop < 1.0, stop, 0.0)
    return stop, *nearest_point(x + gone * dx, y + gone * dy, x0, y0, x1, y1)


def _touch_point(gap_x: Floats, gap_y: Floats, dx: Floats, dy: Floats, apart: float | Floats) -> Floats:
    """As `touch`, for a point that lies `gap_x` and `gap_y` from the start; only from outside."""
    towards = dx * gap_x + dy * gap_y
    rest = gap_x * gap_x + gap_y * gap_y - apart * apart
    root = towards * towards - (dx * dx + dy * dy) * rest
    with np.errstate(divide="ignore", invalid="ignore"):
        stop = rest / (towards + np.sqrt(root))
    return np.where((towards > 0.0) & (root >= 0.0) & (stop < 1.0), stop, 2.0)


def _touch_side(
    x: Floats,
    y: Floats,
    dx: Floats,
    dy: Floats,
    line: tuple[Floats, Floats, Floats, Floats] | Floats,
    apart: float | Floats,
) -> Floats:
    """As `touch`, for the two sides of a line without its ends; only from outside."""
    x0, y0, x1, y1 = line
    ex, ey = x1 - x0, y1 - y0
    length2 = ex * ex + ey * ey
    length = np.sqrt(length2)
    height = ex * (y - y0) - ey * (x - x0)  # scaled by length, as are the next two
    rate = ex * dy - ey * dx
    sign = np.where(height < 0.0, -1.0, 1.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        stop = np.maximum((height * sign - apart * length) / -(rate * sign), 0.0)  # rounding may place it just inside
        along = (x + stop * dx - x0) * ex + (y + stop * dy - y0) * ey
    met = (rate * sign < 0.0) & (stop < 1.0) & (along >= 0.0) & (along <= length2)
    return np.where(met, stop, 2.0)


def _take_first(settled: Settled, i: Whole, stop: Floats, hit_x: Floats, hit_y: Floats) -> None:
    """Shorten ways by stops; among equal first stops, the one last in x, then y, counts as the cause."""
    some = np.flatnonzero(stop < settled.free[i])
    some = some[np.lexsort((hit_y[some], hit_x[some], -stop[some]))]
    # The last assignment wins: the smallest stop, and among equals the greatest x, then y.
    settled.free[i[some]] = stop[some]
    settled.hit_x[i[some]] = hit_x[some]
    settled.hit_y[i[some]] = hit_y[some]
