"""Compiled kernels of motion for bodies on wheels; see `steps` for the form in NumPy, with which they agree to the last
bit. `fast` calls them.

A block of bodies at a time: first what each wants, which takes decisions, then the arcs of all, which do not and so
become vector instructions.
"""

from __future__ import annotations

import numpy as np

from sleepcast.simulator.compiled import part, strict
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
"""Bodies whose numbers stay in the nearest cache."""
SPEED, TURN, LEFT, RIGHT, HEADING, ACROSS, UP, SLIP = (BLOCK * run for run in range(8))
"""Where these lie in the scratch room of a block; one array, so that it is plain that nothing overlaps."""


@part
def scrambled(bits):
    """See `chance.mix`."""
    bits = (bits ^ (bits >> U(30))) * U(0xBF58476D1CE4E5B9)
    bits = (bits ^ (bits >> U(27))) * U(0x94D049BB133111EB)
    return bits ^ (bits >> U(31))


@part
def deviate(counter, draw):
    """See `noise.deviates`."""
    bits = scrambled(counter * GOLDEN + draw)
    total = (bits & U(0xFFFF)) + ((bits >> U(16)) & U(0xFFFF)) + ((bits >> U(32)) & U(0xFFFF)) + (bits >> U(48))
    return float(np.int64(total) - MIDDLE) * SCALE


@strict
def propose(bodies, laws, roam, draw_left, draw_right, proposal, first, last):
    """See `steps.propose`: the bodies from `first` up to `last`."""
    numbers, x, y, heading, _, _, encoder_heading, wheel_mean, wheel_left, wheel_right = bodies[9:19]
    out_across, out_up, out_turn = proposal
    slips = laws.slip_left != 0.0 or laws.slip_right != 0.0 or laws.slip_noise != 0.0
    towards = heading if slips else encoder_heading
    room = np.zeros(8 * BLOCK)
    for begin in range(first, last, BLOCK):
        end = min(begin + BLOCK, last)
        want(bodies, laws, roam, room, begin, end)
        roll(laws, room, wheel_left[begin:end], wheel_right[begin:end], wheel_mean[begin:end])
        if slips:
            slide(laws, room, numbers[begin:end], draw_left, draw_right)
        lead(laws, room, towards[begin:end])
        stay(laws, room, x[begin:end], y[begin:end])
        give(room, out_across[begin:end], out_up[begin:end], out_turn[begin:end])


@part
def want(bodies, laws, roam, room, begin, end):
    """Put into `room` the speed and the turn rate that each of these bodies wants and may have."""
    mode, held, wanted_speed, wanted_turn, target_x, target_y, swing, roaming, chance = bodies[:9]
    x, y, heading, encoder_x, encoder_y, encoder_heading = bodies[10:16]
    stores, uses = bodies[20:]
    for i in range(begin, end):
        speed, turn = wanted_speed[i], wanted_turn[i]
        if mode[i] == GOTO:
            across, up = target_x[i] - encoder_x[i], target_y[i] - encoder_y[i]
            speed, turn = approach(laws, across, up, encoder_heading[i])
        elif mode[i] != DRIVE:
            drawn = float(scrambled(chance[i] + roam) >> U(11)) * UNIT - 0.5
            roaming[i] = roaming[i] * laws.kept + drawn * (UNIT_SPREAD * laws.strayed)
            speed, turn = laws.roam_speed, roaming[i]
        moves = not held[i]
        for store in range(uses.shape[0]):
            if uses[store] != 0.0 and stores[store, i] <= 0.0:
                moves = False
        if swing[i] != 0.0 and moves:
            turn = bounded(swing[i] / laws.tick, -laws.turn_rate, laws.turn_rate)
            rest = swing[i] - turn * laws.tick
            swing[i] = either(np.abs(rest) < 1e-9, 0.0, rest)
        if laws.margin >= 0.0 and mode[i] != GOTO and speed != 0.0 and outside(laws, x[i], y[i]):
            turn = turned_back(laws, x[i], y[i], heading[i], speed, turn)
        room[SPEED + i - begin], room[TURN + i - begin] = (speed, turn) if moves else (0.0, 0.0)


