"""The world of a scenario: what the table [world] of its file says, and what a run may change of it.

What stands in the world is written there, drawn by `rooms` and `maze`, or taken from other files.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import sqrt

from sleepcast.core.settings import Measure, Table
from sleepcast.core.units import LENGTH
from sleepcast.simulator.scenario.robot_settings import LEAST, MAX_WORLD
from sleepcast.simulator.world.drawing import MAX_NAME, read_drawing
from sleepcast.simulator.world.maze import maze
from sleepcast.simulator.world.ros_map import read_map
from sleepcast.simulator.world.world import Circle, Point, Polygon, Shape, Wall, boundary, rooms, rows_of

MAX_SHAPES = 10_000
"""Polygons, circles or walls in one file: each sort."""
MAX_POINTS = 10_000
"""Corners of one polygon or wall."""
MAX_SEED = 2**63 - 1
SLACK = 1e-6
"""m by which rounding may take a map or drawing beyond a world of its own size."""
EDGES = ("fence", "wall")
"""What the world's edge is: robots turn back at a fence by themselves and nobody sees it; a wall is solid."""


@dataclass(frozen=True, slots=True)
class Changes:
    """What a run changes of its scenario's file. robots: so many; area_per_robot: in a world of so many m2 for each;
    walls: False leaves out everything solid. seed: what all chance depends on, a maze with it. over: keys of the file
    as errors write them (`radio.loss`), each with what it says instead."""

    robots: int | None = None
    area_per_robot: float | None = None
    walls: bool = True
    seed: int | None = None
    over: tuple[tuple[str, object], ...] = ()


@dataclass(frozen=True, slots=True)
class WorldSpec:
    """The world's rectangle, m, and the unit in which people read it; what stands in it at the start, and what does not
    yet. fenced: whether robots turn back at its edge by themselves."""

    width: float
    height: float
    unit: str
    shapes: tuple[Shape, ...]
    fenced: bool
    absent: tuple[Shape, ...] = ()


def read_world(root: Table, robots: Callable[[], int], changes: Changes, seed: int) -> WorldSpec:
    """The table [world]. robots: says how many there are, for a world that grows with them; seed: of this run."""
    with root.table("world") as table:
        taken = _from_files(table)
        width, height = _size(table, robots, changes.area_per_robot, taken)
        high = (width.value, height.value)
        for each_taken in taken:
            each_taken.refuse_beyond(table, *high)
        shapes: list[Shape] = [shape for each_taken in taken for shape in each_taken.shapes]
        written = _written(table, high)
        shapes += [shape for shape, absent in written if not absent]
        shapes += _parted(table, high, seed)
        walled = table.text("edge", "fence", choices=EDGES) == "wall"
    if not changes.walls:
        return WorldSpec(*high, width.unit or "m", (), fenced=True)
    if walled:
        shapes.append(boundary(*high))
    absent_ones = tuple(shape for shape, absent in written if absent)
    return WorldSpec(*high, width.unit or "m", tuple(shapes), fenced=not walled, absent=absent_ones)


def _written(world: Table, high: tuple[float, float]) -> list[tuple[Shape, bool]]:
    """The polygons, circles and walls of the file itself, and whether each is absent at the start."""
    low, shapes = (0.0, 0.0), list[tuple[Shape, bool]]()
    for each in world.array("polygons", most=MAX_SHAPES):
        with each:
            corners = each.points("corners", low, high, least=3, most=MAX_POINTS)
            shapes.append((_real(Polygon(corners, _name(each)), each, "corners"), _absent(each)))
    for each in world.array("circles", most=MAX_SHAPES):
        with each:
            x, y = each.point("center", low, high)
            radius = each.number("radius", LENGTH, low=LEAST, high=MAX_WORLD)
            shapes.append((Circle(x, y, radius, _name(each)), _absent(each)))
    for each in world.array("walls", most=MAX_SHAPES):
        with each:
            points = each.points("points", low, high, least=2, most=MAX_POINTS)
            shapes.append((_real(Wall(points, _name(each)), each, "points"), _absent(each)))
    return shapes


