"""Areas that robots know by name from the start: tables `[areas.NAME]` of a scenario.

Each is a polygon, a disc or a rectangle. They are nothing solid: (INSIDE NAME) and (TO-EDGE NAME) tell a robot where it
is, by its own x and y.
"""

from __future__ import annotations

from sleepcast.core.model import NamedArea
from sleepcast.core.settings import Table, checked_name
from sleepcast.core.units import LENGTH
from sleepcast.simulator.scenario.robot_settings import LEAST, MAX_WORLD

MAX_AREAS = 32
"""Areas of one scenario: half of the operators that a robot has room for."""
MAX_CORNERS = 48
"""Corners of one area: as many as a robot can be told of."""
_KINDS = (("corners",), ("center", "radius"), ("x", "y"))


def read_areas(root: Table, size: tuple[float, float]) -> tuple[NamedArea, ...]:
    """The areas of a world of this size, m. Raises SettingsError."""
    areas = dict[str, NamedArea]()
    for name, table in root.tables("areas", most=MAX_AREAS).items():
        with table:
            around = root.table("areas")
            folded = checked_name(around, name).casefold()
            if folded in areas:
                raise around.error(name, f"an area is called {areas[folded].name} already; choose another name")
            areas[folded] = NamedArea(name, _sizes(table, around, name, size))
    return tuple(areas.values())


def _sizes(table: Table, around: Table, name: str, high: tuple[float, float]) -> tuple[float, ...]:
    kinds = [kind for kind in _KINDS if any(table.has(key) for key in kind)]
    if len(kinds) != 1:
        raise around.error(name, "wanted either corners, or center and radius, or x and y")
    low = (0.0, 0.0)
    if "corners" in kinds[0]:
        corners = table.points("corners", low, high, least=3, most=MAX_CORNERS)
        for number, (before, after) in enumerate(zip(corners, (*corners[1:], corners[0]), strict=True), 1):
            if before == after:
                following = number % len(corners) + 1
                raise table.error("corners", f"points {number} and {following} are the same: leave one out")
        return tuple(each for corner in corners for each in corner)
    if "radius" in kinds[0]:
        center = table.point("center", low, high)
        return (*center, table.number("radius", LENGTH, low=LEAST, high=MAX_WORLD))
    (left, right), (bottom, top) = (
        [end.value for end in table.span(axis, LENGTH, low=0.0, high=most)]
        for axis, most in zip("xy", high, strict=True)
    )
    for axis, width in (("x", right - left), ("y", top - bottom)):
        if width < LEAST:
            raise table.error(axis, f"wanted two values at least {LEAST:g} m apart")
    return left, bottom, right, bottom, right, top, left, top
