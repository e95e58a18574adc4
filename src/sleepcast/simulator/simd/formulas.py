"""Formulas that give the same bits on every processor: for arrays, and for single numbers in compiled kernels.

They use only additions, multiplications, divisions, roots and comparisons, which IEEE 754 rounds correctly
everywhere, in a fixed order; NumPy's own sines and logarithms depend on the processor. Angles in rad.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Floats: TypeAlias = NDArray[np.float64]

LANES = 16
"""Numbers that kernels process at once, see `vectors`."""
TURN = 2.0 * np.pi
_QUARTER, _REST = 1.57079632673412561417, 6.07710050650619224932e-11
"""A quarter turn: 33 bits, so that small multiples are exact, and the remainder."""


def either(condition: NDArray[np.bool_], yes: Floats | float, no: Floats | float) -> Floats:
    """`yes` where the condition holds, elsewhere `no`. Kernels have their own version, see `compiled`."""
    return np.where(condition, yes, no)


def sine_cosine(angle: Floats) -> tuple[Floats, Floats]:
    """Sine and cosine, to about one unit in the last place, of an angle of at most some thousand turns (Cody and
    Waite's reduction to an eighth of a turn; Taylor polynomials with adjusted last terms, as in C libraries)."""
    quarters = np.floor(angle * (2.0 / np.pi) + 0.5)
    r = (angle - quarters * _QUARTER) - quarters * _REST
    z, s = r * r, sine_of_rest(r)
    high = 2.48015872894767294178e-05 + z * (
        -2.75573143513906633035e-07 + z * (2.08757232129817482790e-09 + z * -1.13596475577881948265e-11)
    )
    c = 1.0 - (0.5 * z - z * z * (4.16666666666666019037e-02 + z * (-1.38888888888741095749e-03 + z * high)))
    quadrant = quarters - 4.0 * np.floor(quarters * 0.25)
    odd = (quadrant == 1.0) | (quadrant == 3.0)
    sine, cosine = either(odd, c, s), either(odd, s, c)
    return either(quadrant >= 2.0, -sine, sine), either((quadrant == 1.0) | (quadrant == 2.0), -cosine, cosine)


def rotated(dx: Floats, dy: Floats, sine: Floats, cosine: Floats) -> tuple[Floats, Floats]:
    """The vectors (`dx`, `dy`), turned by an angle with this sine and cosine."""
    return dx * cosine - dy * sine, dx * sine + dy * cosine


def sine_of_rest(r: Floats) -> Floats:
    """Sine of an angle of at most an eighth of a turn, positive or negative."""
    z = r * r
    high = -1.98412698298579493134e-04 + z * (
        2.75573137070700676789e-06 + z * (-2.50507602534068634195e-08 + z * 1.58969099521155010221e-10)
    )
    return r + r * z * (-1.66666666666666324348e-01 + z * (8.33333333332248946124e-03 + z * high))


def arc_tangent(dy: Floats, dx: Floats) -> Floats:
    """The angle, -pi..pi, of the vector (`dx`, `dy`), to a few units in the last place; 0 for the zero vector."""
    a, b = np.abs(dx), np.abs(dy)
    swapped = b > a
    low, high = either(swapped, a, b), either(swapped, b, a)
    t = low / either(high > 0.0, high, 1.0)
    t = t / (1.0 + np.sqrt(1.0 + t * t))  # the tangent of half the angle,
    t = t / (1.0 + np.sqrt(1.0 + t * t))  # and of a quarter of it: at most 0.2, where the series is short
    z = t * t
    rest = 1.0 / 13.0 - z * (1.0 / 15.0 - z * (1.0 / 17.0 - z * (1.0 / 19.0 - z / 21.0)))
    rest = 1.0 / 7.0 - z * (1.0 / 9.0 - z * (1.0 / 11.0 - z * rest))
    angle = 4.0 * (t - t * z * (1.0 / 3.0 - z * (1.0 / 5.0 - z * rest)))
    angle = either(swapped, np.pi / 2.0 - angle, angle)
    angle = either(dx < 0.0, np.pi - angle, angle)
    return either(dy < 0.0, -angle, angle)


_LN2, _LN2_REST = 6.93147180369123816490e-01, 1.90821492927058770002e-10
"""The logarithm of 2: 32 bits, so that multiples are exact, and the remainder."""


def exponential(power: Floats) -> Floats:
    """e to this power, to about one unit in the last place: the power of 2 taken out (Cody and Waite), then Taylor's
    series; 0 below -700, where it is smaller than anything that is measured, and as for 700 above."""
    bounded = np.clip(power, -700.0, 700.0)
    twos = np.floor(bounded * (1.0 / (_LN2 + _LN2_REST)) + 0.5)
    r = (bounded - twos * _LN2) - twos * _LN2_REST
    series = np.ones_like(r)
    for n in range(14, 0, -1):
        series = 1.0 + series * (r / n)
    return either(power < -700.0, 0.0, np.ldexp(series, twos.astype(np.int32)))


def square_within(radius: float) -> float:
    """The greatest square whose root, as it is rounded, is at most `radius`: whoever compares squares with it finds
    what is found by comparing distances with `radius`."""
    square = radius * radius * (1.0 + 2.0**-50)
    for _ in range(16):  # each time to the next lower number
        if np.sqrt(square) > radius:
            square = square * (1.0 - 2.0**-53)
    return square


def shortest(way: Floats, around: float) -> Floats:
    """The shortest way between two points that are `way` apart along one axis, m.
    around: the size of a torus, infinite for a plain world."""
    half = around / 2.0
    return either(way > half, way - around, either(way < -half, way + around, way))


def wrap(angle: Floats) -> Floats:
    """The angle wrapped to -pi..pi."""
    return angle - TURN * np.floor((angle + np.pi) / TURN)
