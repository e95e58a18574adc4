"""A warm-up leaves nothing to be compiled in a tick, and the first one of all compiles in two processes."""

from __future__ import annotations

import os
import subprocess
import sys
from collections import Counter
from dataclasses import replace
from pathlib import Path

import pytest

from sleepcast.api import assembly
from sleepcast.api.assembly import few_of, warm_up
from sleepcast.simulator import find_scenario
from sleepcast.simulator.engine import choose, cores
from sleepcast.simulator.kernel_warm_up import _note
from sleepcast.simulator.simd.cached import ENTRIES
from small_worlds import scouts

SONARS = {"all at once": 'noise = "3%"', "in order": 'noise = "3%"\npause = "4ms"'}


@pytest.mark.parametrize("sonar", SONARS.values(), ids=SONARS.keys())
def test_what_a_tick_takes_is_compiled_beforehand(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, sonar: str) -> None:
    """Every kernel meets the same types in a warm-up as in a tick."""
    numba = pytest.importorskip("numba")
    from sleepcast.simulator.simd.cached import CachedKernel

    called: set[tuple[str, object]] = set()
    itself = CachedKernel.__call__

    def call(kernel: CachedKernel, *arguments: object) -> object:
        called.add((kernel.__name__, tuple(numba.typeof(argument) for argument in arguments)))
        return itself(kernel, *arguments)

    rooms = ("[robots]\n", '[world.rooms]\nsize = "6m"\ndoor = "1.5m"\n\n[robots]\n')
    sim = scouts(tmp_path, ("count = 1\n", "count = 40\n"), rooms, more=sonar, machine=choose("numba", 1))
    monkeypatch.setattr(CachedKernel, "__call__", call)
    monkeypatch.setattr(assembly, "load_kernels", lambda scenario, threads: False)  # as if no process had noted them
    warm_up(sim.scenario, 1)
    prepared = set(called)
    called.clear()
    sim.step()
    sim.sense()
    assert len(called) >= 8
    assert called <= prepared


COLD = """
import sys
from sleepcast.api.assembly import warm_up
from sleepcast.simulator import find_scenario

warm_up(find_scenario("crowd"), 1)
for name, module in sorted(sys.modules.items()):
    if name.startswith("sleepcast.simulator") and ".kernels" in name:
        for kernel in vars(module).values():
            if hasattr(kernel, "stats") and kernel.__module__ == name:
                print(name, kernel.__name__, sum(kernel.stats.cache_misses.values()))
"""


@pytest.mark.nightly
def test_the_first_start_compiles_in_two_processes(tmp_path: Path) -> None:
    """Each kernel once: what sonars need elsewhere, what motion needs here."""
    pytest.importorskip("numba")
    if cores() < 2:
        pytest.skip("one core compiles alone")
    environment = {**os.environ, "XDG_CACHE_HOME": str(tmp_path)}
    ran = subprocess.run([sys.executable, "-c", COLD], env=environment, capture_output=True, text=True, check=True)
    rows = [row.split() for row in ran.stdout.splitlines()]
    compiled = Counter({(module.rpartition(".")[2], kernel): int(times) for module, kernel, times in rows})
    assert compiled["kernels_motion", "propose"] == compiled["kernels_motion", "stop_at_old"] == 1
    assert compiled["kernels_sonar", "see"] == compiled["kernels", "hear"] == 0
    kept = {file.name.split("-")[1] for file in tmp_path.rglob("kernels/*")}
    assert kept >= {"kernels_motion.propose", "kernels_sonar.see", "kernels.hear"}


NOTED = """
from sleepcast.api import assembly
from sleepcast.simulator import find_scenario
from sleepcast.simulator.simd.cached import in_use

lived, assemble = [], assembly.assemble
assembly.assemble = lambda *settings, **more: lived.append(settings) or assemble(*settings, **more)
scenario = find_scenario("crowd")
assembly.warm_up(scenario, 1)
loaded = set(in_use() or ())
swarm, _ = assemble(scenario, None, mission=False, threads=1)
for _ in range(3):
    swarm.step()
    swarm.simulator.readings()
print(len(lived), *sorted(loaded))
print(*sorted(set(in_use() or ()) - loaded))
"""


def test_another_process_loads_what_was_needed_without_trying_it() -> None:
    """Once everything is compiled; and no longer if one of the kernels is not there any more."""
    pytest.importorskip("numba")
    scenario = few_of(find_scenario("crowd"))

    def ran() -> tuple[int, set[str], str]:
        done = subprocess.run([sys.executable, "-c", NOTED], capture_output=True, text=True, check=True)
        first, more = done.stdout.splitlines()
        lived, *loaded = first.split()
        return int(lived), set(loaded), more

    ENTRIES.save(_note(scenario, 1), b"sleepcast.simulator.motion.kernels_motion:nobody_has_this")
    assert ran()[0] == 1
    ran()  # the first one may have had to compile
    lived, loaded, more = ran()
    assert (lived, more) == (0, "")
    assert {"propose", "commit", "see", "hear"} <= {name.rpartition(":")[2] for name in loaded}
    assert _note(replace(scenario, seed=7), 1) == _note(scenario, 1)
    assert len({_note(scenario, 1), _note(scenario, 2), _note(replace(scenario, shapes=()), 1)}) == 3
