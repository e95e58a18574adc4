"""Polygons and discs on the plane: how deep inside of one a straight way lies; m."""

from __future__ import annotations

from collections.abc import Iterator
from math import cos, hypot, inf, pi, sin

from sleepcast.core.model import NamedArea

Point = tuple[float, float]
CORNERS_OF_A_DISC = 32
"""With which a disc is drawn."""


def corners_of(area: NamedArea) -> tuple[Point, ...]:
    """The corners of an area, of a disc many."""
    if not area.is_disc:
        return tuple(zip(area.sizes[::2], area.sizes[1::2], strict=True))
    x, y, radius = area.sizes
    turns = (2.0 * pi * corner / CORNERS_OF_A_DISC for corner in range(CORNERS_OF_A_DISC))
    return tuple((x + radius * cos(turn), y + radius * sin(turn)) for turn in turns)


def depths(area: NamedArea, start: Point, end: Point) -> tuple[float, float]:
    """The least and the greatest depth of a straight way inside an area: the distance to its edge, negative outside.
    What is only known to lie beyond the other one is infinite: a way that meets the edge of a polygon has any depth."""
    if area.is_disc:
        x, y, radius = area.sizes
        farthest = max(hypot(start[0] - x, start[1] - y), hypot(end[0] - x, end[1] - y))
        return radius - farthest, radius - _distance((x, y), start, end)
    corners = corners_of(area)
    sides = list(zip(corners, (*corners[1:], corners[0]), strict=True))
    if any(_cross(start, end, *side) for side in sides):
        return -inf, inf
    apart = min(each for side in sides for each in _apart(start, end, *side))
    return (apart, inf) if _is_inside(start, sides) else (-inf, -apart)


def depth(area: NamedArea, point: Point) -> float:
    """How far from its edge a point lies, m, negative outside."""
    least, greatest = depths(area, point, point)
    return greatest if least == -inf else least


def _apart(start: Point, end: Point, first: Point, last: Point) -> Iterator[float]:
    """Distances of which the least is that of two lines that do not cross."""
    yield _distance(start, first, last)
    yield _distance(end, first, last)
    yield _distance(first, start, end)
    yield _distance(last, start, end)


def _distance(point: Point, start: Point, end: Point) -> float:
    """Of a point from a line between two others."""
    along, up = end[0] - start[0], end[1] - start[1]
    square = along * along + up * up
    share = ((point[0] - start[0]) * along + (point[1] - start[1]) * up) / square if square > 0.0 else 0.0
    share = min(max(share, 0.0), 1.0)
    return hypot(point[0] - start[0] - share * along, point[1] - start[1] - share * up)


def _cross(start: Point, end: Point, first: Point, last: Point) -> bool:
    """Whether two lines cross each other, not merely touch."""
    one, two = _side(start, end, first), _side(start, end, last)
    three, four = _side(first, last, start), _side(first, last, end)
    return one * two < 0.0 and three * four < 0.0


def _side(start: Point, end: Point, point: Point) -> float:
    """Positive where a point lies to the left of a line."""
    return (end[0] - start[0]) * (point[1] - start[1]) - (end[1] - start[1]) * (point[0] - start[0])


def _is_inside(point: Point, sides: list[tuple[Point, Point]]) -> bool:
    """Whether a point lies inside an odd number of times."""
    x, y = point
    odd = False
    for (x1, y1), (x2, y2) in sides:
        if (y1 > y) != (y2 > y) and x < x1 + (y - y1) * (x2 - x1) / (y2 - y1):
            odd = not odd
    return odd
