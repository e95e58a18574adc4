"""How high the ground of a simulated world is, as pages show it."""

from __future__ import annotations

import numpy as np

from sleepcast.console.view import ReliefMap
from sleepcast.simulator import Scenario

MOST = 128
"""Points along the longer side: 32 kilobytes at most."""
STEPS = 65_535.0
"""Of the scale, above the lowest."""


def relief_of(scenario: Scenario) -> ReliefMap | None:
    """The ground map of a scenario, None where the ground is flat."""
    terrain, size = scenario.terrain, (scenario.width, scenario.height)
    if terrain is None:
        return None
    columns, rows = (max(2, round(MOST * side / max(size))) for side in size)
    x, y = np.meshgrid(np.linspace(0.0, size[0], columns), np.linspace(0.0, size[1], rows))
    heights = terrain.at(x.ravel(), y.ravel())[0]
    low, high = float(heights.min()), float(heights.max())
    steps = np.round((heights - low) * (STEPS / (high - low))) if high > low else np.zeros(len(heights))
    return ReliefMap(columns, rows, steps.astype("<u2").tobytes(), low, high)
