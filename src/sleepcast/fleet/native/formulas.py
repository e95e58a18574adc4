"""Formulas: the built-in functions of numbers as native code, with the results of `pure` to the last bit.

Each takes known numbers; where the function has no finite value, or leaves a case to the walk, the result is not
finite. Functions that need the C library are called lane by lane, for the lanes that reach them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial, reduce
from itertools import combinations, pairwise

from sleepcast.fleet.native import libm
from sleepcast.fleet.native.assembly import Assembly
from sleepcast.language import numerics
from sleepcast.language.functions import TWO_PI
from sleepcast.language.parts import Part

ORDERED = {"<": "olt", "<=": "ole", ">": "ogt", ">=": "oge", "=": "oeq", "EQ": "oeq"}
TRUTHS = frozenset({*ORDERED, "/=", "NOT"})
"""Functions that return a truth and never a fault."""
MAX_DIFFERENT = 8
"""Arguments of /=, at most: each is compared with each."""

Formula = Callable[[Assembly, Sequence[str], str], str]
"""Takes the numbers and the lanes that reach it."""


def is_known(part: Part) -> bool:
    """Whether there is native code for a pure part."""
    name = part.function.name
    if name in TRUTHS:
        return name != "/=" or len(part.parts) <= MAX_DIFFERENT
    return name in FORMULAS and (name not in _NEEDS or libm.address(_NEEDS[name]) is not None)


def has_logarithm() -> bool:
    """Whether there is native code for functions that need a logarithm."""
    return libm.address("log") is not None


def holds(a: Assembly, name: str, numbers: Sequence[str]) -> str:
    """Where a test of known numbers holds."""
    if name == "NOT":
        return a.compare("oeq", numbers[0], a.zero)
    if name == "/=":
        return reduce(a.both, (a.compare("one", x, y) for x, y in combinations(numbers, 2)), a.yes)
    return reduce(a.both, (a.compare(ORDERED[name], x, y) for x, y in pairwise(numbers)), a.yes)


def each(name: str, a: Assembly, numbers: Sequence[str], mask: str) -> str:
    """A function of the C library, called for each lane of the mask; 0 in the others."""
    own = f"each_{name}"
    if own not in a.outside:
        a.outside[name] = f"declare double @{libm.symbol(name)}({', '.join(['double'] * len(numbers))})"
        a.outside[own] = _each(a, name, len(numbers))
    lanes = f"i{a.lanes}"
    flags = mask if a.lanes == 1 else a.convert("bitcast", a.truth, mask, lanes)
    return a.call(own, a.real, [*numbers, flags], [*[a.real] * len(numbers), lanes])


def _each(a: Assembly, name: str, count: int) -> str:
    """The text of such a function: one branch per lane, taken if its bit is set."""
    given = "".join(f"{a.real} %a{i}, " for i in range(count))
    lines = [f"define internal {a.real} @each_{name}({given}i{a.lanes} %mask) noinline {{", "entry:"]
    before, value = "entry", a.zero
    for lane in range(a.lanes):
        lines += [f"%m{lane} = and i{a.lanes} %mask, {1 << lane if a.lanes > 1 else 'true'}"]
        lines += [f"%t{lane} = icmp ne i{a.lanes} %m{lane}, 0"]
        lines += [f"br i1 %t{lane}, label %in{lane}, label %after{lane}", f"in{lane}:"]
        numbers = [f"%x{i}_{lane}" if a.lanes > 1 else f"%a{i}" for i in range(count)]
        if a.lanes > 1:
            lines += [f"{x} = extractelement {a.real} %a{i}, i32 {lane}" for i, x in enumerate(numbers)]
        lines += [f"%r{lane} = call double @{libm.symbol(name)}({', '.join(f'double {x}' for x in numbers)})"]
        result = f"%r{lane}"
        if a.lanes > 1:
            result = f"%s{lane}"
            lines += [f"{result} = insertelement {a.real} {value}, double %r{lane}, i32 {lane}"]
        lines += [f"br label %after{lane}", f"after{lane}:"]
        lines += [f"%v{lane} = phi {a.real} [ {value}, %{before} ], [ {result}, %in{lane} ]"]
        before, value = f"after{lane}", f"%v{lane}"
    return "\n".join([*lines, f"ret {a.real} {value}", "}"])


def quantile(a: Assembly, u: str, mask: str) -> str:
    """The standard normal quantile of `u` in [0, 1), see `language.numerics.normal`."""
    u = a.select(a.compare("oeq", u, a.zero), a.number(2.0**-54), u)
    q = a.binary("fsub", a.real, u, a.number(0.5))
    centre = a.compare("ole", a.intrinsic("fabs", q), a.number(0.425))
    r = a.binary("fsub", a.real, a.number(0.180625), a.binary("fmul", a.real, q, q))
    top = a.binary("fmul", a.real, q, _polynomial(a, numerics.CENTRE_TOP, r))
    result = a.cell(a.real, a.binary("fdiv", a.real, top, _polynomial(a, numerics.CENTRE_BOTTOM, r)))
    outside = a.both(mask, a.neither(centre))
    with a.when(a.any(outside)):
        a.put(result, a.real, a.select(outside, _tail(a, u, q, outside), a.get(result, a.real)))
    return a.get(result, a.real)


def _tail(a: Assembly, u: str, q: str, mask: str) -> str:
    low = a.compare("olt", q, a.zero)
    near = a.select(low, u, a.binary("fsub", a.real, a.one, u))
    r = a.intrinsic("sqrt", a.emit(f"fneg {a.real} {each('log', a, [near], mask)}"))
    sizes = []
    for shift, top, bottom in (
        (1.6, numerics.MIDDLE_TOP, numerics.MIDDLE_BOTTOM),
        (5.0, numerics.TAIL_TOP, numerics.TAIL_BOTTOM),
    ):
        x = a.binary("fsub", a.real, r, a.number(shift))
        sizes.append(a.binary("fdiv", a.real, _polynomial(a, top, x), _polynomial(a, bottom, x)))
    size = a.select(a.compare("ole", r, a.number(5.0)), *sizes)
    return a.select(low, a.emit(f"fneg {a.real} {size}"), size)


def _polynomial(a: Assembly, coefficients: Sequence[float], x: str) -> str:
    total = a.number(coefficients[0])
    for c in coefficients[1:]:
        total = a.binary("fadd", a.real, a.binary("fmul", a.real, total, x), a.number(c))
    return total


def _fold(operation: str, empty: float, a: Assembly, numbers: Sequence[str], mask: str) -> str:
    match operation, len(numbers):
        case _, 0:
            return a.number(empty)
        case "fsub", 1:
            return a.emit(f"fneg {a.real} {numbers[0]}")
        case "fdiv", 1:
            return a.binary("fdiv", a.real, a.one, numbers[0])
        case _:
            return reduce(partial(a.binary, operation, a.real), numbers)


def _pick(how: str, a: Assembly, numbers: Sequence[str], mask: str) -> str:
    return reduce(lambda best, x: a.select(a.compare(how, x, best), x, best), numbers)


def _bearing(a: Assembly, n: Sequence[str], mask: str) -> str:
    return _angle(a, [a.binary("fsub", a.real, n[3], n[1]), a.binary("fsub", a.real, n[2], n[0])], mask)


def _angle(a: Assembly, n: Sequence[str], mask: str) -> str:
    """See `language.numerics.angle`, step by step."""
    y, x = n
    width, height = a.intrinsic("fabs", x), a.intrinsic("fabs", y)
    swapped = a.compare("olt", width, height)
    behind = a.compare("olt", a.intrinsic("copysign", a.one, x), a.zero)
    low, high = a.select(swapped, width, height), a.select(swapped, height, width)
    scale = a.select(a.compare("ogt", high, a.number(numerics.HUGE)), a.number(0.25), a.one)
    low, high = (a.binary("fmul", a.real, scale, each) for each in (low, high))
    steep = a.compare("ogt", low, a.binary("fmul", a.real, a.number(numerics.STEEP), high))
    flat = a.select(a.compare("oeq", high, a.zero), a.one, high)
    bottom = a.select(steep, a.binary("fadd", a.real, low, high), flat)
    t = a.binary("fdiv", a.real, a.select(steep, a.binary("fsub", a.real, low, high), low), bottom)
    z = a.binary("fmul", a.real, t, t)
    rest = a.binary("fmul", a.real, t, a.binary("fmul", a.real, z, _polynomial(a, numerics.COEFFICIENTS, z)))
    turned = a.binary("xor", a.truth, swapped, behind)
    t, rest = (a.select(turned, a.emit(f"fneg {a.real} {each}"), each) for each in (t, rest))
    base, tail = (_eighths(a, steep, swapped, behind, values) for values in (numerics.EIGHTHS, numerics.TAILS))
    angle = a.binary("fadd", a.real, base, a.binary("fadd", a.real, t, a.binary("fadd", a.real, rest, tail)))
    return a.intrinsic("copysign", angle, y)


def _eighths(a: Assembly, steep: str, swapped: str, behind: str, values: Sequence[float]) -> str:
    v = [a.number(value) for value in values]
    flat = a.select(swapped, v[2], a.select(behind, v[4], v[0]))
    return a.select(steep, a.select(behind, v[3], v[1]), flat)


def _distance(a: Assembly, n: Sequence[str], mask: str) -> str:
    half = len(n) // 2
    ways = [a.binary("fsub", a.real, one, other) for one, other in zip(n[:half], n[half:], strict=True)]
    total, *others = [a.binary("fmul", a.real, way, way) for way in ways]
    for square in others:
        total = a.binary("fadd", a.real, total, square)
    return a.intrinsic("sqrt", total)


def _mod(a: Assembly, n: Sequence[str], mask: str) -> str:
    """The remainder with the sign of the divisor, as Python's `%`; for a smaller dividend it is the dividend itself."""
    number, divisor = n
    small = a.compare("olt", a.intrinsic("fabs", number), a.intrinsic("fabs", divisor))
    remainder = a.cell(a.real, number)
    large = a.both(mask, a.neither(small))
    with a.when(a.any(large)):
        a.put(remainder, a.real, a.select(large, each("fmod", a, n, large), number))
    rest = a.get(remainder, a.real)
    apart = a.binary("xor", a.truth, a.compare("olt", divisor, a.zero), a.compare("olt", rest, a.zero))
    turned = a.select(apart, a.binary("fadd", a.real, rest, divisor), rest)
    return a.select(a.compare("oeq", rest, a.zero), a.intrinsic("copysign", a.zero, divisor), turned)


