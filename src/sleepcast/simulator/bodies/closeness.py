"""Which flying bodies are so near to others that they may touch: a quick look before ways are compared.

Compiled code keeps a list of pairs that may touch soon, and looks at these alone. Without it everybody counts as near.
"""

from __future__ import annotations

from functools import cached_property

import numpy as np

from sleepcast.simulator.bodies.bodies import Bodies, Whole
from sleepcast.simulator.bodies.flight import Flight
from sleepcast.simulator.motion.touching import EACH, OVERFLOWED, Airborne, NearPairs, pairs_of
from sleepcast.simulator.simd.cached import CachedKernels

kernels_touching = CachedKernels("motion.kernels_touching")
MOST = 16 * EACH
"""Pairs for each body at most: where there are more, everybody counts as near."""


class Closeness:
    """The quick look of a world. flight: of these bodies."""

    def __init__(self, bodies: Bodies, flight: Flight) -> None:
        self._bodies, self._flight = bodies, flight
        self._each = EACH

    @cached_property
    def airborne(self) -> Airborne:
        """The bodies for compiled code."""
        bodies, flight = self._bodies, self._flight
        radii = np.array(bodies.radii)
        (way_x, way_y, way_z), where = flight.way, (bodies.x, bodies.y, flight.z, flight.ground)
        return Airborne(*where, way_x, way_y, way_z, radii, float(radii.max()), *bodies.scenario.around)

    @cached_property
    def pairs(self) -> NearPairs:
        """Those that compiled code looks at."""
        bodies = self._bodies
        top = max(spec.limits.ceiling for spec in bodies.scenario.each_type if spec.flight is not None)
        size = bodies.scenario.width, bodies.scenario.height, min(top, bodies.scenario.width + bodies.scenario.height)
        return pairs_of(bodies.count, self._each * (bodies.count + EACH), size, bodies.scenario.around)

    def grow(self) -> bool:
        """Make room for more pairs; False if there is enough for all but a crowd."""
        if self._each == MOST:
            return False
        self._each *= 2
        self.__dict__.pop("pairs", None)
        return True

    def of(self, which: Whole) -> Whole:
        """Those of these bodies that may have touched another one in the tick that is over, and perhaps others."""
        if not self._bodies.machine.compiles or self._bodies.population is not None:
            return which
        while (found := kernels_touching.touching(self.airborne, self.pairs)) == OVERFLOWED:
            if not self.grow():
                return which
        touched = which[self.pairs.touched[which]]
        if found:
            self.pairs.touched[:] = False
        return touched
