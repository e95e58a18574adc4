"""What robots of a simulated world see, as the map shows it: now, and where a recording says that they were.

Whether a line is blocked, and where, is known from `world.sight` alone, as in the run itself. What is lost by chance on
the way (`[neighbours] loss`) is not told here. What a scanner measured was not recorded, so that recordings show none.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import hypot, inf, pi

import msgspec
import numpy as np

from sleepcast.console.features.sight import MAX_SIGHT_LINES, Sense, SightLine, SightView
from sleepcast.console.frames import places_of
from sleepcast.console.timeline import Track
from sleepcast.console.view import Outline
from sleepcast.simulator import Scenario, Shape, Simulator
from sleepcast.simulator.bodies.line_of_sight import LineOfSight
from sleepcast.simulator.engine import NumPyMachine
from sleepcast.simulator.scenario.groups import seeing
from sleepcast.simulator.world.grid import Floats, Whole
from sleepcast.simulator.world.sight import stops, unrolled
from sleepcast.simulator.world.world import World

DIRECTIONS = 360
"""In which the area that a robot overlooks is measured, besides those to ends of walls."""
MAX_ENDS = 120
"""Ends of walls to which it is measured exactly: the nearest ones."""
BESIDE = 1e-5
"""How far beside such an end, rad."""


def senses_of(scenario: Scenario) -> tuple[str, ...]:
    """The senses of a scenario's robots that see or hear something elsewhere."""
    there = {
        "neighbours": scenario.neighbours,
        "pings": scenario.pings,
        "lights": scenario.lights,
        "scanner": scenario.laser,
    }
    return tuple(name for name, sense in there.items() if sense)


def sight_now(simulator: Simulator, robot: int) -> SightView:
    """What a robot sees now. Changes nothing that a run depends on."""
    bodies = simulator.bodies
    view = _Observer(simulator.scenario, bodies.sight, (bodies.x, bodies.y), robot).view()
    return msgspec.structs.replace(view, scan=_scan_of(simulator, robot))


def _scan_of(simulator: Simulator, robot: int) -> Outline:
    """Where the beams of a robot's scanner have met something."""
    bodies, laser = simulator.bodies, simulator.scenario.laser
    if laser is None:
        return ()
    ranges = simulator.scans(np.array([robot]))[0].astype(np.float64)
    met = np.isfinite(ranges)
    angles = (bodies.heading[robot] + laser.angles)[met]
    x, y = bodies.x[robot] + ranges[met] * np.cos(angles), bodies.y[robot] + ranges[met] * np.sin(angles)
    return _corners(x, y)


class RecordedSight:
    """What robots of a recording saw.

    radii: of their bodies, m
    poses: as in a frame, each with its tick
    solids: what was solid, from each time on
    """

    def __init__(
        self, scenario: Scenario, radii: Floats, poses: Track[tuple[int, bytes]], solids: Track[tuple[Shape, ...]]
    ) -> None:
        self._scenario, self._poses, self._solids, self._number = scenario, poses, solids, -1
        self._places: Floats = np.zeros((2, len(radii)))
        self._radii = radii

    def __call__(self, time: float, robot: int) -> SightView:
        """What this robot saw at a time, s, when poses were recorded last."""
        number = self._solids.before(time)
        if number != self._number:
            world = World(self._solids.values[max(number - 1, 0)])
            places = self._places[0], self._places[1]
            self._sight = LineOfSight(self._scenario, world, NumPyMachine(), places, self._radii)
            self._number = number
        _, poses = self._poses.at(time) or self._poses.values[0]
        self._places[:] = places_of(poses, len(self._radii))[:2]
        self._sight.moved = True
        return _Observer(self._scenario, self._sight, (self._places[0], self._places[1]), robot).view()


