"""Bodies that slide along what they touch: never into it, and in every machine and order alike."""

from __future__ import annotations

from math import cos, pi, radians
from pathlib import Path

import numpy as np
import pytest

from machines import ALL, MACHINES
from sleepcast.core.settings import SettingsError
from sleepcast.simulator import Simulator
from sleepcast.simulator.engine import Machine, choose
from sleepcast.simulator.world.grid import distance
from small_worlds import scouts

SLIDE = ("bumpers = 8\n", 'bumpers = 8\ncontact = "slide"\n')
SLIP = ("[robots.sonar]", 'slip_left = "1%"\nslip_noise = "20mm"\n\n[robots.sonar]')
RADIUS = 0.17
OBSTACLES = """
[[world.circles]]
center = [6, 6]
radius = 0.8
[[world.walls]]
points = [[2, 3], [3.5, 9]]
[[world.walls]]
points = [[9, 3], [10, 3], [9.5, 3.2]]
"""


def one(folder: Path, machine: Machine, x: float, y: float, heading: float, *changes: tuple[str, str]) -> Simulator:
    """A robot that starts there at full speed, and needs no time for it."""
    sim = scouts(folder, SLIDE, ('"2m/s2"', '"100m/s2"'), *changes, machine=machine)
    sim.place(0, x, y, heading)
    sim.robots[0].drive(1.0, 0.0)
    return sim


def full(folder: Path, machine: Machine, *changes: tuple[str, str], count: int = 300) -> Simulator:
    """A full room in which all drive somewhere, most of them into each other."""
    room = SLIDE, ("count = 1\n", f"count = {count}\n"), *changes
    return scouts(folder, *room, more=OBSTACLES, machine=machine)


def stir(sim: Simulator) -> None:
    draw = np.random.default_rng(6)
    for body in sim.robots:
        body.drive(*draw.uniform((-1.2, -1.0), (1.2, 1.0)))


def gap(sim: Simulator) -> float:
    """The least distance between two bodies, rim to rim."""
    away = np.hypot(sim.x[:, None] - sim.x, sim.y[:, None] - sim.y)
    return float(away[~np.eye(len(sim.x), dtype=bool)].min()) - 2.0 * RADIUS


@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize("degrees", [5, 30, 60, 85])
def test_a_body_slides_along_a_wall(tmp_path: Path, machine: Machine, degrees: int) -> None:
    sim = one(tmp_path, machine, 2.0, RADIUS + 2e-6, -radians(degrees))
    for _ in range(20):
        sim.step()
    assert sim.x[0] == pytest.approx(2.0 + 2.0 * cos(radians(degrees)), rel=1e-6)
    assert RADIUS < sim.y[0] < RADIUS + 3e-6
    assert sim.bodies.bumper[0] > 0.0
    assert sim.bodies.encoder_x[0] == pytest.approx(sim.x[0], abs=1e-12)  # odometry has noticed
    assert sim.bodies.speed[0] == 1.0


@pytest.mark.parametrize("machine", MACHINES)
def test_a_body_that_stops_keeps_standing_there(tmp_path: Path, machine: Machine) -> None:
    sim = one(tmp_path, machine, 2.0, RADIUS + 2e-6, -radians(30), ('contact = "slide"', 'contact = "stop"'))
    for _ in range(20):
        sim.step()
    assert sim.x[0] == pytest.approx(2.0, abs=1e-5)


@pytest.mark.parametrize("machine", MACHINES)
def test_a_body_slides_around_another_one(tmp_path: Path, machine: Machine) -> None:
    sim = one(tmp_path, machine, 2.0, 6.05, 0.0, ("count = 1\n", "count = 2\n"))
    sim.place(1, 3.0, 6.0, 0.0)
    for _ in range(30):
        sim.step()
        assert gap(sim) > 0.0
    assert sim.x[0] > 3.5
    assert (sim.x[1], sim.y[1]) == (3.0, 6.0)


@pytest.mark.parametrize("machine", MACHINES)
def test_a_body_in_a_corner_stays(tmp_path: Path, machine: Machine) -> None:
    sim = one(tmp_path, machine, 0.5, 0.5, -0.75 * pi)
    for _ in range(20):
        sim.step()
    assert (sim.x[0], sim.y[0]) == pytest.approx((RADIUS, RADIUS), abs=1e-5)


@pytest.mark.parametrize("machine", MACHINES)
def test_nothing_ever_penetrates(tmp_path: Path, machine: Machine) -> None:
    sim = full(tmp_path, machine, ('"2m/s2"', '"20m/s2"'))
    x0, y0, x1, y1, radius = sim.world.solids.T
    stir(sim)
    for _ in range(100):
        sim.step()
        assert gap(sim) > 0.0
        assert (distance(sim.x[:, None], sim.y[:, None], x0, y0, x1, y1) - radius).min() > RADIUS


def test_machines_and_threads_agree_to_the_last_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for few in ("LIGHT", "CROWDED", "ALONE", "WATCHFUL"):  # whatever threads may share, they do
        monkeypatch.setattr(f"sleepcast.simulator.fast.{few}", 0)
    for changes in ((SLIP,), (('edge = "wall"', 'edge = "fence"'),)):
        hashes = set()
        for machine in (*ALL, *([choose("numba", threads) for threads in (1, 2, 3)] if ALL[1:] else [])):
            sim = full(tmp_path, machine, *changes)
            stir(sim)
            for _ in range(60):
                sim.step()
            hashes.add(sim.state_hash())
        assert len(hashes) == 1


@pytest.mark.parametrize("machine", MACHINES)
def test_the_order_of_the_bodies_does_not_matter(tmp_path: Path, machine: Machine) -> None:
    one, other = full(tmp_path, machine), full(tmp_path, machine)
    stir(one)
    for name, values in one.bodies.arrays().items():
        if name != "sensed":
            other.bodies.arrays()[name][:] = values[..., ::-1]
    other.bodies.known[:] = one.bodies.known[:, ::-1]
    other.bodies.forget()
    for _ in range(60):
        for sim in (one, other):
            sim.step()
    assert one.x.tolist() == other.x[::-1].tolist()
    assert one.y.tolist() == other.y[::-1].tolist()


def test_bodies_without_bumpers_do_not_slide(tmp_path: Path) -> None:
    with pytest.raises(SettingsError, match=r"body.contact: bodies without bumpers touch nothing"):
        scouts(tmp_path, SLIDE, ("bumpers = 8\n", ""))
