"""Only the sonars that fire look: what they see is what the whole ring would see, the same bits on every machine."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from machines import ALL, MACHINES
from simulator.sonar.sonar_reference import readings
from simulator.sonar.test_cones import THINGS
from simulator.test_sorts import SORTS, mixed
from sleepcast.simulator import Simulator, choose
from sleepcast.simulator.engine import Machine
from small_worlds import scouts

MANY = ("count = 1\n", "count = 90\n")
WANDER = ('motion = "still"', 'motion = "wander"')
IN_THINGS = ("[robots]\n", THINGS + "\n[robots]\n")
RINGS = {
    "noise": 'pause = "4ms"\nnoise = "2%"\ndropout = "5%"',
    "specular": 'pause = "4ms"\nincidence = "30deg"',
    "wide beams": 'count = 7\nbeam = "80deg"\nrange = "3m"\nleast = "0m"\npause = "1ms"',
    "one narrow beam": 'count = 1\nbeam = "2deg"\npause = "40ms"',
    "cross-talk": 'pause = "4ms"\n[robots.sonar.crosstalk]\nchance = "70%"',
}


@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize("sonar", ["", 'incidence = "30deg"', 'count = 7\nbeam = "80deg"\nrange = "3m"'])
def test_one_cone_sees_what_the_reference_sees(tmp_path: Path, machine: Machine, sonar: str) -> None:
    sim = scouts(tmp_path, MANY, IN_THINGS, more=sonar, machine=machine)
    bodies, ring = sim.bodies, sim.bodies.rings[0]
    cones, solids = ring.cones, sim.world.solids.tolist()
    lines = [((a, b), (c, d)) for a, b, c, d, r in solids if r == 0.0]
    discs = list(zip(bodies.x.tolist(), bodies.y.tolist(), [cones.radius] * bodies.count, strict=True))
    posts = [(a, b, r) for a, b, _, _, r in solids if r > 0.0]
    which, sonars = np.arange(1, 90, 2), np.arange(1, 90, 2) % cones.count
    seen = machine.look(ring._view((bodies.x, bodies.y, bodies.heading), alone=True), which, sonars)
    for number, one, found in zip(which.tolist(), sonars.tolist(), seen.tolist(), strict=True):
        others = [*discs[:number], *discs[number + 1 :], *posts]
        pose = float(bodies.x[number]), float(bodies.y[number]), float(bodies.heading[number])
        assert found == pytest.approx(readings(cones, *pose, others, lines)[one], abs=1e-6)


def hashes(sim: Simulator, ticks: int = 25) -> list[str]:
    found = []
    for _ in range(ticks):
        sim.step()
        found.append(sim.state_hash())
    return found


@pytest.mark.parametrize("sonar", RINGS.values(), ids=RINGS)
def test_machines_agree_to_the_last_bit(tmp_path: Path, sonar: str) -> None:
    """The hash of a state has all readings in it, and who has fired when."""
    runs = [hashes(scouts(tmp_path, MANY, WANDER, IN_THINGS, more=sonar, machine=machine)) for machine in ALL]
    assert all(run == runs[0] for run in runs)
    assert len(set(runs[0])) == len(runs[0])


def test_machines_agree_about_robots_of_several_sorts(tmp_path: Path) -> None:
    firing = SORTS.replace("[robots.stores.battery]", '[robots.sonar]\npause = "4ms"\n\n[robots.stores.battery]', 1)
    firing = firing.replace('motion = "still"\n', "")
    found = []
    for machine in ALL:
        sim = mixed(tmp_path, firing, machine, 60)
        sim.bodies.rings[0].arrange(3, [0, 8, 4], 0.001)
        for _ in range(25):
            sim.step()
        found.append((sim.bodies.rings[0].readings.tobytes(), sim.bodies.x.tobytes()))
    assert all(each == found[0] for each in found)


def test_threads_do_not_matter(tmp_path: Path) -> None:
    pytest.importorskip("numba")
    room = ('"12m"\nheight = "12m"', '"150m"\nheight = "150m"')
    found = [
        hashes(
            scouts(
                tmp_path,
                ("count = 1\n", "count = 6000\n"),
                room,
                WANDER,
                more='pause = "4ms"\nnoise = "2%"',
                machine=choose("numba", threads),
            ),
            4,
        )
        for threads in (1, 2, 3)
    ]
    assert found[0] == found[1] == found[2]
