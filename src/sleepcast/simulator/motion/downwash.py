"""Downwash: the air below what flies pushes down whoever is in it. SI.

Two quadrotors of 34 g, one below the other, were measured by Shi et al., "Neural-Swarm" (ICRA 2020, arXiv 2003.02992,
fig. 3). The line here is a rough reading of that figure: the lower one is pushed down with about 10 grams of force at
0.2 m, 8 at 0.3, 6 at 0.4 and 4 at 0.5 m, so with 14 - 20 z grams at z m, and no more from 0.7 m on. Their radius is
that of a Crazyflie, 0.07 m. Distances are taken in radii of the upper body, since bodies with as much weight on as
much area blow as fast.

The air is a cone: with each metre down, a round turbulent jet is half as fast 0.094 m farther from its middle (Pope,
"Turbulent Flows", 2000, section 5.1). The push falls evenly to nothing at twice that distance, to which the radius of
the body is added.
"""

from __future__ import annotations

import numpy as np

from sleepcast.simulator.scenario.flight import GRAVITY
from sleepcast.simulator.world.grid import Floats

MEASURED_RADIUS = 0.07
"""m."""
STRONGEST = GRAVITY * 14.0 / 34.0
"""m/s2, directly below."""
DEEP = 0.7 / MEASURED_RADIUS
"""Radii below a body where its downwash ends."""
SPREAD = 0.094


def widest(radius: float) -> float:
    """How far aside of a body with this radius anything is pushed at most, m."""
    return 2.0 * (1.0 + SPREAD * DEEP) * radius


def push(below: Floats, aside: Floats, radius: Floats) -> Floats:
    """The acceleration downwards of what is so far below and aside of a body with this radius, m/s2."""
    depth = below / (DEEP * radius)
    beside = aside / (2.0 * (radius + SPREAD * below))
    strength = STRONGEST * (1.0 - depth) * (1.0 - beside)
    pushed: Floats = np.where((below > 0.0) & (depth < 1.0) & (beside < 1.0), strength, 0.0)
    return pushed
