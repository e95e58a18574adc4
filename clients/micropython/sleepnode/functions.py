"""The built-in functions: how many arguments each takes, and what the arithmetic ones compute.

Pure functions take known, finite numbers. Undefined says why there is no value; the machine turns it, and a result that
is not finite, into a fault. What is rarely asked for stands in texts here: they take less memory than tables.
"""

import math

from micropython import const

from sleepnode.reader import general

_MANY = const(100)

_MAX_CORNERS = const(48)
_TWO_PI = 2.0 * math.pi


class Undefined(Exception):
    """A function has no value for these numbers."""


def _subtract(*a):
    if len(a) == 1:
        return -a[0]
    total = a[0]
    for x in a[1:]:
        total -= x
    return total


def _multiply(*a):
    total = a[0] if a else 1.0
    for x in a[1:]:
        total *= x
    return total


def _divide(*a):
    total, rest = (1.0, a) if len(a) == 1 else (a[0], a[1:])
    for x in rest:
        if x == 0:
            raise Undefined("division by zero")
        total /= x
    return total


def _power(x, y):
    if (x == 0 and y < 0) or (x < 0 and y != int(y)):
        raise Undefined("%s to the power %s has no value" % (general(x), general(y)))
    try:
        return math.pow(x, y)
    except (ValueError, OverflowError):
        return math.inf


def _root(x):
    if x < 0:
        raise Undefined("square root of %s" % general(x))
    return math.sqrt(x)


def _logarithm(x):
    if x <= 0:
        raise Undefined("logarithm of %s" % general(x))
    return math.log(x)


def _distance(a, b, x, y):
    dx, dy = a - x, b - y
    return math.sqrt(dx * dx + dy * dy)


def _edge_distance(*a):
    px, py, x0, y0 = a[0], a[1], a[-2], a[-1]
    nearest, sign = math.inf, -1.0
    for at in range(2, len(a), 2):
        x1, y1 = a[at], a[at + 1]
        dx, dy, from_x, from_y = x1 - x0, y1 - y0, px - x0, py - y0
        t = (from_x * dx + from_y * dy) / (dx * dx + dy * dy or 1.0)
        t = 0.0 if t < 0.0 else 1.0 if t > 1.0 else t
        out_x, out_y = from_x - t * dx, from_y - t * dy
        square = out_x * out_x + out_y * out_y
        if square < nearest:
            nearest = square
        if (y0 <= py) != (y1 <= py) and (from_x * dy < from_y * dx) == (dy > 0.0):
            sign = -sign  # a ray to the east crosses this side
        x0, y0 = x1, y1
    return sign * math.sqrt(nearest) + 0.0


def clamp(x, a, b):
    if a > b:
        raise Undefined("CLAMP from %s to %s: the low end is above the high end" % (general(a), general(b)))
    return a if x < a else b if x > b else x


def _all_different(*a):
    for at, x in enumerate(a):
        if x in a[at + 1 :]:
            return 0.0
    return 1.0


def _chain(holds, equal):
    """Whether each number and the next are in order, or perhaps equal."""

    def compare(*a):
        for at in range(len(a) - 1):
            x, y = a[at], a[at + 1]
            if not (equal and x == y) and not (x < y if holds == "<" else holds == ">" and x > y):
                return 0.0
        return 1.0

    return compare


CALLS = (
    lambda *a: sum(a[1:], a[0]) if a else 0.0,
    _subtract,
    _multiply,
    _divide,
    _power,
    lambda x, y: x % y if y else _divide(x, y),
    abs,
    lambda *a: a[0] if len(a) == 1 else min(*a),
    lambda *a: a[0] if len(a) == 1 else max(*a),
    _root,
    math.exp,
    _logarithm,
    math.sin,
    math.cos,
    math.tan,
    math.atan2,
    math.floor,
    math.ceil,
    round,
    _distance,
    lambda a, b, x, y: math.atan2(y - b, x - a),
    _edge_distance,
    lambda x: math.pi - (math.pi - x) % _TWO_PI,
    clamp,
    _chain("", True),
    _all_different,
    _chain("<", False),
    _chain("<", True),
    _chain(">", False),
    _chain(">", True),
    lambda x: 0.0 if x else 1.0,
)
"""The pure functions, in the order of their names below."""

_PURE = const(31)
_ARGUMENTS = const(
    " + 0- - 1- * 0- / 1- ^ 2 mod 2 abs 1 min 1- max 1- sqrt 1 exp 1 log 1 sin 1 cos 1 tan 1 atan2 2 floor 1 ceil 1 "
    "round 1 dist 4 bearing 4 edge-dist 8-98 wrap 1 clamp 3 = 1- /= 1- < 1- <= 1- > 1- >= 1- not 1 eq 1- and 0- or 0- "
    "known 1 cond 0- if 2-3 when 1- progn 0- let 1- dotimes 1- setq 2 setqq 2 defvar 1-2 quote 1 quasiquote 1 "
    "unquote 1 rule 2-4 activate 1 deactivate 1 forget 1 lease 2 defun 3- join 1 leave 1 in 1 prob 1 dice 1- random 2 "
    "gauss 2 sleep 0 wake 0 freeze 0 thaw 0 mark 0 unmark 0 rollback 0 report 1- print 1- tell 1-3 ping 0-1 "
    "area 4-97 inside 1 to-edge 1 once 1- held 2 hysteresis 3 every 1- after 1- within 2 age 1 share 2-3 "
    "after-issue 2 cancel 0 best 4-8 quorum 4-8 "
)
_WORDS = const(" area inside to-edge once held hysteresis every after within age share after-issue cancel best quorum ")


def _find(key):
    return -1 if not key or key[:1].isdigit() else _ARGUMENTS.find(" %s " % key)


def pure_number(key):
    """The number of a pure function; None for a key that is none."""
    at = _find(key)
    number = _ARGUMENTS.count(" ", 0, at) // 2
    return None if at < 0 or number >= _PURE else number


def arguments_of(key):
    """The least and the largest number of arguments of a built-in; None for a key that is none."""
    at = _find(key)
    if at < 0:
        return None
    written = _ARGUMENTS[at + len(key) + 2 : _ARGUMENTS.find(" ", at + len(key) + 2)]
    least, _, most = written.partition("-")
    return int(least), _MANY if written.endswith("-") else int(most or least)


def gives_way(key):
    """Whether a key is the name of a built-in that gives way to names that robots and programs have."""
    return " %s " % key in _WORDS


def is_fixed(key):
    """Whether a key is the name of a built-in and can be nothing else."""
    return arguments_of(key) is not None and not gives_way(key)
