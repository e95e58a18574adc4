"""The angle of a point, of sums, products and quotients alone: the same bits on every machine, whatever its C library.

Rules ask for it at every tick - where is my goal? - and C libraries differ in its last bit, even from processor to
processor. The point is turned and mirrored into the eighth of the plane above the x axis, and from there, if it lies
beyond half of that, down by an eighth of a turn, so that the tangent t is 0.42 at most; there
arctan t = t + t^3 p(t^2), where p interpolates at the nodes of Chebyshev on [0, 0.1716]. The error is below one unit in
the last place.
"""

from __future__ import annotations

from math import copysign

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
    across, up = abs(x), abs(y)
    swapped, behind = across < up, copysign(1.0, x) < 0.0
    low, high = (across, up) if swapped else (up, across)
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
