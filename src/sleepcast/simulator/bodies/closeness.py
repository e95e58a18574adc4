"""Which flying bodies are so near to others that they may touch: a quick look before ways are compared.

It asks the compiled code of neighbours how many are within a ball around each, so it goes through the same cells in
layers. Without compiled code, and where bodies are few, everybody counts as near.
"""

from __future__ import annotations

import numpy as np

from sleepcast.simulator.bodies.bodies import Bodies, Floats, Whole
from sleepcast.simulator.bodies.flight import Flight
from sleepcast.simulator.neighbours.neighbourhood import ONE, TOTAL, BodyTables, Formula, Neighbourhood
from sleepcast.simulator.scenario.signals import NeighbourModel
from sleepcast.simulator.world.sight import SightLines

ALL_SEEN = NeighbourModel(reach=np.inf, loss=0.0, noise=0.0, shares={})
MANY = 1_000
"""Bodies from which on it is worth while: to compile that code takes seconds, and pairs of few take none."""
ROUNDING = 1e-6
"""m by which the look goes farther than anything can be that touches."""


class Closeness:
    """The quick look of a world. flight: of these bodies."""

    def __init__(self, bodies: Bodies, flight: Flight) -> None:
        self._bodies = bodies
        self._near: Neighbourhood | None = None
        if bodies.machine.compiles and bodies.count >= MANY:
            nothing = np.zeros((1, bodies.count))
            tables = (bodies.x, bodies.y, bodies.heading, *bodies.sensed[:3], nothing, nothing, (flight.z, flight.z))
            sight = SightLines((bodies.scenario.width, bodies.scenario.height))
            self._near = Neighbourhood(bodies.scenario, ALL_SEEN, bodies.seed, BodyTables(*tables), sight)

    def of(self, which: Whole, way: Floats) -> Whole:
        """Those of these bodies that may have touched another one in the tick that is over, and perhaps others. way: of
        all bodies in it, m, shape (3, count)."""
        if self._near is None:
            return which
        bodies, longest = self._bodies, float(np.sqrt(np.max((way * way).sum(axis=0), initial=0.0)))
        reach = 2.0 * (float(bodies.radii.max()) + longest) + ROUNDING
        self._near.step(bodies.tick)
        vicinity = self._near.vicinity(reach, bodies.tick, turning=False)
        radius, colour = np.full(which.size, reach), np.full(which.size, np.nan)
        found: Whole = which[bodies.machine.neighbours(vicinity, Formula(ONE, TOTAL), which, radius, colour) > 0.0]
        return found
