"""Numbers from texts and texts from numbers, each to the last bit. Loaded for one number and let go again.

The firmware's own reading of a number is now and then one unit of the last place off, and its writing is not always the
shortest. Both go by whole numbers here, which are exact: a number is `n / d`, and their quotient is rounded, half to
even. Digits beyond `_MOST` cannot decide anything but that there are more.
"""

import math

from micropython import const

_MOST = const(800)
_LOW = const(1074)
"""Binary places behind the point that a number has at most."""
_SURE = const(15)
"""Digits that every number of full precision has: the shortest text is found by leaving out their zeros."""


def nearest(digits, power):
    """The number nearest to so many times 10 ** power. digits: as text."""
    digits = digits.lstrip("0")
    if len(digits) > _MOST:
        rest = digits[_MOST:].strip("0")
        power += len(digits) - _MOST
        digits = digits[:_MOST]
        if rest:
            digits, power = digits + "1", power - 1
    size = len(digits) + power
    if not digits or size < -330:
        return 0.0
    if size > 310:
        return math.inf
    n, d = int(digits) * 10 ** max(power, 0), 10 ** max(-power, 0)
    shift, step = 53 - size * 10 // 3, 0
    while True:  # until the quotient has 53 bits, or all places that there are
        shift = min(shift, _LOW)
        value, rest = _divided(n << max(shift, 0), d << max(-shift, 0))
        step = -1 if value >> 53 else 0 if value >> 52 or shift == _LOW else 1
        if not step:
            break
        shift += step
    value = _rounded(value, rest, d << max(-shift, 0))
    if shift < -971 or (shift == -971 and value >> 53):
        return math.inf
    return math.ldexp(float(value), -shift)


def _divided(n, d):
    value = n // d
    return value, n - value * d


def _rounded(value, rest, d):
    rest += rest
    return value + (rest > d or (rest == d and value & 1))


def _digits(value, count):
    """The first so many digits of a positive number, as a whole number, and the power of ten of the first one."""
    value, power = math.frexp(value)
    n, power = int(math.ldexp(value, 53)), power - 53
    n, d = n << max(power, 0), 1 << max(-power, 0)
    power = len(str(n)) - len(str(d))
    if n * 10 ** max(-power, 0) < d * 10 ** max(power, 0):
        power -= 1
    shift = count - 1 - power
    d *= 10 ** max(-shift, 0)
    value = _rounded(*_divided(n * 10 ** max(shift, 0), d), d)
    return (value // 10, power + 1) if value == 10**count else (value, power)


def shortest(value):
    """The shortest text that reads back to this finite number, as every other node writes it."""
    sign, value = "-" if math.copysign(1.0, value) < 0 else "", abs(value)
    if value == 0:
        return sign + "0.0"
    for count in range(_SURE if value > 1e-300 else 1, 18):
        digits, power = _digits(value, count)
        for each in (digits, digits - 1, digits + 1):
            if nearest(str(each), power + 1 - count) == value:
                return sign + _placed(str(each).rstrip("0"), power, 16)
    return sign + repr(value)


def general(value):
    """Its first six digits, as in faults."""
    if value == 0 or value - value != 0:
        return "%g" % value
    digits, power = _digits(abs(value), 6)
    return ("-" if value < 0 else "") + _placed(str(digits).rstrip("0"), power, 6, "")


def _placed(digits, power, most, end=".0"):
    """Digits with their point; power: of ten, of the first one. end: behind a whole number."""
    if -4 <= power < most:
        if power < 0:
            return "0." + "0" * (-1 - power) + digits
        digits += "0" * (power + 1 - len(digits))
        return digits[: power + 1] + ("." + digits[power + 1 :] if len(digits) > power + 1 else end)
    return "%s%se%s%02d" % (digits[0], "." + digits[1:] if digits[1:] else "", "-" if power < 0 else "+", abs(power))
