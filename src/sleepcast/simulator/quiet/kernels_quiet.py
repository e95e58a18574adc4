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

from sleepcast.simulator.motion.driving import DRIVE, Laws
from sleepcast.simulator.motion.steps import BodyColumns, Displacement
from sleepcast.simulator.quiet.kernels_chance import draw_keys
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

_R, _W, _S, _B, _F, _U = (np.zeros(1, kind) for kind in ("f8", "i8", "i4", "?", "f4", "u8"))
_R2, _S2, _F2, _N = np.zeros((1, 1)), np.zeros((1, 1), "i4"), np.zeros((1, 1), "f4"), np.zeros(1, "i1")
_COLUMNS = BodyColumns._make((_N, _B, *[_R] * 6, _U, _U, *[_R] * 10, _R2, _R))
_LAWS = Laws._make([0.0] * len(Laws._fields))
_WAYS = Displacement(_R, _R, _R)

PROPOSE, COMMIT, GATHER, STOP_AT_OLD, STOP_AT_WAYS, COUNT_CELLS, BEGIN, PLACE, FIX, SEE, HEAR = range(11)
"""The kernels that a tick calls."""
KERNELS = 11
SAMPLES = (
    (_COLUMNS, _LAWS, np.uint64(0), np.uint64(0), np.uint64(0), _WAYS, 0, 0),
    (_COLUMNS, _LAWS, _WAYS, _R, _R, _R, 0, 0),
    (_S, _R, _R, _R, _R, 0, 0, _R2),
    (*[_R] * 5, _S, _S, 0.0, 0, 0, _R2, _R2, _S, _S, 0.0, 0.0, 0.0, 0, 0, _B, _B, *[_R] * 6),
    (*[_R] * 5, _S, _S, 0.0, 0, 0, 0.0, 0.0, 0, 0, _B, *[_R] * 6),
    (_R, _R, 0.0, 0, 0, 0, 0, _S, _S),
    (_S2, _S),
    (_S, 0, 0, _S, _S),
    (_S, _R, _R, 0.0, 0, 0, _S, _S),
    (
        *(*[_R] * 3, *[_S] * 3, _R, _S, _S, 0.0, 0, 0, _R2, _S, _S, _N, *[0.0] * 8),
        *(0.0, 0.0, False, False, _R, _R, 0, 0, 0.0, _B, _F2),
    ),
    (_F2, _W, (0.0, 0.0, np.uint64(0), np.uint64(0)), 0.0, 0.0, _W, _B, _R2, 0),
)
"""Arguments of each of them, for their types."""


def types_of(arguments):
    """numba's types of arguments."""
    return tuple(typeof(each) for each in arguments)


TYPES = tuple(map(types_of, SAMPLES))

propose, commit = calling(types.none, TYPES[PROPOSE]), calling(types.none, TYPES[COMMIT])
gather = calling(types.float64, TYPES[GATHER])
stop_at_old, stop_at_ways = calling(types.none, TYPES[STOP_AT_OLD]), calling(types.none, TYPES[STOP_AT_WAYS])
count_cells, begin = calling(types.none, TYPES[COUNT_CELLS]), calling(types.none, TYPES[BEGIN])
place, fix = calling(types.none, TYPES[PLACE]), calling(types.none, TYPES[FIX])
see, hear = calling(types.none, TYPES[SEE]), calling(types.none, TYPES[HEAR])


def _size(value):
    """Words of an argument, see `blocks.flat`."""
    if isinstance(value, np.ndarray):
        return 5 + 2 * value.ndim
    return sum(map(_size, value)) if isinstance(value, tuple) else 1


# ---- the words of a world