def _wrap(a: Assembly, n: Sequence[str], mask: str) -> str:
    full = a.number(TWO_PI)
    turned = _mod(a, [n[0], full], mask)
    return a.select(a.compare("ogt", turned, a.number(math.pi)), a.binary("fsub", a.real, turned, full), turned)


def _clamp(a: Assembly, n: Sequence[str], mask: str) -> str:
    value, low, high = n
    above = a.select(a.compare("ogt", value, high), high, value)
    raised = a.select(a.compare("olt", value, low), low, above)
    return a.select(a.compare("ogt", low, high), a.nan, raised)


def _edge_distance(a: Assembly, n: Sequence[str], mask: str) -> str:
    """See `language.functions`, step by step."""

    def of(operation: str, x: str, y: str) -> str:
        return a.binary(f"f{operation}", a.real, x, y)

    def sum_of_products(operation: str, x: str, y: str, z: str, w: str) -> str:
        return of(operation, of("mul", x, y), of("mul", z, w))

    px, py, x0, y0 = n[0], n[1], n[-2], n[-1]
    nearest, sign = a.number(math.inf), a.number(-1.0)
    for x1, y1 in zip(n[2::2], n[3::2], strict=True):
        dx, dy, from_x, from_y = of("sub", x1, x0), of("sub", y1, y0), of("sub", px, x0), of("sub", py, y0)
        square = sum_of_products("add", dx, dx, dy, dy)
        along = sum_of_products("add", from_x, dx, from_y, dy)
        t = of("div", along, a.select(a.compare("oeq", square, a.zero), a.one, square))
        t = a.select(a.compare("olt", t, a.zero), a.zero, a.select(a.compare("ogt", t, a.one), a.one, t))
        out_x, out_y = of("sub", from_x, of("mul", t, dx)), of("sub", from_y, of("mul", t, dy))
        away = sum_of_products("add", out_x, out_x, out_y, out_y)
        nearest = a.select(a.compare("olt", away, nearest), away, nearest)
        west = sum_of_products("sub", from_x, dy, from_y, dx)
        starts, ends = a.compare("ole", y0, py), a.compare("ole", y1, py)
        rising = a.both(a.both(starts, a.neither(ends)), a.compare("olt", west, a.zero))
        falling = a.both(a.both(ends, a.neither(starts)), a.neither(a.compare("olt", west, a.zero)))
        sign = a.select(a.either(rising, falling), a.emit(f"fneg {a.real} {sign}"), sign)
        x0, y0 = x1, y1
    return of("add", of("mul", sign, a.intrinsic("sqrt", nearest)), a.zero)


