"""The field of `benchmarks.gym` in VMAS, in a process of its own; prints one JSON object.

    python -m benchmarks.worlds.with_vmas WORLDS ROBOTS STEPS [--cpu]

On one thread, and on as many as PyTorch takes by itself: the faster counts.
"""

from __future__ import annotations

import json
import sys
import time
from importlib.metadata import version

import torch

from benchmarks.gym import in_vmas
from benchmarks.worlds.sides import CPU


def main() -> None:
    worlds, robots, steps = (int(each) for each in sys.argv[1:4])
    clock = time.process_time if CPU in sys.argv else time.perf_counter
    rates = {}
    for threads in sorted({1, torch.get_num_threads()}):
        torch.set_num_threads(threads)
        rates[threads] = in_vmas(worlds, robots, steps, clock)
    best = max(rates, key=rates.__getitem__)
    print(json.dumps({"setting": f"VMAS {version('vmas')}, {best} threads", "rate": rates[best]}))


if __name__ == "__main__":
    main()
