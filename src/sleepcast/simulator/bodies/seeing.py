"""What expressions ask of scanners and cameras: SCAN-MIN, SCAN-GAP and SEES."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from sleepcast.core.model import HostFunction
from sleepcast.core.records import NamedTuple
from sleepcast.core.units import LENGTH, NONE
from sleepcast.simulator.bodies.bodies import Bodies, Flags, Floats
from sleepcast.simulator.bodies.body import Body
from sleepcast.simulator.bodies.range_and_bearing import COLOUR, RangeAndBearing
from sleepcast.simulator.laser.sectors import gap, least, within
from sleepcast.simulator.scenario.scenario import Scenario
from sleepcast.simulator.simd.formulas import arc_tangent
from sleepcast.simulator.world.grid import Whole, candidates, spread

MAX_PAIRS = 1 << 20
"""Pairs of robots that cameras look at together: some hundred megabytes."""


class Nearby(NamedTuple):
    """Pairs of robots near each other.

    row: which of the questions it is about
    robot, other: who asks, and who is near it
    dx, dy: how far the other one is to the east and to the north, m; on a torus the shortest way
    """

    row: Whole
    robot: Whole
    other: Whole
    dx: Floats
    dy: Floats

    def part(self, some: Flags) -> Nearby:
        """Some of them."""
        return Nearby(self.row[some], self.robot[some], self.other[some], self.dx[some], self.dy[some])


def others_near(bodies: Bodies, robots: Whole, reach: float) -> Iterator[Nearby]:
    """Each of these robots, of which one may ask several times, with all others within `reach` m of it over the ground,
    for some of the questions after the other."""
    images, points = bodies.near.images(bodies.x, bodies.y), bodies.near.points(bodies.x, bodies.y)
    chances = candidates(bodies.near.grid, points, images.x[robots], images.y[robots], reach)
    block = np.cumsum(chances) // MAX_PAIRS
    ends = [0, *(np.flatnonzero(np.diff(block)) + 1).tolist(), len(robots)]
    for begin, end in pairwise(ends):
        asked = robots[begin:end]
        robot, other = bodies.machine.pairs(bodies.near.grid, points, images.x, images.y, reach, np.unique(asked))
        by_robot = np.argsort(asked, kind="stable")
        first, last = (np.searchsorted(asked[by_robot], robot, side) for side in ("left", "right"))
        pair, place = spread(np.arange(len(robot)), first, last)
        robot, other = robot[pair], other[pair]
        dx, dy = images.x[other] - images.x[robot], images.y[other] - images.y[robot]
        yield Nearby(begin + by_robot[place], robot, images.whose(other), dx, dy)


def in_sight(bodies: Bodies, pairs: Nearby) -> Flags:
    """In which of these pairs nothing hides the other one."""
    x, y = bodies.x[pairs.other], bodies.y[pairs.other]
    return ~bodies.sight.hidden(pairs.robot, x, y, walls=True, senders=pairs.other)


class Eyes:
    """The scanners and cameras of all `bodies`. near: which colours they show"""

    def __init__(self, bodies: Bodies, near: RangeAndBearing | None) -> None:
        self._bodies, self._near = bodies, near

    def least(self, robots: Whole, first: Floats, last: Floats) -> Floats:
        """See `sectors.least`."""
        bodies = self._bodies
        assert bodies.scanner
        return least(bodies.scanner.model, bodies.scans(robots), first, last)

    def gap(self, robots: Whole, first: Floats, last: Floats, *clear: Floats) -> Floats:
        """See `sectors.gap`."""
        bodies = self._bodies
        assert bodies.scanner
        return gap(bodies.scanner.model, bodies.scans(robots), first, last, *clear)

    def seen(self, robots: Whole, colour: Floats, first: Floats, last: Floats) -> Floats:
        """How many others that show this colour each of these robots sees in the sector from `first` to `last` (rad,
        counter-clockwise from its heading): their centres are within the camera's range, and nothing hides them."""
        bodies, camera, near = self._bodies, self._bodies.scenario.camera, self._near
        assert camera
        assert near
        found = np.zeros(len(robots))
        for pairs in others_near(bodies, robots, camera.reach):
            bearing = arc_tangent(pairs.dy, pairs.dx) - bodies.heading[pairs.robot]
            row = pairs.row
            shown = near.shows(COLOUR, pairs.other) == colour[row]
            pairs = pairs.part(shown & within(bearing, first[row], last[row]))
            found += np.bincount(pairs.part(in_sight(bodies, pairs)).row, minlength=len(robots))
        return found


SCAN = "Angles are counter-clockwise from the heading."


def eye_functions(scenario: Scenario) -> Iterator[HostFunction]:
    """What expressions may call of robots with the scanner and the camera of a scenario."""
    if scenario.laser:
        doc = f"Least range of the scanner's beams from a to b. {SCAN}"
        yield HostFunction(
            **_asking(Eyes.least), name="SCAN-MIN", dimensions=(NONE, NONE), arguments="a b", result=LENGTH, doc=doc
        )
        doc = f"Bearing of the middle of the widest gap that the scanner sees from a to b, free for so far. {SCAN}"
        yield HostFunction(
            **_asking(Eyes.gap),
            name="SCAN-GAP",
            dimensions=(NONE, NONE, LENGTH),
            least=2,
            arguments="a b [free]",
            result=NONE,
            unit="deg",
            doc=doc,
        )
    if scenario.camera:
        doc = f"How many robots of this colour the camera sees from a to b. {SCAN}"
        yield HostFunction(
            **_asking(Eyes.seen),
            name="SEES",
            dimensions=(NONE, NONE, NONE),
            arguments="colour a b",
            result=NONE,
            doc=doc,
        )


def _asking(method: Callable[..., Floats]) -> dict[str, Any]:
    """How such a function is called, of one robot and of many."""

    def many(bodies: Any, robots: Whole, *columns: Floats) -> Floats:
        known = np.isfinite(columns).all(axis=0)
        found = np.full(len(robots), np.nan)
        found[known] = method(bodies.senses.of(Eyes), robots[known], *(column[known] for column in columns))
        return found

    return {"call": partial(_alone, many), "many": many, "acts": False, "repeats": True}


def _alone(many: Callable[..., Floats], body: Body, *arguments: float) -> float:
    return float(many(body, np.array([body.number]), *(np.array([each]) for each in arguments))[0])
