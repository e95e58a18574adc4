"""Mesa's flocking example, as it comes with Mesa, in a process of its own; prints one JSON object.

    python -m benchmarks.worlds.with_mesa ROBOTS STEPS RUNS [--cpu]

Each run is a new model and its steps; imports are not counted. Its boids have some three neighbours each, those of
`vicsek` twelve.
"""

from __future__ import annotations

import json
import sys
import time
from importlib.metadata import version

from mesa.examples.basic.boid_flockers.model import BoidFlockers, BoidsScenario

from benchmarks.worlds.sides import CPU

clock = time.process_time if CPU in sys.argv else time.perf_counter


def run(robots: int, steps: int, seed: int) -> float:
    """Seconds of one run."""
    began = clock()
    model = BoidFlockers(BoidsScenario(population_size=robots, rng=seed))
    for _ in range(steps):
        model.step()
    return clock() - began


def main() -> None:
    robots, steps, runs = (int(each) for each in sys.argv[1:4])
    run(robots, 2, 0)
    taken = [run(robots, steps, 1 + number) for number in range(runs)]
    print(json.dumps({"setting": f"Mesa {version('mesa')}", "runs": taken}))


if __name__ == "__main__":
    main()
