"""The solid things of a world: polygons, areas, circles and walls, which may be added, moved and removed during a run.

Each thing is stored twice: as it was defined, under a number and perhaps a name; and as *solids*, rows of one array
that motion and sonar read. A solid is a stadium: all points within `radius` of a line segment. The side of a polygon
or a piece of wall is a stadium without a radius, a circle is one without a length.

Things stand on the ground and are `tall` m high, or without limit (None). What flies passes over those that are lower,
and circles, areas and polygons with a limit are solid up to a flat roof.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace
from itertools import pairwise
from math import ceil, inf, isfinite
from types import MappingProxyType
from typing import TypeGuard

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.errors import MisuseError
from sleepcast.core.records import dataclass

MAX_NAME = 64
"""Characters of the name of a thing in the world."""
MAX_SOLIDS = 1_000_000
"""Rows in the array of solids: as many as robots; an index of more no longer fits into a cache."""

MAX_ROOMS = MAX_SOLIDS // 4
"""Rooms of one world: each adds about four pieces of wall."""

Point = tuple[float, float]


@dataclass(frozen=True, slots=True)
class Polygon:
    """A closed line through `corners` (x, y in m), clockwise or not. Bodies stay on the side they are on; one with a
    limited height is a building, in which none starts."""

    corners: tuple[Point, ...]
    name: str = ""
    tall: float | None = None


@dataclass(frozen=True, slots=True)
class Area:
    """The points inside an odd number of the closed `outlines` (each given by its corners, x, y in m): solid
    throughout, except for holes. No body starts in it."""

    outlines: tuple[tuple[Point, ...], ...]
    name: str = ""
    tall: float | None = None


@dataclass(frozen=True, slots=True)
class Circle:
    """A disc; centre and radius in m."""

    x: float
    y: float
    radius: float
    name: str = ""
    tall: float | None = None


@dataclass(frozen=True, slots=True)
class Wall:
    """A thin wall from point to point (x, y in m), open at its ends."""

    points: tuple[Point, ...]
    name: str = ""
    tall: float | None = None


Shape = Polygon | Area | Circle | Wall
Row = tuple[float, float, float, float, float]


class World:
    """The solid things, by number. shapes: as they were defined, read-only. version: counts the changes."""

    def __init__(self, shapes: Iterable[Shape] = ()) -> None:
        self._shapes: dict[int, Shape] = {}
        self._sides = 0
        self._rows: NDArray[np.float64] | None = None
        self._tops: NDArray[np.float64] | None = None
        self._next = 1
        self.version = 0
        for shape in shapes:
            self.add(shape)

    @property
    def shapes(self) -> Mapping[int, Shape]:
        return MappingProxyType(self._shapes)

    @property
    def solids(self) -> NDArray[np.float64]:
        """All solids, shape (n, 5): x and y of one end, x and y of the other, radius; m."""
        if self._rows is None:
            rows = (row for shape in self._shapes.values() for row in rows_of(shape))
            self._rows = np.fromiter(rows, np.dtype((np.float64, 5)))
        return self._rows

    @property
    def tops(self) -> NDArray[np.float64] | None:
        """How high each of the solids is, m above the ground, shape (n,); None if all are without limit."""
        if self._tops is None and any(shape.tall is not None for shape in self._shapes.values()):
            tops = ((inf if shape.tall is None else shape.tall, shape) for shape in self._shapes.values())
            self._tops = np.array([top for top, shape in tops for _ in rows_of(shape)])
        return self._tops

    def add(self, shape: Shape) -> int:
        """Add a thing and return its number. Raises MisuseError for an invalid shape."""
        sides = len(rows_of(shape))
        if self._sides + sides > MAX_SOLIDS:
            raise MisuseError(f"the world is full: at most {MAX_SOLIDS} walls and sides of polygons fit; remove some")
        self._sides += sides
        number = self._next
        self._next += 1
        self._shapes[number] = shape
        self._changed()
        return number

    def move(self, number: int, dx: float, dy: float) -> None:
        """Move a thing by `dx` m to the east and `dy` m to the north. Raises MisuseError if it does not exist."""
        moved = shifted(self._known(number), dx, dy)
        rows_of(moved)
        self._shapes[number] = moved
        self._changed()

    def remove(self, number: int) -> None:
        """Remove a thing. Raises MisuseError if it does not exist."""
        self._sides -= len(rows_of(self._known(number)))
        del self._shapes[number]
        self._changed()

    def put(self, number: int, shape: Shape) -> None:
        """Set the thing with this number to `shape`, new or not: this is how a recorded run is repeated, and how a
        change is undone. Things keep the order of their numbers. Raises MisuseError for an invalid shape or too many
        solids."""
        before = self._shapes.get(number)
        sides = self._sides + len(rows_of(shape)) - (len(rows_of(before)) if before is not None else 0)
        if sides > MAX_SOLIDS:
            raise MisuseError(f"the world is full: at most {MAX_SOLIDS} walls and sides of polygons fit; remove some")
        self._sides = sides
        self._shapes[number] = shape
        if before is None and number < self._next:
            self._shapes = dict(sorted(self._shapes.items()))
        self._next = max(self._next, number + 1)
        self._changed()

    def clear(self) -> None:
        """Remove all things."""
        self._shapes.clear()
        self._sides = 0
        self._changed()

    @property
    def following(self) -> int:
        """The number that the next thing gets."""
        return self._next

    def fill(self, shapes: Mapping[int, Shape], following: int) -> None:
        """Replace all things by these, under these numbers. Raises MisuseError for an invalid shape, a number not below
        `following`, or too many solids."""
        if any(not 0 < number < following for number in shapes):
            raise MisuseError(f"the numbers of things lie from 1 up to {following}, not with it")
        sides = sum(len(rows_of(shape)) for shape in shapes.values())
        if sides > MAX_SOLIDS:
            raise MisuseError(f"at most {MAX_SOLIDS} walls and sides of polygons fit into a world")
        self._shapes, self._sides, self._next = dict(shapes), sides, following
        self._changed()

    def _known(self, number: int) -> Shape:
        if number not in self._shapes:
            raise MisuseError(f"there is no obstacle {number}: numbers are given by add and end with remove")
        return self._shapes[number]

    def _changed(self) -> None:
        self.version += 1
        self._rows = self._tops = None


def is_solid_throughout(shape: Shape) -> TypeGuard[Area | Circle | Polygon]:
    """Whether no body starts in it; if its height is limited, it has a roof."""
    return isinstance(shape, Area | Circle) or (isinstance(shape, Polygon) and shape.tall is not None)


def rows_of(shape: Shape) -> list[Row]:
    """The solids of a shape. Raises MisuseError for an invalid shape."""
    if shape.tall is not None and not 0.0 < shape.tall < inf:
        raise MisuseError(f"nothing can be {shape.tall:g} m tall: wanted a number above 0, or None for no limit")
    if isinstance(shape, Circle):
        if not (isfinite(shape.x) and isfinite(shape.y) and 0.0 < shape.radius < float("inf")):
            raise MisuseError(f"no circle: {shape}; wanted finite numbers and a radius above 0")
        return [(shape.x, shape.y, shape.x, shape.y, shape.radius)]
    if isinstance(shape, Area):
        return [row for outline in shape.outlines for row in _sides_of(outline, "an outline", closed=True)]
    if isinstance(shape, Polygon):
        return _sides_of(shape.corners, "a polygon", closed=True)
    return _sides_of(shape.points, "a wall", closed=False)


def _sides_of(points: tuple[Point, ...], noun: str, *, closed: bool) -> list[Row]:
    """The lines from point to point, and back to the first one if `closed`."""
    least = 3 if closed else 2
    if len(points) < least:
        raise MisuseError(f"{noun} of {len(points)} points; wanted at least {least}")
    if not all(isfinite(value) for point in points for value in point):
        raise MisuseError(f"{noun} with a point that is not finite: {_shown(points)}")
    ends = (*points[1:], points[0]) if closed else points[1:]
    if any(start == end for start, end in zip(points, ends, strict=False)):
        itself = ", or the first one again at its end" if closed else ""
        raise MisuseError(f"{noun} with the same point twice in a row{itself}: {_shown(points)}")
    return [(*start, *end, 0.0) for start, end in zip(points, ends, strict=False)]


def _shown(points: tuple[Point, ...]) -> str:
    return f"{', '.join(map(str, points[:8]))}{', ...' if len(points) > 8 else ''}"


def shifted(shape: Shape, dx: float, dy: float) -> Shape:
    """The shape moved by `dx` m to the east and `dy` m to the north."""
    if isinstance(shape, Circle):
        return replace(shape, x=shape.x + dx, y=shape.y + dy)
    if isinstance(shape, Wall):
        return replace(shape, points=_shifted(shape.points, dx, dy))
    if isinstance(shape, Area):
        return replace(shape, outlines=tuple(_shifted(outline, dx, dy) for outline in shape.outlines))
    return replace(shape, corners=_shifted(shape.corners, dx, dy))


def _shifted(points: tuple[Point, ...], dx: float, dy: float) -> tuple[Point, ...]:
    return tuple((x + dx, y + dy) for x, y in points)


def boundary(width: float, height: float) -> Wall:
    """A wall around the whole world."""
    return Wall(((0.0, 0.0), (width, 0.0), (width, height), (0.0, height), (0.0, 0.0)))


def rooms(width: float, height: float, size: float, door: float) -> list[Wall]:
    """Walls that divide a rectangle into square rooms of `size` m (the last row and column may be smaller or larger),
    with a door of `door` m in the middle of each side of a room. A side too short for its door is left out. Each wall
    goes from door to door, with a corner where it crosses another one. Raises MisuseError for more than MAX_ROOMS."""
    columns, rows = _rooms_along(width, size), _rooms_along(height, size)
    if columns * rows > MAX_ROOMS:
        raise MisuseError(f"{columns} by {rows} rooms; at most {MAX_ROOMS} fit: make them larger")
    marks_x, marks_y = _marks(width, size, columns), _marks(height, size, rows)
    pieces = _from_door_to_door(marks_y, door)
    walls = [Wall(tuple((x, y) for y in piece)) for x in marks_x[1:-1] for piece in pieces]
    pieces = _from_door_to_door(marks_x, door)
    return walls + [Wall(tuple((x, y) for x in piece)) for y in marks_y[1:-1] for piece in pieces]


def _rooms_along(length: float, size: float) -> int:
    """Number of rooms along a side: the last one has between half a size and one and a half."""
    return max(1, ceil(length / size - 0.5))


def _marks(length: float, size: float, count: int) -> list[float]:
    """Positions of the walls between `count` rooms along a side: every `size` m."""
    return [*(number * size for number in range(count)), length]


def _from_door_to_door(marks: list[float], door: float) -> list[list[float]]:
    """The walls along a line that crosses others at `marks`: for each its begin, crossing and end."""
    walls, piece = [], marks[:1]
    for low, high in pairwise(marks):
        middle, fits = (low + high) / 2.0, high - low > door
        walls.append([*piece, middle - door / 2.0] if fits else piece)
        piece = [middle + door / 2.0, high] if fits else [high]
    return [piece for piece in (*walls, piece) if len(piece) > 1]
