"""What a filled shape is filled with: its outlines by SVG's fill rules, as outlines of what is inside an odd number.

By the rule "nonzero", which counts unless another is said, a point is inside if the outlines wind around it other than
zero times altogether: an outline within another one is a hole only if it runs the other way round. Where outlines
cross, touch or run along each other, themselves or others, all sides are parted there, and those pieces are kept that
have the inside on one of their two sides. Shapes with more than MAX_SIDES sides or MAX_CONTACTS are taken to touch
nothing, and those with more than MAX_LOOPS to be filled as by "evenodd".
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sleepcast.simulator.world.areas import inside
from sleepcast.simulator.world.world import Area, Point

MAX_SIDES = 2_000
"""Sides of one shape that are compared with each other."""
MAX_CONTACTS = 5_000
"""Places of one shape where a side meets another one: a drawing that somebody has drawn has a few."""
PLAIN = 4
"""Sides of an outline that is looked at without comparing them."""
MAX_LOOPS = 2_000
"""Outlines of one shape that are compared with each other."""
AT_ONCE = 1 << 18
"""Pairs of sides that are compared in one step, which bounds the memory."""
NEAR = 1e-9
"""Share of the largest coordinate, or of a metre, within which rounding may have parted equal places."""

Outline = tuple[Point, ...]
Floats = NDArray[np.float64]
Numbers = NDArray[np.intp]


def filled(outlines: tuple[Outline, ...], rule: str) -> tuple[Outline, ...]:
    """The outlines of the area that a shape fills. rule: "nonzero" or "evenodd"."""
    if rule == "evenodd" or (len(outlines) == 1 and _is_plain(outlines[0])):
        return outlines
    sides = _sides(outlines)
    contacts = _contacts(sides) if len(sides.corners) <= MAX_SIDES else None
    if contacts is None:
        return _nested(outlines)
    places, pieces, turns = _pieces(sides, *contacts)
    parted = _chained(places, pieces[_parting(places, pieces, turns)])
    return _nested(outlines) if parted is None else parted  # None: rounding has left them open


def pairs_compared(outlines: tuple[Outline, ...]) -> int:
    """How many pairs of sides are compared to fill these outlines, at most: those of each by itself, and of all."""
    counts = [len(outline) for outline in outlines]
    return sum(count**2 for count in (*counts, sum(counts)) if PLAIN < count <= MAX_SIDES)


def encloses(outline: Outline) -> bool:
    """Whether an outline goes around anything, and not only to and fro."""
    if len(outline) < 3:
        return False
    box = np.ptp(np.array(outline), axis=0)
    return abs(_signed_area(outline)) > NEAR * float(box.sum()) or bool(filled((outline,), "nonzero"))


def _is_plain(outline: Outline) -> bool:
    """Whether this is a triangle or a quadrangle without a dent, as most shapes of a plan are."""
    if len(outline) > PLAIN:
        return False
    corners = zip(outline, (*outline[1:], outline[0]), (*outline[2:], *outline[:2]), strict=True)
    turns = [(bx - ax) * (cy - by) - (by - ay) * (cx - bx) for (ax, ay), (bx, by), (cx, cy) in corners]
    return min(turns) > 0.0 or max(turns) < 0.0


def _nested(outlines: tuple[Outline, ...]) -> tuple[Outline, ...]:
    """The outlines that are not within others of the same way round, of outlines that nowhere touch."""
    if len(outlines) == 1 or len(outlines) > MAX_LOOPS:
        return outlines
    turns = np.array([1 if _signed_area(outline) > 0.0 else -1 for outline in outlines])
    # The middle of a side, because those of a large shape may touch at their corners.
    x, y = np.array([[(a + b) / 2.0 for a, b in zip(*outline[:2], strict=True)] for outline in outlines]).T
    within = np.array([inside(Area((outline,)), x, y) for outline in outlines])
    np.fill_diagonal(within, False)
    outer = within.T @ turns
    edges = (outer == 0) != (outer + turns == 0)
    return tuple(outline for outline, edge in zip(outlines, edges, strict=True) if edge)


def _signed_area(outline: Outline) -> float:
    """Twice of it, above 0 for counter-clockwise."""
    return sum(x0 * y1 - x1 * y0 for (x0, y0), (x1, y1) in zip(outline, (*outline[1:], outline[0]), strict=True))


# ---- outlines that meet


class _Sides(NamedTuple):
    """The sides of some outlines: corners, shape (n, 2), at which they begin, and numbers of those at which they
    end."""

    corners: Floats
    ends: Numbers

    @property
    def ways(self) -> Floats:
        ways: Floats = self.corners[self.ends] - self.corners
        return ways

    @property
    def near(self) -> float:
        """Distance within which places are one, m."""
        return NEAR * max(1.0, float(np.abs(self.corners).max()))


def _sides(outlines: tuple[Outline, ...]) -> _Sides:
    begin, ends = 0, list[Numbers]()
    for outline in outlines:
        ends.append(begin + (np.arange(len(outline)) + 1) % len(outline))
        begin += len(outline)
    return _Sides(np.array([corner for outline in outlines for corner in outline], np.float64), np.concatenate(ends))


def _contacts(sides: _Sides) -> tuple[Numbers, Floats] | None:
    """Numbers of sides that meet others, and where, shape (n, 2); None if there are none, or too many."""
    firsts, seconds = _neighbours(sides)
    numbers, points = [np.empty(0, np.intp)], [np.empty((0, 2))]
    for begin in range(0, len(firsts), AT_ONCE):
        first, second = firsts[begin : begin + AT_ONCE], seconds[begin : begin + AT_ONCE]
        crossed, at = _crossed(sides, first, second)
        touched = _touched(sides, first, second)
        numbers += [first[crossed], second[crossed], first[touched]]
        points += [at, at, sides.corners[second[touched]]]
        if sum(map(len, numbers)) > MAX_CONTACTS:
            return None
    return (np.concatenate(numbers), np.concatenate(points)) if any(map(len, numbers)) else None


def _neighbours(sides: _Sides) -> tuple[Numbers, Numbers]:
    """Pairs of sides, each both ways round, that are close enough to meet."""
    ends = sides.corners[sides.ends]
    low, high = np.minimum(sides.corners, ends), np.maximum(sides.corners, ends) + sides.near
    reach = (low[:, None, 0] <= high[:, 0]) & (low[:, None, 1] <= high[:, 1])
    meet = reach & reach.T
    np.fill_diagonal(meet, False)
    first, second = np.nonzero(meet)
    return first, second


def _crossed(sides: _Sides, first: Numbers, second: Numbers) -> tuple[Numbers, Floats]:
    """The pairs of sides that cross within both, each one way round, and where."""
    way, other, gap = sides.ways[first], sides.ways[second], sides.corners[second] - sides.corners[first]
    turn = _cross(way, other)
    with np.errstate(divide="ignore", invalid="ignore"):
        along, across = _cross(gap, other) / turn, _cross(gap, way) / turn
        crossing = (first < second) & (along > 0.0) & (along < 1.0) & (across > 0.0) & (across < 1.0)
    met = np.flatnonzero(crossing)
    return met, sides.corners[first[met]] + along[met, None] * way[met]


def _touched(sides: _Sides, first: Numbers, second: Numbers) -> Numbers:
    """The pairs in which the first side touches the corner where the second one begins, and does not end there."""
    way, gap = sides.ways[first], sides.corners[second] - sides.corners[first]
    along = np.clip((gap * way).sum(axis=1) / np.maximum((way * way).sum(axis=1), 1e-300), 0.0, 1.0)
    away = np.abs(gap - along[:, None] * way).max(axis=1)
    return np.flatnonzero((away <= sides.near) & (sides.ends[first] != second))


def _cross(one: Floats, other: Floats) -> Floats:
    product: Floats = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    return product


def _pieces(sides: _Sides, numbers: Numbers, points: Floats) -> tuple[Floats, Numbers, Numbers]:
    """Places, and the pieces of sides between them, where the sides with these numbers meet others at these points.

    Each piece comes once, as the numbers of its two places, with how many more sides run from the first to the second
    than back.
    """
    count = len(sides.corners)
    steps = np.concatenate((np.arange(count), np.arange(count), numbers))
    at = _together(np.concatenate((sides.corners, sides.corners[sides.ends], points)), sides.near)
    along = ((at - sides.corners[steps]) * sides.ways[steps]).sum(axis=1)
    places, which = np.unique(at, axis=0, return_inverse=True)
    order = np.lexsort((along, steps))
    steps, which = steps[order], which.reshape(-1)[order]
    pairs = np.column_stack((which[:-1], which[1:]))[(steps[:-1] == steps[1:]) & (which[:-1] != which[1:])]
    pieces, number = np.unique(np.sort(pairs, axis=1), axis=0, return_inverse=True)
    turns = np.zeros(len(pieces), np.intp)
    np.add.at(turns, number.reshape(-1), np.where(pairs[:, 0] < pairs[:, 1], 1, -1))
    return places, pieces[turns != 0], turns[turns != 0]


def _together(points: Floats, near: float) -> Floats:
    """The points, where those that rounding has parted have become equal."""
    points_together = points.copy()
    for axis in points_together.T:
        order = np.argsort(axis, kind="stable")
        first = np.flatnonzero(np.diff(axis[order], prepend=-np.inf) > near)
        axis[order] = np.repeat(axis[order][first], np.diff(first, append=len(axis)))
    return points_together


def _parting(places: Floats, pieces: Numbers, turns: Numbers) -> NDArray[np.bool_]:
    """Which pieces have the inside on just one side."""
    begin, end = places[pieces[:, 0]], places[pieces[:, 1]]
    steep = np.abs(end[:, 1] - begin[:, 1]) >= np.abs(end[:, 0] - begin[:, 0])
    parting = np.zeros(len(pieces), np.bool_)
    for some, axes in ((steep, [0, 1]), (~steep, [1, 0])):
        rows, size = np.flatnonzero(some), max(1, AT_ONCE // max(len(pieces), 1))
        for part in (rows[first : first + size] for first in range(0, len(rows), size)):
            parting[part] = _parts(begin[:, axes], end[:, axes], turns, part)
    return parting


def _parts(begin: Floats, end: Floats, turns: Numbers, some: Numbers) -> NDArray[np.bool_]:
    """Whether some of the pieces part inside and outside. A ray from the middle of each to the right tells how often
    all others wind around it, and the piece itself adds what lies on its left."""
    middle, winding = (begin[some] + end[some]) / 2.0, np.where(end[:, 1] > begin[:, 1], turns, -turns)
    row, other = np.nonzero((begin[:, 1] > middle[:, None, 1]) != (end[:, 1] > middle[:, None, 1]))
    a, way = begin[other], end[other] - begin[other]
    beyond = a[:, 0] + (middle[row, 1] - a[:, 1]) * way[:, 0] / way[:, 1] > middle[row, 0]
    counted = beyond & (other != some[row])
    outer = np.bincount(row[counted], winding[other[counted]], len(some))
    parting: NDArray[np.bool_] = (outer == 0.0) != (outer + winding[some] == 0.0)
    return parting


def _chained(places: Floats, pieces: Numbers) -> tuple[Outline, ...] | None:
    """Pieces as closed outlines that pass no place twice; None if they are not closed."""
    ways: dict[int, set[int]] = {}
    for one, other in pieces.tolist():
        ways.setdefault(one, set()).add(other)
        ways.setdefault(other, set()).add(one)
    if any(len(each) % 2 for each in ways.values()):
        return None
    outlines = list[Outline]()
    for begin in sorted(ways):
        walk, at = dict[int, None](), begin
        while ways[at]:
            walk[at] = None
            following = min(ways[at])
            ways[at].remove(following)
            ways[following].remove(at)
            at = following
            if at in walk:
                outlines.append(tuple((float(x), float(y)) for x, y in places[_since(walk, at)]))
    return tuple(outlines)


def _since(walk: dict[int, None], at: int) -> list[int]:
    """Take from a walk what it has passed since it was at this place, which comes first."""
    loop = list[int]()
    while not loop or loop[-1] != at:
        loop.append(walk.popitem()[0])
    return loop[::-1]
