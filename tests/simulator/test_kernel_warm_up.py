"""The two halves of a warm-up know what robots need."""

from __future__ import annotations

import subprocess
import sys

import pytest

pytest.importorskip("numba")

BOTH = """
from dataclasses import replace

import numba

from sleepcast.simulator import Simulator, find_scenario, kernel_warm_up
from sleepcast.simulator.simd.cached import CachedKernel

called = set()
itself = CachedKernel.__call__

def call(kernel, *arguments):
    called.add((kernel.__name__, tuple(map(numba.typeof, arguments))))
    return itself(kernel, *arguments)

CachedKernel.__call__ = call

scenario = find_scenario("crowd")
few = replace(scenario, robots=replace(scenario.robots, count=12), shapes=(), absent=(), events=())
kernel_warm_up.compile_sonar_kernels(few)
seen = set(called)
kernel_warm_up.compile_motion_kernels(few)
both = set(called)
simulator = Simulator(few)
simulator.step()
simulator.readings()
print(len(seen), len(both - seen), len(called - both))
"""


def test_each_half_needs_kernels_that_the_other_one_does_not_and_nothing_is_left() -> None:
    done = subprocess.run([sys.executable, "-c", BOTH], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    by_looking, by_moving, unknown = done.stdout.split()
    assert int(by_looking) >= 5
    assert int(by_moving) >= 5
    assert unknown == "0"
