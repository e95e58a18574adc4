"""The built-in functions of numbers over columns, with the results of the one-robot machine to the last bit.

A function here only needs to be right for finite numbers with a finite result: wherever it gives NaN or infinity, or
an argument is unknown, `apply` decides robot by robot with the language's own function, which also names the reason
of a fault.

Sums, products, quotients, square roots and remainders are equally exact in NumPy and in the C library. NumPy's own
logarithms, powers and sines may differ from the C library's in the last bit, depending on the processor, so those
functions are called one number at a time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from sleepcast.columns.values import Column, Index, Mask
from sleepcast.language.functions import TWO_PI
from sleepcast.language.numerics import COEFFICIENTS, EIGHTHS, HUGE, STEEP, TAILS
from sleepcast.language.parts import Part

Argument: TypeAlias = Column | float
"""A column, or one number for all; of several arguments at least one is a column."""
Compute: TypeAlias = Callable[[Sequence[Argument]], Argument]
Report: TypeAlias = Callable[[Index, Sequence[str]], None]
"""Takes the rows that met a fault, ascending, and the reason of each."""


def apply(part: Part, arguments: Sequence[Argument], size: int, report: Report) -> Column:
    """A pure function of `size` rows: unknown if an argument is; a fault if the result is undefined or not finite."""
    name = part.function.name
    computed = np.asarray(VECTOR[name](arguments), np.float64)
    values = np.full(size, float(computed.item())) if computed.size == 1 else computed
    if name in TRUTHS:
        for argument in arguments:
            unknown = np.isnan(argument)
            if unknown.any():
                values[unknown] = np.nan
        return values
    doubtful = ~np.isfinite(values)
    if doubtful.any():
        _decide(part, arguments, values, doubtful, report)
    return values


def _decide(part: Part, arguments: Sequence[Argument], values: Column, doubtful: Mask, report: Report) -> None:
    """Compute the doubtful rows one by one, in place."""
    compute = part.function.compute
    if compute is None:
        raise TypeError(f"{part.name} computes nothing")
    columns = [np.broadcast_to(np.asarray(argument, np.float64), values.shape) for argument in arguments]
    for column in columns:
        values[np.isnan(column)] = np.nan
        doubtful &= ~np.isnan(column)
    rows = np.flatnonzero(doubtful)
    if rows.size == 0:
        return
    numbers = np.array([column[rows] for column in columns])
    bits = numbers.view(np.int64)
    alike = bool((bits == bits[:, :1]).all())  # values that are the same on all robots are computed once
    settled = [_settled(compute, arguments) for arguments in numbers[:, : 1 if alike else None].T.tolist()]
    settled *= rows.size if alike else 1
    values[rows] = [value for value, _ in settled]
    wrong = np.isnan(values[rows])
    report(rows[wrong], [reason for _, reason in settled if reason])


def _settled(compute: Callable[[Sequence[float]], float], arguments: Sequence[float]) -> tuple[float, str]:
    """The value, and ""; or NaN, and the reason."""
    reason = "overflow"
    try:
        value = compute(arguments)
    except OverflowError:
        value = math.inf
    except (ArithmeticError, ValueError) as error:
        value, reason = math.inf, str(error)
    return (value, "") if math.isfinite(value) else (math.nan, reason)


def _fold(operation: np.ufunc, empty: float, one: Callable[[Argument], Argument]) -> Compute:
    def folded(arguments: Sequence[Argument]) -> Argument:
        if len(arguments) < 2:
            return one(arguments[0]) if arguments else empty
        total: Argument = operation(arguments[0], arguments[1])
        for argument in arguments[2:]:
            total = operation(total, argument)
        return total

    return folded


def _pick(better: np.ufunc) -> Compute:
    """MIN and MAX: the first of equal values, so that 0 and -0 are told apart by their order."""

    def picked(arguments: Sequence[Argument]) -> Argument:
        best = np.array(arguments[0])
        for argument in arguments[1:]:
            best = np.where(better(argument, best) | np.isnan(argument), argument, best)
        return best

    return picked


def _one_by_one(compute: Callable[..., float]) -> Compute:
    """A function of the C library, called for each row; NaN where it raises."""

    def safely(*numbers: float) -> float:
        try:
            return compute(*numbers)
        except (ArithmeticError, ValueError):
            return math.nan

    def each(arguments: Sequence[Argument]) -> Argument:
        columns = [column.tolist() for column in np.broadcast_arrays(*map(np.atleast_1d, arguments))]
        try:
            results = list(map(compute, *columns))
        except (ArithmeticError, ValueError):
            results = list(map(safely, *columns))
        return np.array(results)

    return each


def _power(a: Sequence[Argument]) -> Argument:
    powers = _POWER(a)
    return np.where(np.isnan(a[0]) | np.isnan(a[1]), np.nan, powers)  # the C library gives 1 for NaN to the power 0


def _distance(a: Sequence[Argument]) -> Argument:
    half = len(a) // 2
    dx, dy = np.subtract(a[0], a[half]), np.subtract(a[1], a[half + 1])
    squares: Argument = dx * dx + dy * dy
    if half == 3:
        dz = np.subtract(a[2], a[5])
        squares = squares + dz * dz
    distance: Argument = np.sqrt(squares)
    return distance


def _edge_distance(a: Sequence[Argument]) -> Argument:
    px, py, x0, y0 = a[0], a[1], a[-2], a[-1]
    nearest: Argument = math.inf
    sign: Argument = -1.0
    for x1, y1 in zip(a[2::2], a[3::2], strict=True):
        dx, dy, from_x, from_y = x1 - x0, y1 - y0, px - x0, py - y0
        square = dx * dx + dy * dy
        t = (from_x * dx + from_y * dy) / np.where(np.equal(square, 0.0), 1.0, square)
        t = np.where(t < 0.0, 0.0, np.where(t > 1.0, 1.0, t))
        out_x, out_y = from_x - t * dx, from_y - t * dy
        nearest = np.minimum(nearest, out_x * out_x + out_y * out_y)
        between = np.less_equal(y0, py) != np.less_equal(y1, py)
        west = np.less(from_x * dy, from_y * dx) == np.greater(dy, 0.0)
        sign = np.where(between & west, np.negative(sign), sign)
        x0, y0 = x1, y1
    distance: Argument = sign * np.sqrt(nearest) + 0.0
    return distance


def _angle(a: Sequence[Argument]) -> Argument:
    """See `language.numerics.angle`, step by step."""
    y, x = a
    width, height = np.abs(x), np.abs(y)
    swapped, behind = np.less(width, height), np.copysign(1.0, x) < 0.0
    low, high = np.minimum(width, height), np.maximum(width, height)
    scale = np.where(high > HUGE, 0.25, 1.0)
    low, high = scale * low, scale * high
    steep = low > STEEP * high
    bottom = np.where(steep, low + high, np.where(high == 0.0, 1.0, high))
    t = np.where(steep, low - high, low) / bottom
    eighths = np.where(steep, np.where(behind, 3, 1), np.where(swapped, 2, np.where(behind, 4, 0)))
    z = t * t
    total: Argument = COEFFICIENTS[0]
    for c in COEFFICIENTS[1:]:
        total = total * z + c
    turned = np.where(swapped != behind, -1.0, 1.0)
    rest = turned * (t * (z * total))
    angle: Argument = np.copysign(_EIGHTHS[eighths] + (turned * t + (rest + _TAILS[eighths])), y)
    return angle


def _wrap(a: Sequence[Argument]) -> Argument:
    turned = np.remainder(a[0], TWO_PI)
    return np.where(turned > math.pi, turned - TWO_PI, turned)


def _clamp(a: Sequence[Argument]) -> Argument:
    value, low, high = a
    clamped = np.where(np.less(value, low), low, np.where(np.greater(value, high), high, value))
    return np.where(np.less_equal(low, high), clamped, np.nan)


def _chain(holds: np.ufunc) -> Compute:
    def compare(a: Sequence[Argument]) -> Argument:
        if len(a) == 2:
            both: Argument = holds(a[0], a[1])
            return both
        truths: Argument = 1.0
        for x, y in pairwise(a):
            truths = np.multiply(truths, holds(x, y))
        return truths

    return compare


def _all_different(a: Sequence[Argument]) -> Argument:
    ordered = np.sort(np.stack(np.broadcast_arrays(*map(np.atleast_1d, a))), axis=0)
    truths: Argument = np.all(ordered[1:] != ordered[:-1], axis=0)
    return truths


_POWER = _one_by_one(math.pow)
_EQUAL = _chain(np.equal)
_EIGHTHS, _TAILS = np.array(EIGHTHS), np.array(TAILS)

VECTOR: dict[str, Compute] = {
    "+": _fold(np.add, 0.0, np.array),
    "-": _fold(np.subtract, 0.0, np.negative),
    "*": _fold(np.multiply, 1.0, np.array),
    "/": _fold(np.divide, 1.0, lambda x: np.divide(1.0, x)),
    "^": _power,
    "MOD": lambda a: np.remainder(a[0], a[1]),
    "ABS": lambda a: np.abs(a[0]),
    "MIN": _pick(np.less),
    "MAX": _pick(np.greater),
    "SQRT": lambda a: np.sqrt(a[0]),
    "EXP": _one_by_one(math.exp),
    "LOG": _one_by_one(math.log),
    "SIN": _one_by_one(math.sin),
    "COS": _one_by_one(math.cos),
    "TAN": _one_by_one(math.tan),
    "ATAN2": _angle,
    # Adding 0 turns -0 into 0: the language's own functions go through integers, which have no -0.
    "FLOOR": lambda a: np.floor(a[0]) + 0.0,
    "CEIL": lambda a: np.ceil(a[0]) + 0.0,
    "ROUND": lambda a: np.rint(a[0]) + 0.0,
    "DIST": _distance,
    "BEARING": lambda a: _angle((np.subtract(a[3], a[1]), np.subtract(a[2], a[0]))),
    "EDGE-DIST": _edge_distance,
    "WRAP": _wrap,
    "CLAMP": _clamp,
    "=": _EQUAL,
    "EQ": _EQUAL,
    "/=": _all_different,
    "<": _chain(np.less),
    "<=": _chain(np.less_equal),
    ">": _chain(np.greater),
    ">=": _chain(np.greater_equal),
    "NOT": lambda a: np.equal(a[0], 0.0),
}
"""Every pure function by name."""

TESTS: dict[str, np.ufunc] = {
    "=": np.equal,
    "EQ": np.equal,
    "<": np.less,
    "<=": np.less_equal,
    ">": np.greater,
    ">=": np.greater_equal,
}
"""Comparisons of two values that do not hold if either is unknown, without further checks."""

TRUTHS = frozenset({*TESTS, "/=", "NOT"})
"""Functions that return 1 or 0 and never a fault."""