@part
def roll(laws, room, wheel_left, wheel_right, wheel_mean):
    """Let wheels follow what is wanted, and put into `room` how far they get."""
    size = wheel_mean.shape[0]
    for q in range(size):
        room[LEFT + q], room[RIGHT + q] = wheel_left[q], wheel_right[q]
    for q in range(size):
        left, right = room[LEFT + q], room[RIGHT + q]
        left, right = wheels_follow(laws, left, right, room[SPEED + q], room[TURN + q])
        room[LEFT + q], room[RIGHT + q], room[SPEED + q] = left, right, (left + right) / 2.0
    for q in range(size):
        wheel_left[q], wheel_right[q], wheel_mean[q] = room[LEFT + q], room[RIGHT + q], room[SPEED + q]
    for q in range(size):
        room[LEFT + q] *= laws.tick
        room[RIGHT + q] *= laws.tick


@part
def slide(laws, room, numbers, draw_left, draw_right):
    """Put into `room` how far wheels that slip really get."""
    size = numbers.shape[0]
    if laws.slip_noise != 0.0:
        for q in range(size):
            room[SPEED + q] = deviate(numbers[q], draw_left)
        for q in range(size):
            room[SLIP + q] = deviate(numbers[q], draw_right)
    for q in range(size):
        room[LEFT + q] = slipped(laws, room[LEFT + q], laws.slip_left, room[SPEED + q])
        room[RIGHT + q] = slipped(laws, room[RIGHT + q], laws.slip_right, room[SLIP + q])


@part
def lead(laws, room, heading):
    """Put into `room` where wheels lead that get so far, from these headings."""
    size = heading.shape[0]
    for q in range(size):
        room[HEADING + q] = heading[q]
    for q in range(size):
        across, up, turn = arc(laws, room[LEFT + q], room[RIGHT + q], room[HEADING + q])
        room[ACROSS + q], room[UP + q], room[TURN + q] = across, up, turn


@part
def stay(laws, room, x, y):
    """Let no way in `room` lead out of the world."""
    for q in range(x.shape[0]):
        across, up = x[q] + room[ACROSS + q], y[q] + room[UP + q]
        room[ACROSS + q] = bounded(across, laws.left, laws.right) - x[q]
        room[UP + q] = bounded(up, laws.bottom, laws.top) - y[q]


@part
def give(room, across, up, turn):
    """Copy the ways in `room` to where they are kept."""
    for q in range(across.shape[0]):
        across[q], up[q], turn[q] = room[ACROSS + q], room[UP + q], room[TURN + q]


@strict
def commit(bodies, laws, proposal, free, across, up, first, last):
    """See `steps.commit`: the bodies from `first` up to `last`."""
    x, y, heading, encoder_x, encoder_y, encoder_heading, speed, left, right, bumper, stores, uses = bodies[10:]
    way_across, way_up, turn = proposal
    room = np.zeros(8 * BLOCK)
    for begin in range(first, last, BLOCK):
        end = min(begin + BLOCK, last)
        spend(laws, stores, uses, speed, free, begin, end)
        turned_wheels(laws, room, left[begin:end], right[begin:end])
        lead(laws, room, encoder_heading[begin:end])
        trust(room, free[begin:end], encoder_x[begin:end], encoder_y[begin:end], encoder_heading[begin:end])
        for i in range(begin, end):
            if free[i] < 1.0:
                if laws.parts != 0.0:
                    bumper[i] = touched_part(laws, across[i], up[i], heading[i])
                speed[i], left[i], right[i] = 0.0, 0.0, 0.0
            elif laws.parts != 0.0 and bumper[i] != 0.0:
                bumper[i] = 0.0
        for i in range(begin, end):
            x[i] += free[i] * way_across[i]
            y[i] += free[i] * way_up[i]
            heading[i] = wrap(heading[i] + turn[i])


@part
def spend(laws, stores, uses, speed, free, begin, end):
    """Take out of the stores what the way of each body takes."""
    for store in range(uses.shape[0]):
        use = uses[store]
        if use != 0.0:
            for i in range(begin, end):
                rest = stores[store, i] - np.abs(speed[i]) * laws.tick * free[i] * use
                stores[store, i] = either(rest < 0.0, 0.0, rest)


@part
def turned_wheels(laws, room, wheel_left, wheel_right):
    """Put into `room` how far the wheels have turned."""
    for q in range(wheel_left.shape[0]):
        room[LEFT + q], room[RIGHT + q] = wheel_left[q] * laws.tick, wheel_right[q] * laws.tick


@part
def trust(room, free, x, y, heading):
    """Let bodies believe that they get where `room` leads, as far as they are free to."""
    for q in range(free.shape[0]):
        x[q] += free[q] * room[ACROSS + q]
        y[q] += free[q] * room[UP + q]
        heading[q] = wrap(heading[q] + room[TURN + q])
