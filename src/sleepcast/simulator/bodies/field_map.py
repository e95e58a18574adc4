"""Fields as maps, for whoever shows them: the values in the middles of the cells of a coarse grid over the world."""

from __future__ import annotations

from math import ceil

import numpy as np

from sleepcast.core.records import dataclass
from sleepcast.simulator.bodies.bodies import Floats
from sleepcast.simulator.bodies.line_of_sight import BetweenWalls
from sleepcast.simulator.bodies.local_fields import cell_middles, values
from sleepcast.simulator.engine import NumPyMachine
from sleepcast.simulator.motion.wind import flow
from sleepcast.simulator.scenario.fields import Field, VectorField
from sleepcast.simulator.scenario.scenario import Scenario
from sleepcast.simulator.world.world import World


@dataclass(frozen=True, slots=True)
class FieldMap:
    """values: in SI, shape (rows, columns), the bottom row first; of a vector field how long the vectors are. angles:
    where these point, rad, counter-clockwise from x, in the same shape; None of others."""

    values: Floats
    angles: Floats | None = None


def still_map(field: Field, scenario: Scenario, most: int, world: World | None = None) -> FieldMap:
    """A field of a scenario that does not grow, or the start of one that does.

    most: cells along the longer side
    world: whose walls hide hills; by default those with which the scenario begins
    """
    side = max(scenario.width, scenario.height) / most
    columns, rows = (max(1, ceil(each / side - 1e-9)) for each in (scenario.width, scenario.height))
    size = (scenario.width, scenario.height)
    x, y = cell_middles(columns, rows, size)
    if isinstance(field, VectorField):
        east, north = (each.reshape(rows, columns) for each in flow(field, x, y, scenario.around))
        return FieldMap(np.hypot(east, north), np.arctan2(north, east))
    sight = BetweenWalls(scenario, World(scenario.shapes) if world is None else world, NumPyMachine())
    return FieldMap(values(field, x, y, size, scenario.around, sight.from_points(x, y))[0].reshape(rows, columns))


def coarse(amount: Floats, most: int) -> FieldMap:
    """The cells of a growing field, or the means of blocks of them where there are more than `most` along a side."""
    means = amount.copy()
    for axis in (0, 1):
        length = means.shape[axis]
        blocks = -(-length // ceil(length / most))
        starts = np.arange(blocks) * length // blocks
        counts = np.diff(starts, append=length)
        means = np.add.reduceat(means, starts, axis) / (counts[:, None] if axis == 0 else counts)
    return FieldMap(means)
