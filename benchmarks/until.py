"""What it costs to look at the stop condition of a sweep on every tick, in the scenarios of the gallery that have one.

    python -m benchmarks.until [--ticks N] [--quick] [--json]

Each experiment of the gallery with an `until` is opened at its first point. Its ticks and the looks after them are
timed in turns, by the time of the processor; each is the median over the same ticks, after some that compile and warm
everything up.
"""

from __future__ import annotations

import argparse
import json
import sys
import time

from benchmarks.report import Bar, Json, described, machine, middle, number, table

BAR = 5.0
"""Percent of a tick that a look may take, in the middle of the scenarios."""
WARM = 60


def microseconds(name: str, ticks: int) -> tuple[int, float, float]:
    """How many robots a scenario has, and what a tick and a look take."""
    from sleepcast.experiments.measures import if_known, read_stop
    from sleepcast.experiments.plan import experiment_of_scenario
    from sleepcast.experiments.run import opened

    experiment = experiment_of_scenario(name)
    assert experiment is not None
    holds = if_known(read_stop(experiment.until).holds)
    ticking, looking = [], []
    with opened(experiment, experiment.first()) as fleet:
        for turn in range(WARM + ticks):
            began = time.process_time()
            fleet.swarm.step()
            between = time.process_time()
            holds(fleet)
            if turn >= WARM:
                ticking.append(between - began)
                looking.append(time.process_time() - between)
        return len(fleet), 1e6 * middle(ticking), 1e6 * middle(looking)


def names() -> list[str]:
    """The scenarios whose experiments have a stop condition."""
    from sleepcast.experiments.plan import experiment_of_scenario
    from sleepcast.simulator import scenario_names

    found = ((name, experiment_of_scenario(name)) for name in scenario_names())
    return [name for name, experiment in found if experiment is not None and experiment.until]


def main() -> int:
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.until", description=(__doc__ or "").partition("\n\n")[0]
    )
    parser.add_argument("--ticks", type=int, default=600, help="that are timed in each scenario")
    parser.add_argument("--quick", action="store_true", help="fewer ticks; rough numbers")
    parser.add_argument("--json", action="store_true", help="print one JSON object")
    options = parser.parse_args()
    found = {name: microseconds(name, 100 if options.quick else options.ticks) for name in names()}
    shares = {name: 100.0 * look / tick for name, (_, tick, look) in found.items()}
    bar = Bar(
        "a look at `until`, in the middle of the scenarios", middle(list(shares.values())), BAR, "% of a tick", False
    )
    if options.json:
        rows: Json = {name: {"robots": found[name][0], "percent": share} for name, share in shares.items()}
        print(json.dumps({"machine": machine(), "scenarios": rows, "bars": [bar.to_dict()]}))
    else:
        print(described(machine()), "\n")
        rows_ = [
            [name, f"{robots:,}", number(tick), number(look), f"{shares[name]:.1f} %"]
            for name, (robots, tick, look) in found.items()
        ]
        print(table(["scenario", "robots", "tick, µs", "look, µs", "look of a tick"], rows_), "\n")
        print(bar.text)
    return int(not bar.met)


if __name__ == "__main__":
    sys.exit(main())
