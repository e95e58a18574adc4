"""Scans in plain Python, beam by beam and over everything: what `laser.beams` is held to."""

from __future__ import annotations

from collections.abc import Sequence
from math import cos, hypot, inf, isclose, sin, sqrt

Row = Sequence[float]
"""A line or a disc as in `World.solids`: both ends and the radius."""
STEP = 1e-9
"""Rad by which a beam may be off: what it barely touches it may miss."""


def images(rows: Sequence[Row], around: tuple[float, float]) -> list[Row]:
    """These rows, with all images on a torus."""
    shifts = [[0.0] if side == inf else [-side, 0.0, side] for side in around]
    found = []
    for x0, y0, x1, y1, radius in rows:
        found += [(x0 + dx, y0 + dy, x1 + dx, y1 + dy, radius) for dx in shifts[0] for dy in shifts[1]]
    return found


def free(x: float, y: float, angle: float, rows: Sequence[Row]) -> float:
    """How far a beam goes from x, y until it hits something, m."""
    c, s = cos(angle), sin(angle)
    return min((_disc(x, y, c, s, row) if row[4] else _line(x, y, c, s, row) for row in rows), default=inf)


def is_told(told: float, x: float, y: float, angle: float, rows: Sequence[Row], least: float, reach: float) -> bool:
    """Whether a scanner may tell this of a beam."""
    tries = [free(x, y, angle + off, rows) for off in (0.0, -STEP, STEP)]
    return any(_agrees(told, way, least, reach) for way in tries)


def _agrees(told: float, way: float, least: float, reach: float) -> bool:
    if told == inf:
        return way > reach * (1.0 - 1e-9)
    if told == -inf:
        return way < least * (1.0 + 1e-9)
    return isclose(told, way, rel_tol=1e-6, abs_tol=1e-6)


def _disc(x: float, y: float, c: float, s: float, row: Row) -> float:
    dx, dy, radius = row[0] - x, row[1] - y, row[4]
    if hypot(dx, dy) <= radius:
        return 0.0
    along, aside = dx * c + dy * s, dy * c - dx * s
    return along - sqrt(radius**2 - aside**2) if along > 0.0 and abs(aside) <= radius else inf


def _line(x: float, y: float, c: float, s: float, row: Row) -> float:
    """Solved for both the way of the beam and the share of the line."""
    px, py, ex, ey = row[0] - x, row[1] - y, row[2] - row[0], row[3] - row[1]
    across = c * ey - s * ex
    if across == 0.0:
        if c * py - s * px != 0.0:
            return inf
        ends = sorted((px * c + py * s, (px + ex) * c + (py + ey) * s))
        return inf if ends[1] < 0.0 else max(ends[0], 0.0)
    way, share = (px * ey - py * ex) / across, (px * s - py * c) / across
    return way if way >= 0.0 and 0.0 <= share <= 1.0 else inf
