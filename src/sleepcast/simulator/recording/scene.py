"""The scene for standard viewers: Foxglove's schema `SceneUpdate`, in Protobuf.

An entity with a name (its id) replaces the earlier one of that name on its topic, or is deleted. `ground` is what does
not move: the world's edge, areas, places and lights; `walls` is what is solid; `members` is a group, or what shows one
colour, as each picture has it. Foxglove and Lichtblick draw all of it; Rerun, which knows no scenes, shows the colours
of the points.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from math import cos, pi, sin
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sleepcast.core.model import NamedArea
from sleepcast.core.varint import varint
from sleepcast.simulator.recording.foxglove import POSE_MESSAGES, WORLD
from sleepcast.simulator.recording.protobuf import (
    BOOL,
    BYTES,
    DOUBLE,
    DURATION,
    DURATION_FILE,
    DURATION_FILE_NAME,
    FIXED,
    FIXED_64,
    STAMP_FILE,
    STAMP_FILE_NAME,
    TEXT,
    TIME,
    described,
    described_file,
    double,
    field,
    of,
    one_of,
    tag,
    timestamp,
    whole,
    with_values,
)
from sleepcast.simulator.scenario.scenario import Scenario
from sleepcast.simulator.world.world import Area, Circle, Point, Shape, Wall

SCENE = "foxglove.SceneUpdate"
MAX_SEGMENTS = 250_000
"""Pieces of wall that are drawn: 15 MB of them; of more, none are drawn."""
MAX_MEMBERS = 20_000
"""Robots of one group that are drawn with each picture; of a larger group only the points have colours."""
CORNERS = 32
"""Of a circle as it is drawn."""
LEAST_PART = 0.006
"""Half a robot's length, as a part of the world: smaller ones would not be seen when all of it is."""
LINE, FONT = 2.0, 14.0
"""Pixels."""


class Colour(NamedTuple):
    """Red, green, blue and alpha from 0 to 1."""

    red: float
    green: float
    blue: float
    alpha: float = 1.0

    @classmethod
    def of(cls, text: str) -> Colour:
        """The colour that is written `#rrggbb`."""
        red, green, blue = (int(text[at : at + 2], 16) / 255 for at in (1, 3, 5))
        return cls(red, green, blue)

    def written(self, number: int) -> bytes:
        return field(number, b"".join(double(place, value) for place, value in enumerate(self, 1)))


EDGE, SOLID, PLACE, LIGHT, AREA = (Colour.of(text) for text in ("#8a99a8", "#52667a", "#c62828", "#b8860b", "#2a8c82"))


def scene(entities: Iterable[bytes], deletions: Iterable[bytes] = ()) -> bytes:
    """A `SceneUpdate`."""
    return b"".join(field(1, each) for each in deletions) + b"".join(field(2, each) for each in entities)


def deletion(nanoseconds: int, name: str) -> bytes:
    """What removes the entity with this name."""
    return timestamp(1, nanoseconds) + field(3, name)


def ground(nanoseconds: int, scenario: Scenario) -> list[bytes]:
    """Entities of the world's edge, areas, places and lights."""
    wide, high = scenario.width, scenario.height
    edge = _line(closed(((0.0, 0.0), (wide, 0.0), (wide, high), (0.0, high))), EDGE)
    areas = [
        part
        for area in scenario.areas
        for part in (_line(closed(outline(area)), AREA), _text(outline(area)[0], area.name, AREA))
    ]
    places = [_text((each.x, each.y), each.title, PLACE) for each in scenario.named_points]
    lights = [_text((each.x, each.y), each.title, LIGHT) for each in scenario.lights]
    dot = 2.0 * LEAST_PART * max(wide, high)
    dots = [(places, PLACE, scenario.named_points), (lights, LIGHT, scenario.lights)]
    for parts, colour, points in dots:
        parts += [_sphere((each.x, each.y), dot, colour) for each in points]
    named = {"world": [edge], "areas": areas, "places": places, "lights": lights}
    return [_entity(nanoseconds, name, parts) for name, parts in named.items() if parts]


def walls(nanoseconds: int, shapes: Iterable[Shape]) -> bytes:
    """The entity of everything solid."""
    lines = [line for shape in shapes for line in edges(shape)]
    parts = [_line(lines, SOLID)] if 0 < len(lines) <= MAX_SEGMENTS else []
    return _entity(nanoseconds, "walls", parts)


def half_length(scenario: Scenario) -> float:
    """Half a robot's length as it is drawn, m."""
    return max(1.35 * scenario.robots.geometry.radius, LEAST_PART * max(scenario.width, scenario.height))


