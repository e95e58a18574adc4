"""What robots have in view: a cone around their own direction, and all that is very near.

`neighbours.kernels_field` computes the same, compiled.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from sleepcast.simulator.motion.steering import pointing
from sleepcast.simulator.neighbours.neighbourhood import ALL_SIDES, edge_of
from sleepcast.simulator.scenario.signals import NeighbourModel
from sleepcast.simulator.simd.formulas import sine_cosine

Floats = NDArray[np.float64]
Flags = NDArray[np.bool_]
Whole = NDArray[np.int64]


class FieldOfView:
    """The fields of view of all bodies: of these true headings, and pitches; None where all look level. rad"""

    def __init__(self, model: NeighbourModel, heading: Floats, pitch: Floats | None) -> None:
        self._edge, self._all_round = edge_of(model), model.all_round
        self._heading, self.pitch = heading, pitch

    @property
    def is_narrow(self) -> bool:
        """Whether anything is out of view at all."""
        return self._edge > ALL_SIDES

    def holds(self, robots: Whole, dx: Floats, dy: Floats, dz: Floats | None, away: Floats) -> Flags:
        """Whether each of these robots senses what is so far from it (m, in the world's frame; dz: None on the plane).
        away: the lengths of these vectors, m"""
        ahead, aside, upwards = (part[robots] for part in self._directions())
        along = dx * ahead + dy * aside
        along = along if dz is None else along + dz * upwards
        seen: Flags = (along >= self._edge * away) | (away <= self._all_round)
        return seen

    def _directions(self) -> tuple[Floats, Floats, Floats]:
        """The unit vector of each body's own direction."""
        if self.pitch is not None:
            return pointing(self._heading, self.pitch)
        sine, cosine = sine_cosine(self._heading)
        return cosine, sine, np.zeros_like(cosine)
