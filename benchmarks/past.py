"""How long it takes to see any moment of a run, and why any robot did what it did, while the run goes on.

    python -m benchmarks.past [--robots N] [--minutes M] [--questions Q] [--quick] [--json]

`bravo` runs for ten simulated minutes with its commands, as on the page, with all that the page keeps of a run. Then
somebody stands at random moments, looks at a random robot, and asks it why; each is timed from the question to the
answer, by the wall clock, while nothing else runs. What was said before is not asked again. The first question begins
the process that runs again; it is told apart.
"""

from __future__ import annotations

import argparse
import asyncio
import json
import random
import sys
import time

from benchmarks.report import Bar, Json, described, machine, middle, number, table
from sleepcast.api.assembly import assemble, warm_up
from sleepcast.console.adapters.live_past import LivePast
from sleepcast.console.adapters.swarm import SwarmAdapter
from sleepcast.console.features.why import Why
from sleepcast.core.clock import WallClock
from sleepcast.simulator import Changes, find_scenario

BARS = {1_000: 1.0, 100_000: 3.0}
"""Seconds at the median that were promised, by robots."""
MINUTES = 10.0
QUESTIONS = 40
ROWS = {
    "look": "any moment, s, median",
    "why": "why, s, median",
    "slowest": "slowest of all, s",
    "first": "first question, s",
    "states": "states kept",
    "state_mb": "MB of states",
    "pictures": "pictures kept",
    "picture_mb": "MB of pictures",
    "share": "part of the run's time that keeping takes",
    "longest_ms": "longest turn of keeping, ms",
}
GAP = 90.0
"""Simulated seconds from one command to the next."""


class TimedPast(LivePast):
    """The past of a run that knows how long it took to keep it, in the thread in which the swarm runs, s."""

    taken = 0.0
    longest = 0.0

    def ticking(self) -> None:
        began = time.perf_counter()
        super().ticking()
        self._took(began)

    def ticked(self) -> None:
        began = time.perf_counter()
        super().ticked()
        self._took(began)

    def _took(self, began: float) -> None:
        took = time.perf_counter() - began
        self.taken += took
        self.longest = max(self.longest, took)


async def answers(past: LivePast, robots: int, questions: int) -> dict[str, list[float]]:
    """Seconds for each look and each why."""
    chance, took = random.Random(1), {"look": [], "why": []}  # type: dict[str, list[float]]
    began = time.perf_counter()
    await past.look(0, -1)
    took["first"] = [time.perf_counter() - began]
    for _ in range(questions):
        tick, robot = chance.randint(1, past.tick_of(past.ended)), chance.randrange(robots)
        began = time.perf_counter()
        await past.look(tick, robot)
        took["look"].append(time.perf_counter() - began)
        sent = [message for at, message in past.inputs.posted if at < tick]
        if sent:
            command = chance.choice(sent).id
            began = time.perf_counter()
            await past.why(tick, Why(1, robot, command))
            took["why"].append(time.perf_counter() - began)
    return took


def measure(robots: int, minutes: float, questions: int) -> dict[str, float]:
    """What it takes with so many robots."""
    scenario = find_scenario("bravo", Changes(robots=robots))
    warm_up(scenario, None)
    swarm, station = assemble(scenario, None, mission=False)
    past = TimedPast(SwarmAdapter(swarm), swarm, station, WallClock())
    waiting = [each.text for each in scenario.commands]
    began = time.perf_counter()
    for tick in range(round(60.0 * minutes / scenario.tick)):
        if tick % round(GAP / scenario.tick) == 10 and waiting:
            station.send(waiting.pop(0), everybody=True, confirmed=True)
        swarm.step()
    ran = time.perf_counter() - began
    took = asyncio.run(answers(past, robots, questions))
    past.close()
    pictures = past.timeline.poses
    return {
        "robots": robots,
        "minutes": minutes,
        "look": middle(took["look"]),
        "why": middle(took["why"]),
        "slowest": max(took["look"] + took["why"]),
        "first": took["first"][0],
        "states": len(past.states),
        "state_mb": past.states.size / 1e6,
        "pictures": len(pictures.times),
        "picture_mb": sum(len(data) for _, data in pictures.values) / 1e6,
        "share": past.taken / ran,
        "longest_ms": 1e3 * past.longest,
    }


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.past", description=(__doc__ or "").partition("\n\n")[0])
    parser.add_argument("--robots", type=int, nargs="*", default=list(BARS), help="numbers of robots")
    parser.add_argument("--minutes", type=float, default=MINUTES, help="simulated minutes of the run")
    parser.add_argument("--questions", type=int, default=QUESTIONS, help="moments that are looked at")
    parser.add_argument("--quick", action="store_true", help="half a minute, a few questions; rough numbers")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args()
    minutes, questions = (0.5, 4) if options.quick else (options.minutes, options.questions)
    found = [measure(robots, minutes, questions) for robots in options.robots]
    note = "" if minutes == MINUTES else f"wanted {MINUTES:g} minutes"
    bars = [
        Bar(
            f"any moment and any why, the slower median, {row['robots']:,.0f} robots",
            None if note else max(row["look"], row["why"]),
            BARS[round(row["robots"])],
            "s",
            False,
            note,
        )
        for row in found
        if row["robots"] in BARS
    ]
    if options.json:
        print(json.dumps(Json(machine=machine(), rows=found, bars=[bar.to_dict() for bar in bars])))
        return 0
    rows = [(title, *(number(row[key]) for row in found)) for key, title in ROWS.items()]
    heads = (f"{minutes:g} minutes of bravo", *(f"{row['robots']:,.0f} robots" for row in found))
    print(f"{described(machine())}\n\n{table(heads, rows)}\n\n" + "\n".join(bar.text for bar in bars))
    return 0


if __name__ == "__main__":
    sys.exit(main())
