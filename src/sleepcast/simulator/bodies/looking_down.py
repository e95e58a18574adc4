"""Cameras that look straight down from what flies, and what expressions ask of them: BELOW, BELOW_LIGHTS and the like.

Such a camera sees a cone. What lies d m below it is seen as far from the point beneath it as d times the tangent of
half its opening angle, its *footprint* at that depth; so what stands on a roof has to be nearer to that point than what
stands beside the house. The camera stays level, however the body leans. Roofs and walls hide what the line from the
camera to it does not pass above.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from math import inf, tan
from typing import Any

import numpy as np

from sleepcast.core.model import HostFunction
from sleepcast.core.units import LENGTH, NONE, Dimension
from sleepcast.simulator.bodies.bodies import Bodies, Flags, Floats
from sleepcast.simulator.bodies.body import Body, LackError
from sleepcast.simulator.bodies.range_and_bearing import COLOUR, RangeAndBearing
from sleepcast.simulator.bodies.seeing import Nearby, in_sight, others_near
from sleepcast.simulator.scenario.scenario import Scenario
from sleepcast.simulator.simd.formulas import rotated, shortest, sine_cosine
from sleepcast.simulator.world.grid import Whole

ROUNDING = 1.0 + 1e-9
"""By how much farther is looked than a footprint reaches: exactly that is compared later."""
BLIND = "this robot has no camera that looks down"


class DownCameras:
    """The cameras of all `bodies` that look down. near: which colours they show; None where they show none"""

    def __init__(self, bodies: Bodies, near: RangeAndBearing | None) -> None:
        assert bodies.flight
        self._bodies, self._near, self._z = bodies, near, bodies.flight.z
        self._ground_at = bodies.flight.ground_at
        scenario = bodies.scenario
        self._lights_z = [scenario.ground_at(light.x, light.y) for light in scenario.lights]
        """How high lights are, m."""
        self._slopes = bodies.by_type([tan(spec.camera / 2.0) for spec in bodies.scenario.each_type])
        """How much wider each footprint becomes with each metre of depth, 0 of robots without a camera."""

    @property
    def footprints(self) -> Floats:
        """How far from the point below it each robot sees the ground, m: 0 of those without a camera, or on it."""
        above = np.nan_to_num(self._z) - self._ground_at(self._bodies.x, self._bodies.y)
        reaches: Floats = above * self._slopes
        return reaches

    def lacking(self, robots: Whole) -> Flags:
        """Which of these robots have no camera."""
        lacking: Flags = self._slopes[robots] == 0.0
        return lacking

    def count(self, robots: Whole, *colour: Floats) -> Floats:
        """How many others lie in the footprint of each of these robots; with a colour, of those that show it."""
        found = np.zeros(len(robots))
        for pairs in self._seen(robots, *colour):
            found += np.bincount(pairs.row, minlength=len(robots))
        return found

    def nearest_id(self, robots: Whole, *colour: Floats) -> Floats:
        """The id of the one that lies nearest to the middle of each footprint, NaN without one."""
        return self._nearest(robots, *colour)[0]

    def nearest_x(self, robots: Whole, *colour: Floats) -> Floats:
        """Where that one is in the asker's own frame of reference: x, m."""
        _, dx, dy = self._nearest(robots, *colour)
        return self._placed(robots, dx, dy)[0]

    def nearest_y(self, robots: Whole, *colour: Floats) -> Floats:
        """As `nearest_x`: y, m."""
        _, dx, dy = self._nearest(robots, *colour)
        return self._placed(robots, dx, dy)[1]

    def lights(self, robots: Whole) -> Floats:
        """How many lights lie in the footprint of each of these robots."""
        seen = [np.isfinite(self._light(robots, number)[0]) for number in range(len(self._bodies.scenario.lights))]
        count: Floats = np.sum(seen, axis=0, dtype=np.float64)
        return count

    def light_x(self, robots: Whole) -> Floats:
        """Where the light nearest to the middle of each footprint is in the asker's own frame of reference: x, m; NaN
        without one."""
        return self._placed(robots, *self._nearest_light(robots))[0]

    def light_y(self, robots: Whole) -> Floats:
        """As `light_x`: y, m."""
        return self._placed(robots, *self._nearest_light(robots))[1]

    # ---- what is seen

    def _heights(self, robots: Whole) -> Floats:
        """z of these robots, m: 0 of those on the ground."""
        z: Floats = np.nan_to_num(self._z[robots])
        return z

    def _slopes_of(self, robots: Whole) -> Floats:
        """How much wider the footprint of each of these robots becomes with each metre of depth: 0 on the ground."""
        bodies = self._bodies
        up = self._heights(robots) > self._ground_at(bodies.x[robots], bodies.y[robots])
        return np.where(up, self._slopes[robots], 0.0)

    def _seen(self, robots: Whole, *colour: Floats) -> Iterator[Nearby]:
        """Each of these robots with all others that its camera sees, for some of them after the other."""
        slopes = self._slopes_of(robots)
        reach = float((self._heights(robots) * slopes).max(initial=0.0)) * ROUNDING
        if reach == 0.0:
            return
        for pairs in others_near(self._bodies, robots, reach):
            wide = (self._heights(pairs.robot) - self._heights(pairs.other)) * slopes[pairs.row]
            seen = (wide > 0.0) & (pairs.dx * pairs.dx + pairs.dy * pairs.dy <= wide * wide)
            for wanted in colour:
                assert self._near
                seen &= self._near.shows(COLOUR, pairs.other) == wanted[pairs.row]
            pairs = pairs.part(seen)
            yield pairs.part(in_sight(self._bodies, pairs))

    def _nearest(self, robots: Whole, *colour: Floats) -> tuple[Floats, Floats, Floats]:
        """The id of the one nearest to the middle of each footprint, of equally near ones the smallest, and how far it
        is to the east and to the north, m; NaN without one."""
        found = np.full((3, len(robots)), np.nan)
        for pairs in self._seen(robots, *colour):
            ids = self._bodies.numbers[pairs.other].astype(np.float64) + self._bodies.first_id
            away = pairs.dx * pairs.dx + pairs.dy * pairs.dy
            order = np.lexsort((ids, away, pairs.row))
            row, first = np.unique(pairs.row[order], return_index=True)
            best = order[first]
            found[:, row] = ids[best], pairs.dx[best], pairs.dy[best]
        return found[0], found[1], found[2]

    def _nearest_light(self, robots: Whole) -> tuple[Floats, Floats]:
        """How far the light nearest to the middle of each footprint is to the east and to the north, m."""
        least, found = np.full(len(robots), inf), np.full((2, len(robots)), np.nan)
        for number in range(len(self._bodies.scenario.lights)):
            dx, dy = self._light(robots, number)
            away = dx * dx + dy * dy
            nearer = away < least
            least[nearer], found[:, nearer] = away[nearer], (dx[nearer], dy[nearer])
        return found[0], found[1]

    def _light(self, robots: Whole, number: int) -> tuple[Floats, Floats]:
        """How far a light is from each of these robots to the east and to the north, m; NaN where it is not seen."""
        bodies, light = self._bodies, self._bodies.scenario.lights[number]
        around_x, around_y = bodies.scenario.around
        dx = shortest(light.x - bodies.x[robots], around_x)
        dy = shortest(light.y - bodies.y[robots], around_y)
        deep, away = self._heights(robots) - self._lights_z[number], dx * dx + dy * dy
        slopes = self._slopes_of(robots)
        seen = (deep > 0.0) & (slopes > 0.0) & (away <= (deep * slopes) ** 2) & (away + deep * deep <= light.reach**2)
        may = np.flatnonzero(seen)
        place = np.full(may.size, light.x), np.full(may.size, light.y)
        seen[may] = ~bodies.sight.hidden(robots[may], *place, walls=bodies.scenario.sight.lights)
        return np.where(seen, dx, np.nan), np.where(seen, dy, np.nan)

    def _placed(self, robots: Whole, dx: Floats, dy: Floats) -> tuple[Floats, Floats]:
        """Where something so far to the east and to the north of each robot is, by where that one believes to be."""
        bodies = self._bodies
        x, y, heading = (bodies.sensed[row, robots] for row in range(3))
        dx, dy = rotated(dx, dy, *sine_cosine(heading - bodies.heading[robots]))
        return x + dx, y + dy