def members(
    nanoseconds: int,
    name: str,
    colour: Colour,
    size: float,
    places: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    z: NDArray[np.float64] | None = None,
) -> bytes:
    """The entity of robots of one colour: a triangle each, which points along its heading. size: half its length, m.
    places: x, y (m) and heading (rad), shape (count,). z: m, None where nothing flies."""
    x, y, heading = places
    forwards, aside = np.cos(heading) * size, np.sin(heading) * size
    corners = np.empty((len(x), 3, 2 if z is None else 3))
    if z is not None:
        corners[:, :, 2] = z[:, None]
    for corner, (ahead, left) in enumerate(((1.0, 0.0), (-0.8, 0.6), (-0.8, -0.6))):
        corners[:, corner, 0] = x + ahead * forwards - left * aside
        corners[:, corner, 1] = y + ahead * aside + left * forwards
    triangles = _points(2, corners.reshape(-1, corners.shape[-1])) + colour.written(3)
    return _entity(nanoseconds, name, [field(12, triangles)], {"robots": str(len(x))})


# ---- primitives, each as a field of an entity


def _entity(nanoseconds: int, name: str, parts: Sequence[bytes], about: Mapping[str, str] | None = None) -> bytes:
    head = timestamp(1, nanoseconds) + field(2, WORLD) + field(3, name)
    metadata = b"".join(field(6, field(1, key) + field(2, value)) for key, value in (about or {}).items())
    return head + metadata + b"".join(parts)


def _line(segments: Sequence[ArrayLike], colour: Colour) -> bytes:
    """Segments from point to point, of one width in pixels; the points have two coordinates or three, m."""
    ends = np.array(segments, float)
    points = _points(5, ends.reshape(-1, ends.shape[-1]))
    return field(11, whole(1, 2) + double(3, LINE) + whole(4, 1) + points + colour.written(6))


def _text(place: Point, text: str, colour: Colour) -> bytes:
    """A text that faces whoever looks."""
    return field(13, _at(place) + whole(2, 1) + double(3, FONT) + whole(4, 1) + colour.written(5) + field(6, text))


def _sphere(place: Point, size: float, colour: Colour) -> bytes:
    extent = b"".join(double(axis, size) for axis in (1, 2, 3))
    return field(9, _at(place) + field(2, extent) + colour.written(3))


def _at(place: Point) -> bytes:
    """A pose that is not turned."""
    return field(1, field(1, double(1, place[0]) + double(2, place[1])) + field(2, double(4, 1.0)))


_POINT = np.dtype(
    {
        "names": ["head", *("tag_x", "x", "tag_y", "y", "tag_z", "z")],
        "formats": ["S2", *("u1", "<f8") * 3],
    }
)
"""A `Point3` as a field of one byte's number."""


def _points(number: int, corners: NDArray[np.float64]) -> bytes:
    """Points, each as the field `number`; in single precision, whose zeros compress well. corners: m, shape (count, 2)
    for the plane, (count, 3) for space."""
    frame = np.zeros(len(corners), _POINT)
    frame["head"] = tag(number) + varint(_POINT.itemsize - 2)
    for place, name in enumerate(("tag_x", "tag_y", "tag_z"), 1):
        frame[name] = place << 3 | FIXED_64
    for name, column in zip("xyz", corners.astype(np.float32).T, strict=False):
        frame[name] = column
    return frame.tobytes()


# ---- outlines


def closed(corners: Sequence[Point]) -> list[tuple[Point, Point]]:
    """The sides of what has these corners."""
    return [*pairwise(corners), (corners[-1], corners[0])]


def _circle(x: float, y: float, radius: float) -> list[Point]:
    angles = (2.0 * pi * corner / CORNERS for corner in range(CORNERS))
    return [(x + radius * cos(angle), y + radius * sin(angle)) for angle in angles]


def outline(area: NamedArea) -> Sequence[Point]:
    """The corners of an area, of a disc those of the polygon as which it is drawn, m."""
    if area.is_disc:
        x, y, radius = area.sizes
        return _circle(x, y, radius)
    return list(zip(area.sizes[::2], area.sizes[1::2], strict=True))


def edges(shape: Shape) -> NDArray[np.float64]:
    """The lines, m, by which a solid thing is drawn, shape (count, 2, 3): on the ground and, of what has a height, its
    upper edges and a post below each corner of these."""
    lines = np.array(_segments(shape), float).reshape(-1, 2, 2)
    low = np.dstack((lines, np.zeros(lines.shape[:2])))
    if shape.tall is None:
        return low
    high = low + np.array((0.0, 0.0, shape.tall))
    feet, ends = np.unique(low.reshape(-1, 3), axis=0), np.unique(high.reshape(-1, 3), axis=0)
    return np.concatenate((low, high, np.stack((feet, ends), 1)))


