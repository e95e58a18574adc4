"""What expressions ask of scanners and cameras: SCAN-MIN, SCAN-GAP and SEES."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial
from itertools import pairwise
from typing import Any

import numpy as np

from sleepcast.core.model import HostFunction
from sleepcast.core.units import LENGTH, NONE
from sleepcast.simulator.bodies.bodies import Bodies, Floats
from sleepcast.simulator.bodies.body import Body
from sleepcast.simulator.bodies.range_and_bearing import COLOUR, RangeAndBearing
from sleepcast.simulator.laser.sectors import gap, least, within
from sleepcast.simulator.scenario.scanners import CameraModel
from sleepcast.simulator.scenario.scenario import Scenario
from sleepcast.simulator.simd.formulas import arc_tangent
from sleepcast.simulator.world.grid import Whole, candidates, spread

MAX_PAIRS = 1 << 20
"""Pairs of robots that cameras look at together: some hundred megabytes."""


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
        bodies, camera = self._bodies, self._bodies.scenario.camera
        assert camera
        images = bodies.near.images(bodies.x, bodies.y)
        points = bodies.near.points(bodies.x, bodies.y)
        chances = candidates(bodies.near.grid, points, images.x[robots], images.y[robots], camera.reach)
        block = np.cumsum(chances) // MAX_PAIRS
        ends = [0, *(np.flatnonzero(np.diff(block)) + 1).tolist(), len(robots)]
        found = np.zeros(len(robots))
        for begin, end in pairwise(ends):
            some = slice(begin, end)
            found[some] = self._seen_by(camera, robots[some], colour[some], first[some], last[some])
        return found

    def _seen_by(self, camera: CameraModel, robots: Whole, colour: Floats, first: Floats, last: Floats) -> Floats:
        """As `seen`, for some robots, of which one may ask several times: for each of its neighbours."""
        bodies, near = self._bodies, self._near
        assert near
        images, grid = bodies.near.images(bodies.x, bodies.y), bodies.near.grid
        points, asking = bodies.near.points(bodies.x, bodies.y), np.unique(robots)
        robot, other = bodies.machine.pairs(grid, points, images.x, images.y, camera.reach, asking)
        by_robot = np.argsort(robots, kind="stable")
        begin, end = (np.searchsorted(robots[by_robot], robot, side) for side in ("left", "right"))
        pair, place = spread(np.arange(len(robot)), begin, end)
        robot, other, row = robot[pair], other[pair], by_robot[place]
        dx, dy = images.x[other] - images.x[robot], images.y[other] - images.y[robot]
        other = images.whose(other)
        bearing = arc_tangent(dy, dx) - bodies.heading[robot]
        matched = (near.shows(COLOUR, other) == colour[row]) & within(bearing, first[row], last[row])
        robot, other, row = robot[matched], other[matched], row[matched]
        hidden = bodies.sight.hidden(robot, bodies.x[other], bodies.y[other], walls=True, senders=other)
        seen: Floats = np.bincount(row[~hidden], minlength=len(robots)).astype(np.float64)
        return seen


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
