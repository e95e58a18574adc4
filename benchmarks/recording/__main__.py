"""Prints what recording costs a run of 1,000 robots, as the ratio of its time to that of the same run unrecorded.

    python -m benchmarks.recording [--quick] [--json]

Swarms that differ in nothing but what is recorded of them run in turns, in one process and one run of this program;
times are CPU time, that of the thread which saves included.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from contextlib import ExitStack
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

from benchmarks.language.timing import Batch, in_turns
from sleepcast.api.assembly import assemble
from sleepcast.api.recording import RecordingPlan, recorded
from sleepcast.loop import Swarm
from sleepcast.simulator import Order, Scenario, find_scenario

LIMIT = 1.2
"""A recorded run of 1,000 robots takes at most so many times as long, at the usual rates."""
ROBOTS, FEW, SEED = 1_000, 100, 7
"""FEW: robots of a quick run."""
TICKS = 300
"""Ticks in one round: everything that is recorded at the usual rates comes up in each."""
WARM_UP = 320
"""Ticks before anything is timed: the mission's commands lie behind then."""
RULE = "(RULE look (IF (AND (> fuel 20%) (< (DIST x y vessel_x vessel_y) 5mi)) 1 0))"
RATES: dict[str, tuple[float | None, float | None] | None] = {
    "not recorded": None,
    "recorded at the usual rates": (None, None),
    "a picture at every tick": (0.001, None),
    "a picture and all readings at every tick": (0.001, 0.001),
}
"""What is compared: simulated s between two pictures and between two readings; None: as the program chooses."""


@dataclass(frozen=True)
class Row:
    """One way to record. seconds: of CPU time a tick; ratio: to the run that is not recorded, with its quartiles;
    bytes_per_second: in the file, per simulated second."""

    run: str
    name: str
    seconds: float
    ratio: float
    low: float
    high: float
    bytes_per_second: float


def runs(robots: int) -> dict[str, Scenario]:
    """What so many robots do while they are recorded."""
    bravo = find_scenario("bravo")
    bravo = replace(bravo, robots=replace(bravo.robots, count=robots))
    everybody = (Order(1.0, RULE, "the benchmark"),)
    return {
        "bravo: its own mission, nobody keeps a rule": bravo,
        "bravo: everybody keeps a rule and thinks at every tick": replace(bravo, mission=everybody),
    }


def measure(run: str, scenario: Scenario, turns: int, seconds: float) -> list[Row]:
    """Time all rates of recording for one run."""
    swarms: dict[str, Swarm] = {}
    batches: dict[str, Batch] = {}
    with TemporaryDirectory() as folder, ExitStack() as stack:
        files = {}
        for number, (name, rates) in enumerate(RATES.items()):
            swarm, station = assemble(scenario, SEED, mission=True)
            for _ in range(WARM_UP):
                swarm.step()
            if rates is not None:
                files[name] = Path(folder, f"{number}.mcap")
                stack.enter_context(recorded(swarm, station, RecordingPlan(files[name], *rates), print))
            swarms[name], batches[name] = swarm, _ticks(swarm)
        times = in_turns(batches, turns, seconds)
        stack.close()
        sizes = {name: file.stat().st_size for name, file in files.items()}
    bare = times["not recorded"]
    rows = []
    for name, timing in times.items():
        ratio = timing.over(bare)
        simulated = swarms[name].now() - WARM_UP * scenario.tick
        rows.append(Row(run, name, timing.median, ratio.median, *ratio.quartiles, sizes.get(name, 0) / simulated))
    return rows


def _ticks(swarm: Swarm) -> Batch:
    def batch(rounds: int) -> int:
        for _ in range(rounds * TICKS):
            swarm.step()
        return rounds * TICKS

    return batch


def show(rows: Sequence[Row]) -> str:
    """The rows for people."""
    lines = []
    for row in rows:
        if row.run not in lines:
            lines.append(row.run)
        lines.append(
            f"  {row.name:42}{row.seconds * 1e3:9.3f} ms a tick{row.ratio:8.2f} x  ({row.low:.2f} to {row.high:.2f})"
            f"{row.bytes_per_second / 1e3:9.1f} kB a simulated second"
        )
    return "\n".join(lines)


def main() -> int:
    """Measure and print; 1 if recording at the usual rates costs more than it may."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.recording", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="a few seconds; rough")
    parser.add_argument("--json", action="store_true", help="one JSON object")
    options = parser.parse_args()
    robots, turns, seconds = (FEW, 1, 0.05) if options.quick else (ROBOTS, 7, 0.5)
    rows = [row for run, scenario in runs(robots).items() for row in measure(run, scenario, turns, seconds)]
    usual = [row.ratio for row in rows if row.name == "recorded at the usual rates"]
    met = max(usual) <= LIMIT
    if options.json:
        print(json.dumps({"rows": [asdict(row) for row in rows], "limit": LIMIT, "value": max(usual), "met": met}))
    else:
        print(show(rows))
        print(f"{'met' if met else 'MISSED'}: recorded / not recorded {max(usual):.2f} x, wanted <= {LIMIT:g} x")
    return 0 if met or options.quick else 1


if __name__ == "__main__":
    sys.exit(main())
