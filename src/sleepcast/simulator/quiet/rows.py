"""The robots of many worlds as rows, world by world, for programs that drive all of them in every step.

Python would need some microseconds for each world; compiled code goes through all of them in one call.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from sleepcast.simulator.quiet import layout as words
from sleepcast.simulator.simd.cached import CachedKernels
from sleepcast.simulator.simulation import Simulator

kernels_rows = CachedKernels("quiet.kernels_rows")

Floats = NDArray[np.float64]
NOTHING: Floats = np.empty(0)


class WorldRows:
    """Robots of worlds with equal sensors. simulators: their worlds, in order."""

    def __init__(self, simulators: Sequence[Simulator]) -> None:
        self._words = np.zeros((len(simulators), words.ROW_WORDS), np.int64)
        self._kept = list(simulators)
        self.count = 0
        for row, simulator in zip(self._words, simulators, strict=True):
            row[words.ROBOTS] = self.count
            self.count += self._fill(row, simulator)
        self._table = self._words.ctypes.data + 8 * words.ROW_WORDS * np.arange(len(simulators))
        self._sensed = np.empty((len(simulators[0].sensed), self.count))

    def _fill(self, row: NDArray[np.int64], simulator: Simulator) -> int:
        bodies = simulator.bodies
        columns = bodies.stopped, bodies.mode, bodies.wanted_speed, bodies.wanted_turn, simulator.sensed
        assert all(column.flags.c_contiguous for column in columns)
        row[words.SIZE], row[words.HALTED :] = bodies.count, [column.ctypes.data for column in columns]
        return bodies.count

    def replace(self, number: int, simulator: Simulator) -> None:
        """Put another world with as many robots in the place of one."""
        self._kept[number] = simulator
        self._fill(self._words[number], simulator)

    def drive(self, speeds: Floats | None, turns: Floats | None) -> None:
        """Let all robots drive at these speeds (m/s) and turn rates (rad/s), one for each row, as `Simulator.act` does;
        None leaves what was wanted before."""
        given = (NOTHING if each is None else np.ascontiguousarray(each, np.float64) for each in (speeds, turns))
        kernels_rows.drive(self._table, *given, 0, len(self._table))

    def sensed(self) -> Floats:
        """What all robots have sensed, SI, shape (sensors, rows): one and the same array each time."""
        kernels_rows.gather(self._table, self._sensed, 0, len(self._table))
        return self._sensed