def _whole(name: str, a: Assembly, n: Sequence[str], mask: str) -> str:
    """Adding 0 turns -0 into 0, see `pure`."""
    return a.binary("fadd", a.real, a.intrinsic(name, n[0]), a.zero)


FORMULAS: dict[str, Formula] = {
    "+": partial(_fold, "fadd", 0.0),
    "-": partial(_fold, "fsub", 0.0),
    "*": partial(_fold, "fmul", 1.0),
    "/": partial(_fold, "fdiv", 1.0),
    "MIN": partial(_pick, "olt"),
    "MAX": partial(_pick, "ogt"),
    "ABS": lambda a, n, mask: a.intrinsic("fabs", n[0]),
    "SQRT": lambda a, n, mask: a.intrinsic("sqrt", n[0]),
    "FLOOR": partial(_whole, "floor"),
    "CEIL": partial(_whole, "ceil"),
    "ROUND": partial(_whole, "rint"),
    "DIST": _distance,
    "CLAMP": _clamp,
    "MOD": _mod,
    "EDGE-DIST": _edge_distance,
    "WRAP": _wrap,
    "BEARING": _bearing,
    "ATAN2": _angle,
    "^": partial(each, "pow"),
    "EXP": partial(each, "exp"),
    "LOG": partial(each, "log"),
    "SIN": partial(each, "sin"),
    "COS": partial(each, "cos"),
    "TAN": partial(each, "tan"),
}
"""Every function of numbers by name."""

_NEEDS = {
    "MOD": "fmod",
    "WRAP": "fmod",
    "^": "pow",
    "EXP": "exp",
    "LOG": "log",
    "SIN": "sin",
    "COS": "cos",
    "TAN": "tan",
}
"""The function of the C library that each needs."""
COSTLY = frozenset({*_NEEDS, "BEARING", "ATAN2"})
"""Functions that are skipped if no lane reaches them."""
