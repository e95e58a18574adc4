"""Noise of sonars: the same numbers from every machine, for a robot whoever else is asked.

A draw hashes a key and a counter (robot and sonar) to 64 bits. Noise is the sum of their four quarters, less its mean:
Irwin and Hall's distribution, close to normal up to two deviations and never beyond three and a half, and whole
numbers to the last step.
`kernels` has the fast form of the same.
"""

from __future__ import annotations

from math import sqrt
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.chance import GOLDEN, mix
from sleepcast.simulator.grid import Whole

QUARTER = 65_536
MIDDLE = 2 * QUARTER - 2
"""The mean of the sum of four numbers from 0 to 65,535."""
SCALE = sqrt(3.0) / QUARTER
"""Makes the sum one of standard deviation 1."""


class Noise(NamedTuple):
    """What disturbs ranges. share: standard deviation as a share of the range; dropout: the chance that an echo is
    missed; most: m, what is read where there is nothing; key, dropout_key: 64 bits, other ones at each tick."""

    share: float
    dropout: float
    most: float
    key: int
    dropout_key: int


def disturb(seen: NDArray[np.float32], which: Whole, noise: Noise) -> None:
    """Disturb the ranges `seen` (m, shape (robots, sonars)) of the robots with these indices, in place."""
    sonars = np.arange(seen.shape[1], dtype=np.uint64)
    counters = which.astype(np.uint64)[:, None] * np.uint64(seen.shape[1]) + sonars
    nothing = seen >= np.float32(noise.most)
    if noise.share:
        bits = mix(counters * np.uint64(GOLDEN) + np.uint64(noise.key))
        total = sum((bits >> np.uint64(shift)) & np.uint64(QUARTER - 1) for shift in (0, 16, 32, 48))
        deviates = (np.asarray(total).astype(np.int64) - MIDDLE).astype(np.float64) * SCALE
        seen *= (1.0 + noise.share * deviates).astype(np.float32)
    if noise.dropout:
        bits = mix(counters * np.uint64(GOLDEN) + np.uint64(noise.dropout_key))
        nothing |= (bits >> np.uint64(11)).astype(np.float64) * 2.0**-53 < noise.dropout
    seen[nothing] = np.float32(noise.most)