def _real(shape: Shape, table: Table, key: str) -> Shape:
    """The shape that stands under `key`. Raises SettingsError if it is none."""
    with table.answering(key):
        rows_of(shape)
    return shape


def _name(shape: Table) -> str:
    """How people call it, "" if they do not."""
    return shape.text("name", "", most=MAX_NAME)


def _absent(shape: Table) -> bool:
    """Whether it is not there at the start."""
    absent = shape.flag("absent", False)
    if absent and not shape.text("name", ""):
        raise shape.error("absent", "what no name is given to can never be added: give it a name")
    return absent


@dataclass(frozen=True, slots=True)
class _Taken:
    """What another file has. low, high: corners of the box round it, m. key: under which the file is named."""

    key: str
    shapes: tuple[Shape, ...]
    low: Point
    high: Point

    def refuse_beyond(self, world: Table, width: float, height: float) -> None:
        """Raise SettingsError if the box does not lie within the world."""
        if min(self.low) < -SLACK or self.high[0] > width + SLACK or self.high[1] > height + SLACK:
            (x0, y0), (x1, y1) = self.low, self.high
            raise world.error(
                self.key,
                f"it reaches from {x0:g}, {y0:g} to {x1:g}, {y1:g} m, beyond a world of {width:g} by {height:g} m: "
                "leave out width and height, or make them larger",
            )


def _from_files(world: Table) -> list[_Taken]:
    """What [world.map] and [world.drawing] take from other files."""
    found = []
    if world.has("map"):
        with world.table_or_text("map", "file") as each:
            path = each.file("file")
            at = each.point("zero", (-MAX_WORLD, -MAX_WORLD), (MAX_WORLD, MAX_WORLD)) if each.has("zero") else None
            solid = each.text("unknown", "open", choices=("open", "solid")) == "solid"
            found_map = read_map(path)
            with each.answering("file"):
                area, low, high = found_map.area(at, unknown_is_solid=solid)
            found.append(_Taken("map", (area,) if area.outlines else (), low, high))
    if world.has("drawing"):
        with world.table_or_text("drawing", "file") as each:
            path = each.file("file")
            metre = each.number("metre", low=LEAST, high=1.0 / LEAST) if each.has("metre") else None
            at = each.point("at", (0.0, 0.0), (MAX_WORLD, MAX_WORLD)) if each.has("at") else (0.0, 0.0)
            drawing = read_drawing(path, metre, at)
            found.append(_Taken("drawing", drawing.shapes, drawing.low, drawing.high))
    return found


def _parted(table: Table, size: tuple[float, float], seed: int) -> list[Wall]:
    """The walls of [world.rooms] and [world.maze]."""
    walls: list[Wall] = []
    if table.has("rooms"):
        with table.table("rooms") as each:
            room = each.number("size", LENGTH, low=0.1, high=MAX_WORLD)
            door = each.number("door", LENGTH, low=0.0, high=room)
            with table.answering("rooms"):
                walls += rooms(*size, room, door)
    if table.has("maze"):
        with table.table("maze") as each:
            cell = each.number("cell", LENGTH, low=0.1, high=MAX_WORLD)
            loops = each.number("loops", default=0.0, low=0.0, high=1.0)
            own = each.whole("seed", seed, low=0, high=MAX_SEED)
            with table.answering("maze"):
                walls += maze(*size, cell, loops, own)
    return walls


def _size(
    table: Table, robots: Callable[[], int], area: float | None, taken: Sequence[_Taken]
) -> tuple[Measure, Measure]:
    """Width and height: as they are written, or as large as the robots or other files want them."""
    if table.has("area_per_robot"):
        for key in ("width", "height"):
            if table.has(key):
                raise table.error(key, "a world has either width and height or area_per_robot")
        area = area or table.number("area_per_robot", low=LEAST, high=MAX_WORLD)
    if area is not None:
        table.has("width"), table.has("height")
        side = Measure(sqrt(area * robots()))
        return side, side
    across, up = (Measure(max(each.high[i] for each in taken)) if taken else None for i in (0, 1))
    width = table.measure("width", LENGTH, across, low=LEAST, high=MAX_WORLD)
    return width, table.measure("height", LENGTH, up, low=LEAST, high=MAX_WORLD)
