"""In which unit people read the value of an expression; "" for a plain number.

The unit is that of what the value is made of: a difference of percentages is one, the least of some distances is read
as they are. What has a dimension and no unit of its own, such as a product, is read as robots' positions and speeds
are. What may be one thing or another, such as a length in one branch and a share in the other, has no unit: a wrong one
is worse than none. Products of plain numbers, variables of one's own and what robots have learned have no unit, either:
`(WRAP course)` says that a variable is an angle.

Angles are plain numbers, in rad, to the checker. But a mean of directions is another one than that of numbers, so
whoever makes statistics of an expression asks here, too: the size of an angle is read in degrees, and is no direction.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Iterable, Sequence
from math import isnan, nan
from typing import TypeGuard

from sleepcast.core.model import HostFunction
from sleepcast.core.units import ACCELERATION, LENGTH, MASS, NONE, SPEED, TIME, UNITS, Dimension, value_in_words
from sleepcast.core.units import is_angle as is_angle_unit
from sleepcast.language.functions import WORDS
from sleepcast.language.parts import Part
from sleepcast.language.reader import Number
from sleepcast.language.vocabulary import Variable, Vocabulary, unit_of

DimensionOf = Callable[[Part], Dimension | None]

DIRECTIONS = ("ATAN2", "BEARING", "WRAP")
"""Functions whose values are angles, whatever they are given."""
TURNED = ("+", "-")
"""Functions of an angle and other numbers that give an angle."""
CHOSEN = ("MIN", "MAX", "CLAMP")
"""Functions that give one of the angles that they are given."""
SIZED = ("ABS", "MOD", "FLOOR", "CEIL", "ROUND")
"""Functions whose values are read as what they are given, and are no directions any more."""
LAST = ("progn", "let", "set_local", "set_user", "clause")
"""Forms with the value of their last part."""
COMPARING = ("<", "<=", ">", ">=", "=", "EQ", "/=")
"""Functions that are read as one number beside another."""
_DIGITS = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)(e[+-]?\d+)?", re.IGNORECASE)
_SI = {LENGTH: "m", TIME: "s", SPEED: "m/s", ACCELERATION: "m/s2", MASS: "kg"}
_READ_AS = {LENGTH: "x", SPEED: "speed"}
"""Variables in whose unit people read what else has their dimension."""


def is_angle(part: Part) -> bool:
    """Whether the value of this part is an angle, so that means of it are circular ones."""
    return is_angle_unit(_Made((*TURNED, *CHOSEN)).unit(part) or "")


def unit_to_read(part: Part, dimension: DimensionOf, vocabulary: Vocabulary) -> str:
    """The unit of a part's value. dimension: gives that of the value of a part, None where it is not known."""
    known, own = dimension(part), _Made((*TURNED, *CHOSEN, *SIZED), dimension).unit(part)
    if own and known in (None, UNITS[own].dimension):
        return own
    return unit_of_dimension(known, vocabulary)


def unit_of_dimension(dimension: Dimension | None, vocabulary: Vocabulary) -> str:
    """The unit in which people read values of this dimension, of which nothing else is known."""
    if dimension not in _SI:
        return ""
    alike = unit_of(_READ_AS.get(dimension, ""), vocabulary)
    return alike if alike and UNITS[alike].dimension == dimension else _SI[dimension]


def compared_units(operands: Sequence[Part], units: Sequence[str], dimension: DimensionOf) -> list[str]:
    """The units in which operands of a comparison are read, side by side: that of a literal as it was written, else the
    first of their own, `units`. What measures something else keeps its own."""
    written = (part.form.unit for part in operands if isinstance(part.form, Number) and part.form.unit)
    side = next((unit for unit in (*written, *units) if unit), "")
    return [
        side if _is_alike(unit, dimension(part), side) else unit for part, unit in zip(operands, units, strict=True)
    ]


