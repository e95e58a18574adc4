"""One contender with so many robots, in a process of its own; prints one JSON object.

    python -m benchmarks.rivals.one NAME ROBOTS WARM SECONDS

It sets up, goes for WARM s (and a tick at least) so that whatever compiles or caches has done so, and then is timed on
the wall clock for SECONDS (and three ticks at least).
"""

from __future__ import annotations

import importlib
import json
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass

from benchmarks.rivals import job


@dataclass(frozen=True)
class Contender:
    """Who takes part. library: what must be installed. most: robots beyond which it is not tried, and `why`."""

    library: str
    module: str
    ready: str = "ready"
    most: int = 1_000_000
    why: str = ""


OURS = "sleepcast, the same rule"
CONTENDERS = {
    OURS: Contender("sleepcast", "with_sleepcast"),
    "sleepcast, ten rules": Contender("sleepcast", "with_sleepcast", "ready_with_ten"),
    "navground": Contender("navground", "with_navground", most=10_000, why="a tick takes minutes"),
    "vmas, worlds of ten": Contender("vmas", "with_vmas", "ready_in_worlds"),
    "vmas, one world": Contender("vmas", "with_vmas", most=1_000, why="its memory grows with the square"),
    "ir-sim": Contender("ir-sim", "with_ir_sim", most=10_000, why="a tick takes minutes"),
}


def ready(name: str, robots: int) -> job.Job:
    """This contender, set up. Raises ImportError if it is not installed."""
    contender = CONTENDERS[name]
    module = importlib.import_module(f"benchmarks.rivals.{contender.module}")
    make: Callable[[int], job.Job] = getattr(module, contender.ready)
    return make(robots)


def main() -> None:
    name, robots, warm, seconds = sys.argv[1], int(sys.argv[2]), float(sys.argv[3]), float(sys.argv[4])
    begin = time.perf_counter()
    found = ready(name, robots)
    setup = time.perf_counter() - begin
    before = found.places()
    warmed, _ = go(found, warm, 1)
    ticks, taken = go(found, seconds, 3)
    job.check(before, found, robots, (warmed + ticks) * job.TICK)
    result = {"setup": setup, "tick": taken / ticks, "ticks": ticks, "setting": found.setting}
    print(json.dumps(result))


def go(found: job.Job, seconds: float, least: int) -> tuple[int, float]:
    """Ticks for so long, at least so many; gives how many, and the seconds they took."""
    ticks, begin = 0, time.perf_counter()
    while ticks < least or time.perf_counter() - begin < seconds:
        found.step()
        ticks += 1
    return ticks, time.perf_counter() - begin


if __name__ == "__main__":
    main()
