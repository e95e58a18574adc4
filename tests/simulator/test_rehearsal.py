"""The first start compiles what robots need, and no machine code of what is only part of that."""

from __future__ import annotations

import subprocess
import sys

import pytest

pytest.importorskip("numba")

BOTH = """
import sys
from dataclasses import replace
from pathlib import Path

import numba

from sleepcast.simulator import Simulator, compiled, find_scenario, rehearsal

def known():
    modules = [module for name, module in sys.modules.items() if name.startswith("sleepcast.simulator.kernels")]
    functions = {each for module in modules for each in vars(module).values() if hasattr(each, "signatures")}
    kernels = [each for each in functions if not each.targetoptions.get("no_cpython_wrapper")]
    return {(each.__name__, str(signature)) for each in kernels for signature in each.signatures}

scenario = find_scenario("crowd")
few = replace(scenario, robots=replace(scenario.robots, count=12), shapes=(), absent=(), events=())
rehearsal.look_around(few)
seen = known()
rehearsal.move(few)
both = known()
simulator = Simulator(few)
simulator.step()
simulator.readings()
kept = {file.name.split("-")[0] for file in Path(numba.config.CACHE_DIR).rglob("*.nbi")}
print(len(seen), len(both - seen), len(known() - both), "kernels_sonar.see" in kept, "kernels_cones.walls" in kept)
"""


def test_two_halves_of_a_rehearsal_know_all_that_robots_need_and_keep_no_parts() -> None:
    done = subprocess.run([sys.executable, "-c", BOTH], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    by_looking, by_moving, unknown, *kept = done.stdout.split()
    assert int(by_looking) >= 5
    assert int(by_moving) >= 5
    assert unknown == "0"
    assert kept == ["True", "False"]
