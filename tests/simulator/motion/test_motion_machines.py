"""Every machine moves bodies in the same way, to the last bit, whatever they are doing and on however many threads."""

from __future__ import annotations

from functools import partial
from pathlib import Path

import numpy as np
import pytest

from machines import ALL
from sleepcast.simulator import Simulator, find_scenario, scenario_names
from sleepcast.simulator.bodies.bodies import Mode
from sleepcast.simulator.engine import Machine, choose
from sleepcast.simulator.motion.driving import arc
from sleepcast.simulator.simd.formulas import wrap
from sleepcast.simulator.world.grid import grid_over, sort
from small_worlds import scouts

MANY = ("count = 1\n", "count = 300\n")
ROOMY = ('width = "12m"\nheight = "12m"\nedge = "wall"', 'width = "40m"\nheight = "30m"')
STORES = (
    '\n[robots.stores.battery]\nstart = ["0%", "2%"]\nreach = "100m"\n\n[robots.stores.water]\nstart = ["1kg", "2kg"]\n'
)
WHEELS = {
    "rolling": "",
    "biased": 'slip_left = "1%"\nslip_right = "-2%"\n',
    "counted": "counts = 300\n",
    "noisy and counted": 'slip_noise = "20mm"\ncounts = 16700\n',
    "noisy": 'slip_left = "1%"\nslip_noise = "20mm"\n',
}


def busy(folder: Path, machine: Machine, slip: str, *changes: tuple[str, str]) -> Simulator:
    """Robots that roam, drive, go somewhere, tumble, are held or stopped, run into each other and run dry."""
    wheels = ("[robots.sonar]", f"{slip}\n[robots.sonar]")
    sim = scouts(folder, MANY, ROOMY, wheels, *changes, more=STORES, seed=4, machine=machine)
    draw = np.random.default_rng(6)
    for number, body in enumerate(sim.robots):
        match number % 6:
            case 0:
                body.wander()
            case 1 | 2:
                body.go_to(*draw.uniform(0.0, (40.0, 30.0)))
            case _:
                body.drive(*draw.uniform((-1.2, -4.0), (1.2, 4.0)))
        if number % 7 == 0:
            body.tumble()
        if number % 11 == 0:
            body.hold(True)
        if number % 13 == 0:
            body.stop()
    return sim


def went(sim: Simulator, ticks: int) -> str:
    for tick in range(ticks):
        sim.robots[tick % 300].tumble()
        sim.step()
    return sim.state_hash()


@pytest.mark.parametrize("slip", WHEELS.values(), ids=WHEELS.keys())
def test_machines_agree_to_the_last_bit(tmp_path: Path, slip: str) -> None:
    sims = [busy(tmp_path, machine, slip) for machine in ALL]
    hashes = {went(sim, 150) for sim in sims}
    assert len(hashes) == 1
    bodies = sims[0].bodies
    assert (bodies.stores[0] == 0.0).any()
    assert (bodies.stores[0] > 0.0).any()
    assert (bodies.swing != 0.0).any() or (bodies.heading != 0.0).all()


@pytest.mark.parametrize("count", [1, 15, 16, 275, 530])
def test_machines_agree_on_bodies_that_only_drive(tmp_path: Path, count: int) -> None:
    """But for a few that tumble, are near the fence, or have run dry; also where they fill no vector."""
    hashes = set()
    for machine in ALL:
        many = MANY[0], f"count = {count}\n"
        wheels = ("[robots.sonar]", f"{WHEELS['noisy']}\n[robots.sonar]")
        sim = scouts(tmp_path, many, ROOMY, wheels, more=STORES, seed=4, machine=machine)
        draw = np.random.default_rng(6)
        for body in sim.robots:
            body.drive(*draw.uniform((-1.2, -4.0), (1.2, 4.0)))
        for tick in range(60):
            if tick % 3 == 0:
                sim.robots[7 * tick % count].tumble()
            sim.step()
        hashes.add(sim.state_hash())
        if count > 100:
            assert (sim.bodies.stores[0] == 0.0).any()
            assert (sim.bodies.stores[0] > 0.0).any()
            assert (sim.bodies.bumper > 0.0).any()
    assert len(hashes) == 1


def test_machines_agree_between_walls_and_without_bumpers(tmp_path: Path) -> None:
    walls = ('width = "40m"\nheight = "30m"', 'width = "40m"\nheight = "30m"\nedge = "wall"')
    for change in (walls, ("bumpers = 8\n", "")):
        assert len({went(busy(tmp_path, machine, WHEELS["noisy"], change), 80) for machine in ALL}) == 1


@pytest.mark.parametrize("bumpers", ["bumpers = 8\n", 'bumpers = 8\ncontact = "slide"\n', ""])
def test_machines_agree_on_bodies_without_wheels(tmp_path: Path, bumpers: str) -> None:
    gliding = ('[robots.wheels]\ntrack = "0.3452m"\n', ""), ("bumpers = 8\n", bumpers)
    sims = [busy(tmp_path, machine, "", *gliding) for machine in ALL]
    assert len({went(sim, 150) for sim in sims}) == 1
    bodies = sims[0].bodies
    assert not bodies.laws.track
    assert (bodies.stores[0] == 0.0).any()
    assert (bodies.stores[0] > 0.0).any()


