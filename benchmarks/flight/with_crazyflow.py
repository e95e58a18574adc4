"""Drones of crazyflow in one world, in a process of its own; prints one JSON object.

    python -m benchmarks.flight.with_crazyflow DRONES SECONDS [--cpu]

Its simplest model, at its own 500 Hz, without contact, neighbours or rules: they hover. A second of theirs is one call,
as often as fits into SECONDS, three times at least, after one that compiles.
"""

from __future__ import annotations

import json
import sys
import time
from importlib.metadata import version
from statistics import median

import jax
import numpy as np
from crazyflow.control import Control
from crazyflow.dynamics import Dynamics
from crazyflow.sim import Sim

HERTZ, LEAST = 500, 3
CPU = "--cpu"
"""As in `benchmarks.worlds.sides`, which this Python may not be able to import."""
THRUST = 0.45
"""N of a drone that about hovers."""


def main() -> None:
    drones, seconds = int(sys.argv[1]), float(sys.argv[2])
    clock = time.process_time if CPU in sys.argv else time.perf_counter
    sim = Sim(n_worlds=1, n_drones=drones, dynamics=Dynamics.so_rpy, control=Control.attitude, freq=HERTZ, device="cpu")
    sim.attitude_control(np.tile(np.array([0.0, 0.0, 0.0, THRUST], np.float32), (1, drones, 1)))
    taken: list[float] = []
    while len(taken) <= LEAST or sum(taken[1:]) < seconds:
        began = clock()
        sim.step(HERTZ)
        jax.block_until_ready(sim.data)
        taken.append(clock() - began)
    setting = f"crazyflow {version('crazyflow')}, so_rpy, attitude, one world, {HERTZ} Hz"
    print(json.dumps({"setting": setting, "second": median(taken[1:]), "seconds": len(taken) - 1}))


if __name__ == "__main__":
    main()
