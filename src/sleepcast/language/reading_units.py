"""In which unit people read the value of an expression; "" for a plain number.

The unit is that of what the value is made of: a difference of percentages is one, the least of some distances is read
as they are. What has a dimension and no unit of its own, such as a product, is read as robots' positions and speeds
are. Products of plain numbers, variables of one's own and what robots have learned have no unit: `(WRAP course)` says
that a variable is an angle.

Angles are plain numbers, in rad, to the checker. But a mean of directions is another one than that of numbers, so
whoever makes statistics of an expression asks here, too: the size of an angle is read in degrees, and is no direction.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Sequence
from math import nan

from sleepcast.core.model import HostFunction
from sleepcast.core.units import ACCELERATION, LENGTH, MASS, NONE, SPEED, TIME, UNITS, Dimension, value_in_words
from sleepcast.core.units import is_angle as is_angle_unit
from sleepcast.language.parts import Part
from sleepcast.language.reader import Number
from sleepcast.language.vocabulary import Variable, Vocabulary, unit_of

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
_SI = {LENGTH: "m", TIME: "s", SPEED: "m/s", ACCELERATION: "m/s2", MASS: "kg"}
_READ_AS = {LENGTH: "x", SPEED: "speed"}
"""Variables in whose unit people read what else has their dimension."""


def is_angle(part: Part) -> bool:
    """Whether the value of this part is an angle, so that means of it are circular ones."""
    return is_angle_unit(_own(part, (*TURNED, *CHOSEN)))


def unit_to_read(part: Part, dimension: Dimension | None, vocabulary: Vocabulary) -> str:
    """The unit of a part's value. dimension: of the value, None where it is not known."""
    own = _own(part, (*TURNED, *CHOSEN, *SIZED))
    if own and dimension in (None, UNITS[own].dimension):
        return own
    return unit_of_dimension(dimension, vocabulary)


def unit_of_dimension(dimension: Dimension | None, vocabulary: Vocabulary) -> str:
    """The unit in which people read values of this dimension, of which nothing else is known."""
    if dimension not in _SI:
        return ""
    alike = unit_of(_READ_AS.get(dimension, ""), vocabulary)
    return alike if alike and UNITS[alike].dimension == dimension else _SI[dimension]


def compared_unit(operands: Iterable[Part], units: Iterable[str]) -> str:
    """The unit in which operands of a comparison are read, side by side: of a literal as it was written, else the first
    of their own, `units`."""
    written = (part.form.unit for part in operands if isinstance(part.form, Number) and part.form.unit)
    return next((unit for unit in (*written, *units) if unit), "")


def _own(part: Part, keeping: Collection[str]) -> str:
    """The unit of what a value is made of. keeping: functions that leave the unit as it is."""
    if isinstance(part.data, Variable) and part.op in ("var", "linked", "write"):
        return part.data.quantity.shown_as or part.data.quantity.unit
    if isinstance(part.data, HostFunction):
        return part.data.unit
    if part.op == "const":
        return part.form.unit if isinstance(part.form, Number) else ""
    if part.op in LAST:
        return _own(part.parts[-1], keeping) if part.parts else ""
    if part.op in ("if", "cond"):
        return _common(part.parts[1:] if part.op == "if" else part.parts, keeping)
    if part.op != "pure":
        return ""
    if part.function.name in DIRECTIONS:
        return "deg"
    if part.function.name not in keeping:
        return ""
    ends = part.function.name in CHOSEN
    return _common([each for each in part.parts if not (ends and each.op == "const")], keeping)


def _common(parts: Iterable[Part], keeping: Collection[str]) -> str:
    """The unit of a value that may come from each of these: of angles, if one is an angle; "" where they differ in
    what they measure."""
    units = [unit for part in parts if (unit := _own(part, keeping))]
    angles = [unit for unit in units if is_angle_unit(unit)]
    alike = len({(UNITS[unit].dimension, UNITS[unit].dimension == NONE and unit) for unit in units}) == 1
    return angles[0] if angles else units[0] if units and alike else ""


def report_in_words(label: object, values: object) -> str:
    """What REPORT and PRINT say, as people read it: `low: 0.431`. values: as they came, None or NaN for unknown; which
    expressions gave them is not known any more, so they are plain numbers in SI."""
    numbers = values if isinstance(values, Sequence) and not isinstance(values, str) else ()
    shown = " ".join(value_in_words(each if isinstance(each, float | int) else nan, "") for each in numbers)
    return ": ".join(filter(None, (str(label or ""), shown)))
