"""Compiled kernels of motion for bodies on wheels; see `steps` for the form in NumPy, with which they agree to the last
bit. `fast` calls them.

A block of bodies at a time: first what each wants, which takes decisions, then the arcs of all, which do not and so
become vector instructions.
"""

from __future__ import annotations

import numpy as np

from sleepcast.simulator.compiled import strict
from sleepcast.simulator.driving import (
    DRIVE,
    GOTO,
    approach,
    arc,
    bounded,
    outside,
    slipped,
    touched_part,
    turned_back,
    wheels_follow,
)
from sleepcast.simulator.formulas import either, wrap
from sleepcast.simulator.kernels import GOLDEN, U
from sleepcast.simulator.noise import MIDDLE, SCALE
from sleepcast.simulator.steps import UNIT, UNIT_SPREAD

BLOCK = 256
"""Bodies whose wishes stay in the nearest cache."""


@strict
def scrambled(bits):
    """See `chance.mix`."""
    bits = (bits ^ (bits >> U(30))) * U(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> U(27))) * U(0x94D049BB133111EB)
    return bits ^ (bits >> U(31))


@strict
def deviate(counter, draw):
    """See `noise.deviates`."""
    bits = scrambled(counter * GOLDEN + draw)
    total = (bits & U(0xFFFF)) + ((bits >> U(16)) & U(0xFFFF)) + ((bits >> U(32)) & U(0xFFFF)) + (bits >> U(48))
    return float(np.int64(total) - MIDDLE) * SCALE


@strict
def wish(b, laws, roam, i):
    """The speed and turn rate that body i may have: what it wants, unless something overrules it."""
    if b.mode[i] == DRIVE:
        speed, turn = b.wanted_speed[i], b.wanted_turn[i]
    elif b.mode[i] == GOTO:
        across, up = b.target_x[i] - b.encoder_x[i], b.target_y[i] - b.encoder_y[i]
        speed, turn = approach(laws, across, up, b.encoder_heading[i])
    else:
        drawn = float(scrambled(b.chance[i] + roam) >> U(11)) * UNIT - 0.5
        b.roaming[i] = b.roaming[i] * laws.kept + drawn * (UNIT_SPREAD * laws.strayed)
        speed, turn = laws.roam_speed, b.roaming[i]
    moves = not b.held[i]
    for store in range(b.uses.shape[0]):
        if b.uses[store] != 0.0 and b.stores[store, i] <= 0.0:
            moves = False
    if b.swing[i] != 0.0 and moves:
        turn = bounded(b.swing[i] / laws.tick, -laws.turn_rate, laws.turn_rate)
        rest = b.swing[i] - turn * laws.tick
        b.swing[i] = either(np.abs(rest) < 1e-9, 0.0, rest)
    if laws.margin >= 0.0 and b.mode[i] != GOTO and speed != 0.0 and outside(laws, b.x[i], b.y[i]):
        turn = turned_back(laws, b.x[i], b.y[i], b.heading[i], speed, turn)
    return (speed, turn) if moves else (0.0, 0.0)


@strict
def propose(b, laws, roam, draw_left, draw_right, p, first, last):
    """See `steps.propose`: the bodies from `first` up to `last`."""
    speeds, turns = np.empty(BLOCK), np.empty(BLOCK)
    slips = laws.slip_left != 0.0 or laws.slip_right != 0.0 or laws.slip_noise != 0.0
    for begin in range(first, last, BLOCK):
        size = min(BLOCK, last - begin)
        for q in range(size):
            speeds[q], turns[q] = wish(b, laws, roam, begin + q)
        for q in range(size):
            i = begin + q
            left, right = wheels_follow(laws, b.left[i], b.right[i], speeds[q], turns[q])
            b.left[i], b.right[i], b.speed[i] = left, right, (left + right) / 2.0
            across, up, turn = arc(laws, left * laws.tick, right * laws.tick, b.encoder_heading[i])
            p.seen_across[i], p.seen_up[i], p.seen_turn[i] = across, up, turn
            p.across[i], p.up[i], p.turn[i] = across, up, turn
        if slips:
            for q in range(size):
                i = begin + q
                left = slipped(laws, b.left[i] * laws.tick, laws.slip_left, deviate(b.numbers[i], draw_left))
                right = slipped(laws, b.right[i] * laws.tick, laws.slip_right, deviate(b.numbers[i], draw_right))
                p.across[i], p.up[i], p.turn[i] = arc(laws, left, right, b.heading[i])
        for q in range(size):
            i = begin + q
            p.across[i] = bounded(b.x[i] + p.across[i], laws.left, laws.right) - b.x[i]
            p.up[i] = bounded(b.y[i] + p.up[i], laws.bottom, laws.top) - b.y[i]


@strict
def commit(b, laws, p, free, across, up, first, last):
    """See `steps.commit`: the bodies from `first` up to `last`."""
    for i in range(first, last):
        if laws.parts != 0.0:
            b.bumper[i] = touched_part(laws, across[i], up[i], b.heading[i]) if free[i] < 1.0 else 0.0
    for store in range(b.uses.shape[0]):
        use = b.uses[store]
        if use != 0.0:
            for i in range(first, last):
                left = b.stores[store, i] - np.abs(b.speed[i]) * laws.tick * free[i] * use
                b.stores[store, i] = either(left < 0.0, 0.0, left)
    for i in range(first, last):
        b.x[i] += free[i] * p.across[i]
        b.y[i] += free[i] * p.up[i]
        b.heading[i] = wrap(b.heading[i] + p.turn[i])
    for i in range(first, last):
        b.encoder_x[i] += free[i] * p.seen_across[i]
        b.encoder_y[i] += free[i] * p.seen_up[i]
        b.encoder_heading[i] = wrap(b.encoder_heading[i] + p.seen_turn[i])
    for i in range(first, last):
        if free[i] < 1.0:
            b.speed[i], b.left[i], b.right[i] = 0.0, 0.0, 0.0
