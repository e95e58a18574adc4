"""A grid over the world with bodies sorted by cell and solids listed by cell, rebuilt only when something has moved."""

from __future__ import annotations

from sleepcast.simulator.engine import Machine
from sleepcast.simulator.sonar.cones import Seen
from sleepcast.simulator.world.grid import Floats, Listed, Sorted, grid_over, list_solids
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
