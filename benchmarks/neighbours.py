"""What it costs robots to sense their neighbours: (MEAN_HEADING 1m) and others, and forms that go through neighbours,
at one robot per square metre; and (MEAN_X 1m) and (MEAN_X 5m) where walls hide, beside what they take through walls.

    python -m benchmarks.neighbours [--robots N] [--quick] [--json]

The robots of the scenario `vicsek` stand in a world without edges. In each tick, when nothing is known of it yet,
everybody asks once. Forms, and the function of the same radius, are evaluated in turns, as expressions. Times are of
the processor, over all threads, since the machine may do other things besides; each is the median of some ticks after
two that compile and warm everything up. For walls, the same robots stand in rooms with doors and in a maze, at one per
square metre and at one per four; those that see through walls and those that do not are asked in turns, on the fastest
machine alone.
"""

from __future__ import annotations

import argparse
import json
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from importlib.util import find_spec

import numpy as np

from benchmarks.report import Bar, Json, described, machine, middle, number, table
from sleepcast.loop import Swarm
from sleepcast.simulator import Changes, Simulator, choose, find_scenario
from sleepcast.simulator.bodies.range_and_bearing import RangeAndBearing

ASKED = ("COUNT", "MEAN_X", "MEAN_HEADING", "NEAREST_DIST", "GAP")
BAR = ("MEAN_HEADING", 10_000, 3.0)
"""The function, the robots, and the ms a tick that were promised, with compiled kernels."""
FORMS = (
    ("(MEAN_X 1m)", None),
    ("(MEAN-OVER (n 1m) (OF n x))", 6.0),
    ("(MEAN_X 5m)", None),
    ("(MEAN-OVER (n 5m) (OF n x))", 60.0),
)
"""Expressions, and the ms a tick that were promised for so many robots."""
RADIUS = 1.0
WALLS: dict[str, tuple[tuple[str, object], ...]] = {
    "rooms of 5 m": (("world.rooms.size", "5m"), ("world.rooms.door", "1m")),
    "maze": (("world.maze.cell", "20m"), ("world.maze.seed", 3)),
}
"""Worlds in which walls hide; the maze is that of the scenario of this name."""
AREAS, RADII = (1.0, 4.0), (1.0, 5.0)
"""Square metres for each robot there, and how far it looks, m."""
SIGHTS = {"hidden": True, "through": False}
"""Whether walls hide, by the name of the number."""
WARM = 2


def milliseconds(on: str, robots: int, ticks: int) -> dict[str, float]:
    """What each function takes a tick, on this machine."""
    scenario = find_scenario("vicsek", Changes(robots=robots, over=(("world.area_per_robot", 1.0),)))
    simulator = Simulator(scenario, machine=choose(on))
    found = {}
    for name in ASKED:
        times = []
        for _ in range(WARM + ticks):
            simulator.step()
            times.append(_asked(simulator, name, RADIUS))
        found[name] = middle(times[WARM:])
    return found


def _asked(simulator: Simulator, name: str, radius: float) -> float:
    """What it takes everybody to ask a function, when nothing is known of this tick, ms."""
    simulator.senses.of(RangeAndBearing).forget()
    many = next(each.many for each in simulator.model.functions if each.name == name)
    assert many
    everybody, radii = np.arange(simulator.bodies.count), np.full(simulator.bodies.count, radius)
    began = time.process_time()
    many(simulator.robots, everybody, radii)
    return 1e3 * (time.process_time() - began)


@dataclass(frozen=True)
class Row:
    """What (MEAN_X radius) takes a tick in a world with walls, ms. area: m2 for each robot."""

    walls: str
    area: float
    radius: float
    hidden: float
    through: float


