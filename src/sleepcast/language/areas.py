"""Areas by name: what AREA, INSIDE and TO-EDGE mean in ordinary forms.

An area is an operator without parameters: the distance of the robot to the area's edge, negative outside. AREA writes
it out, INSIDE and TO-EDGE call it. So robots learn, keep, merge and forget an area as they do every operator, and an
operator that people define themselves is an area, too. What an area does not say with EDGE-DIST, such as a ring, is
one DEFUN.
"""

from __future__ import annotations

from collections.abc import Sequence

from sleepcast.core.model import NamedArea
from sleepcast.language.reader import Form, List, Number, Symbol, show

DISC = 3
"""Arguments of an area that is a disc: x, y and radius."""


def wrong(sizes: Sequence[Form]) -> tuple[str, Form] | None:
    """What is wrong with the arguments of an AREA behind its name, and with which of them; None if nothing is."""
    if len(sizes) == DISC:
        radius = sizes[2]
        if isinstance(radius, Number) and radius.value <= 0.0:
            return f"the radius of an area @@ must be more than 0, not {radius.text}", radius
        return None
    if len(sizes) % 2:
        return f"{len(sizes)} numbers @@ are no corners: wanted x and y of each, or x, y and radius of a disc", sizes[
            -1
        ]
    if len(sizes) < 6:
        return f"an area of {len(sizes) // 2} corners @@: wanted at least 3, or x, y and radius of a disc", sizes[0]
    corners = list(zip(sizes[::2], sizes[1::2], strict=True))
    for number, (before, after) in enumerate(zip(corners, (*corners[1:], corners[0]), strict=True), 1):
        if all(isinstance(each, Number) for each in (*before, *after)) and before == after:
            return f"corners {number} and {number % len(corners) + 1} @@ are the same: leave one out", before[0]
    return None


def written_out(sizes: Sequence[Form], where: Form) -> Form:
    """The expression that an area with these arguments stands for, standing where `where` stands."""

    def call(head: str, *items: Form) -> Form:
        return List((Symbol(head, where.start, where.end), *items), where.start, where.end)

    x, y = (Symbol(name, where.start, where.end) for name in ("x", "y"))
    if len(sizes) == DISC:
        return call("-", sizes[2], call("DIST", x, y, *sizes[:2]))
    return call("EDGE-DIST", x, y, *sizes)


def text_of(area: NamedArea) -> str:
    """The text of the operator that a robot has for this area from the start."""
    return show(written_out([Number(size) for size in area.sizes], Number(0.0)))
