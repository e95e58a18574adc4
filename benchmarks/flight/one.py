"""So many copters in a process of its own; prints one JSON object.

    python -m benchmarks.flight.one '{"copters": 1000, "threads": 2, "numba": true, "warm": 3, "seconds": 5}' [--cpu]

They fly until their rules are native code and `warm` s are over, then for `seconds` s in which ticks are timed, in as
many at once as make a simulated second; three such seconds at least. With --cpu seconds are those of the processor.
"numba": false hides numba and llvmlite, as if they were not installed.
"""

from __future__ import annotations

import sys
import time
from typing import TYPE_CHECKING

from benchmarks.children import answer
from benchmarks.flight import copters as job
from benchmarks.loop.one import Memory, warm_up
from benchmarks.report import Json, middle
from benchmarks.worlds.sides import CPU

if TYPE_CHECKING:
    from sleepcast.loop import Swarm

FEW, LEAST, TICKS = 100, 3, round(1.0 / job.TICK)
"""Copters that fly first, so that all is compiled; simulated seconds that are timed at least; ticks of one."""
clock = time.process_time if CPU in sys.argv else time.perf_counter


def measure(copters: int, threads: int, warm: float, seconds: float) -> Json:
    """What a simulated second takes, s, and what has become of the copters."""
    compiling = warm_up(job.swarm(FEW, threads))
    before = Memory.look()
    began = time.perf_counter()
    swarm = job.swarm(copters, threads)
    setup = time.perf_counter() - began
    began = time.perf_counter()
    while swarm.simulator.tick < TICKS or time.perf_counter() - began < warm:
        swarm.advance(TICKS - swarm.simulator.tick % TICKS)
    taken: list[float] = []
    while len(taken) < LEAST or sum(taken) < seconds:
        taken.append(second(swarm))
    flight = swarm.simulator.bodies.flight
    assert flight is not None
    return {
        "second": middle(taken),
        "seconds": len(taken),
        "setup": setup,
        "compile": compiling,
        "bytes": (Memory.look().now - before.now) / copters,
        "crashed": int(flight.crashed.sum()),
        "flying": int(flight.flying.sum()),
        "awake": swarm.measures()["awake"],
    }


def second(swarm: Swarm) -> float:
    """What a simulated second takes, s."""
    began, end = clock(), swarm.simulator.tick + TICKS
    while swarm.simulator.tick < end:
        swarm.advance(end - swarm.simulator.tick)
    return clock() - began


if __name__ == "__main__":
    answer(measure)
