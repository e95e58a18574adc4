"""From ranges to readings: noise, dropout and limits; bit-identical on every backend and for any subset of robots.

A draw hashes a key and a counter (robot and sonar) to 64 bits. Noise is the sum of their four 16-bit quarters, minus
its mean: the Irwin-Hall distribution, close to normal up to two deviations and never beyond three and a half, in
integer arithmetic up to the last step. `kernels` has the fast version.
"""

from __future__ import annotations

from math import sqrt

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.counter_rng import GOLDEN, mix
from sleepcast.core.records import NamedTuple, dataclass
from sleepcast.simulator.world.grid import Floats, Whole

QUARTER = 65_536
MIDDLE = 2 * QUARTER - 2
"""Mean of the sum of four numbers from 0 to 65,535."""
SCALE = sqrt(3.0) / QUARTER
"""Scales the sum to standard deviation 1."""


class Noise(NamedTuple):
    """Sonar noise.

    share: standard deviation as a share of the range
    dropout: probability of a missed echo
    most: the reading without an echo, m
    key, dropout_key: 64 bits, new in each tick
    """

    share: float
    dropout: float
    most: float
    key: int
    dropout_key: int


@dataclass(frozen=True, slots=True)
class SonarReceiver:
    """How ranges become readings.

    least, most: limits, m
    front: numbers of the front sonars
    noise: None without noise, or if already applied
    wanted: the requested rows of the readings, shape (sonars + 1,)
    """

    least: float
    most: float
    front: Whole
    noise: Noise | None
    wanted: NDArray[np.bool_]


def deviates(bits: NDArray[np.uint64]) -> Floats:
    """Numbers with mean 0 and standard deviation 1 from 64 random bits each."""
    total = sum((bits >> np.uint64(shift)) & np.uint64(QUARTER - 1) for shift in (0, 16, 32, 48))
    return (np.asarray(total).astype(np.int64) - MIDDLE).astype(np.float64) * SCALE


def disturb(seen: NDArray[np.float32], which: Whole, noise: Noise) -> None:
    """Apply noise and dropout in place to the ranges `seen` (m, shape (robots, sonars)) of the robots `which`."""
    sonars = np.arange(seen.shape[1], dtype=np.uint64)
    disturb_each(seen, which.astype(np.uint64)[:, None] * np.uint64(seen.shape[1]) + sonars, noise)


def disturb_each(seen: NDArray[np.float32], counters: NDArray[np.uint64], noise: Noise) -> None:
    """As `disturb`, with a counter for each range."""
    nothing = seen >= np.float32(noise.most)
    if noise.share:
        bits = mix(counters * np.uint64(GOLDEN) + np.uint64(noise.key))
        seen *= (1.0 + noise.share * deviates(bits)).astype(np.float32)
    if noise.dropout:
        bits = mix(counters * np.uint64(GOLDEN) + np.uint64(noise.dropout_key))
        nothing |= (bits >> np.uint64(11)).astype(np.float64) * 2.0**-53 < noise.dropout
    seen[nothing] = np.float32(noise.most)


def tell(seen: NDArray[np.float32], which: Whole, receiver: SonarReceiver, sensed: Floats) -> None:
    """Write the readings of ranges `seen` (overwritten) of the robots `which` into their columns of `sensed`, m, shape
    (sonars + 1, robots), in the wanted rows; the last row is the minimum of the front sonars. NaN stays NaN. Limits are
    applied in double precision."""
    if receiver.noise is not None:
        disturb(seen, which, receiver.noise)
    read = seen.T
    reported = np.where(
        read <= np.float32(receiver.least), receiver.least, np.minimum(read.astype(np.float64), receiver.most)
    )
    for sonar in np.flatnonzero(receiver.wanted[:-1]):
        sensed[sonar, which] = reported[sonar]
    if receiver.wanted[-1]:
        sensed[-1, which] = reported[receiver.front].min(axis=0)
