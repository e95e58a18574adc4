"""Bumpers: bodies stop at contact and sense where it is; bodies that overlap at the start are moved apart. `Neighbours`
finds what is near a body; `motion.steps` computes how far each one gets.
"""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt

import numpy as np

from sleepcast.core.errors import MisuseError
from sleepcast.simulator.engine import Machine
from sleepcast.simulator.motion.steps import SKIN, Settled
from sleepcast.simulator.scenario.robot_settings import RobotSpec
from sleepcast.simulator.sonar.cones import Seen
from sleepcast.simulator.world.grid import (
    Floats,
    Grid,
    Listed,
    Sorted,
    distance,
    grid_over,
    list_solids,
    pairs,
    sort,
    spread,
)
from sleepcast.simulator.world.world import World


class Neighbours:
    """The spatial index of motion and sonar. size: of the world, m; cell: least side, m; count: of bodies."""

    def __init__(self, size: tuple[float, float], cell: float, count: int, world: World, machine: Machine) -> None:
        self.grid = grid_over(*size, cell, count)
        self.world = world
        self._machine = machine
        self._points: Sorted | None = None
        self._listed: dict[float, Listed] = {}
        self._in_sight: dict[float, Seen] = {}
        self._version = -1

    def forget(self) -> None:
        """Invalidate the sorted bodies: they have moved."""
        self._points = None

    def points(self, x: Floats, y: Floats) -> Sorted:
        """The bodies at x, y (m) by cell."""
        if self._points is None:
            self._points = self._machine.sort(self.grid, x, y)
        return self._points

    def solids(self, reach: float) -> Listed:
        """The world's solids that come within `reach` m of each cell."""
        self._keep_up()
        if reach not in self._listed:
            self._listed[reach] = list_solids(self.grid, self.world, reach)
        return self._listed[reach]

    def in_sight(self, reach: float) -> Seen:
        """The same solids in the form that the machine's sonars use."""
        self._keep_up()
        if reach not in self._in_sight:
            listed = list_solids(self.grid, self.world, reach)
            self._in_sight[reach] = self._machine.in_sight(listed, self.world.solids)
        return self._in_sight[reach]

    def _keep_up(self) -> None:
        """Drop the lists if the world has changed."""
        if self._version != self.world.version:
            self._listed.clear()
            self._in_sight.clear()
            self._version = self.world.version


MAX_ATTEMPTS = 1_000
"""Times that bodies which overlap at the start are put elsewhere: a world that is not full needs a few dozen."""
CELL = 3.0
"""Side of a cell in radii of a body, if nothing else asks for more: about one body fits in."""


class Bumpers:
    """Contact of bodies with each other and with solids. radii: of the bodies, m; reach: greatest distance of a solid
    that a body can touch within one tick, m."""

    def __init__(self, radii: Floats, reach: float, near: Neighbours, machine: Machine) -> None:
        self.radii = radii
        alike = radii.min(initial=np.inf) == radii.max(initial=0.0)
        self._of_each = radii[:1].copy() if alike else radii
        self._near, self._machine, self._reach = near, machine, reach

    def settle(self, x: Floats, y: Floats, across: Floats, up: Floats, settled: Settled) -> None:
        """Write into `settled` how far bodies at x, y (m) get along `across` and `up` (m)."""
        near = self._near
        listed = near.solids(self._reach)
        self._machine.settle(
            near.grid, near.points(x, y), listed, near.world.solids, self._of_each, (x, y), (across, up), settled
        )

    def part(self, x: Floats, y: Floats, anew: Callable[[int], tuple[Floats, Floats]]) -> None:
        """Move bodies until none overlaps another one or a solid. anew: new places for all of them,
        by attempt. Of two that overlap the one with the higher index moves. Raises MisuseError if they do not fit."""
        wide = self._near.grid  # its cells are made for sonars, in which a full room has too many pairs
        fine = grid_over(wide.across * wide.size, wide.up * wide.size, CELL * self.radii.max(), len(x))
        for attempt in range(MAX_ATTEMPTS):
            wrong = self._overlapping(fine, x, y)
            if not len(wrong):
                return
            other_x, other_y = anew(attempt)
            x[wrong], y[wrong] = other_x[wrong], other_y[wrong]
        raise MisuseError(
            f"{len(x)} robots with a radius of {self.radii.max():g} m do not fit where they start: "
            "give them more room, or ask for fewer"
        )

    def _overlapping(self, fine: Grid, x: Floats, y: Floats) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
        every, radii = np.arange(len(x)), self.radii
        i, j = pairs(fine, sort(fine, x, y), x, y, 2.0 * radii.max() + SKIN, every)
        if radii.min() < radii.max():
            close = np.hypot(x[i] - x[j], y[i] - y[j]) <= radii[i] + radii[j] + SKIN
            i, j = i[close], j[close]
        listed, solids = self._near.solids(self._reach), self._near.world.solids
        cell = self._near.grid.cells_of(x, y)
        k, item = spread(every, listed.start[cell], listed.start[cell + 1])
        lines = solids[listed.items[item]]
        inside = distance(x[k], y[k], *lines[:, :4].T) < radii[k] + lines[:, 4] + SKIN
        return np.unique(np.concatenate((i[i > j], k[inside])))


def reach(robots: RobotSpec, tick: float) -> float:
    """How far away a solid may be that a body can touch in one tick, slip included, m."""
    return robots.geometry.radius + SKIN + 2.0 * robots.limits.speed * tick


def least_cell(robots: RobotSpec, size: tuple[float, float], tick: float) -> float:
    """The side of a cell for bodies that only touch, m; larger where they are rare."""
    each = sqrt(size[0] * size[1] / robots.count)  # the side of a square for one robot
    return max(CELL * robots.geometry.radius, reach(robots, tick), each)
