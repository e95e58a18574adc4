"""Bumpers: bodies stop at contact and sense where it is; bodies that overlap at the start are moved apart.

`motion.contact` computes how far each body gets.
"""

from __future__ import annotations

from collections.abc import Callable
from math import sqrt

import numpy as np

from sleepcast.core.errors import MisuseError
from sleepcast.simulator.bodies.neighbours import Neighbours
from sleepcast.simulator.engine import Machine
from sleepcast.simulator.motion.contact import SKIN, Settled
from sleepcast.simulator.scenario.robot_settings import RobotSpec
from sleepcast.simulator.world.grid import Floats, Grid, distance, grid_over, pairs, sort, spread

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
