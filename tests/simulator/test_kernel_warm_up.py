"""The two halves of a warm-up know what robots need."""

from __future__ import annotations

import subprocess
import sys

import pytest

pytest.importorskip("numba")

BOTH = """
import sys
from dataclasses import replace

from sleepcast.simulator import Simulator, find_scenario, kernel_warm_up

def known():
    modules = [each for name, each in sys.modules.items() if name.startswith("sleepcast.sim") and ".kernels" in name]
    functions = {each for module in modules for each in vars(module).values() if hasattr(each, "signatures")}
    kernels = [each for each in functions if not each.targetoptions.get("no_cpython_wrapper")]
    return {(each.__name__, str(signature)) for each in kernels for signature in each.signatures}

scenario = find_scenario("crowd")
few = replace(scenario, robots=replace(scenario.robots, count=12), shapes=(), absent=(), events=())
kernel_warm_up.compile_sonar_kernels(few)
seen = known()
kernel_warm_up.compile_motion_kernels(few)
both = known()
simulator = Simulator(few)
simulator.step()
simulator.readings()
print(len(seen), len(both - seen), len(known() - both))
"""


def test_each_half_needs_kernels_that_the_other_one_does_not_and_nothing_is_left() -> None:
    done = subprocess.run([sys.executable, "-c", BOTH], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    by_looking, by_moving, unknown = done.stdout.split()
    assert int(by_looking) >= 5
    assert int(by_moving) >= 5
    assert unknown == "0"
