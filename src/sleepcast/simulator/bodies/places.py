"""Where all bodies are, for who is near whom: on the plane, or in layers where something flies."""

from __future__ import annotations

import numpy as np

from sleepcast.core.records import NamedTuple
from sleepcast.simulator.engine import Machine
from sleepcast.simulator.world.grid import Floats, Grid, Sorted, Whole, candidates, pairs, sort
from sleepcast.simulator.world.torus import Images


class Places(NamedTuple):
    """Where all bodies and their images are, for who is near whom. z: m, None on the plane, where `machine` may have
    compiled code; see the functions of `grid` of the same names.

    Where bodies see others at other places than their own, the places from which they look follow those that they see,
    from `own` on; it is 0 where they are the same. Pairs are then of the index of such a place, and of a body.
    """

    images: Images
    z: Floats | None
    machine: Machine
    own: int = 0

    def looking_from(self, x: Floats, y: Floats, z: Floats | None) -> Places:
        """The same, seen from these places; in the frame of the cells, m."""
        seen_x, seen_y, of = self.images
        images = Images(np.append(seen_x, x), np.append(seen_y, y), of)
        return Places(images, None if z is None or self.z is None else np.append(self.z, z), self.machine, len(seen_x))

    def sort(self, grid: Grid) -> Sorted:
        x, y, _ = self.images
        return self.machine.sort(grid, x, y) if self.z is None else sort(grid, x, y, self.z)

    def candidates(self, grid: Grid, points: Sorted, reach: float, which: Whole) -> Whole:
        which = which + self.own
        x, y = self.images.x[which], self.images.y[which]
        if self.z is None:
            return self.machine.candidates(grid, points, x, y, reach)
        return candidates(grid, points, x, y, reach, self.z[which])

    def pairs(self, grid: Grid, points: Sorted, reach: float, first: Whole) -> tuple[Whole, Whole]:
        x, y, _ = self.images
        if self.z is None:
            looking, seen = self.machine.pairs(grid, points, x, y, reach, first + self.own)
        else:
            looking, seen = pairs(grid, points, x, y, reach, first + self.own, self.z)
        if self.own:
            others = seen != looking - self.own  # nobody sees itself, where it was
            looking, seen = looking[others], seen[others]
        return looking, seen
