"""Line of sight in plain Python, in whole numbers and over all solids: what `world.sight` is held to."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf

SCALE = 2**80
"""Every place of a test times this is a whole number, so that nothing is rounded."""
Point = tuple[int, int]
Solid = tuple[Point, Point, int]
"""Both ends and the radius."""


def exactly(solids: Sequence[Sequence[float]], around: tuple[float, float] = (inf, inf)) -> list[Solid]:
    """These rows of `World.solids` in whole numbers, with all images on a torus."""
    shifts = [[0] if side == inf else [_whole(side) * each for each in (-1, 0, 1)] for side in around]
    found = []
    for solid in solids:
        x0, y0, x1, y1, radius = map(_whole, solid)
        found += [((x0 + dx, y0 + dy), (x1 + dx, y1 + dy), radius) for dx in shifts[0] for dy in shifts[1]]
    return found


def blocked(line: Sequence[float], solids: Sequence[Solid]) -> bool:
    """Whether one of them touches the line x, y, to_x, to_y."""
    return count(line, solids) > 0


def count(line: Sequence[float], solids: Sequence[Solid]) -> int:
    """How many do."""
    x, y, to_x, to_y = map(_whole, line)
    return sum(_hits((x, y), (to_x, to_y), solid) for solid in solids)


def _whole(value: float) -> int:
    whole = int(value * SCALE)
    assert whole / SCALE == value
    return whole


def _hits(p: Point, q: Point, solid: Solid) -> bool:
    a, b, radius = solid
    if max(a[0], b[0]) + radius < min(p[0], q[0]) or min(a[0], b[0]) - radius > max(p[0], q[0]):
        return False  # for speed alone
    return _near(a, p, q, radius) if radius else _meet(p, q, a, b)


def _turn(p: Point, q: Point, r: Point) -> int:
    cross = (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])
    return (cross > 0) - (cross < 0)


def _on(p: Point, q: Point, r: Point) -> bool:
    """Whether r, on the line through p and q, lies between them."""
    return min(p[0], q[0]) <= r[0] <= max(p[0], q[0]) and min(p[1], q[1]) <= r[1] <= max(p[1], q[1])


def _meet(p: Point, q: Point, a: Point, b: Point) -> bool:
    """Whether two closed lines have a point in common."""
    turns = _turn(p, q, a), _turn(p, q, b), _turn(a, b, p), _turn(a, b, q)
    if turns[0] != turns[1] and turns[2] != turns[3]:
        return True
    corners = (p, q, a), (p, q, b), (a, b, p), (a, b, q)
    return any(turn == 0 and _on(*each) for turn, each in zip(turns, corners, strict=True))


def _near(middle: Point, p: Point, q: Point, radius: int) -> bool:
    """Whether the nearest point of a line lies at most `radius` from the middle of a disc."""
    along = q[0] - p[0], q[1] - p[1]
    way = middle[0] - p[0], middle[1] - p[1]
    length = along[0] ** 2 + along[1] ** 2
    share = min(max(way[0] * along[0] + way[1] * along[1], 0), length)
    if length == 0:
        return way[0] ** 2 + way[1] ** 2 <= radius**2
    off = way[0] * length - share * along[0], way[1] * length - share * along[1]
    return off[0] ** 2 + off[1] ** 2 <= (radius * length) ** 2
