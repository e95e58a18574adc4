"""A torus has no edge: what bodies sense and do there does not depend on where on it they are."""

from __future__ import annotations

from math import pi
from pathlib import Path

import numpy as np
import pytest

from machines import ALL, MACHINES
from sleepcast.core.settings import SettingsError
from sleepcast.simulator import Simulator, load
from sleepcast.simulator.engine import Machine, choose
from sleepcast.simulator.simd.formulas import shortest
from sleepcast.simulator.snapshot import resume, state_of
from sleepcast.simulator.world.torus import cells_over, wrap_position
from sleepcast.simulator.world.world import Circle, Wall
from small_worlds import SMALL, scouts, simulator, write

TORUS = ('width = "12m"\nheight = "12m"\nedge = "wall"', 'width = "20m"\nheight = "15m"\nedge = "torus"')
SHORT = ("[robots.sonar]", '[robots.sonar]\nrange = "4m"')
FAR = (12.4, 9.7)


def crowd(folder: Path, machine: Machine, count: int = 300, *changes: tuple[str, str], more: str = "") -> Simulator:
    """Scouts on a torus, with a pillar across its corner, that drive across its edges and into each other."""
    sim = scouts(folder, ("count = 1\n", f"count = {count}\n"), TORUS, SHORT, *changes, more=more, machine=machine)
    sim.world.add(Circle(19.8, 14.9, 0.4))
    sim.world.add(Wall(((17.0, 3.0), (19.5, 5.0))))
    draw = np.random.default_rng(6)
    for number, body in enumerate(sim.robots):
        if number % 4:
            body.drive(*draw.uniform((-1.0, -1.0), (1.0, 1.0)))
        else:
            body.go_to(*draw.uniform(-20.0, 40.0, 2))
    return sim


def gaps(sim: Simulator) -> np.ndarray:
    """The distances of all pairs of different bodies, the shortest way around."""
    width, height = sim.scenario.around
    across, up = (shortest(each[:, None] - each, size) for each, size in ((sim.x, width), (sim.y, height)))
    return np.hypot(across, up)[~np.eye(len(sim.x), dtype=bool)]


def test_the_shortest_way_and_the_way_back() -> None:
    assert shortest(np.array((-9.0, -5.0, -4.0, 0.0, 5.0, 6.0)), 10.0).tolist() == [1.0, -5.0, -4.0, 0.0, 5.0, -4.0]
    assert shortest(np.array((-9.0, 1e9)), np.inf).tolist() == [-9.0, 1e9]
    x = np.array((-1.0, -1e-30, 0.0, 9.0, 10.0, 31.0))
    wrap_position(x, 10.0)
    assert x.tolist() == [9.0, 0.0, 0.0, 9.0, 0.0, 1.0]


def test_images_are_all_that_is_near_the_edge() -> None:
    x, y = np.random.default_rng(1).uniform(((0.0,), (0.0,)), ((10.0,), (8.0,)), (2, 60))
    cells = cells_over((10.0, 8.0), (10.0, 8.0), 1.0, 3.0, 60)
    found = cells.images(x, y)
    wanted = {
        (number, i, j)
        for i in (-1, 0, 1)
        for j in (-1, 0, 1)
        for number in range(60)
        if -3.0 <= x[number] + 10.0 * i < 13.0 and -3.0 <= y[number] + 8.0 * j < 11.0
    }
    assert {
        (int(of), round((a - 3.0 - x[of]) / 10.0), round((b - 3.0 - y[of]) / 8.0))
        for a, b, of in zip(found.x, found.y, found.whose(np.arange(len(found.x))), strict=True)
    } == wanted
    assert found.whose(np.arange(60)).tolist() == list(range(60))


@pytest.mark.parametrize("machine", MACHINES)
def test_bodies_wrap_and_touch_across_the_edges(tmp_path: Path, machine: Machine) -> None:
    sim = crowd(tmp_path, machine)
    wrapped, touched = np.zeros(300, bool), 0
    for _ in range(80):
        before = sim.x.copy(), sim.y.copy()
        sim.step()
        wrapped |= (np.abs(sim.x - before[0]) > 10.0) | (np.abs(sim.y - before[1]) > 7.0)
        edge = (sim.x < 0.2) | (sim.x > 19.8) | (sim.y < 0.2) | (sim.y > 14.8)
        touched += np.count_nonzero(edge & (sim.bodies.bumper > 0.0))
        assert gaps(sim).min() > 0.34
        assert ((sim.x >= 0.0) & (sim.x < 20.0) & (sim.y >= 0.0) & (sim.y < 15.0)).all()
    assert np.count_nonzero(wrapped) > 20
    assert touched > 20


@pytest.mark.parametrize("machine", MACHINES)
def test_nothing_depends_on_where_the_edges_are(tmp_path: Path, machine: Machine) -> None:
    """The same robots and obstacles elsewhere on the torus do and see the same, but for rounding."""
    one, other = crowd(tmp_path, machine), crowd(tmp_path, machine)
    other.world.clear()
    other.world.add(Circle(12.2, 9.6, 0.4))
    other.world.add(Wall(((9.4, 12.7), (11.9, 14.7))))
    for _ in range(40):
        shift(one, other)
        seen = [np.array(sim.readings())[:, 5:] for sim in (one, other)]
        assert np.abs(seen[0] - seen[1]).max() < 1e-4
        resting = one.bodies.bumper > 0.0  # rounding decides whether those at rest beside others are held
        for sim in (one, other):
            sim.step()
        apart = [
            np.mod(getattr(other, axis) - getattr(one, axis) - far + size / 2.0, size) - size / 2.0
            for axis, far, size in zip("xy", FAR, one.scenario.around, strict=True)
        ]
        touches = one.bodies.bumper > 0.0, other.bodies.bumper > 0.0
        assert np.count_nonzero(touches[0] != touches[1]) < 10
        assert np.hypot(*apart)[~(resting | touches[0] | touches[1])].max() < 1e-6