def _segments(shape: Shape) -> list[tuple[Point, Point]]:
    """Its lines on the ground."""
    if isinstance(shape, Circle):
        return closed(_circle(shape.x, shape.y, shape.radius))
    if isinstance(shape, Wall):
        return list(pairwise(shape.points))
    outlines = shape.outlines if isinstance(shape, Area) else (shape.corners,)
    return [segment for corners in outlines for segment in closed(corners)]


# ---- the schema

_POSE, _VECTOR, _POINT3, _COLOUR = (of(f"foxglove.{name}") for name in ("Pose", "Vector3", "Point3", "Color"))
_SIZED = {"pose": _POSE, "size": _VECTOR}
_ARROW = {"pose": _POSE, "shaft_length": DOUBLE, "shaft_diameter": DOUBLE, "head_length": DOUBLE}
_ARROW |= {"head_diameter": DOUBLE, "color": _COLOUR}
_LINE = {"type": one_of("foxglove.LinePrimitive.Type"), "pose": _POSE, "thickness": DOUBLE, "scale_invariant": BOOL}
_LINE |= {"points": _POINT3, "color": _COLOUR, "colors": _COLOUR, "indices": FIXED}
_TRIANGLES = {"pose": _POSE, "points": _POINT3, "color": _COLOUR, "colors": _COLOUR, "indices": FIXED}
_WRITING = {"pose": _POSE, "billboard": BOOL, "font_size": DOUBLE, "scale_invariant": BOOL, "color": _COLOUR}
_WRITING |= {"text": TEXT}
_MODEL = {"pose": _POSE, "scale": _VECTOR, "color": _COLOUR, "override_color": BOOL, "url": TEXT}
_MODEL |= {"media_type": TEXT, "data": BYTES}
_PRIMITIVES = {
    "arrows": "ArrowPrimitive",
    "cubes": "CubePrimitive",
    "spheres": "SpherePrimitive",
    "cylinders": "CylinderPrimitive",
    "lines": "LinePrimitive",
    "triangles": "TriangleListPrimitive",
    "texts": "TextPrimitive",
    "models": "ModelPrimitive",
}
_ENTITY = {"timestamp": TIME, "frame_id": TEXT, "id": TEXT, "lifetime": DURATION, "frame_locked": BOOL}
_ENTITY |= {"metadata": of("foxglove.KeyValuePair")}
_ENTITY |= {name: of(f"foxglove.{kind}") for name, kind in _PRIMITIVES.items()}
_DELETION = {"timestamp": TIME, "type": one_of("foxglove.SceneEntityDeletion.Type"), "id": TEXT}
_MANY = ("points", "colors", "indices")

SCENE_SCHEMA = (
    STAMP_FILE
    + DURATION_FILE
    + described_file(
        "foxglove",
        "foxglove/SceneUpdate.proto",
        [
            *POSE_MESSAGES,
            described("Point3", dict.fromkeys("xyz", DOUBLE)),
            described("Color", dict.fromkeys("rgba", DOUBLE)),
            described("KeyValuePair", {"key": TEXT, "value": TEXT}),
            described("ArrowPrimitive", _ARROW),
            described("CubePrimitive", _SIZED | {"color": _COLOUR}),
            described("SpherePrimitive", _SIZED | {"color": _COLOUR}),
            described("CylinderPrimitive", _SIZED | {"bottom_scale": DOUBLE, "top_scale": DOUBLE, "color": _COLOUR}),
            with_values(
                described("LinePrimitive", _LINE, repeated=_MANY), "Type", ("LINE_STRIP", "LINE_LOOP", "LINE_LIST")
            ),
            described("TriangleListPrimitive", _TRIANGLES, repeated=_MANY),
            described("TextPrimitive", _WRITING),
            described("ModelPrimitive", _MODEL),
            described("SceneEntity", _ENTITY, repeated=("metadata", *_PRIMITIVES)),
            with_values(described("SceneEntityDeletion", _DELETION), "Type", ("MATCHING_ID", "ALL")),
            described(
                "SceneUpdate",
                {"deletions": of("foxglove.SceneEntityDeletion"), "entities": of("foxglove.SceneEntity")},
                repeated=("deletions", "entities"),
            ),
        ],
        needs=(STAMP_FILE_NAME, DURATION_FILE_NAME),
    )
)
