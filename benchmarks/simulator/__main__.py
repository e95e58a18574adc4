"""Prints what the bodies of the scenario `crowd` cost for a robot and a tick, on each machine, and the bars beside it.

    python -m benchmarks.simulator [--quick] [--json] [--density M2] [--no-walls] [--cpu]

The robots drive circles of their own, without minds, so that nothing but the simulator is measured: a tick is motion
with contact, and one look of all sonars. Times are the medians of several ticks on the wall clock, after one that
compiles and warms everything up; with --cpu they are of the processor, over all threads, for machines that do other
things besides. `sorting` is part of motion and contact, and of the sonars. `real time` is how many simulated seconds of
10 Hz fit into a second.
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
from sleepcast.simulator.bodies.bodies import Floats, Mode
from sleepcast.simulator.motion.steps import Settled

Clock = Callable[[], float]
"""Seconds since some time or other."""

FULL, QUICK = ((1_000, 10_000, 100_000), 15), ((200, 1_000), 3)
"""Numbers of robots, and ticks that are timed."""
NUMPY_MOST = 10_000
"""Robots up to which NumPy is timed: its times grow in proportion."""
SLOWEST_NUMPY = 3.0
"""Times real time that a thousand robots must reach without compiled kernels."""


@dataclass(frozen=True)
class Row:
    """One machine with so many robots: ns for a robot and a tick. motion: what bodies propose, and what becomes of it;
    contact: how far they get, and sorting for it; sort: once, in either; look: all sonars."""

    machine: str
    threads: int
    robots: int
    motion: float
    contact: float
    sort: float
    look: float

    @property
    def step(self) -> float:
        return self.motion + self.contact

    @property
    def realtime(self) -> float:
        return 0.1 / ((self.step + self.look) * 1e-9 * self.robots)


def measure(machine: Machine, threads: int, changes: Changes, ticks: int, clock: Clock) -> Row:
    """Time so many ticks of a crowd."""
    simulator = Simulator(find_scenario("crowd", changes), machine=machine)
    bodies, robots = simulator.bodies, len(simulator.names)
    draw = np.random.default_rng(1)
    bodies.mode[:] = Mode.DRIVE
    bodies.wanted_speed[:], bodies.wanted_turn[:] = draw.uniform(0.2, 0.5, robots), draw.uniform(-0.5, 0.5, robots)
    assert bodies.contact
    settle, settling = bodies.contact.settle, [0.0]

    def watched(x: Floats, y: Floats, across: Floats, up: Floats, settled: Settled) -> None:
        begin = clock()
        settle(x, y, across, up, settled)
        settling[0] = clock() - begin

    bodies.contact.settle = watched  # type: ignore[method-assign]
    times = []
    for _ in range(ticks + 1):
        step, look = timed(simulator.step, clock), timed(simulator.sense, clock)
        sort = timed(lambda: machine.sort(bodies.near.grid, bodies.x, bodies.y), clock)
        times.append((step - settling[0], settling[0], sort, look))
    motion, contact, sort, look = (statistics.median(column) * 1e9 / robots for column in zip(*times[1:], strict=True))
    return Row(machine.name, threads, robots, motion, contact, sort, look)


def timed(work: Callable[[], object], clock: Clock) -> float:
    begin = clock()
    work()
    return clock() - begin


def rows(counts: tuple[int, ...], ticks: int, density: float | None, walls: bool, clock: Clock) -> list[Row]:
    """Every machine that is installed, with every number of robots; the compiled one on one thread and on all."""
    cores = len(os.sched_getaffinity(0))
    found = []
    for robots in counts:
        changes = Changes(robots, density, walls)
        if robots <= NUMPY_MOST:
            found.append(measure(choose("numpy"), 1, changes, min(ticks, 5), clock))
        if find_spec("numba") is not None:
            for threads in sorted({1, 2, cores} if cores > 1 else {1}):
                found.append(measure(choose("numba", threads), threads, changes, ticks, clock))
    return found


def table(found: list[Row]) -> str:
    lines = [
        "| machine | threads | robots | motion, ns | contact, ns | sorting, ns | sonar, ns | x real time |",
        "|---|" + "---:|" * 7,
    ]
    for row in found:
        times = (f"{value:,.0f}" for value in (row.motion, row.contact, row.sort, row.look))
        lines.append(f"| {row.machine} | {row.threads} | {row.robots:,} | {' | '.join(times)} | {row.realtime:,.1f} |")
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
    parser.add_argument("--cpu", action="store_true", help="the processor's time instead of the clock's on the wall")
    options = parser.parse_args()
    counts, ticks = QUICK if options.quick else FULL
    clock = time.process_time if options.cpu else time.perf_counter
    found = rows(counts, ticks, options.density, not options.no_walls, clock)
    machine = {"python": platform.python_version(), "processor": platform.machine(), "cores": os.cpu_count()}
    if options.json:
        report = [{**asdict(row), "step": row.step, "realtime": row.realtime} for row in found]
        print(json.dumps({"machine": machine, "rows": report, "bars": bars(found)}))
        return
    print(f"Python {machine['python']}, {machine['processor']}, {machine['cores']} cores\n\n{table(found)}\n")
    for bar in bars(found):
        print(f"{'met ' if bar['met'] else 'MISSED'}  {bar['name']}: {bar['value']:.2f}, wanted {bar['wanted']}")


if __name__ == "__main__":
    main()
