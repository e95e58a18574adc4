"""What a filled shape is filled with: its outlines by SVG's fill rules, as outlines of what is inside an odd number.

By the rule "nonzero", which counts unless another is said, a point is inside if the outlines wind around it other than
zero times altogether: an outline within another one is a hole only if it runs the other way round. Outlines that cross,
themselves or others, are first parted into loops that do not: at each crossing a line goes on along the other one, as
in Seifert's circles of a knot (1934), which leaves all winding numbers as they are. Shapes with more than MAX_SIDES
sides or MAX_CROSSINGS are taken to cross nothing, and those with more than MAX_LOOPS to be filled as by "evenodd".
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from sleepcast.simulator.world.areas import inside
from sleepcast.simulator.world.world import Area, Point

MAX_SIDES = 2_000
"""Sides of one shape that are compared with each other."""
MAX_CROSSINGS = 5_000
"""Crossings of one shape: a drawing that somebody has drawn has a few."""
MAX_LOOPS = 2_000
"""Loops of one shape that are compared with each other."""

Outline = tuple[Point, ...]


def filled(outlines: tuple[Outline, ...], rule: str) -> tuple[Outline, ...]:
    """The outlines of the area that a shape fills. rule: "nonzero" or "evenodd"."""
    loops = _loops(outlines) if rule == "nonzero" else outlines
    if rule == "evenodd" or len(loops) == 1 or len(loops) > MAX_LOOPS:
        return loops
    turns = np.array([1 if _signed_area(loop) > 0.0 else -1 for loop in loops])
    # The middle of a side, because loops may touch at their corners.
    x, y = np.array([[(a + b) / 2.0 for a, b in zip(*loop[:2], strict=True)] for loop in loops]).T
    within = np.array([inside(Area((loop,)), x, y) for loop in loops])
    np.fill_diagonal(within, False)
    outer = within.T @ turns
    edges = (outer == 0) != (outer + turns == 0)
    return tuple(loop for loop, edge in zip(loops, edges, strict=True) if edge)


def _loops(outlines: tuple[Outline, ...]) -> tuple[Outline, ...]:
    """The outlines, parted where they cross."""
    if sum(map(len, outlines)) > MAX_SIDES:
        return outlines
    first, second, points = _crossings(outlines)
    if not len(first):
        return outlines
    walk, following = _walk(outlines, first, second, points)
    found, left = list[Outline](), set(range(len(walk)))
    while left:
        loop, at = list[Point](), min(left)
        while at in left:
            left.remove(at)
            loop.append(walk[at])
            at = following[at]
        if len(loop) > 2:
            found.append(tuple(loop))
    return tuple(found)


def _crossings(outlines: tuple[Outline, ...]) -> tuple[NDArray[np.intp], NDArray[np.intp], NDArray[np.float64]]:
    """Pairs of sides, numbered through all outlines, that cross inside both, and where, shape (n, 2)."""
    starts = np.concatenate([np.array(each, np.float64) for each in outlines])
    ways = np.concatenate([np.roll(np.array(each, np.float64), -1, axis=0) for each in outlines]) - starts
    nothing = np.empty((0, 2), np.intp)
    numbers, shares, count = [nothing], [np.empty(0)], 0
    for number, (start, way) in enumerate(zip(starts, ways, strict=True)):
        gap, others = starts[number + 1 :] - start, ways[number + 1 :]
        turn = way[0] * others[:, 1] - way[1] * others[:, 0]
        with np.errstate(divide="ignore", invalid="ignore"):
            along = (gap[:, 0] * others[:, 1] - gap[:, 1] * others[:, 0]) / turn
            there = (gap[:, 0] * way[1] - gap[:, 1] * way[0]) / turn
            met = np.flatnonzero((along > 0.0) & (along < 1.0) & (there > 0.0) & (there < 1.0))
        numbers.append(np.column_stack((np.full(len(met), number), met + number + 1)))
        shares.append(along[met])
        count += len(met)
        if count > MAX_CROSSINGS:
            return nothing[:, 0], nothing[:, 1], np.empty((0, 2))
    first, second = np.concatenate(numbers).T
    return first, second, starts[first] + np.concatenate(shares)[:, None] * ways[first]


def _walk(
    outlines: tuple[Outline, ...], first: NDArray[np.intp], second: NDArray[np.intp], points: NDArray[np.float64]
) -> tuple[list[Point], list[int]]:
    """All corners and crossings in the order of the outlines, a crossing on each of its two sides; and what follows
    each where lines change over."""
    on_side: dict[int, list[tuple[float, int]]] = {}
    corners = [corner for outline in outlines for corner in outline]
    for number, sides in enumerate(zip(first.tolist(), second.tolist(), strict=True)):
        for side in sides:
            away = float(np.abs(points[number] - corners[side]).sum())
            on_side.setdefault(side, []).append((away, number))
    walk, following, visits, side = list[Point](), list[int](), dict[int, list[int]](), 0
    for outline in outlines:
        begin = len(walk)
        for corner in outline:
            walk.append(corner)
            following.append(len(walk))
            for _, number in sorted(on_side.get(side, [])):
                visits.setdefault(number, []).append(len(walk))
                walk.append((float(points[number, 0]), float(points[number, 1])))
                following.append(len(walk))
            side += 1
        following[-1] = begin
    for one, other in visits.values():
        following[one], following[other] = following[other], following[one]
    return walk, following


def _signed_area(loop: Outline) -> float:
    """Twice of it, above 0 for counter-clockwise."""
    return sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in pairwise((*loop, loop[0])))
