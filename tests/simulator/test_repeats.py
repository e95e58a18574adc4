"""The same seed makes the same run, to the last bit and in every process; another seed makes another one."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

from sleepcast.simulator import Simulator, load
from small_worlds import simulator, write

WANDER = ('motion = "still"', 'motion = "wander"')

RUN = """
import sys
from pathlib import Path
from sleepcast.simulator import Simulator, load
sim = Simulator(load(Path(sys.argv[1])), int(sys.argv[2]))
for _ in range(200):
    sim.step()
print(sim.state_hash())
"""


def state_after(sim: Simulator, ticks: int) -> str:
    for _ in range(ticks):
        sim.step()
    return sim.state_hash()


def in_another_process(file: Path, seed: int) -> str:
    command = [sys.executable, "-c", RUN, str(file), str(seed)]
    return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()


def test_processes_agree(tmp_path: Path) -> None:
    file = write(tmp_path, WANDER)
    here = state_after(Simulator(load(file), 5), 200)
    assert in_another_process(file, 5) == here
    assert in_another_process(file, 6) != here


def test_the_scenario_has_a_seed_of_its_own(tmp_path: Path) -> None:
    hashes = [state_after(simulator(tmp_path, WANDER, seed=seed), 10) for seed in (None, 3, 4)]
    assert hashes[0] == hashes[1] != hashes[2]


def test_the_hash_sees_every_part_of_the_state(tmp_path: Path) -> None:
    seen = {simulator(tmp_path).state_hash()}

    def changed(sim: Simulator) -> None:
        assert sim.state_hash() not in seen
        seen.add(sim.state_hash())

    for name in (
        "x",
        "y",
        "heading",
        "speed",
        "wanted_speed",
        "wanted_turn",
        "target_x",
        "target_y",
        "swing",
        "roaming",
    ):
        sim = simulator(tmp_path)
        getattr(sim.bodies, name)[7] += 1e-9
        changed(sim)
    for name in ("stopped", "held"):
        sim = simulator(tmp_path)
        getattr(sim.bodies, name)[7] = True
        changed(sim)
    sim = simulator(tmp_path)
    sim.robots[7].wander()
    changed(sim)
    sim = simulator(tmp_path)
    sim.step()
    changed(sim)


def test_a_robot_does_not_depend_on_how_many_others_there_are(tmp_path: Path) -> None:
    few, many = simulator(tmp_path, WANDER), simulator(tmp_path, WANDER, ("count = 20", "count = 500"))
    state_after(few, 100)
    state_after(many, 100)
    assert few.x.tolist() == many.x[:20].tolist()