def sight_milliseconds(on: str, robots: int, ticks: int) -> Iterator[Row]:
    """What it takes where walls hide, and where the same walls do not."""
    for walls, settings in WALLS.items():
        for area in AREAS:
            over = (("format", 2), ("world.edge", "wall"), ("world.area_per_robot", area), ("neighbours.reach", "6m"))
            simulators = {}
            for name, hide in SIGHTS.items():
                changes = Changes(robots=robots, over=(*over, *settings, ("sight.neighbours", hide)))
                simulators[name] = Simulator(find_scenario("vicsek", changes), machine=choose(on))
            times: dict[tuple[float, str], list[float]] = {(radius, name): [] for radius in RADII for name in SIGHTS}
            for _ in range(WARM + ticks):
                for simulator in simulators.values():
                    simulator.step()
                for (radius, name), taken in times.items():
                    taken.append(_asked(simulators[name], "MEAN_X", radius))
            for radius in RADII:
                yield Row(walls, area, radius, *(middle(times[radius, name][WARM:]) for name in SIGHTS))


def form_milliseconds(on: str, robots: int, ticks: int) -> dict[str, float]:
    """What each form takes a tick, on this machine, everything that evaluates it included."""
    settings = (("world.area_per_robot", 1.0), ("neighbours.reach", "6m"))
    simulator = Simulator(find_scenario("vicsek", Changes(robots=robots, over=settings)), machine=choose(on))
    queries = Swarm(simulator).fleet.queries
    near = simulator.senses.of(RangeAndBearing)
    times: dict[str, list[float]] = {text: [] for text, _ in FORMS}
    for _ in range(WARM + ticks):
        simulator.step()
        for text, taken in times.items():
            near.forget()
            began = time.process_time()
            queries[text].values(0.0)
            taken.append(1e3 * (time.process_time() - began))
    return {text: middle(taken[WARM:]) for text, taken in times.items()}


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.neighbours", description=(__doc__ or "").partition("\n\n")[0]
    )
    parser.add_argument("--robots", type=int, default=BAR[1], help="at one per square metre")
    parser.add_argument("--quick", action="store_true", help="a few ticks; rough numbers")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args()
    machines = ["numpy", *(["numba"] if find_spec("numba") else [])]
    ticks = 3 if options.quick else 50
    found = {on: milliseconds(on, options.robots, ticks) for on in machines}
    forms = {on: form_milliseconds(on, options.robots, ticks) for on in machines}
    sights = list(sight_milliseconds(machines[-1], options.robots, ticks))
    name, robots, most = BAR
    known = "numba" in found and options.robots == robots
    note = "" if known else f"wanted numba, and {robots:,} robots"
    bars = [Bar(f"({name} 1m) of {robots:,} robots", found["numba"][name] if known else None, most, "ms", False, note)]
    for text, limit in FORMS:
        if limit is not None:
            measured = forms["numba"][text] if known else None
            bars.append(Bar(f"{text} of {robots:,} robots", measured, limit, "ms", False, note))
    if options.json:
        told = [bar.to_dict() for bar in bars]
        rows_of_sight = [asdict(row) for row in sights]
        told_all = Json(machine=machine(), robots=options.robots, ms=found, forms=forms, bar=told[0], bars=told)
        print(json.dumps({**told_all, "sight": rows_of_sight}))
        return 0
    rows = [(f"`({each} 1m)`", *(number(found[on][each]) for on in machines)) for each in ASKED]
    rows += [(f"`{text}`", *(number(forms[on][text]) for on in machines)) for text, _ in FORMS]
    heads = (f"{options.robots:,} robots, ms a tick", *machines)
    walls = [
        (
            f"{row.walls}, a robot per {row.area:g} m2, `(MEAN_X {row.radius:g}m)`",
            number(row.hidden),
            number(row.through),
        )
        for row in sights
    ]
    sight_heads = (f"{options.robots:,} robots, ms a tick, {machines[-1]}", "walls hide", "through walls")
    tables = f"{table(heads, rows)}\n\n{table(sight_heads, walls)}"
    print(f"{described(machine())}\n\n{tables}\n\n" + "\n".join(bar.text for bar in bars))
    return 0


if __name__ == "__main__":
    sys.exit(main())
