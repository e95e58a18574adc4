"""What it costs robots to sense their neighbours: (MEAN_HEADING 1m) and others, at one robot per square metre.

    python -m benchmarks.neighbours [--robots N] [--quick] [--json]

The robots of the scenario `vicsek` stand in a world without edges. In each tick, when nothing is known of it yet,
everybody asks once. Times are of the processor, over all threads, since the machine may do other things
besides; each is the median of some ticks after two that compile and warm everything up.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from importlib.util import find_spec

import numpy as np

from benchmarks.report import Bar, Json, described, machine, middle, number, table
from sleepcast.simulator import Changes, Simulator, choose, find_scenario

ASKED = ("COUNT", "MEAN_X", "MEAN_HEADING", "NEAREST_DIST", "GAP")
BAR = ("MEAN_HEADING", 10_000, 3.0)
"""The function, the robots, and the ms a tick that were promised, with compiled kernels."""
RADIUS = 1.0
WARM = 2


def milliseconds(on: str, robots: int, ticks: int) -> dict[str, float]:
    """What each function takes a tick, on this machine."""
    scenario = find_scenario("vicsek", Changes(robots=robots, over=(("world.area_per_robot", 1.0),)))
    simulator = Simulator(scenario, machine=choose(on))
    functions = {each.name: each.many for each in simulator.model.functions if each.name in ASKED}
    everybody, radius = np.arange(robots), np.full(robots, RADIUS)
    found = {}
    for name in ASKED:
        times = []
        for _ in range(WARM + ticks):
            simulator.step()
            many = functions[name]
            assert many
            began = time.process_time()
            many(simulator.robots, everybody, radius)
            times.append(1e3 * (time.process_time() - began))
        found[name] = middle(times[WARM:])
    return found


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.neighbours", description=(__doc__ or "").partition("\n\n")[0]
    )
    parser.add_argument("--robots", type=int, default=BAR[1], help="at one per square metre")
    parser.add_argument("--quick", action="store_true", help="a few ticks; rough numbers")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args()
    machines = ["numpy", *(["numba"] if find_spec("numba") else [])]
    found = {on: milliseconds(on, options.robots, 3 if options.quick else 50) for on in machines}
    name, robots, most = BAR
    known = "numba" in found and options.robots == robots
    note = "" if known else f"wanted numba, and {robots:,} robots"
    bar = Bar(f"({name} 1m) of {robots:,} robots", found["numba"][name] if known else None, most, "ms", False, note)
    if options.json:
        print(json.dumps(Json(machine=machine(), robots=options.robots, ms=found, bar=bar.to_dict())))
        return 0
    rows = [(f"`({each} 1m)`", *(number(found[on][each]) for on in machines)) for each in ASKED]
    heads = (f"{options.robots:,} robots, ms a tick", *machines)
    print(f"{described(machine())}\n\n{table(heads, rows)}\n\n{bar.text}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
