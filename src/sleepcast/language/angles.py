"""Which expressions are angles: what has the unit of one, and what is made of such.

Angles are plain numbers, in rad, to the checker. But a mean of directions is another one than that of numbers, and
people read degrees, so whoever makes statistics of an expression asks here. Variables of one's own have no unit:
`(WRAP course)` says that it is an angle.
"""

from __future__ import annotations

from sleepcast.core.model import HostFunction
from sleepcast.core.units import is_angle as is_angle_unit
from sleepcast.language.parts import Part
from sleepcast.language.reader import Number
from sleepcast.language.vocabulary import Variable

DIRECTIONS = ("ATAN2", "BEARING", "WRAP")
"""Functions whose values are angles, whatever they are given."""
TURNED = ("+", "-")
"""Functions of an angle and other numbers that give an angle."""
CHOSEN = ("MIN", "MAX", "CLAMP")
"""Functions that give one of the angles that they are given."""
LAST = ("progn", "let", "set_local", "set_user", "clause")
"""Forms with the value of their last part."""


def is_angle(part: Part) -> bool:
    """Whether the value of this part is an angle."""
    if isinstance(part.data, Variable) and part.op in ("var", "linked"):
        return is_angle_unit(part.data.quantity.shown_as or part.data.quantity.unit)
    if isinstance(part.data, HostFunction):
        return is_angle_unit(part.data.unit)
    if part.op == "const":
        return isinstance(part.form, Number) and is_angle_unit(part.form.unit)
    if part.op in LAST:
        return bool(part.parts) and is_angle(part.parts[-1])
    if part.op in ("if", "cond"):
        return any(map(is_angle, part.parts[1:] if part.op == "if" else part.parts))
    return part.op == "pure" and _is_angle_of(part.function.name, part.parts)


def _is_angle_of(function: str, parts: tuple[Part, ...]) -> bool:
    if function in TURNED:
        return any(map(is_angle, parts))
    if function in CHOSEN:
        return any(is_angle(part) for part in parts if part.op != "const")
    return function in DIRECTIONS