def shift(one: Simulator, other: Simulator) -> None:
    """Put the robots of the other simulator where those of the first one are, shifted by FAR."""
    for name, values in one.bodies.arrays().items():
        if name != "sensed":
            other.bodies.arrays()[name][:] = values
    other.bodies.known[:] = one.bodies.known
    for axis, far, size in zip("xy", FAR, one.scenario.around, strict=True):
        for name in (axis, f"encoder_{axis}", f"target_{axis}"):
            getattr(other.bodies, name)[:] = np.mod(getattr(one.bodies, name) + far, size)
    other.bodies.forget()


def test_machines_and_threads_agree_to_the_last_bit(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for few in ("LIGHT", "CROWDED", "ALONE", "WATCHFUL"):  # whatever threads may share, they do
        monkeypatch.setattr(f"sleepcast.simulator.fast.{few}", 0)
    machines = [*ALL, *([choose("numba", threads) for threads in (1, 2, 3)] if ALL[1:] else [])]
    hashes = set()
    for machine in machines:
        sim = crowd(tmp_path, machine, 400)
        for _ in range(60):
            sim.step()
        hashes.add(sim.state_hash())
    assert len(hashes) == 1


def test_a_torus_goes_on_after_a_snapshot(tmp_path: Path) -> None:
    sim = crowd(tmp_path, ALL[0])
    sim.step()
    again = resume(state_of(sim))
    for _ in range(10):
        sim.step()
        again.step()
    assert again.state_hash() == sim.state_hash()


def test_robots_start_apart_across_the_edges(tmp_path: Path) -> None:
    for seed in range(5):
        sim = scouts(tmp_path, ("count = 1\n", "count = 600\n"), TORUS, SHORT, seed=seed)
        assert gaps(sim).min() > 0.34


class TestSenses:
    def two(self, folder: Path, more: str = "") -> Simulator:
        """One robot at the left edge of a small world, another one at its right edge, looking at each other."""
        sim = simulator(folder, ('height = "1km"', 'height = "1km"\nedge = "torus"'), more=more)
        bodies = sim.bodies
        bodies.x[:], bodies.y[:], bodies.heading[:] = 500.0, 500.0, 0.0
        bodies.x[:2], bodies.y[:2], bodies.heading[:2] = (5.0, 985.0), (990.0, 990.0), (pi, 0.0)
        bodies.forget()
        return sim

    def test_ideal_sonars_see_across_the_edge(self, tmp_path: Path) -> None:
        sim = self.two(tmp_path)
        assert sim.robots[0].sonar(0.0) == pytest.approx(19.0)
        assert sim.robots[1].sonar(0.0) == pytest.approx(19.0)

    def test_pings_lights_and_neighbours_are_across_the_edge(self, tmp_path: Path) -> None:
        signals = '[lights.lamp]\nx = "990m"\ny = "990m"\n[pings]\nreach = "50m"\n[neighbours]\nreach = "50m"\n'
        sim = self.two(tmp_path, more=signals)
        sim.ping(1, 3.0)
        sim.step()
        read = dict(zip((sensor.name for sensor in sim.model.sensors), sim.readings([0])[0], strict=True))
        assert read["pFlag"] == 1.0
        assert read["pRange"] == pytest.approx(20.0)
        assert read["pBearing"] == 1.0
        assert read["sRange"] == pytest.approx(15.0)
        assert read["sBearing"] == 1.0
        ask = {function.name: function.call for function in sim.model.functions}
        assert [ask["COUNT"](sim.robots[number], 30.0) for number in (0, 1, 2)] == [1.0, 1.0, 17.0]
        assert ask["MEAN_X"](sim.robots[0], 30.0) == pytest.approx(-15.0)
        assert ask["NEAREST_DIST"](sim.robots[1], 30.0) == pytest.approx(20.0)

    def test_a_robot_goes_the_short_way(self, tmp_path: Path) -> None:
        sim = self.two(tmp_path)
        sim.robots[0].go_to(-10.0, 990.0)
        for _ in range(100):
            sim.step()
        assert sim.x[0] == pytest.approx(990.0, abs=0.6)
        assert sim.time < 11.0


@pytest.mark.parametrize(
    ("changes", "more", "wanted"),
    [
        ([('"1km"\nheight', '"501m"\nheight'), ('"5m/s"', '"500m/s"')], "", "too small: their bodies move up to 402 m"),
        ([], '[pings]\nreach = "600m"\n', "too small: they sense others up to 600 m far"),
        ([], '[measures.size]\nof = "gyration"\n', "robots on a torus have no centre"),
        ([("sonars = 16\nsonar_range", "# ")], '[robots.sonar]\npause = "4ms"\n', "leave the pause out"),
    ],
    ids=["too small", "too far", "measures", "pause"],
)
def test_what_does_not_go_together_is_refused(
    tmp_path: Path, changes: list[tuple[str, str]], more: str, wanted: str
) -> None:
    edge = ('height = "1km"', 'height = "1km"\nedge = "torus"')
    with pytest.raises(SettingsError, match=wanted):
        load(write(tmp_path, edge, *changes, more=more, text=SMALL))
