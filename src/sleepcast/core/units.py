"""Units and dimensions: everything inside is SI; conversion happens when a text is read.

A dimension is a triple of whole exponents (length, time, mass). Angles, fractions and counts have none. The factors
are exact by definition (international foot, statute and nautical mile, knot).
"""

from __future__ import annotations

import math
from functools import cache

from sleepcast.core.records import NamedTuple


class Dimension(NamedTuple):
    """Exponents of metre, second and kilogram."""

    length: int = 0
    time: int = 0
    mass: int = 0

    def __str__(self) -> str:
        if self in _DIMENSION_NAMES:
            return _DIMENSION_NAMES[self]
        parts = [f"{u}^{n}" if n != 1 else u for u, n in zip(("m", "s", "kg"), self, strict=True) if n]
        return "*".join(parts)


NONE = Dimension()
LENGTH = Dimension(length=1)
TIME = Dimension(time=1)
MASS = Dimension(mass=1)
SPEED = Dimension(length=1, time=-1)
ACCELERATION = Dimension(length=1, time=-2)
RATE = Dimension(time=-1)

_DIMENSION_NAMES = {
    NONE: "a plain number",
    LENGTH: "a length",
    TIME: "a time",
    MASS: "a mass",
    SPEED: "a speed",
    ACCELERATION: "an acceleration",
    RATE: "a rate",
}


class Unit(NamedTuple):
    """How a literal with this suffix becomes SI: multiply by `factor`."""

    factor: float
    dimension: Dimension


ANGLES = ("deg", "rad")
"""The units of angles: these make a number a direction, of which means are other ones."""

_DEGREE = math.pi / 180.0

UNITS: dict[str, Unit] = {
    "m": Unit(1.0, LENGTH),
    "km": Unit(1000.0, LENGTH),
    "cm": Unit(0.01, LENGTH),
    "mm": Unit(0.001, LENGTH),
    "in": Unit(0.0254, LENGTH),
    "ft": Unit(0.3048, LENGTH),
    "yd": Unit(0.9144, LENGTH),
    "mi": Unit(1609.344, LENGTH),
    "nmi": Unit(1852.0, LENGTH),
    "ms": Unit(0.001, TIME),
    "s": Unit(1.0, TIME),
    "min": Unit(60.0, TIME),
    "h": Unit(3600.0, TIME),
    "deg": Unit(_DEGREE, NONE),
    "rad": Unit(1.0, NONE),
    "%": Unit(0.01, NONE),
    "m/s": Unit(1.0, SPEED),
    "km/h": Unit(1000.0 / 3600.0, SPEED),
    "kn": Unit(1852.0 / 3600.0, SPEED),
    "in/s": Unit(0.0254, SPEED),
    "ft/s": Unit(0.3048, SPEED),
    "m/s2": Unit(1.0, ACCELERATION),
    "deg/s": Unit(_DEGREE, RATE),
    "rad/s": Unit(1.0, RATE),
    "kg": Unit(1.0, MASS),
}


@cache
def dimension_of(unit: str) -> Dimension:
    """The dimension of a unit; "" is that of a plain number."""
    return UNITS[unit].dimension if unit else NONE


def is_angle(unit: str) -> bool:
    """Whether this is a unit of angles."""
    return unit in ANGLES


def si_unit(unit: str) -> str:
    """The unit in which a value of this unit is held: "m" for "mi", "rad" for "deg", "1" for what is a plain number."""
    dimension = dimension_of(unit)
    if dimension == NONE:
        return "rad" if is_angle(unit) else "1"
    return next(name for name, each in UNITS.items() if each == Unit(1.0, dimension))


def to_si(number: float, suffix: str) -> float:
    """`number` of the unit `suffix` in SI, rounded once where the factor allows (50% is 0.5, 45deg is pi/4)."""
    if suffix == "%":
        return number / 100.0
    if suffix in ("mm", "ms"):
        return number / 1000.0
    if suffix == "cm":
        return number / 100.0
    return number * UNITS[suffix].factor


def value_in_words(value: float | None, unit: str, digits: int | None = None) -> str:
    """`value` (SI) as people read it, rounded, with its unit ("" for a plain number): `43.1 %`, `2.13 mi`.

    NaN is "unknown", None is "". digits: significant ones; by default 4 with a unit and 6 without. No digit before the
    point is lost, and nothing below 1e15 has an exponent.
    """
    if value is None:
        return ""
    if math.isnan(value):
        return "unknown"
    number = value / UNITS[unit].factor if unit else value
    text = f"{number + 0.0:.{digits or (4 if unit else 6)}g}"  # no -0
    if "e+" in text and abs(number) < 1e15:
        text = f"{number:.0f}"
    return f"{text} {unit}" if unit else text
