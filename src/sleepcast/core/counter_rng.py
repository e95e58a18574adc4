"""Chance for many at once: numbers that depend on what they are for, never on when or in which order they are
drawn.

A draw hashes a key (who draws, in which run, for what) and a counter with the finaliser of SplitMix64
(Steele, Lea and Flood, OOPSLA 2014), on arrays of unsigned 64-bit integers, where overflow wraps.
"""

from __future__ import annotations

from hashlib import blake2b

import numpy as np
from numpy.typing import NDArray

GOLDEN = 0x9E37_79B9_7F4A_7C15
"""The odd number nearest to 2**64 divided by the golden ratio: it spreads neighbouring counters."""
_UNIT = 2.0**-53


def key(*what: object) -> int:
    """A 64-bit key from whatever tells one purpose of chance from another, by its text."""
    return int.from_bytes(blake2b(repr(what).encode(), digest_size=8).digest(), "little")


def uniform(key: int | NDArray[np.uint64], counters: NDArray[np.uint64]) -> NDArray[np.float64]:
    """Numbers evenly from [0, 1), float64, one for each of `counters` (uint64, any shape), with 53 random
    bits. key: one for all of them, or one for each."""
    bits = mix(counters * np.uint64(GOLDEN) + (np.uint64(key) if isinstance(key, int) else key))
    return (bits >> np.uint64(11)).astype(np.float64) * _UNIT


def mix(bits: NDArray[np.uint64]) -> NDArray[np.uint64]:
    """The finaliser of SplitMix64 on each element; the argument is left as it was."""
    bits = (bits ^ (bits >> np.uint64(30))) * np.uint64(0xBF58_476D_1CE4_E5B9)
    bits = (bits ^ (bits >> np.uint64(27))) * np.uint64(0x94D0_49BB_1331_11EB)
    return bits ^ (bits >> np.uint64(31))
