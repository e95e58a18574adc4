"""A tick of many bodies, in NumPy: what each proposes, and what becomes of it where it is free to go.

`kernels_motion` has the compiled form for bodies on wheels, with the same bits.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.counter_rng import GOLDEN, mix
from sleepcast.simulator.motion.contact import Settled
from sleepcast.simulator.motion.driving import (
    DRIVE,
    GOTO,
    WANDER,
    Laws,
    approach,
    arc,
    bounded,
    outside,
    slipped,
    swing_left,
    touched_part,
    tumbling,
    turned_back,
    wheels_follow,
)
from sleepcast.simulator.simd.formulas import sine_cosine, wrap
from sleepcast.simulator.sonar.noise import deviates
from sleepcast.simulator.world.grid import Floats, Whole

UNIT = 2.0**-53
UNIT_SPREAD = np.sqrt(12.0)
"""Makes an even draw of width 1 one of standard deviation 1."""


class Columns(NamedTuple):
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


class Proposal(NamedTuple):
    """Where bodies are going in this tick, if they are free to: across and up, m, and round, rad. Shape (count,)."""

    across: Floats
    up: Floats
    turn: Floats

    def of(self, which: slice) -> Proposal:
        """Of some of the bodies."""
        return Proposal(*(each[which] for each in self))


class Draws(NamedTuple):
    """What chance depends on in this tick: 64 bits each. roam: for wandering; left, right: for the slip of wheels."""

    roam: int
    left: int
    right: int


def propose(bodies: Columns, laws: Laws, draws: Draws, proposal: Proposal) -> None:
    """Let the bodies set out: change the speeds of their wheels, and say where that leads."""
    speed, turn = _wanted(bodies, laws, draws)
    moves = ~(bodies.held | _empty(bodies))
    swinging = np.flatnonzero((bodies.swing != 0.0) & moves)
    turn[swinging] = _tumbling(laws, bodies.swing[swinging])
    if laws.margin >= 0.0:
        near = np.flatnonzero(outside(laws, bodies.x, bodies.y))
        near = near[(bodies.mode[near] != GOTO) & (speed[near] != 0.0)]
        pose = bodies.x[near], bodies.y[near], bodies.heading[near]
        turn[near] = turned_back(laws, *pose, speed[near], turn[near])
    _swing(bodies, laws, swinging, speed[swinging], turn[swinging])
    speed, turn = np.where(moves, speed, 0.0), np.where(moves, turn, 0.0)
    if laws.track:
        _roll(bodies, laws, draws, speed, turn, proposal)
    else:
        _glide(bodies, laws, speed, turn, proposal)
    proposal.across[:] = bounded(bodies.x + proposal.across, laws.left, laws.right) - bodies.x
    proposal.up[:] = bounded(bodies.y + proposal.up, laws.bottom, laws.top) - bodies.y


def commit(bodies: Columns, laws: Laws, proposal: Proposal, settled: Settled) -> None:
    """Let the bodies go as far as they are free to, and feel what stopped them."""
    free = settled.free
    touched = np.flatnonzero(free < 1.0)
    if laws.parts:
        bodies.bumper[:] = 0.0
        across, up = settled.across[touched], settled.up[touched]
        bodies.bumper[touched] = touched_part(laws, across, up, bodies.heading[touched])
    used = np.abs(bodies.speed) * laws.tick * free
    bodies.x[:] += free * proposal.across
    bodies.y[:] += free * proposal.up
    bodies.heading[:] = wrap(bodies.heading + proposal.turn)
    if laws.track:
        left, right = bodies.left * laws.tick, bodies.right * laws.tick
        seen_across, seen_up, seen_turn = arc(laws, left, right, bodies.encoder_heading)
        bodies.encoder_x[:] += free * seen_across
        bodies.encoder_y[:] += free * seen_up
        bodies.encoder_heading[:] = wrap(bodies.encoder_heading + seen_turn)
    for speed in (bodies.speed, bodies.left, bodies.right):
        speed[touched] = 0.0
    for row, use in zip(bodies.stores, bodies.uses, strict=True):
        if use:
            rest = row - used * use
            row[:] = np.where(rest < 0.0, 0.0, rest)


def _wanted(bodies: Columns, laws: Laws, draws: Draws) -> tuple[Floats, Floats]:
    """What each body wants: speed and turn rate, before anything overrules or limits it."""
    drives = bodies.mode == DRIVE
    speed, turn = np.where(drives, bodies.wanted_speed, laws.roam_speed), np.where(drives, bodies.wanted_turn, 0.0)
    roams = np.flatnonzero(bodies.mode == WANDER)
    bits = mix(bodies.chance[roams] + np.uint64(draws.roam))
    drawn = (bits >> np.uint64(11)).astype(np.float64) * UNIT - 0.5
    bodies.roaming[roams] = bodies.roaming[roams] * laws.kept + drawn * (UNIT_SPREAD * laws.strayed)
    turn[roams] = bodies.roaming[roams]
    goes = np.flatnonzero(bodies.mode == GOTO)
    across, up = bodies.target_x[goes] - bodies.encoder_x[goes], bodies.target_y[goes] - bodies.encoder_y[goes]
    speed[goes], turn[goes] = approach(laws, across, up, bodies.encoder_heading[goes])
    return speed, turn


def _empty(bodies: Columns) -> NDArray[np.bool_]:
    """Whether each body has run out of something that driving uses."""
    empty = np.zeros(len(bodies.x), bool)
    for row, use in zip(bodies.stores, bodies.uses, strict=True):
        if use:
            empty |= row <= 0.0
    return empty


def _tumbling(laws: Laws, swing: Floats) -> Floats:
    """The turn rates of bodies that tumble."""
    return tumbling(laws, swing) if laws.track else bounded(swing / laws.tick, -laws.turn_rate, laws.turn_rate)


def _swing(bodies: Columns, laws: Laws, swinging: Whole, speed: Floats, turn: Floats) -> None:
    """Note what is left of the swing of these bodies, after a tick in which they want that speed and turn rate."""
    swing = bodies.swing[swinging]
    if laws.track:
        wheels = bodies.left[swinging], bodies.right[swinging]
        bodies.swing[swinging] = swing_left(laws, swing, *wheels, speed, turn)
        return
    rest = swing - _tumbling(laws, swing) * laws.tick
    bodies.swing[swinging] = np.where(np.abs(rest) < 1e-9, 0.0, rest)


def _roll(bodies: Columns, laws: Laws, draws: Draws, speed: Floats, turn: Floats, proposal: Proposal) -> None:
    """The steps of bodies on wheels; what their encoders make of them is worked out where they are gone."""
    bodies.left[:], bodies.right[:] = wheels_follow(laws, bodies.left, bodies.right, speed, turn)
    bodies.speed[:] = (bodies.left + bodies.right) / 2.0
    left, right = bodies.left * laws.tick, bodies.right * laws.tick
    towards = bodies.encoder_heading
    if laws.slips:
        drawn = [deviates(mix(bodies.numbers * np.uint64(GOLDEN) + np.uint64(draw))) for draw in draws[1:]]
        left = slipped(laws, left, laws.slip_left, drawn[0])
        right = slipped(laws, right, laws.slip_right, drawn[1])
        towards = bodies.heading
    proposal.across[:], proposal.up[:], proposal.turn[:] = arc(laws, left, right, towards)


def _glide(bodies: Columns, laws: Laws, speed: Floats, turn: Floats, proposal: Proposal) -> None:
    """The steps of crafts without wheels, which know where they are."""
    most = laws.acceleration * laws.tick
    bodies.speed[:] += bounded(bounded(speed, -laws.speed, laws.speed) - bodies.speed, -most, most)
    turned = bounded(turn, -laws.turn_rate, laws.turn_rate) * laws.tick
    way = bodies.speed * laws.tick
    sine, cosine = sine_cosine(bodies.heading + turned)
    proposal.across[:], proposal.up[:], proposal.turn[:] = way * cosine, way * sine, turned
