"""How the words of a world lie that compiled code makes the quiet ticks of: see `kernels_quiet`, which reads and writes
them, and `blocks`, which fills them."""

from __future__ import annotations

import numpy as np

from sleepcast.simulator.motion.driving import Laws
from sleepcast.simulator.motion.flying import FlightColumns, Power, TypeLaws
from sleepcast.simulator.motion.steps import BodyColumns, Displacement
from sleepcast.simulator.motion.touching import Airborne, NearPairs

_R, _W, _S, _B, _F, _U = (np.zeros(1, kind) for kind in ("f8", "i8", "i4", "?", "f4", "u8"))
_R2, _S2, _F2, _N = np.zeros((1, 1)), np.zeros((1, 1), "i4"), np.zeros((1, 1), "f4"), np.zeros(1, "i1")
_COLUMNS = BodyColumns._make((_N, _B, *[_R] * 6, _U, _U, *[_R] * 10, _R2, _R))
_LAWS = Laws._make([0.0] * len(Laws._fields))
_WAYS = Displacement(_R, _R, _R)
_FLIERS = FlightColumns._make((_N, _B, *[_R] * 22, _R2, *[_R] * 4))
_TYPE_LAWS, _POWER = TypeLaws._make((*[0.0] * 7, (0.0,) * 4, *[0.0] * 3)), Power(_R, _B, 0, 0.0, 0.0)
_AIRBORNE, _PAIRS = Airborne._make((*[_R] * 8, *[0.0] * 3)), NearPairs(_S2, _R, _R, _R, _B, _W, _R, _R2, _S, _S, _S)

PROPOSE, COMMIT, GATHER, STOP_AT_OLD, STOP_AT_WAYS, COUNT_CELLS, BEGIN, PLACE, FIX, SEE, HEAR = range(11)
SLIDE, DISPLACE, FLY, TOUCHING, EDGES = range(11, 16)
"""The kernels that a tick calls: the last three where something flies."""
KERNELS = 16
SAMPLES: tuple[tuple[object, ...], ...] = (
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
    (_COLUMNS, _LAWS, _WAYS, _R, _R, _R, 0, 0),
    (_COLUMNS, _LAWS, _WAYS, _R, _R, 0, 0),
    (_FLIERS, _TYPE_LAWS, _POWER, 0, 0),
    (_AIRBORNE, _PAIRS),
    (_FLIERS, _TYPE_LAWS, _B, 0, 0),
)
"""Arguments of each of them, for their types."""


def _size(value: object) -> int:
    """Words of an argument, see `blocks.flat`."""
    if isinstance(value, np.ndarray):
        return 1 + value.ndim
    return sum(map(_size, value)) if isinstance(value, tuple) else 1


# ---- the words of a world

TICK, TICKS, DONE, TROUBLE, COUNT, STEP = range(6)
"""The number of the tick that bodies are in; ticks that are to be made, and that are made; why the tick after those is
not finished: the leg, from 1, whose rules have left robots to be walked, or TOUCHED where bodies may have touched in
the air or come to their fence, else 0; the number of robots; s of a tick."""
TOUCHED = -1
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
AWAKE, LEGS, MOMENTS, MOST_STEPS, DRAWN = range(37, 42)
"""Whether robots think. The addresses of lists, each with its length first: of each leg of rules the addresses of its
code and table; the addresses of words for the time, each with what they hold of it; the addresses of columns of steps,
each with its maximum. The address of how many numbers each robot has drawn."""
SENSES = 42
"""The address of a list: of functions to be called once bodies have moved, each with that of its argument."""
ROUNDS = 43
"""The address of a list: of positions along an axis of a torus, each with its size, m."""
SLIDES, BEFORE, BEFORE_X, BEFORE_Y = range(44, 48)
"""Whether bodies slide; the addresses of room for what contact has come to before they did."""
EVERY, MOVES, HEARD = range(48, 51)
"""After how many ticks telemetry is sampled, 0 for never; the address of a list: from where to where it is copied, and
how many words; whether sonars are wanted then, all of them."""
FLIES = 51
"""Whether bodies hover."""
FENCED = 52
"""Whether they have a fence."""
HEADER = 53
BLOCKS = tuple(HEADER + sum(sum(map(_size, each)) for each in SAMPLES[:number]) for number in range(KERNELS + 1))
"""Where the arguments of each kernel begin, and the end."""
LENGTH = BLOCKS[-1]
"""Words of a world."""


def _at(kernel: int, argument: int) -> int:
    """Where an argument of a kernel lies."""
    return BLOCKS[kernel] + sum(map(_size, SAMPLES[kernel][:argument]))


ROAM, LEFT, RIGHT = (_at(PROPOSE, number) for number in (2, 3, 4))
LONGEST, REACH, CLOSE_ONES = _at(STOP_AT_OLD, 15), _at(STOP_AT_OLD, 16), _at(STOP_AT_OLD, 19)
WAYS_REACH = _at(STOP_AT_WAYS, 11)
LOOKS_FORWARD, SEEN_BESIDE = _at(SEE, 27), _at(SEE, 32)
ECHO, DROPOUT, WANTED_ROWS = _at(HEAR, 2) + 2, _at(HEAR, 2) + 3, _at(HEAR, 6)
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
    AT_SLIDE,
    AT_DISPLACE,
    AT_FLY,
    AT_TOUCHING,
    AT_EDGES,
    _,
) = BLOCKS
# ---- what is drawn in a tick

PURPOSES = 4
"""Keys of chance that are drawn at once: of the slip of left and right wheels, of echoes, of dropout."""
TEXT = 128
"""Bytes of a block of BLAKE2b, in which a text lies."""
TEXT_WORDS = TEXT // 8
LENGTHS, FIRST_TEXT = 0, PURPOSES
"""Where, in the words of four texts, their lengths without the tick lie, and the texts, a block each."""
TEXTS_LENGTH = PURPOSES + PURPOSES * TEXT_WORDS
DIGITS = 20
"""Characters that the number of a tick and the closing bracket take at most."""
WHOLE, REAL, TIME = range(3)
"""What a word for the time holds."""

# ---- the words of a world whose robots are rows, see `rows`

ROBOTS, SIZE, HALTED, MODES, SPEEDS, TURNS, MEASURED = range(7)
"""The row of its first robot; how many there are; the addresses of which are stopped, of modes, of the speeds and turn
rates that are wanted, and of what is sensed."""
ROW_WORDS = 7
