"""Two machines for a rehearsal by two processes: neither needs the kernels that take the other one longest."""

from __future__ import annotations

import numpy as np

from sleepcast.simulator.cones import Ranges, View
from sleepcast.simulator.fast import NumbaMachine
from sleepcast.simulator.fields import Shots
from sleepcast.simulator.grid import Floats, Whole
from sleepcast.simulator.noise import Ear


class Sightless(NumbaMachine):
    """A machine whose sonars see nothing."""

    def _squares(self, view: View, which: Whole, *, forward: bool = False) -> Ranges:
        return np.zeros((len(which), view.cones.count), np.float32)

    def _shoot(self, view: View, shots: Shots) -> None:
        pass


class Deaf(NumbaMachine):
    """A machine whose sonars tell nobody what they see."""

    def hear(self, view: View, which: Whole, ear: Ear, sensed: Floats) -> None:
        self._squares(view, which)
