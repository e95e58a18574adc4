"""Prints what the bodies of the scenario `crowd` cost for a robot and a tick, on each machine, and the bars beside it.

    python -m benchmarks.simulator [--quick] [--json] [--density M2] [--no-walls]

The robots drive circles of their own, without minds, so that nothing but the simulator is measured: a tick is motion
with contact, and one look of all sonars. Times are the medians of several ticks on the wall clock, after one that
compiles and warms everything up. `real time` is how many simulated seconds of 10 Hz fit into a second.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import statistics
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib.util import find_spec

import numpy as np

from sleepcast.simulator import Changes, Machine, Simulator, choose, find_scenario

FULL, QUICK = ((1_000, 10_000, 100_000), 15), ((200, 1_000), 3)
"""Numbers of robots, and ticks that are timed."""
NUMPY_MOST = 10_000
"""Robots up to which NumPy is timed: its times grow in proportion."""
SLOWEST_NUMPY = 3.0
"""Times real time that a thousand robots must reach without compiled kernels."""


@dataclass(frozen=True)
class Row:
    """One machine with so many robots. step, look: ns for a robot and a tick: motion with contact, all sonars."""

    machine: str
    threads: int
    robots: int
    step: float
    look: float

    @property
    def realtime(self) -> float:
        return 0.1 / ((self.step + self.look) * 1e-9 * self.robots)


def measure(machine: Machine, threads: int, changes: Changes, ticks: int) -> Row:
    """Time so many ticks of a crowd."""
    simulator = Simulator(find_scenario("crowd", changes), machine=machine)
    bodies, robots = simulator.bodies, len(simulator.names)
    draw = np.random.default_rng(1)
    bodies.mode[:] = 1
    bodies.wanted_speed[:], bodies.wanted_turn[:] = draw.uniform(0.2, 0.5, robots), draw.uniform(-0.5, 0.5, robots)
    steps, looks = [], []
    for tick in range(ticks + 1):
        step, look = timed(simulator.step), timed(bodies.echo)
        if tick:
            steps.append(step)
            looks.append(look)
    each = 1e9 / robots
    return Row(machine.name, threads, robots, statistics.median(steps) * each, statistics.median(looks) * each)


def timed(work: Callable[[], object]) -> float:
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def rows(counts: tuple[int, ...], ticks: int, density: float | None, walls: bool) -> list[Row]:
    """Every machine that is installed, with every number of robots; the compiled one on one thread and on all."""
    cores = len(os.sched_getaffinity(0))
    found = []
    for robots in counts:
        changes = Changes(robots, density, walls)
        if robots <= NUMPY_MOST:
            found.append(measure(choose("numpy"), 1, changes, min(ticks, 5)))
        if find_spec("numba") is not None:
            found += [measure(choose("numba", threads), threads, changes, ticks) for threads in sorted({1, cores})]
    return found


def table(found: list[Row]) -> str:
    lines = ["| machine | threads | robots | motion and contact, ns | sonar, ns | x real time |", "|---|" + "---:|" * 5]
    lines += [
        f"| {row.machine} | {row.threads} | {row.robots:,} | {row.step:,.0f} | {row.look:,.0f} | {row.realtime:,.1f} |"
        for row in found
    ]
    return "\n".join(lines)


def bars(found: list[Row]) -> list[dict[str, object]]:
    """What was promised of the simulator alone, where this run can tell."""
    told: list[dict[str, object]] = []
    for row in found:
        if (row.machine, row.robots) == ("numpy", 1_000):
            wanted = f"at least {SLOWEST_NUMPY:g} x real time"
            told.append({"name": "1,000 Scouts without numba", "value": row.realtime, "wanted": wanted})
            told[-1]["met"] = row.realtime >= SLOWEST_NUMPY
    flat = {row.robots: row.step + row.look for row in found if row.machine == "numba" and row.threads == 1}
    if len(flat) > 1 and min(flat) >= 1_000:
        value = flat[max(flat)] / flat[sorted(flat)[-2]]
        name = f"cost of a robot's tick, {max(flat):,} robots over {sorted(flat)[-2]:,}, one thread"
        told.append({"name": name, "value": value, "wanted": "at most 1.5", "met": value <= 1.5})
    return told


def main() -> None:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.simulator", description=__doc__.split("\n")[0])
    parser.add_argument("--quick", action="store_true", help="few robots, few ticks: whether it runs at all")
    parser.add_argument("--json", action="store_true", help="print JSON instead of tables")
    parser.add_argument("--density", type=float, metavar="M2", help="square metres for each robot; else 4")
    parser.add_argument("--no-walls", action="store_true", help="nothing solid but the robots")
    options = parser.parse_args()
    counts, ticks = QUICK if options.quick else FULL
    found = rows(counts, ticks, options.density, not options.no_walls)
    machine = {"python": platform.python_version(), "processor": platform.machine(), "cores": os.cpu_count()}
    if options.json:
        report = [{**asdict(row), "realtime": row.realtime} for row in found]
        print(json.dumps({"machine": machine, "rows": report, "bars": bars(found)}))
        return
    print(f"Python {machine['python']}, {machine['processor']}, {machine['cores']} cores\n\n{table(found)}\n")
    for bar in bars(found):
        print(f"{'met ' if bar['met'] else 'MISSED'}  {bar['name']}: {bar['value']:.2f}, wanted {bar['wanted']}")


if __name__ == "__main__":
    main()
