"""One thing that is timed in a process of its own; prints one JSON object, "missing" for what this version has not.

    python -m benchmarks.worlds.one vector 100 10 100    # worlds, robots in each, steps
    python -m benchmarks.worlds.one memory 1000 20 60    # worlds, robots in each, simulated seconds
    python -m benchmarks.worlds.one batch flood 1000 60  # scenario, worlds, simulated seconds
    python -m benchmarks.worlds.one alone flood 20 60    # scenario, runs, simulated seconds

With PYTHONPATH it measures the sleepcast of another checkout; with --cpu after these, it counts the processor's time
where it would count that on the wall.
"""

from __future__ import annotations

import inspect
import json
import os
import sys
import time
from collections.abc import Callable
from typing import Any

import numpy as np

import sleepcast as sc
from benchmarks.gym import AWAY, FIELD, rate, side
from benchmarks.loop.one import Memory
from benchmarks.report import Json
from benchmarks.worlds.sides import CPU

HISTORY, EVERY = ("x", "y"), 5.0
"""What the histories of the row about memory keep of each robot, and how often, simulated s."""


class NotThereError(Exception):
    """This version does not have what is to be measured."""


clock = time.process_time if CPU in sys.argv else time.perf_counter


def vector(worlds: int, robots: int, steps: int) -> Json:
    """Robots' steps a second of `vector_env` with so many worlds, on one thread and on all: the faster counts."""
    import sleepcast.gym

    if "worlds" not in inspect.signature(sleepcast.gym.vector_env).parameters:
        raise NotThereError("vector_env takes no worlds")
    field = FIELD.format(side=side(robots), half=side(robots) / 2, robots=robots)
    options: dict[str, Any] = {"observations": ["x", "y", "heading", "speed", AWAY], "reward": f"(- 0m {AWAY})"}
    actions = np.random.default_rng(1).uniform(-1.0, 1.0, (steps, worlds * robots, 2)).astype(np.float32)
    rates = {}
    for threads in sorted({1, len(os.sched_getaffinity(0))}):
        env = sleepcast.gym.vector_env(field, worlds=worlds, robots=robots, threads=threads, **options)
        env.reset(seed=1)
        rates[threads] = rate(worlds * robots, steps, lambda i, env=env: env.step(actions[i]), clock)  # type: ignore[misc]
    return {"rate": max(rates.values())}


def many(scenario: str, worlds: int, **options: object) -> Any:
    """So many worlds of a scenario as one batch, each with its desk, which sends the mission."""
    if not hasattr(sc, "open_many"):
        raise NotThereError("there is no open_many")
    return sc.open_many(scenario, seeds=range(worlds), mission=True, quiet=True, **options)


def memory(worlds: int, robots: int, seconds: float) -> Json:
    """kB a robot: what the process has at its most, with desks and histories, less what it has once it has run two
    worlds of the same kind, so that all is imported and compiled."""

    def run(worlds: int) -> Any:
        fleets = many("crowd", worlds, over={"robots.count": robots})
        history = fleets.history(*HISTORY, every=EVERY)
        fleets.run(seconds, quiet=True)
        return fleets, history

    run(2)
    before = Memory.look()
    kept = run(worlds)
    most = Memory.look().most
    assert not kept[0].failed
    return {"kilobytes": (most - before.now) / 1e3 / (worlds * robots)}


def batch(scenario: str, worlds: int, seconds: float) -> Json:
    """Seconds of the processor a run, from its opening to its end, of so many at once."""

    def run(worlds: int) -> None:
        many(scenario, worlds, threads=1).run(seconds, quiet=True)

    run(2)
    return {"runs": [_cpu(lambda: run(worlds)) / worlds]}


def alone(scenario: str, runs: int, seconds: float) -> Json:
    """Seconds of the processor that each of so many runs takes, one after the other."""

    def run(seed: int) -> None:
        sc.open(scenario, seed=seed, mission=True, threads=1).run(seconds, quiet=True)

    run(0)
    return {"runs": [_cpu(lambda seed=seed: run(seed)) for seed in range(runs)]}  # type: ignore[misc]


def _cpu(work: Callable[[], None]) -> float:
    began = time.process_time()
    work()
    return time.process_time() - began


MEASURED: dict[str, Callable[..., Json]] = {each.__name__: each for each in (vector, memory, batch, alone)}


def main() -> None:
    name, *texts = [each for each in sys.argv[1:] if each != CPU]
    try:
        found = MEASURED[name](
            *(float(each) if "." in each else int(each) if each.isdigit() else each for each in texts)
        )
    except NotThereError as error:
        found = {"missing": f"not there: {error}"}
    print(json.dumps(found))


if __name__ == "__main__":
    main()