TICK, TICKS, DONE, TROUBLE, COUNT, STEP = range(6)
"""The number of the tick that bodies are in; ticks that are to be made, and that are made; the leg, from 1, whose rules
were left in the tick after those because robots have to be walked, else 0; the number of robots; s of a tick."""
ACTS, STOPPED, MODE = range(6, 9)
"""The address of the actuators that rules assign: how many, then of each the addresses of its values, of who has
assigned it and of what it commands. The addresses of which bodies are stopped, and of their modes."""
DRAWS, TEXTS, KEYS, KEYED, FREE, HIT_X, HIT_Y = range(9, 16)
"""Whether wheels slip; the addresses of the texts of chance (see `kernels_chance`) and of room for eight words, first
the keys; the tick of which these are. The addresses of what contact comes to, see `steps.Settled`."""
TOUCHES, SORTED, CELLS, COUNTS, CLOSE, ONES, NEAR = range(16, 23)
"""Whether there is contact; whether bodies are sorted; how many cells there are, and the address of how many bodies are
in each. The addresses of flags of bodies: which ones may touch others, as far as is known; that all may; which do."""
WIDE, SKIN, ROUNDING, AGAIN, KNOWN, BESIDE, LONE = range(23, 30)
"""Twice the greatest radius, m; see `steps.SKIN`, `fast.ROUNDING` and `fast.AGAIN`; within which reach CLOSE holds, m;
that of the next look, m, and its limit."""
DRAINS = 30
"""The address of what ticks take: how many, then of each the address of its store and how much."""
SEES, SOME_ROWS, ALL_ROWS, FORWARD, SAMPLED, ECHOES = range(31, 37)
"""Whether sonars are heard; the addresses of the rows that are wanted in ordinary ticks, and of all; whether none of
those looks behind; whether all are wanted in the last tick; whether there is noise."""
AWAKE, LEGS, MOMENTS, MOST_STEPS, PREPARES, DRAWN = range(37, 43)
"""Whether robots think. The addresses of lists, each with its length first: of each leg of rules the addresses of its
code and table; the addresses of words for the time, each with what they hold of it; the addresses of columns of steps,
each with its maximum; the addresses of functions to be called before rules, each with that of its context. The address
of how many numbers each robot has drawn."""
HEADER = 43
BLOCKS = tuple(HEADER + sum(sum(map(_size, each)) for each in SAMPLES[:number]) for number in range(KERNELS + 1))
"""Where the arguments of each kernel begin, and the end."""
LENGTH = BLOCKS[-1]
"""Words of a world."""


def _at(kernel, argument):
    """Where an argument of a kernel lies."""
    return BLOCKS[kernel] + sum(map(_size, SAMPLES[kernel][:argument]))


DATA = 4
"""Where, of an array, the address of its data lies."""
ROAM, LEFT, RIGHT = (_at(PROPOSE, number) for number in (2, 3, 4))
LONGEST, REACH, CLOSE_ONES = _at(STOP_AT_OLD, 15), _at(STOP_AT_OLD, 16), _at(STOP_AT_OLD, 19) + DATA
WAYS_REACH = _at(STOP_AT_WAYS, 11)
LOOKS_FORWARD, SEEN_BESIDE = _at(SEE, 27), _at(SEE, 32)
ECHO, DROPOUT, WANTED_ROWS = _at(HEAR, 2) + 2, _at(HEAR, 2) + 3, _at(HEAR, 6) + DATA
(
    AT_PROPOSE,
    AT_COMMIT,
    AT_GATHER,
    AT_STOP_AT_OLD,
    AT_STOP_AT_WAYS,
    AT_COUNT_CELLS,
    AT_BEGIN,
    AT_PLACE,
    AT_FIX,
    AT_SEE,
    AT_HEAR,
    _,
) = BLOCKS
WHOLE, REAL, TIME = range(3)
"""What a word for the time holds."""


@strict
def quiet(table, kernels, first, last):
    """Let the worlds from `first` to `last` (exclusive) make the ticks that they are to make. table: the addresses of
    their words; kernels: those of the kernels. A world stops early where robots have to be walked."""
    for number in range(first, last):
        w = table[number]
        put_word(w, DONE, 0)
        put_word(w, TROUBLE, 0)
        while word(w, DONE) < word(w, TICKS):
            act(w)
            advance(w, kernels)
            final = word(w, DONE) + 1 == word(w, TICKS)
            if word(w, AWAKE) or (final and word(w, SAMPLED)):
                sense(w, kernels, final and word(w, SAMPLED) != 0)
            if word(w, AWAKE):
                think(w)
                if word(w, TROUBLE):
                    break
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
    """See `simulation.step`."""
    count, free = word(w, COUNT), word(w, FREE)
    if word(w, DRAWS):
        draw(w)
        put_word(w, LEFT, word(word(w, KEYS), 0))
        put_word(w, RIGHT, word(word(w, KEYS), 1))
    put_word(w, ROAM, np.int64(np.uint64(word(w, TICK)) * GOLDEN))
    propose(kernels[PROPOSE], w + 8 * AT_PROPOSE)
    for i in range(count):
        put_real(free, i, 1.0)
        put_real(word(w, HIT_X), i, 0.0)
        put_real(word(w, HIT_Y), i, 0.0)
    if word(w, TOUCHES):
        settle(w, kernels)
    commit(kernels[COMMIT], w + 8 * AT_COMMIT)
    drain(w)
    put_word(w, SORTED, 0)
    put_word(w, TICK, word(w, TICK) + 1)


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
    moments, legs, prepares, most = word(w, MOMENTS), word(w, LEGS), word(w, PREPARES), word(w, MOST_STEPS)
    for number in range(word(moments, 0)):
        address, kind = word(moments, 2 * number + 1), word(moments, 2 * number + 2)
        now = tick if kind == WHOLE else bits_of(float(tick)) if kind == REAL else bits_of(time)
        put_word(address, 0, now)
    for number in range(word(prepares, 0)):
        call_once(word(prepares, 2 * number + 1), word(prepares, 2 * number + 2))
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
