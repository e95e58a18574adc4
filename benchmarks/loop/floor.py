"""How fast this machine is, so that times measured on it can be read: three small loops that have nothing of sleepcast.

They are compiled by numba and work on numbers that lie side by side: multiplying and adding as fast as a core can, the
arithmetic of one body in a ring of sixteen sonar cones, and adding up an array that no cache holds. What the scenario
`crowd` costs, measured in the second of them, travels better from machine to machine than nanoseconds do.
"""

from __future__ import annotations

import os
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from math import cos, inf, pi, sin

import numpy as np

try:
    import numba
except ImportError:
    COMPILES = False
else:
    COMPILES = True

REFERENCE = 480.0
"""Gflop/s of the two cores of the machine for which the bars were set (a Xeon with AVX-512)."""
NUMBERS, STEPS, ROUNDS = 1_024, 32, 2_000
"""Numbers that stay in the nearest cache; multiply-adds with each before the next; how often all are gone through."""
BODIES, CONES = 65_536, 16
FAR = 8 * 1024 * 1024
"""Numbers of eight bytes: 64 MiB."""
TURNS = 7


@dataclass(frozen=True)
class Floor:
    """gflops: multiply-adds of all cores at once, in Gflop/s. cones: ns for one body in sixteen cones, one core.
    gigabytes: read from memory in a second, in GB, all cores at once."""

    gflops: float
    cones: float
    gigabytes: float

    @property
    def text(self) -> str:
        return (
            f"this machine: {self.gflops:,.0f} Gflop/s in single precision ({self.gflops / REFERENCE:.2f} x that for "
            f"which the bars were set), {self.gigabytes:.1f} GB/s from memory, "
            f"{self.cones:.2f} ns for one body in sixteen cones"
        )


def measure() -> Floor | None:
    """Measure this machine; None without numba."""
    if not COMPILES:
        return None
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    powers, bodies, added = _kernels()
    numbers = np.ones((cores, NUMBERS), np.float32)
    busy = _together([partial(powers, part) for part in numbers])
    flops = 2.0 * NUMBERS * STEPS * ROUNDS * cores
    source = np.random.default_rng(1)
    ahead, aside = source.uniform(-6, 6, (2, BODIES)).astype(np.float32)
    axes = np.array([2 * pi * cone / CONES for cone in range(CONES)])
    ring = np.cos(axes).astype(np.float32), np.sin(axes).astype(np.float32)
    out = np.empty(CONES, np.float32)
    half = np.float32(cos(pi / 14.4)), np.float32(sin(pi / 14.4))
    one = _together([partial(bodies, ahead, aside, *ring, *half, out)])
    far = np.ones(FAR)
    read = _together([partial(added, part) for part in np.array_split(far, cores)])
    return Floor(flops / busy * 1e-9, one / BODIES * 1e9, far.nbytes / read * 1e-9)


def _together(works: list[Callable[[], object]]) -> float:
    """Seconds of the processor until all have done their work, each on a thread of its own; the best of `TURNS`."""
    taken = [0.0] * len(works)

    def timed(number: int) -> None:
        begin = time.thread_time()
        works[number]()
        taken[number] = time.thread_time() - begin

    best = inf
    for turn in range(TURNS + 1):  # the first compiles
        threads = [threading.Thread(target=timed, args=(number,)) for number in range(len(works))]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join()
        best = min(best, max(taken)) if turn else inf
    return best


def _kernels() -> tuple[Callable[..., object], Callable[..., object], Callable[..., object]]:
    fast = numba.njit(fastmath=True, nogil=True, error_model="numpy")

    @fast
    def powers(numbers):  # type: ignore[no-untyped-def]
        for _ in range(ROUNDS):
            for i in range(NUMBERS):
                value = numbers[i]
                for _ in range(STEPS):
                    value = value * value + np.float32(0.1)  # a root of it is near: nothing overflows
                numbers[i] = value

    @fast
    def bodies(ahead, aside, axis_cos, axis_sin, cosine, sine, out):  # type: ignore[no-untyped-def]
        out[:] = np.float32(6.5)
        for body in range(ahead.shape[0]):
            for cone in range(CONES):
                along = ahead[body] * axis_cos[cone] + aside[body] * axis_sin[cone] - np.float32(0.17)
                across = abs(aside[body] * axis_cos[cone] - ahead[body] * axis_sin[cone])
                outside = across * cosine - along * sine
                forward = along * cosine + across * sine
                within = outside <= np.float32(0.0)
                square = forward * forward + outside * outside if within else np.float32(0.0289) - outside * outside
                root = np.sqrt(max(square, np.float32(0.0)))
                seen = root - np.float32(0.17) if within else forward - root
                met = (outside < np.float32(0.17)) & (forward > np.float32(0.0))
                out[cone] = min(out[cone], seen if met else np.float32(6.5))

    @fast
    def added(values):  # type: ignore[no-untyped-def]
        total = 0.0
        for value in values:
            total += value
        return total

    return powers, bodies, added
