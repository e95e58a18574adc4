"""A million robots come and go in one run: how fast, and whether memory grows.

    python -m benchmarks.population                 # a million births and deaths, some minutes
    python -m benchmarks.population --quick --json

Each of 2,000 robots hatches one and dies in every tick, with a desk that hears them, on the radio and with telemetry.
What is told is the memory of the process after each tenth of the births: it is to stay what it was after the first.
"""

from __future__ import annotations

import json
import sys
from argparse import ArgumentParser
from pathlib import Path
from time import perf_counter

import sleepcast as sc
from benchmarks.report import Bar, Json, described, machine

ROBOTS = 2_000
SCENARIO = f"""
format = 2
title = "Mayflies"
seconds = "1h"

[world]
width = "500m"
height = "500m"
edge = "torus"

[robots]
type = "mayfly"
count = {ROBOTS}
hatch = true
most = {2 * ROBOTS}

[robots.limits]
speed = "1m/s"
turn_rate = "90deg/s"
acceleration = "1m/s2"

[robots.body]
radius = "0.1m"
"""
TIMES, QUICK = 10, 20_000
"""How often memory is looked at; births of a quick run."""
MOST_GROWTH = 1.05
"""Times as much memory at the end as after a tenth of the births: what Python's allocator keeps may vary by so much."""


def megabytes() -> float:
    """What the process has in memory now."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096 / 1e6


def run(births: int, *, told: bool) -> tuple[list[float], float, int]:
    """MB after each tenth of so many births, s that all took, and how many robots were left. told: as they come."""
    with sc.open(SCENARIO, seed=1) as fleet:
        fleet.run("1s", quiet=True)
        fleet.send("(RULE live (PROGN (HATCH mayfly 1) (DIE)))", everybody=True, wait=0)
        population, memory = fleet.swarm.simulator.population, list[float]()
        assert population is not None
        began, first = perf_counter(), population.following
        while len(memory) < TIMES:
            fleet.run("0.1s", quiet=True)
            born = population.following - first
            if TIMES * born >= (len(memory) + 1) * births:
                memory.append(megabytes())
                if told:
                    print(f"{born:9,} births, {population.count:,} robots: {memory[-1]:6.1f} MB", flush=True)
        return memory, perf_counter() - began, population.count


def main() -> int:
    parser = ArgumentParser(description=(__doc__ or "").partition("\n\n")[0])
    parser.add_argument("--births", type=int, default=1_000_000, help="how many robots come, and go")
    parser.add_argument("--quick", action="store_true", help="fewer births")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args()
    births = min(options.births, QUICK) if options.quick else options.births
    memory, seconds, left = run(births, told=not options.json)
    bar = Bar("memory at the end, beside that after a tenth", memory[-1] / memory[0], MOST_GROWTH, "times", False)
    if options.json:
        row: Json = {"births": births, "seconds": seconds, "megabytes": memory, "left": left}
        print(json.dumps({"machine": machine(), "run": row, "bars": [bar.to_dict()]}))
    else:
        print(described(machine()), f"\n{births:,} births and deaths in {seconds:.1f} s\n{bar.text}")
    return int(not bar.met)


if __name__ == "__main__":
    sys.exit(main())
