"""Where all bodies are, for who is near whom: on the plane, or in layers where something flies."""

from __future__ import annotations

from sleepcast.core.records import NamedTuple
from sleepcast.simulator.engine import Machine
from sleepcast.simulator.world.grid import Floats, Grid, Sorted, Whole, candidates, pairs, sort
from sleepcast.simulator.world.torus import Images


class Places(NamedTuple):
    """Where all bodies and their images are, for who is near whom. z: m, None on the plane, where `machine` may have
    compiled code; see the functions of `grid` of the same names."""

    images: Images
    z: Floats | None
    machine: Machine

    def sort(self, grid: Grid) -> Sorted:
        x, y, _ = self.images
        return self.machine.sort(grid, x, y) if self.z is None else sort(grid, x, y, self.z)

    def candidates(self, grid: Grid, points: Sorted, reach: float, which: Whole) -> Whole:
        x, y = self.images.x[which], self.images.y[which]
        if self.z is None:
            return self.machine.candidates(grid, points, x, y, reach)
        return candidates(grid, points, x, y, reach, self.z[which])

    def pairs(self, grid: Grid, points: Sorted, reach: float, first: Whole) -> tuple[Whole, Whole]:
        x, y, _ = self.images
        if self.z is None:
            return self.machine.pairs(grid, points, x, y, reach, first)
        return pairs(grid, points, x, y, reach, first, self.z)
