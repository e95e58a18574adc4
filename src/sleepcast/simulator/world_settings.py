"""The world of a scenario: what the table [world] of its file says, and what a run may change of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from math import sqrt

from sleepcast.simulator.robot_settings import LEAST, MAX_WORLD
from sleepcast.simulator.settings import Measure, Table
from sleepcast.simulator.world import Circle, Polygon, Shape, Wall, edge, rooms
from sleepcast.units import LENGTH

MAX_SHAPES = 10_000
"""Polygons, circles or walls in one file: each sort."""
MAX_POINTS = 10_000
"""Corners of one polygon or wall."""
EDGES = ("fence", "wall")
"""What the world's edge is: robots turn back at a fence by themselves and nobody sees it; a wall is solid."""


@dataclass(frozen=True, slots=True)
class Changes:
    """What a run changes of its scenario's file. robots: so many; area_per_robot: in a world of so many m2 for each;
    walls: False leaves out everything solid."""

    robots: int | None = None
    area_per_robot: float | None = None
    walls: bool = True


@dataclass(frozen=True, slots=True)
class WorldSpec:
    """The world's rectangle, m, and the unit in which people read it; what stands in it at the start. fenced: whether
    robots turn back at its edge by themselves."""

    width: float
    height: float
    unit: str
    shapes: tuple[Shape, ...]
    fenced: bool


def read_world(root: Table, robots: Callable[[], int], changes: Changes) -> WorldSpec:
    """The table [world]. robots: says how many there are, for a world that grows with them."""
    with root.table("world") as table:
        width, height = _size(table, robots, changes.area_per_robot)
        low, high = (0.0, 0.0), (width.value, height.value)
        shapes: list[Shape] = []
        for each in table.array("polygons", most=MAX_SHAPES):
            with each:
                shapes.append(Polygon(each.points("corners", low, high, least=3, most=MAX_POINTS)))
        for each in table.array("circles", most=MAX_SHAPES):
            with each:
                x, y = each.point("center", low, high)
                shapes.append(Circle(x, y, each.number("radius", LENGTH, low=LEAST, high=MAX_WORLD)))
        for each in table.array("walls", most=MAX_SHAPES):
            with each:
                shapes.append(Wall(each.points("points", low, high, least=2, most=MAX_POINTS)))
        if table.has("rooms"):
            with table.table("rooms") as each:
                size = each.number("size", LENGTH, low=0.1, high=MAX_WORLD)
                door = each.number("door", LENGTH, low=0.0, high=size)
                shapes += rooms(*high, size, door)
        walled = table.text("edge", "fence", choices=EDGES) == "wall"
    if not changes.walls:
        return WorldSpec(*high, width.unit or "m", (), fenced=True)
    if walled:
        shapes.append(edge(*high))
    return WorldSpec(*high, width.unit or "m", tuple(shapes), fenced=not walled)


def _size(table: Table, robots: Callable[[], int], area: float | None) -> tuple[Measure, Measure]:
    if table.has("area_per_robot"):
        for key in ("width", "height"):
            if table.has(key):
                raise table.error(key, "a world has either width and height or area_per_robot")
        area = area or table.number("area_per_robot", low=LEAST, high=MAX_WORLD)
    if area is not None:
        table.has("width"), table.has("height")
        side = Measure(sqrt(area * robots()))
        return side, side
    width = table.measure("width", LENGTH, low=LEAST, high=MAX_WORLD)
    return width, table.measure("height", LENGTH, low=LEAST, high=MAX_WORLD)
