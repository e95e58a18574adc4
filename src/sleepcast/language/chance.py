"""Chance: a pure function of (seed, robot, tick, draw number), so that a run repeats to the last bit.

Each draw hashes its four numbers with the finaliser of SplitMix64 (Steele, Lea and Flood, OOPSLA 2014), which needs
nothing but 64-bit multiplications and shifts and can be done for a whole fleet at once.
"""

from __future__ import annotations

import math

MASK = 0xFFFF_FFFF_FFFF_FFFF
GOLDEN = 0x9E37_79B9_7F4A_7C15
UNIT = 2.0**-53


def mix(z: int) -> int:
    """The finaliser of SplitMix64 on a 64-bit integer."""
    z = (z ^ (z >> 30)) * 0xBF58_476D_1CE4_E5B9 & MASK
    z = (z ^ (z >> 27)) * 0x94D0_49BB_1331_11EB & MASK
    return z ^ (z >> 31)


def stream(seed: int, robot: int) -> int:
    """The 64-bit key of one robot's chance in one run; hashed once, not at every draw."""
    return mix((mix(seed + GOLDEN & MASK) + robot * GOLDEN) & MASK)


def draw(key: int, tick: int, number: int) -> float:
    """A number evenly from [0, 1) with 53 bits: draw `number` (from 0) of tick `tick` in the stream `key`."""
    return (mix(mix((key + tick * GOLDEN) & MASK) + number * GOLDEN & MASK) >> 11) * UNIT


def normal(u: float) -> float:
    """The standard normal quantile of `u` in [0, 1) by Wichura's algorithm AS 241 (Applied Statistics 37, 1988).

    The relative error is about 1e-16; u = 0 counts as 2**-54 so that the result is always finite.
    """
    u = u or 2.0**-54
    q = u - 0.5
    if abs(q) <= 0.425:
        r = 0.180625 - q * q
        return q * _polynomial(CENTRE_TOP, r) / _polynomial(CENTRE_BOTTOM, r)
    r = math.sqrt(-math.log(u if q < 0 else 1.0 - u))
    if r <= 5.0:
        r -= 1.6
        size = _polynomial(MIDDLE_TOP, r) / _polynomial(MIDDLE_BOTTOM, r)
    else:
        r -= 5.0
        size = _polynomial(TAIL_TOP, r) / _polynomial(TAIL_BOTTOM, r)
    return -size if q < 0 else size


def _polynomial(coefficients: tuple[float, ...], x: float) -> float:
    total = 0.0
    for c in coefficients:
        total = total * x + c
    return total


# The coefficients of AS 241, numerator and denominator, highest power first: near 1/2, further out, and in the tails.
CENTRE_TOP = (
    2509.0809287301226727,
    33430.575583588128105,
    67265.770927008700853,
    45921.953931549871457,
    13731.693765509461125,
    1971.5909503065514427,
    133.14166789178437745,
    3.387132872796366608,
)
CENTRE_BOTTOM = (
    5226.495278852545925,
    28729.085735721942674,
    39307.89580009271061,
    21213.794301586595867,
    5394.1960214247511077,
    687.1870074920579083,
    42.313330701600911252,
    1.0,
)
MIDDLE_TOP = (
    7.7454501427834140764e-4,
    0.0227238449892691845833,
    0.24178072517745061177,
    1.27045825245236838258,
    3.64784832476320460504,
    5.7694972214606914055,
    4.6303378461565452959,
    1.42343711074968357734,
)
MIDDLE_BOTTOM = (
    1.05075007164441684324e-9,
    5.475938084995344946e-4,
    0.0151986665636164571966,
    0.14810397642748007459,
    0.68976733498510000455,
    1.6763848301838038494,
    2.05319162663775882187,
    1.0,
)
TAIL_TOP = (
    2.01033439929228813265e-7,
    2.71155556874348757815e-5,
    0.0012426609473880784386,
    0.026532189526576123093,
    0.29656057182850489123,
    1.7848265399172913358,
    5.4637849111641143699,
    6.6579046435011037772,
)
TAIL_BOTTOM = (
    2.04426310338993978564e-15,
    1.4215117583164458887e-7,
    1.8463183175100546818e-5,
    7.868691311456132591e-4,
    0.0148753612908506148525,
    0.13692988092273580531,
    0.59983220655588793769,
    1.0,
)
