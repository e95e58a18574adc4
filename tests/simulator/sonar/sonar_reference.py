"""Sonar once more, slowly and by other means: what the fast machines are measured against.

Every cone is tried against every disc and every line, one at a time, in double precision. A disc's nearest point in a
cone is found among the point that faces the transducer and the points where the cone's two edges meet the rim; a line
is cut with the cone's two half-planes.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import acos, atan2, cos, hypot, inf, pi, remainder, sin, sqrt, tan

from sleepcast.simulator.sonar.cones import Cones

Point = tuple[float, float]


def readings(
    cones: Cones,
    x: float,
    y: float,
    heading: float,
    discs: Iterable[tuple[float, float, float]],
    lines: Iterable[tuple[Point, Point]],
) -> list[float]:
    """The range of each cone; `most` where there is nothing. discs: x, y, radius; without the robot itself."""
    discs, lines = list(discs), list(lines)
    found = []
    for number in range(cones.count):
        axis = heading + 2.0 * pi * number / cones.count
        face = (x + cones.radius * cos(axis), y + cones.radius * sin(axis))
        ranges = [disc(cones, face, axis, each) for each in discs] + [line(cones, face, axis, *each) for each in lines]
        found.append(min(cones.most, *ranges) if ranges else cones.most)
    return found


def disc(cones: Cones, face: Point, axis: float, target: tuple[float, float, float]) -> float:
    across, up, radius = target[0] - face[0], target[1] - face[1], target[2]
    away = hypot(across, up)
    if away < radius:
        return 0.0
    if abs(remainder(atan2(up, across) - axis, 2.0 * pi)) <= cones.half:
        return away - radius
    nearest = inf
    for edge in (axis - cones.half, axis + cones.half):
        along = across * cos(edge) + up * sin(edge)
        root = radius * radius - (away * away - along * along)
        if root < 0.0 or along < 0.0:
            continue
        hit = along - sqrt(root)
        normal = ((hit * cos(edge) - across) / radius, (hit * sin(edge) - up) / radius)
        incidence = acos(max(-1.0, min(1.0, -(normal[0] * cos(edge) + normal[1] * sin(edge)))))
        if incidence <= cones.incidence:
            nearest = min(nearest, hit)
    return nearest


def line(cones: Cones, face: Point, axis: float, start: Point, end: Point) -> float:
    sx, sy = start[0] - face[0], start[1] - face[1]
    dx, dy = end[0] - start[0], end[1] - start[1]
    first, last = 0.0, 1.0
    for edge, side in ((axis - cones.half, 1.0), (axis + cones.half, -1.0)):
        inside, change = side * (cos(edge) * sy - sin(edge) * sx), side * (cos(edge) * dy - sin(edge) * dx)
        if change > 0.0:
            first = max(first, -inside / change)
        elif change < 0.0:
            last = min(last, -inside / change)
        elif inside < 0.0:
            return inf
    length = hypot(dx, dy)
    foot = -(sx * dx + sy * dy) / length**2
    if cones.incidence < pi / 2:
        reach = abs(sx * dy - sy * dx) / length * tan(cones.incidence) / length
        first, last = max(first, foot - reach), min(last, foot + reach)
    if first > last:
        return inf
    share = min(max(foot, first), last)
    return hypot(sx + share * dx, sy + share * dy)
