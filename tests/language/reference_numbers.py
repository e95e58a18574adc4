"""What the pure functions of the reference compute: known, finite numbers in, a number out or no value at all."""

from __future__ import annotations

import math
import operator
from collections.abc import Callable
from functools import reduce
from itertools import combinations, pairwise

from sleepcast.language.numerics import angle


class Undefined(Exception):
    """A function has no value for these numbers; the text is the reason of the fault."""


def truth(condition: bool) -> float:
    return 1.0 if condition else 0.0


def divided(x: float, y: float) -> float:
    if y == 0:
        raise Undefined("division by zero")
    return x / y


def remainder(x: float, y: float) -> float:
    if y == 0:
        raise Undefined("division by zero")
    return x % y


def power(x: float, y: float) -> float:
    try:
        return math.pow(x, y)
    except ValueError:
        raise Undefined("to the power") from None


def square_root(x: float) -> float:
    if x < 0:
        raise Undefined("square root of")
    return math.sqrt(x)


def logarithm(x: float) -> float:
    if x <= 0:
        raise Undefined("logarithm of")
    return math.log(x)


def distance(*places: float) -> float:
    half, squares = len(places) // 2, 0.0
    for one, other in zip(places[:half], places[half:], strict=True):
        squares += (one - other) * (one - other)
    return math.sqrt(squares)


def wrapped(angle: float) -> float:
    turned = angle % (2 * math.pi)
    return turned - 2 * math.pi if turned > math.pi else turned


def clamped(x: float, low: float, high: float) -> float:
    if low > high:
        raise Undefined("CLAMP")
    if x < low:
        return low
    if x > high:
        return high
    return x


def edge_distance(x: float, y: float, *corners: float) -> float:
    """By its definition: to the nearest point of any side; inside if a ray to the east meets an odd number of them."""
    points = list(zip(corners[::2], corners[1::2], strict=True))
    sides = list(zip((points[-1], *points), points, strict=False))
    squares, crossed = [math.inf], 0
    for (x0, y0), (x1, y1) in sides:
        dx, dy = x1 - x0, y1 - y0
        length = dx * dx + dy * dy
        share = ((x - x0) * dx + (y - y0) * dy) / (length if length != 0 else 1.0)
        share = 0.0 if share < 0 else 1.0 if share > 1 else share
        away_x, away_y = (x - x0) - share * dx, (y - y0) - share * dy
        squares.append(away_x * away_x + away_y * away_y)
        if y0 <= y < y1:
            crossed += (x - x0) * dy < (y - y0) * dx
        elif y1 <= y < y0:
            crossed += not (x - x0) * dy < (y - y0) * dx
    away = math.sqrt(min(each for each in squares if not math.isnan(each)))
    return (away if crossed % 2 else -away) + 0.0


def chain(holds: Callable[[float, float], bool]) -> Callable[..., float]:
    return lambda *xs: truth(all(holds(x, y) for x, y in pairwise(xs)))


PURE: dict[str, Callable[..., float]] = {
    "+": lambda *xs: reduce(operator.add, xs) if xs else 0.0,
    "-": lambda *xs: reduce(operator.sub, xs) if len(xs) > 1 else -xs[0],
    "*": lambda *xs: reduce(operator.mul, xs) if xs else 1.0,
    "/": lambda *xs: reduce(divided, xs) if len(xs) > 1 else divided(1.0, xs[0]),
    "^": power,
    "mod": remainder,
    "abs": abs,
    "min": lambda *xs: min(xs),
    "max": lambda *xs: max(xs),
    "sqrt": square_root,
    "exp": math.exp,
    "log": logarithm,
    "sin": math.sin,
    "cos": math.cos,
    "tan": math.tan,
    "atan2": angle,
    "floor": lambda x: float(math.floor(x)),
    "ceil": lambda x: float(math.ceil(x)),
    "round": lambda x: float(round(x)),
    "dist": distance,
    "bearing": lambda x1, y1, x2, y2: angle(y2 - y1, x2 - x1),
    "wrap": wrapped,
    "clamp": clamped,
    "edge-dist": edge_distance,
    "=": chain(operator.eq),
    "eq": chain(operator.eq),
    "/=": lambda *xs: truth(all(x != y for x, y in combinations(xs, 2))),
    "<": chain(operator.lt),
    "<=": chain(operator.le),
    ">": chain(operator.gt),
    ">=": chain(operator.ge),
    "not": lambda x: truth(x == 0),
}
