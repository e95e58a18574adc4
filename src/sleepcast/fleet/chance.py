"""Chance over columns: the same numbers as `language.chance` gives one robot, for many robots at once."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from sleepcast.language.chance import GOLDEN, MASK, UNIT, mix

Words: TypeAlias = NDArray[np.uint64]

_GOLDEN = np.uint64(GOLDEN)
_FIRST, _SECOND = np.uint64(0xBF58_476D_1CE4_E5B9), np.uint64(0x94D0_49BB_1331_11EB)
_30, _27, _31, _11 = (np.uint64(shift) for shift in (30, 27, 31, 11))


def _mixed(z: Words) -> Words:
    """The finaliser of SplitMix64, see `language.chance.mix`; whole numbers wrap at 64 bits by themselves."""
    z = (z ^ (z >> _30)) * _FIRST
    z = (z ^ (z >> _27)) * _SECOND
    return z ^ (z >> _31)


def streams(seed: int, robots: NDArray[np.int64]) -> Words:
    """The 64-bit key of each robot's chance."""
    first = np.uint64(mix(seed + GOLDEN & MASK))
    return _mixed(first + robots.astype(np.uint64) * _GOLDEN)


def draws(keys: Words, ticks: NDArray[np.int64], numbers: NDArray[np.int32]) -> NDArray[np.float64]:
    """One number in [0, 1) for each key: draw `number` of its tick."""
    of_tick = _mixed(keys + ticks.astype(np.uint64) * _GOLDEN)
    word = _mixed(of_tick + numbers.astype(np.uint64) * _GOLDEN)
    return (word >> _11).astype(np.float64) * UNIT
