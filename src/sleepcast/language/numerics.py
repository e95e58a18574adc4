"""Chance: a pure function of (seed, robot, tick, draw number), so that a run repeats to the last bit.

Each draw hashes its four numbers with the finaliser of SplitMix64 (Steele, Lea and Flood, OOPSLA 2014), which needs
nothing but 64-bit multiplications and shifts and can be done for a whole fleet at once.
"""

from __future__ import annotations

import math
from math import copysign

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


# ---- the angle of a point, with the same bits on every machine: no C library is asked

STEEP = 0.41421356237309503
"""The tangent of a sixteenth of a turn."""
HUGE = 2.0**1000
"""Coordinates beyond this are quartered, so that their sum is finite."""
COEFFICIENTS = (
    0.016284375050043393,
    -0.03456931506332609,
    0.045515447340221615,
    -0.05230443640686948,
    0.05878927554473807,
    -0.0666642476020052,
    0.07692296368042296,
    -0.09090908753259112,
    0.11111111105150588,
    -0.14285714285659779,
    0.19999999999999804,
    -0.3333333333333333,
)
"""Of p, highest power first."""
EIGHTHS = (0.0, 0.7853981633974483, 1.5707963267948966, 2.356194490192345, 3.141592653589793)
"""So many eighths of a turn, rounded."""
TAILS = (0.0, 3.061616997868383e-17, 6.123233995736766e-17, 9.184850993605148e-17, 1.2246467991473532e-16)
"""What rounding took from them."""


def angle(y: float, x: float) -> float:
    """The angle of the point (x, y) from the x axis, counter-clockwise, rad, -pi..pi; of zeros as C's atan2 has it.

    Unknown, which is no angle, if both are infinite.
    """
    width, height = abs(x), abs(y)
    swapped, behind = width < height, copysign(1.0, x) < 0.0
    low, high = (width, height) if swapped else (height, width)
    if high > HUGE:
        low, high = 0.25 * low, 0.25 * high
    steep = low > STEEP * high
    if steep:
        t = (low - high) / (low + high)
        eighths = 3 if behind else 1
    else:
        t = low / high if high != 0.0 else 0.0
        eighths = 2 if swapped else 4 if behind else 0
    z = t * t
    total = COEFFICIENTS[0]
    for c in COEFFICIENTS[1:]:
        total = total * z + c
    rest = t * (z * total)
    if swapped != behind:
        t, rest = -t, -rest
    return copysign(EIGHTHS[eighths] + (t + (rest + TAILS[eighths])), y)