def _is_alike(unit: str, dimension: Dimension | None, other: str) -> bool:
    """Whether a value of this unit ("": none of its own) and dimension (None: not known) can be read in the other."""
    if unit:
        return bool(other) and _quantity(unit) == _quantity(other)
    return bool(other) and dimension in (None, UNITS[other].dimension)


def _quantity(unit: str) -> tuple[Dimension, str]:
    """What this unit measures. A share and an angle are different, although both are plain numbers."""
    plain = UNITS[unit].dimension == NONE
    return UNITS[unit].dimension, "angle" if is_angle_unit(unit) else unit if plain else ""


class _Made:
    """Finds the unit of what a value is made of. keeping: functions that leave the unit as it is. dimension: as above;
    without it, what may be an angle is one, whatever else it may be."""

    def __init__(self, keeping: Collection[str], dimension: DimensionOf | None = None) -> None:
        self._keeping, self._dimension = keeping, dimension

    def unit(self, part: Part) -> str | None:
        """The unit, "" for what has none of its own; None for a bare number and for unknown, which take any."""
        if isinstance(part.data, Variable) and part.op in ("var", "linked", "write"):
            return part.data.quantity.shown_unit
        if part.op == "over":
            return self.unit(part.parts[-1]) if WORDS[part.name.casefold()].rule == "same" else ""
        if isinstance(part.data, HostFunction):
            return part.data.unit if part.op == "host" else ""
        if part.op == "const":
            return self._literal(part)
        if part.op in LAST:
            return self.unit(part.parts[-1]) if part.parts else ""
        if part.op in ("if", "cond"):
            return self._one_of(part.parts[1:] if part.op == "if" else part.parts)
        if part.op != "pure":
            return ""
        return self._computed(part, part.function.name)

    def _literal(self, part: Part) -> str | None:
        if isinstance(part.form, Number):
            return part.form.unit or None
        return None if isnan(part.number) or part.name == "nil" else ""

    def _computed(self, part: Part, name: str) -> str | None:
        if name in DIRECTIONS:
            return "deg"
        if name not in self._keeping:
            return ""
        if name in CHOSEN:
            return self._one_of([each for each in part.parts if each.op != "const"])
        return self._one_of(part.parts, turned=name in TURNED)

    def _one_of(self, parts: Sequence[Part], *, turned: bool = False) -> str | None:
        """Of a value that is made of these, or of one of them: "" where they differ in what they measure. turned: an
        angle and a number make an angle."""
        units = [unit for part in parts if (unit := self.unit(part)) is not None]
        if not units:
            return None
        angle = next(filter(is_angle_unit, units), "")
        if angle and (turned or self._dimension is None) and self._fit(parts, angle):
            return angle
        alike = all(units) and len(set(map(_quantity, units))) == 1
        return units[0] if alike and self._fit(parts, units[0]) else ""

    def _fit(self, parts: Iterable[Part], unit: str) -> bool:
        known = map(self._dimension, parts) if self._dimension is not None else ()
        return all(dimension in (None, UNITS[unit].dimension) for dimension in known)


def as_written(text: str, unit: str) -> str:
    """A literal of this unit in words, with every digit: `359.99 deg`; "" for any other text."""
    digits = text[: len(text) - len(unit)]
    if _DIGITS.fullmatch(digits) is None or text[len(digits) :].casefold() != unit:
        return ""
    return f"{digits} {unit}" if unit else text


def report_in_words(label: object, values: object) -> str:
    """What REPORT and PRINT say, as people read it: `low: 0.431`. values: as they came, None or NaN for unknown; which
    expressions gave them is not known any more, so they are plain numbers in SI."""
    numbers = values if isinstance(values, Sequence) and not isinstance(values, str) else ()
    shown = " ".join(value_in_words(each if _is_number(each) else nan, "") for each in numbers)
    return ": ".join(filter(None, (str(label or ""), shown)))


def _is_number(value: object) -> TypeGuard[float]:
    """Whether it can be a value. Whoever sends a report can put a whole number of any length into it."""
    return isinstance(value, float) or (isinstance(value, int) and abs(value) < 1e300)
