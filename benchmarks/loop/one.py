"""One crowd, in a process of its own; prints one JSON object.

    python -m benchmarks.loop.one '{"robots": 1000, "area": 4, "walls": true, "threads": 2, "numba": true,
                                    "warm": 3, "seconds": 5, "in_order": false}'

A small crowd runs first, so that compiling and loading is over and its memory is there before the large one is made;
what the process grows by after that belongs to the robots. Then so many seconds of warming up, in which rules become
native code, and then seconds of simulated time are timed one by one, three at least. "numba": false hides numba and
llvmlite, as if they were not installed.
"""

from __future__ import annotations

import resource
import sys
import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

from benchmarks.children import answer
from benchmarks.report import Json, middle

if TYPE_CHECKING:
    from sleepcast.loop import Swarm

FEW = 200
"""Robots of the small crowd."""
SEED = 5
LEAST = 3
"""Simulated seconds that are timed at least."""
TICKS = 10
"""In a simulated second."""
PAUSE = 0.036
"""s between an echo and the next ping, where sonars fire in order: two of them in a tick of 0.1 s."""
ORDER = (0, 2, 15, 1, 14, 3, 13, 4, 12, 5, 11, 6, 10, 7, 9, 8)
"""In which no sonar fires right after its neighbour."""


@dataclass(frozen=True)
class Memory:
    """Bytes of this process: now, and at its most."""

    now: int
    most: int

    @staticmethod
    def look() -> Memory:
        try:
            lines = Path("/proc/self/status").read_text().splitlines()
        except OSError:  # no Linux: only the most is told, in bytes or kB
            most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
            return Memory(most, most)
        values = {line.partition(":")[0]: line.split()[1] for line in lines if line.startswith(("VmRSS", "VmHWM"))}
        return Memory(int(values["VmRSS"]) * 1024, int(values["VmHWM"]) * 1024)


def crowd(robots: int, area: float, walls: bool, threads: int, in_order: bool = False) -> Swarm:
    """A crowd whose operator broadcasts the ten rules at its first tick. in_order: its sonars fire one after another,
    about two in a tick."""
    from sleepcast.api.assembly import assemble
    from sleepcast.simulator import Changes, find_scenario

    scenario = find_scenario("crowd", Changes(robots, area, walls))
    if in_order and scenario.robots.ring:
        ring = replace(scenario.robots.ring, pause=PAUSE, order=ORDER)
        scenario = replace(scenario, robots=replace(scenario.robots, ring=ring))
    return assemble(scenario, SEED, mission=True, threads=threads)[0]


def measure(
    robots: int, area: float, walls: bool, threads: int, warm: float, seconds: float, in_order: bool = False
) -> Json:
    """One row of the table. Times in s: compile and set-up apart, `second` and `cpu` for a simulated second."""
    compiling = warm_up(crowd(FEW, area, walls, threads, in_order))
    before = Memory.look()
    begin = time.perf_counter()
    swarm = crowd(robots, area, walls, threads, in_order)
    setup = time.perf_counter() - begin
    first, _ = timed(swarm, 1)
    begin = time.perf_counter()
    while swarm.simulator.tick < TICKS or time.perf_counter() - begin < warm:
        swarm.step()
    taken: list[float] = []
    cpus: list[float] = []
    while len(taken) < LEAST or sum(taken) < seconds:
        wall, cpu = timed(swarm, TICKS)
        taken.append(wall)
        cpus.append(cpu)
    after = Memory.look()
    return {
        "compile": compiling,
        "setup": setup,
        "first_tick": first,
        "second": middle(taken),
        "best": min(taken),
        "cpu": middle(cpus),
        "seconds": len(taken),
        "bytes": (after.now - before.now) / robots,
        "most_bytes": (after.most - before.now) / robots,
        "awake": swarm.measures()["awake"],
    }


def warm_up(swarm: Swarm) -> float:
    """Seconds until all is compiled, rules that became native code included, and has run."""
    begin = time.perf_counter()
    timed(swarm, TICKS)
    if swarm.fleet.kernels is not None:
        swarm.fleet.kernels.settle()
    timed(swarm, TICKS)
    return time.perf_counter() - begin


def timed(swarm: Swarm, ticks: int) -> tuple[float, float]:
    """Seconds on the wall clock, and of the processor, that so many ticks take."""
    begin, begin_cpu = time.perf_counter(), time.process_time()
    for _ in range(ticks):
        swarm.step()
    return time.perf_counter() - begin, time.process_time() - begin_cpu


if __name__ == "__main__":
    answer(measure)
