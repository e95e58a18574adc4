"""Quiet ticks of many worlds in one call: act, advance, sense, think, without Python in between.

A world is a block of words (`quiet.blocks` makes it): numbers and addresses, and for each kernel that a tick calls its
arguments, taken apart into words. The kernels are the ones that `fast.NumbaMachine` calls, by their addresses, with the
same arguments; so every bit is the same. Rules are called by theirs. What differs from tick to tick - keys of chance,
the number of the tick, the longest way - is written into the blocks.

Worlds are independent. Each call processes a slice of them, so that threads can share the work.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numba import typeof
from numba.core import types

from sleepcast.simulator.motion.driving import DRIVE
from sleepcast.simulator.quiet.kernels_chance import draw_keys
from sleepcast.simulator.quiet.layout import (
    ACTS,
    AGAIN,
    ALL_ROWS,
    AT_BEGIN,
    AT_COMMIT,
    AT_COUNT_CELLS,
    AT_DISPLACE,
    AT_EDGES,
    AT_FIX,
    AT_FLY,
    AT_GATHER,
    AT_HEAR,
    AT_PLACE,
    AT_PROPOSE,
    AT_SEE,
    AT_SLIDE,
    AT_STOP_AT_OLD,
    AT_STOP_AT_WAYS,
    AT_TOUCHING,
    AWAKE,
    BEFORE,
    BEFORE_X,
    BEFORE_Y,
    BEGIN,
    BESIDE,
    CELLS,
    CLOSE,
    CLOSE_ONES,
    COMMIT,
    COUNT,
    COUNT_CELLS,
    COUNTS,
    DISPLACE,
    DONE,
    DRAINS,
    DRAWN,
    DRAWS,
    DROPOUT,
    ECHO,
    ECHOES,
    EDGES,
    EVERY,
    FENCED,
    FIX,
    FLIES,
    FLY,
    FORWARD,
    FREE,
    GATHER,
    HEAR,
    HEARD,
    HIT_X,
    HIT_Y,
    KEYED,
    KEYS,
    KNOWN,
    LEFT,
    LEGS,
    LONE,
    LONGEST,
    LOOKS_FORWARD,
    MODE,
    MOMENTS,
    MOST_STEPS,
    MOVES,
    NEAR,
    ONES,
    PLACE,
    PROPOSE,
    REACH,
    REAL,
    RIGHT,
    ROAM,
    ROUNDING,
    ROUNDS,
    SAMPLED,
    SAMPLES,
    SEE,
    SEEN_BESIDE,
    SEES,
    SENSES,
    SKIN,
    SLIDE,
    SLIDES,
    SOME_ROWS,
    SORTED,
    STEP,
    STOP_AT_OLD,
    STOP_AT_WAYS,
    STOPPED,
    TEXTS,
    TICK,
    TICKS,
    TOUCHED,
    TOUCHES,
    TOUCHING,
    TROUBLE,
    WANTED_ROWS,
    WAYS_REACH,
    WHOLE,
    WIDE,
)
from sleepcast.simulator.simd.compiled import part, strict
from sleepcast.simulator.simd.memory import (
    bits_of,
    byte,
    call_once,
    call_round,
    calling,
    put_byte,
    put_half,
    put_real,
    put_word,
    real,
    short,
    word,
)
from sleepcast.simulator.sonar.kernels import GOLDEN

TYPES = [tuple(typeof(each) for each in arguments) for arguments in SAMPLES]

propose, commit = calling(types.none, TYPES[PROPOSE]), calling(types.none, TYPES[COMMIT])
gather = calling(types.float64, TYPES[GATHER])
stop_at_old, stop_at_ways = calling(types.none, TYPES[STOP_AT_OLD]), calling(types.none, TYPES[STOP_AT_WAYS])
count_cells, begin = calling(types.none, TYPES[COUNT_CELLS]), calling(types.none, TYPES[BEGIN])
place, fix = calling(types.none, TYPES[PLACE]), calling(types.none, TYPES[FIX])
see, hear = calling(types.none, TYPES[SEE]), calling(types.none, TYPES[HEAR])
fly, touching = calling(types.none, TYPES[FLY]), calling(types.int64, TYPES[TOUCHING])
at_fence = calling(types.int64, TYPES[EDGES])
slide, displace = calling(types.int64, TYPES[SLIDE]), calling(types.none, TYPES[DISPLACE])


@strict
def quiet(table, kernels, first, last):
    """Let the worlds from `first` to `last` (exclusive) make the ticks that they are to make. table: the addresses of
    their words; kernels: those of the kernels. A world stops early where robots have to be walked, or
    may have touched in the air or come to their fence."""
    for number in range(first, last):
        w = table[number]
        put_word(w, DONE, 0)
        put_word(w, TROUBLE, 0)
        while word(w, DONE) < word(w, TICKS):
            act(w)
            advance(w, kernels)
            if word(w, TROUBLE):
                break
            told = word(w, EVERY) != 0 and word(w, TICK) % word(w, EVERY) == 0
            final = word(w, DONE) + 1 == word(w, TICKS)
            every = (told and word(w, HEARD) != 0) or (final and word(w, SAMPLED) != 0)
            if word(w, AWAKE) or every:
                sense(w, kernels, every)
            if word(w, AWAKE):
                think(w)
                if word(w, TROUBLE):
                    break
            if told:
                tell(w)
            put_word(w, DONE, word(w, DONE) + 1)


@part
def act(w):
    """What rules have assigned goes to the bodies."""
    acts = word(w, ACTS)
    for number in range(word(acts, 0)):
        values, assigned, wanted = word(acts, 3 * number + 1), word(acts, 3 * number + 2), word(acts, 3 * number + 3)
        for i in range(word(w, COUNT)):
            if byte(assigned, i) == 0:
                continue
            put_byte(assigned, i, 0)
            if byte(word(w, STOPPED), i) == 0:
                put_byte(word(w, MODE), i, DRIVE)
                value = real(values, i)
                if value == value:
                    put_real(wanted, i, value)


@part
def advance(w, kernels):
    """See `Simulator.step`."""
    if word(w, FLIES):
        fly(kernels[FLY], w + 8 * AT_FLY)
    else:
        drive(w, kernels)
    go_round(w)
    put_word(w, SORTED, 0)
    if word(w, SLIDES):
        slide_on(w, kernels)
    drain(w)
    put_word(w, TICK, word(w, TICK) + 1)
    if word(w, FLIES):
        touched = touching(kernels[TOUCHING], w + 8 * AT_TOUCHING) != 0
        held = word(w, FENCED) != 0 and at_fence(kernels[EDGES], w + 8 * AT_EDGES) != 0
        if touched or held:
            put_word(w, TROUBLE, TOUCHED)
            return
    senses = word(w, SENSES)
    for number in range(word(senses, 0)):
        call_once(word(senses, 2 * number + 1), word(senses, 2 * number + 2))


@part
def drive(w, kernels):
    """Move bodies on the ground, see `simulation.step`."""
    if word(w, DRAWS):
        draw(w)
        put_word(w, LEFT, word(word(w, KEYS), 0))
        put_word(w, RIGHT, word(word(w, KEYS), 1))
    put_word(w, ROAM, np.int64(np.uint64(word(w, TICK)) * GOLDEN))
    propose(kernels[PROPOSE], w + 8 * AT_PROPOSE)
    clear(w)
    if word(w, TOUCHES):
        settle(w, kernels)
    commit(kernels[COMMIT], w + 8 * AT_COMMIT)


@part
def clear(w):
    """See `steps.clear`."""
    for i in range(word(w, COUNT)):
        put_real(word(w, FREE), i, 1.0)
        put_real(word(w, HIT_X), i, 0.0)
        put_real(word(w, HIT_Y), i, 0.0)


@part
def go_round(w):
    """See `torus.wrap_position`."""
    rounds = word(w, ROUNDS)
    for number in range(word(rounds, 0)):
        places, size = word(rounds, 2 * number + 1), real(rounds, 2 * number + 2)
        for i in range(word(w, COUNT)):
            place = real(places, i)
            if place < 0.0 or place >= size:
                inside = np.mod(place, size)
                put_real(places, i, inside if inside < size else 0.0)


@part
def slide_on(w, kernels):
    """See `simulation.slide`."""
    if slide(kernels[SLIDE], w + 8 * AT_SLIDE) == 0:
        return
    for i in range(word(w, COUNT)):
        put_real(word(w, BEFORE), i, real(word(w, FREE), i))
        put_real(word(w, BEFORE_X), i, real(word(w, HIT_X), i))
        put_real(word(w, BEFORE_Y), i, real(word(w, HIT_Y), i))
    clear(w)
    settle(w, kernels)
    displace(kernels[DISPLACE], w + 8 * AT_DISPLACE)
    for i in range(word(w, COUNT)):
        put_real(word(w, HIT_X), i, real(word(w, BEFORE_X), i))
        put_real(word(w, HIT_Y), i, real(word(w, BEFORE_Y), i))
    put_word(w, SORTED, 0)


@part
def draw(w):
    """Find the keys of all chance of this tick, unless they are known."""
    if word(w, KEYED) != word(w, TICK):
        put_word(w, KEYED, word(w, TICK))
        draw_keys(word(w, TEXTS), word(w, TICK), word(w, KEYS), word(w, KEYS) + 32)


@part
def sort(w, kernels):
    """See `NumbaMachine.sort`."""
    if word(w, SORTED) == 0:
        for cell in range(word(w, CELLS)):
            put_half(word(w, COUNTS), cell, 0)
        count_cells(kernels[COUNT_CELLS], w + 8 * AT_COUNT_CELLS)
        begin(kernels[BEGIN], w + 8 * AT_BEGIN)
        place(kernels[PLACE], w + 8 * AT_PLACE)
        put_word(w, SORTED, 1)
        put_real(w, KNOWN, 0.0)


@part
def settle(w, kernels):
    """See `NumbaMachine.settle`."""
    sort(w, kernels)
    longest = sqrt(gather(kernels[GATHER], w + 8 * AT_GATHER))
    reach = real(w, WIDE) + real(w, SKIN) + 2.0 * longest
    known = reach < real(w, KNOWN) - real(w, ROUNDING)
    put_word(w, CLOSE_ONES, word(w, CLOSE) if known else word(w, ONES))
    put_real(w, BESIDE, real(w, AGAIN) * reach + real(w, ROUNDING))
    put_real(w, LONGEST, longest)
    put_real(w, REACH, reach)
    put_real(w, WAYS_REACH, reach)
    stop_at_old(kernels[STOP_AT_OLD], w + 8 * AT_STOP_AT_OLD)
    near = 0
    for i in range(word(w, COUNT)):
        near |= byte(word(w, NEAR), i)
    if near:
        stop_at_ways(kernels[STOP_AT_WAYS], w + 8 * AT_STOP_AT_WAYS)


@part
def drain(w):
    """See `Bodies.drain`."""
    drains = word(w, DRAINS)
    for number in range(word(drains, 0)):
        store, lost = word(drains, 2 * number + 1), real(drains, 2 * number + 2)
        for i in range(word(w, COUNT)):
            rest = real(store, i) - lost
            put_real(store, i, 0.0 if rest < 0.0 else rest)


@part
def tell(w):
    """Copy what robots tell of themselves; see `ValueColumns.copy_all`."""
    moves = word(w, MOVES)
    for number in range(word(moves, 0)):
        begin, into = word(moves, 3 * number + 1), word(moves, 3 * number + 2)
        for i in range(word(moves, 3 * number + 3)):
            put_word(into, i, word(begin, i))


@part
def sense(w, kernels, every):
    """Let sonars measure; see `NumbaMachine.hear`. every: whether all rows are wanted."""
    if word(w, SEES) == 0 and not every:
        return
    sort(w, kernels)
    if word(w, ECHOES):
        draw(w)
        put_word(w, ECHO, word(word(w, KEYS), 2))
        put_word(w, DROPOUT, word(word(w, KEYS), 3))
    put_word(w, WANTED_ROWS, word(w, ALL_ROWS) if every else word(w, SOME_ROWS))
    put_word(w, LOOKS_FORWARD, 0 if every else word(w, FORWARD))
    beside = min(real(w, LONE), real(w, BESIDE))
    put_real(w, SEEN_BESIDE, beside)
    put_real(w, KNOWN, beside)
    fix(kernels[FIX], w + 8 * AT_FIX)
    see(kernels[SEE], w + 8 * AT_SEE)
    hear(kernels[HEAR], w + 8 * AT_HEAR)


@part
def think(w):
    """Let rules run, leg by leg; see `BatchScheduler._follow`."""
    count, tick, time = word(w, COUNT), word(w, TICK), word(w, TICK) * real(w, STEP)
    moments, legs, most = word(w, MOMENTS), word(w, LEGS), word(w, MOST_STEPS)
    for number in range(word(moments, 0)):
        address, kind = word(moments, 2 * number + 1), word(moments, 2 * number + 2)
        now = tick if kind == WHOLE else bits_of(float(tick)) if kind == REAL else bits_of(time)
        put_word(address, 0, now)
    for i in range(count):
        put_half(word(w, DRAWN), i, 0)
    for number in range(word(legs, 0)):
        if call_round(word(legs, 2 * number + 1), 0, count, count, word(legs, 2 * number + 2)):
            put_word(w, TROUBLE, number + 1)
            return
    for number in range(word(most, 0)):
        steps, highest = word(most, 2 * number + 1), word(most, 2 * number + 2)
        for i in range(count):
            highest = max(highest, short(steps, i))
        put_word(most, 2 * number + 2, highest)