_Asked = tuple[str, Callable[..., Floats], Dimension, str]
"""Name, what is asked, dimension of the result, and description."""
_OF_ROBOTS: tuple[_Asked, ...] = (
    ("BELOW", DownCameras.count, NONE, "How many robots the camera sees below."),
    ("BELOW_X", DownCameras.nearest_x, LENGTH, "x of the one nearest to the middle of what the camera sees below."),
    ("BELOW_Y", DownCameras.nearest_y, LENGTH, "y of the one nearest to the middle of what the camera sees below."),
    ("BELOW_ID", DownCameras.nearest_id, NONE, "id of the one nearest to the middle of what the camera sees below."),
)
"""The functions that take a colour."""
_OF_LIGHTS: tuple[_Asked, ...] = (
    ("BELOW_LIGHTS", DownCameras.lights, NONE, "How many lights the camera sees below."),
    ("BELOW_LIGHT_X", DownCameras.light_x, LENGTH, "x of the light nearest to the middle of what the camera sees."),
    ("BELOW_LIGHT_Y", DownCameras.light_y, LENGTH, "y of the light nearest to the middle of what the camera sees."),
)


def down_functions(scenario: Scenario) -> Iterator[HostFunction]:
    """What expressions may call of robots with cameras that look down."""
    if not scenario.robots.camera:
        return
    if scenario.neighbours:
        for function in (_asking(*each) for each in _OF_ROBOTS):
            doc = f"{function.doc} With a colour: of those that show it."
            yield replace(function, dimensions=(NONE,), least=0, arguments="[colour]", doc=doc)
    if scenario.lights:
        yield from (_asking(*each) for each in _OF_LIGHTS)


def _asking(name: str, asked: Callable[..., Floats], result: Dimension, doc: str) -> HostFunction:
    """A function that asks cameras; on a robot without one it fails."""

    def many(bodies: Any, robots: Whole, *columns: Floats) -> Floats | list[float | LackError]:
        cameras: DownCameras = bodies.senses.of(DownCameras)
        lacking = cameras.lacking(robots)
        known = ~lacking & np.isfinite(columns).all(axis=0)
        found = np.full(len(robots), np.nan)
        found[known] = asked(cameras, robots[known], *(column[known] for column in columns))
        if not lacking.any():
            return found
        return [LackError(BLIND) if lacks else value for lacks, value in zip(lacking, found.tolist(), strict=True)]

    return HostFunction(name, partial(_alone, many), result=result, acts=False, doc=doc, many=many, repeats=True)


def _alone(many: Callable[..., Any], body: Body, *arguments: float) -> float:
    """What a function of many bodies gives for one of them. Raises what it fails with."""
    (result,) = many(body, np.array([body.number]), *(np.array([each]) for each in arguments))
    if isinstance(result, LackError):
        raise result
    return float(result)