@pytest.mark.parametrize("name", scenario_names())
def test_machines_agree_on_the_gallery_without_sonars(name: str) -> None:
    scenario = find_scenario(name)
    if any(spec.ring for spec in scenario.each_type):
        return
    hashes = set()
    for machine in ALL:
        sim = Simulator(scenario, 3, machine)
        for number, body in enumerate([*sim.robots][:30]):
            flight = sim.bodies.flight
            goes = body.take_off if flight is not None and flight.hovers[number] else partial(body.go_to, 1.0, 1.0)
            (body.wander, body.tumble, goes)[number % 3]()
        for _ in range(40):
            sim.step()
        hashes.add(sim.state_hash())
    assert len(hashes) == 1


def test_threads_do_not_matter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("numba")
    for few in ("LIGHT", "CROWDED"):  # whatever threads may share, they do
        monkeypatch.setattr(f"sleepcast.simulator.fast.{few}", 0)
    hashes = set()
    for threads in (1, 2, 3):
        crowd = ("count = 300\n", "count = 6000\n"), ('"40m"\nheight = "30m"', '"100m"\nheight = "90m"')
        sim = busy(tmp_path, choose("numba", threads), WHEELS["noisy"], *crowd)
        for _ in range(5):
            sim.step()
        assert (sim.bodies.bumper > 0).any()
        hashes.add(sim.state_hash())
    assert len(hashes) == 1


def test_a_body_that_only_drives_does_not_roam(tmp_path: Path) -> None:
    """Its turn rate waits for it to wander again."""
    sim = busy(tmp_path, ALL[0], "")
    before = sim.bodies.roaming.copy()
    sim.step()
    wanders = sim.bodies.mode == Mode.WANDER
    assert 20 < np.count_nonzero(wanders) < 100
    assert ((sim.bodies.roaming != before) == wanders).all()


@pytest.mark.skipif(len(ALL) == 1, reason="only NumPy is installed")
@pytest.mark.parametrize("threads", [1, 2, 3])
def test_bodies_are_sorted_alike_on_any_number_of_threads(threads: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """More than one thread does alone, some of them outside of the world."""
    monkeypatch.setattr("sleepcast.simulator.fast.LIGHT", 0)
    world = grid_over(300.0, 200.0, 7.0, 8_000)
    x, y = np.random.default_rng(9).uniform(((-5.0,), (-5.0,)), ((305.0,), (205.0,)), (2, 8_000))
    wanted, found = sort(world, x, y), choose("numba", threads).sort(world, x, y)
    assert found.order.tolist() == wanted.order.tolist()
    assert found.start.tolist() == wanted.start.tolist()


def test_what_is_quick_for_small_turns_is_the_same_for_any(tmp_path: Path) -> None:
    pytest.importorskip("numba")
    from sleepcast.simulator.motion.kernels_motion import short_arc, wrapped
    from sleepcast.simulator.simd import lanes
    from sleepcast.simulator.simd.compiled import strict

    def all_of(laws, angle, left, right, into):  # type: ignore[no-untyped-def]
        for i in range(0, angle.shape[0], 16):
            lanes.put(into[0], i, wrapped(lanes.at(angle, i)))
            across, up, turn = short_arc(laws, lanes.at(left, i), lanes.at(right, i), lanes.at(angle, i))
            lanes.put(into[1], i, across)
            lanes.put(into[2], i, up)
            lanes.put(into[3], i, turn)

    draw = np.random.default_rng(9)
    bounds = np.nextafter(np.outer((-3.0, -1.0, 1.0, 3.0), (np.pi,) * 3), (-9.0, 0.0, 9.0))
    ends = np.concatenate((bounds.ravel(), [-np.pi, np.pi, 0.0, -0.0], draw.uniform(-3.1, 3.1, 16), np.full(16, 50.0)))
    angle = np.concatenate((ends, draw.uniform(-12.0, 12.0, 3_200), draw.uniform(-9.4, 9.4, 320)))
    sizes = draw.choice([0.01, 0.1, 1.0], len(angle) // 16).repeat(16)
    left = draw.normal(0.0, sizes)
    right = left + np.where(draw.random(len(angle)) < 0.2, 0.0, draw.normal(0.0, sizes))
    laws = scouts(tmp_path).bodies.laws
    into = np.zeros((4, len(angle)))
    strict(all_of)(laws, angle, left, right, into)  # type: ignore[no-untyped-call]
    assert into.tobytes() == np.stack((wrap(angle), *arc(laws, left, right, angle))).tobytes()
    small = np.abs(into[3].reshape(-1, 16)).max(axis=1) < 1.4
    assert 0.2 < small.mean() < 0.95


@pytest.mark.parametrize(
    ("machine", "sonars"),
    [
        pytest.param(
            machine,
            f"count = {count}",
            marks=pytest.mark.nightly if machine.name == "numpy" and count != 3 else (),
            id=f"{machine.name}-{count}",
        )
        for machine in ALL
        for count in (1, 3, 16)
    ],
)
def test_looking_ahead_hides_nobody_behind(tmp_path: Path, machine: Machine, sonars: str) -> None:
    """The machines note who has nobody near while they look; whoever backs into others must still stop."""
    ring = ("[robots.sonar]", f'[robots.sonar]\n{sonars}\nbeam = "1deg"\nrange = "12m"')
    sim = scouts(tmp_path, MANY, ('"2m/s2"', '"20m/s2"'), ring, machine=machine)
    everybody, ahead = np.arange(300), sim.sonar_rows[:1]
    for body in sim.robots:
        body.drive(-1.0, 0.5)
    for _ in range(60):
        sim.sense(everybody, ahead)
        sim.step()
        away = np.hypot(sim.x[:, None] - sim.x, sim.y[:, None] - sim.y) + np.eye(300)
        assert away.min() > 0.34
