"""What laser scanners cost: how much faster than real time a world runs whose robots all ask theirs in every tick.

    python -m benchmarks.scanners [--robots N] [--beams N] [--quick] [--json]

Robots wander in rooms with at least a thousand walls and see 8 m far, walls and each other, with noise; in every tick a
rule asks for the least range ahead. On two threads. What counts is the time of a tick by the clock, as the median of
many; beside it stand the quickest tick and the time of the processor, over all threads, since the machine may do other
things besides, and what the same world takes without scanners.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from dataclasses import asdict, dataclass
from importlib.util import find_spec

from benchmarks.report import Bar, Json, described, machine, middle, number, table
from sleepcast.loop import Swarm, step_swarm
from sleepcast.simulator import Simulator, choose
from sleepcast.simulator.scenario.scenario import read_scenario

ROBOTS, BEAMS, WANTED, DREAM = 1_000, 360, 5.0, 20.0
"""The robots and beams for which a multiple of real time was promised, and the one that was dreamed of."""
THREADS, WARM, TICK = 2, 3, 0.1
RULE = "(RULE look (WHEN (< (SCAN-MIN -30deg 30deg) 30cm) (MARK)))"
BLIND = "(RULE look (WHEN (< speed -1m/s) (MARK)))"
WORLD = """
format = 2
title = "rooms"
seconds = "1h"
tick = "{tick}s"

[world]
area_per_robot = 7.0
rooms = {{ size = "5m", door = "1.5m" }}
edge = "wall"

[robots]
type = "scout"
count = {robots}
motion = "wander"

[robots.limits]
speed = "0.5m/s"
turn_rate = "90deg/s"
acceleration = "1m/s2"

[robots.body]
radius = "0.2m"
bumpers = 8

[laser]
beams = {beams}
range = "8m"
least = "0.1m"
noise = "1cm"
"""


@dataclass(frozen=True)
class Row:
    """What a tick takes on one machine, ms: by the clock, the quickest one, of the processor, and that without
    scanners."""

    on: str
    clock: float
    quickest: float
    processor: float
    blind: float

    @property
    def speed(self) -> float:
        """How many times faster than real time."""
        return 1e3 * TICK / self.clock


def measured(on: str, robots: int, beams: int, ticks: int) -> tuple[Row, int]:
    """What a tick takes, with and without scanners in turns; and how many walls there are."""
    scenario = read_scenario(WORLD.format(robots=robots, beams=beams, tick=TICK))
    worlds = [Swarm(Simulator(scenario, 1, choose(on, THREADS if on == "numba" else None))) for _ in (RULE, BLIND)]
    for world, rule in zip(worlds, (RULE, BLIND), strict=True):
        world.fleet.evaluate(rule)
    times: list[list[tuple[float, float]]] = [[], []]
    for _ in range(WARM + ticks):
        for world, taken in zip(worlds, times, strict=True):
            clock, processor = time.perf_counter(), time.process_time()
            step_swarm(world)
            taken.append((1e3 * (time.perf_counter() - clock), 1e3 * (time.process_time() - processor)))
    seeing, blind = (list(zip(*taken[WARM:], strict=True)) for taken in times)
    row = Row(on, middle(seeing[0]), min(seeing[0]), middle(seeing[1]), middle(blind[1]))
    return row, len(worlds[0].simulator.world.solids)


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.scanners", description=(__doc__ or "").partition("\n\n")[0]
    )
    parser.add_argument("--robots", type=int, default=ROBOTS)
    parser.add_argument("--beams", type=int, default=BEAMS, help="of each robot, at most 1080")
    parser.add_argument("--quick", action="store_true", help="a few ticks; rough numbers")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args()
    machines = ["numpy", *(["numba"] if find_spec("numba") else [])]
    found = [measured(on, options.robots, options.beams, 3 if options.quick else 100) for on in machines]
    rows, walls = [row for row, _ in found], found[0][1]
    known = "numba" in machines and (options.robots, options.beams) == (ROBOTS, BEAMS)
    note = "" if known else f"wanted numba, {ROBOTS:,} robots and {BEAMS} beams"
    what = f"{options.robots:,} robots with {options.beams} beams among {walls:,} walls"
    bars = [
        Bar(f"{what}{more}", rows[-1].speed if known else None, wanted, "x real time", note=note)
        for more, wanted in (("", WANTED), (", as dreamed", DREAM))
    ]
    if options.json:
        told: Json = {
            "machine": machine(),
            "walls": walls,
            "rows": [asdict(row) | {"speed": row.speed} for row in rows],
        }
        print(json.dumps({**told, "bars": [bar.to_dict() for bar in bars]}))
        return 0
    heads = (what, "x real time", "ms a tick", "the quickest", "of the processor", "without scanners")
    cells = [(row.on, *map(number, (row.speed, row.clock, row.quickest, row.processor, row.blind))) for row in rows]
    print(f"{described(machine())}\n\n{table(heads, cells)}\n\n" + "\n".join(bar.text for bar in bars))
    return 0


if __name__ == "__main__":
    sys.exit(main())