class _Observer:
    """One robot that looks around; see `sight_now`."""

    def __init__(self, scenario: Scenario, sight: LineOfSight, places: tuple[Floats, Floats], robot: int) -> None:
        self._scenario, self._sight, self._places, self._robot = scenario, sight, places, robot
        self._x, self._y = (float(each[robot]) for each in places)

    def view(self) -> SightView:
        lines = (*self._to_robots("neighbours"), *self._to_robots("pings"), *self._to_lights())
        return SightView(self._x, self._y, lines, self._area())

    def _to_robots(self, sense: Sense) -> Iterator[SightLine]:
        scenario, model = self._scenario, self._scenario.sight
        if sense == "neighbours":
            reach, walls = scenario.neighbours.reach if scenario.neighbours else -1.0, model.neighbours
        else:
            reach, walls = scenario.pings.reach if scenario.pings else -1.0, model.pings
        x, y, away = self._seen_at(*self._places)
        away[self._robot] = inf
        near = _nearest(away, reach)
        asked, bodies = np.full(near.size, self._robot), sense == "pings"
        shares = self._sight.stops(asked, x[near], y[near], walls=walls, bodies=bodies, senders=near)
        yield from self._lines(sense, near, x[near], y[near], shares)

    def _to_lights(self) -> Iterator[SightLine]:
        lights, places = self._scenario.lights, self._places
        if not seeing(self._scenario.robots.groups, len(places[0]))[self._robot]:
            return
        x, y, away = self._seen_at(np.array([each.x for each in lights]), np.array([each.y for each in lights]))
        near = _nearest(away, np.array([each.reach for each in lights]))
        asked, walls = np.full(near.size, self._robot), self._scenario.sight.lights
        shares = self._sight.stops(asked, x[near], y[near], walls=walls, bodies=True)
        yield from self._lines("lights", np.full(near.size, -1), x[near], y[near], shares)

    def _seen_at(self, x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
        """Where the robot sees what stands at x, y, and how far away that is, m."""
        across, up = self._scenario.around
        x, y = unrolled(np.full(len(x), self._x), x, across), unrolled(np.full(len(y), self._y), y, up)
        return x, y, np.hypot(x - self._x, y - self._y)

    def _lines(self, sense: Sense, robots: Whole, x: Floats, y: Floats, shares: Floats) -> Iterator[SightLine]:
        for robot, to_x, to_y, share in zip(robots.tolist(), x.tolist(), y.tolist(), shares.tolist(), strict=True):
            stop = (self._x + share * (to_x - self._x), self._y + share * (to_y - self._y))
            yield SightLine(sense, robot, to_x, to_y, None if share == inf else stop)

    def _area(self) -> Outline:
        reach, walls = self._farthest(), self._sight.walls
        self._sight.keep_up()
        if reach <= 0.0 or not walls:
            return ()
        angles = self._directions(reach)
        x, y = np.full(angles.size, self._x), np.full(angles.size, self._y)
        dx, dy = reach * np.cos(angles), reach * np.sin(angles)
        shares = np.minimum(stops(walls, x, y, x + dx, y + dy), self._in_world(dx, dy))
        return _corners(x + shares * dx, y + shares * dy)

    def _in_world(self, dx: Floats, dy: Floats) -> Floats:
        """Which share of each way that begins at the robot lies in the world, 1 for all of it, as on a torus."""
        shares, scenario = np.ones(len(dx)), self._scenario
        if scenario.torus:
            return shares
        for place, ways, side in ((self._x, dx, scenario.width), (self._y, dy, scenario.height)):
            room = np.where(ways > 0.0, side - place, -place)
            np.minimum(shares, np.divide(room, ways, out=np.ones(len(ways)), where=ways != 0.0), out=shares)
        return np.maximum(shares, 0.0)

    def _farthest(self) -> float:
        """How far the farthest of the senses reaches from which walls hide things, m; on a torus less than half of the
        world, in any other one no farther than its diagonal."""
        scenario, model = self._scenario, self._scenario.sight
        reaches = [each.reach for each in scenario.lights if model.lights]
        if scenario.neighbours and model.neighbours:
            reaches.append(scenario.neighbours.reach)
        if scenario.pings and model.pings:
            reaches.append(scenario.pings.reach)
        size = scenario.width, scenario.height
        return min(max(reaches, default=0.0), min(size) / 2.0 if scenario.torus else hypot(*size))

    def _directions(self, reach: float) -> Floats:
        """In which the area is measured, rad, in order: evenly, and on both sides of ends of walls."""
        solids = self._sight.walls.solids
        width, height = self._scenario.width, self._scenario.height
        corners = np.array(((0.0, 0.0), (width, 0.0), (0.0, height), (width, height)))
        ends = np.unique(np.concatenate((solids[:, :2], solids[:, 2:4], corners)), axis=0) - (self._x, self._y)
        away = np.hypot(ends[:, 0], ends[:, 1])
        some = ends[_nearest(away, reach)[:MAX_ENDS]]
        to_ends = np.arctan2(some[:, 1], some[:, 0])
        even = np.linspace(-pi, pi, DIRECTIONS, endpoint=False)
        return np.unique(np.concatenate((even, to_ends - BESIDE, to_ends, to_ends + BESIDE)))


def _corners(x: Floats, y: Floats) -> Outline:
    """Points as pages are told them: more digits than can be seen would only take time."""
    return tuple((x, y) for x, y in np.round(np.stack((x, y), axis=1), 4).tolist())


def _nearest(away: Floats, reach: float | Floats) -> Whole:
    """The indices of what is no farther away than this, the nearest first, as many as are shown."""
    near = np.flatnonzero(away <= reach)
    return near[np.argsort(away[near], kind="stable")][:MAX_SIGHT_LINES]
