"""What lies below a place in the air: the ground, or the roof of something solid that is not higher than the place.

The ground is flat, or as high as the ground map of the world says. Thin
walls have no roofs. A roof belongs to what lies inside of a circle, an area or a polygon of limited height.
"""

from __future__ import annotations

import numpy as np

from sleepcast.simulator.world.areas import inside
from sleepcast.simulator.world.grey_picture import Stretched
from sleepcast.simulator.world.grid import Floats
from sleepcast.simulator.world.torus import PLAIN, Around
from sleepcast.simulator.world.world import Area, Circle, Polygon, World, is_solid_throughout, rows_of

GROUND = 0.0
"""m: where the ground lies in a world without a ground map."""


class Roofs:
    """The ground and the roofs of a world, up to date whenever they are asked for. around: see `torus`; terrain: the
    ground map, None where the ground is flat."""

    def __init__(self, world: World, around: Around = PLAIN, terrain: Stretched | None = None) -> None:
        self._world, self._around, self._terrain, self._version = world, around, terrain, -1
        self._things: list[tuple[Area | Circle | Polygon, float]] = []
        self._boxes: Floats = np.empty((0, 4))

    def __bool__(self) -> bool:
        """Whether anything may lie higher than flat ground."""
        self._keep_up()
        return bool(self._things) or self._terrain is not None

    def ground(self, x: Floats, y: Floats) -> Floats:
        """How high the ground is at each place x, y, m."""
        return np.full(len(x), GROUND) if self._terrain is None else self._terrain.at(x, y)[0]

    def below(self, x: Floats, y: Floats, z: Floats) -> Floats:
        """How high it is, m, below each place x, y, z; of several roofs the highest counts."""
        found = self.ground(x, y)
        self._keep_up()
        for dx, dy in self._images() if self._things else ():
            self._raise(found, x + dx, y + dy, z)
        return found

    def _raise(self, found: Floats, x: Floats, y: Floats, z: Floats) -> None:
        """Let the heights `found` be those of roofs below these places where these are higher."""
        order = np.argsort(x, kind="stable")
        first, last = (np.searchsorted(x[order], self._boxes[:, at], "left") for at in (0, 1))
        for number in np.flatnonzero(first < last).tolist():
            thing, top = self._things[number]
            near = order[first[number] : last[number]]
            near = near[(z[near] >= top) & (y[near] >= self._boxes[number, 2]) & (y[near] < self._boxes[number, 3])]
            over = near[inside(thing, x[near], y[near])]
            found[over] = np.maximum(found[over], top)

    def _images(self) -> list[tuple[float, float]]:
        """By how much places are moved to be met by things where they were defined, on a torus also beyond its edge."""
        if self._around == PLAIN:
            return [(0.0, 0.0)]
        width, height = self._around
        return [(i * width, j * height) for i in (0, 1, -1) for j in (0, 1, -1)]

    def _keep_up(self) -> None:
        if self._version == self._world.version:
            return
        self._version = self._world.version
        shapes = [shape for shape in self._world.shapes.values() if is_solid_throughout(shape)]
        self._things = [(shape, shape.tall) for shape in shapes if shape.tall is not None]
        self._boxes = np.array([_box(thing) for thing, _ in self._things]).reshape(-1, 4)


def _box(thing: Area | Circle | Polygon) -> tuple[float, float, float, float]:
    """Left, right, bottom and top of a rectangle around something solid, m; a bit larger than it."""
    x0, y0, x1, y1, radius = np.array(rows_of(thing)).T
    x, y = np.concatenate((x0, x1)), np.concatenate((y0, y1))
    wide = radius.max() * (1.0 + 1e-9)
    return (
        float(x.min() - wide),
        float(np.nextafter(x.max() + wide, np.inf)),
        float(y.min() - wide),
        float(y.max() + wide),
    )
