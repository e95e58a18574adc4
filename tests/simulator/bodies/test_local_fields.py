"""What robots sense of fields: values and slopes against differences, their frames, noise and torus."""

from __future__ import annotations

from math import exp, pi
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from PIL import Image

import sleepcast as sc
from machines import MACHINES
from simulator.world.sight_reference import blocked, exactly
from sleepcast.core.settings import SettingsError
from sleepcast.simulator import Simulator, load
from sleepcast.simulator.bodies.bodies import Floats
from sleepcast.simulator.bodies.field_map import still_map
from sleepcast.simulator.bodies.local_fields import cell_middles, flow, values
from sleepcast.simulator.engine import Machine
from sleepcast.simulator.scenario.fields import Hill, ScalarField, Swirl, VectorField
from sleepcast.simulator.snapshot import resume, state_of
from sleepcast.simulator.world.world import Wall
from small_worlds import SCOUTS, SMALL, simulator, small, write

SIZE, PLAIN = (100.0, 80.0), (np.inf, np.inf)
X, Y = (np.random.default_rng(3).uniform(5.0, side - 5.0, 500) for side in SIZE)
LIGHT = '\n[fields.light]\nhills = [{ x = "500m", y = "500m", peak = 8, radius = "20m" }]\n'


def of_hill(*, gaussian: bool) -> ScalarField:
    return ScalarField("light", "", "", 2.0, (Hill(40.0, 30.0, 5.0, 12.0, gaussian),), (), None, None)


def no_walls(which: NDArray[np.intp], to_x: Floats, to_y: Floats) -> NDArray[np.bool_]:
    return np.zeros(len(which), bool)


def row(sim: Simulator, name: str) -> Floats:
    """What all robots sense under this name."""
    sim.sense()
    found: Floats = sim.sensed[[sensor.name for sensor in sim.model.sensors].index(name)]
    return found


def rises(field: ScalarField, x: Floats, y: Floats, around: tuple[float, float] = PLAIN) -> None:
    """The slopes are the differences between values nearby."""
    step = 1e-5
    _, across, up = values(field, x, y, SIZE, around, no_walls)
    for slope, dx, dy in ((across, step, 0.0), (up, 0.0, step)):
        ends = [values(field, x + side * dx, y + side * dy, SIZE, around, no_walls)[0] for side in (1.0, -1.0)]
        assert np.median(np.abs((ends[0] - ends[1]) / (2.0 * step) - slope)) < 1e-7


def test_a_gaussian_hill() -> None:
    value, _, _ = values(of_hill(gaussian=True), np.array([40.0, 52.0]), np.array([30.0, 30.0]), SIZE, PLAIN, no_walls)
    assert value == pytest.approx([7.0, 2.0 + 5.0 * exp(-0.5)])
    rises(of_hill(gaussian=True), X, Y)


def test_a_linear_hill() -> None:
    x, y = np.array([40.0, 46.0, 60.0]), np.array([30.0, 30.0, 30.0])
    value, across, up = values(of_hill(gaussian=False), x, y, SIZE, PLAIN, no_walls)
    assert value == pytest.approx([7.0, 4.5, 2.0])
    assert across == pytest.approx([0.0, -5.0 / 12.0, 0.0])
    assert up == pytest.approx([0.0, 0.0, 0.0])
    rises(of_hill(gaussian=False), X, Y)


def test_a_hill_is_seen_across_the_edge_of_a_torus() -> None:
    field = ScalarField("light", "", "", 0.0, (Hill(99.0, 1.0, 5.0, 4.0, True),), (), None, None)
    (value,), (across,), (up,) = values(field, np.array([1.0]), np.array([79.0]), SIZE, SIZE, no_walls)
    assert value == pytest.approx(5.0 * exp(-8.0 / 32.0))
    assert across < 0.0 < up
    assert values(field, np.array([1.0]), np.array([79.0]), SIZE, PLAIN, no_walls)[0][0] < 1e-9


def test_zones_add_up(tmp_path: Path) -> None:
    sim = simulator(
        tmp_path,
        more='\n[fields.food]\nbase = 1\nzones = [{ center = ["500m", "500m"], radius = "9m", value = 2 },'
        ' { x = ["500m", "510m"], y = ["490m", "510m"], value = 4 }]\n',
    )
    sim.bodies.x[:4], sim.bodies.y[:4] = (495.0, 505.0, 509.5, 530.0), 500.0
    sim.senses.step()
    assert row(sim, "food")[:4].tolist() == [3.0, 7.0, 5.0, 1.0]
    assert row(sim, "food_dx")[:4].tolist() == [0.0] * 4


def test_a_picture_is_linear_between_its_pixels(tmp_path: Path) -> None:
    Image.fromarray(np.array([[0, 255, 0], [255, 51, 102]], np.uint8)).save(tmp_path / "grey.png")
    (field,) = small(tmp_path, more='\n[fields.depth]\nimage = { file = "grey.png", low = 10, high = 20 }\n').fields
    assert isinstance(field, ScalarField)
    x, y = np.array([0.0, 50.0, 100.0 / 6.0, 100.0 / 3.0]), np.array([80.0, 60.0, 0.0, 20.0])
    value, _, _ = values(field, x, y, SIZE, PLAIN, no_walls)
    assert value == pytest.approx([10.0, 20.0, 20.0, (20.0 + 12.0) / 2.0])
    rises(field, X, Y)


def test_a_picture_of_one_pixel_is_even(tmp_path: Path) -> None:
    Image.fromarray(np.array([[51]], np.uint8)).save(tmp_path / "grey.png")
    (field,) = small(tmp_path, more='\n[fields.depth]\nimage = { file = "grey.png" }\n').fields
    assert isinstance(field, ScalarField)
    value, across, up = values(field, X, Y, SIZE, PLAIN, no_walls)
    assert value == pytest.approx(np.full(X.size, 0.2))
    assert not across.any()
    assert not up.any()


def test_a_swirl_turns_counter_clockwise_and_is_strongest_at_its_radius() -> None:
    field = VectorField("wind", "m/s", "", (1.0, 0.0), (Swirl(50.0, 40.0, 3.0, 10.0),))
    x, y = np.array([50.0, 60.0, 50.0]), np.array([40.0, 40.0, 50.0])
    across, up = flow(field, x, y, PLAIN)
    assert across == pytest.approx([1.0, 1.0, -2.0])
    assert up == pytest.approx([0.0, 3.0, 0.0])
    speeds = np.hypot(*flow(VectorField("w", "", "", (0.0, 0.0), field.swirls), X, Y, PLAIN))
    assert speeds.max() <= 3.0


def test_slopes_are_in_the_robots_own_frame(tmp_path: Path) -> None:
    sim = Simulator(load(write(tmp_path, text=SCOUTS, more=LIGHT.replace("500m", "6m").replace("20m", "3m"))))
    bodies = sim.bodies
    bodies.x[0], bodies.y[0], bodies.heading[0], bodies.encoder_heading[0] = 4.0, 6.0, 0.5, 0.5 + pi / 2
    sim.senses.step()
    assert row(sim, "light_dx")[0] == pytest.approx(0.0, abs=1e-12)
    assert row(sim, "light_dy")[0] > 0.1  # the lamp is to the east, which it believes to be north


def test_noise_is_that_of_the_sensor(tmp_path: Path) -> None:
    sim = simulator(tmp_path, ("count = 20", "count = 2000"), more=LIGHT + "[noise]\nlight = 0.5\n")
    sim.bodies.x[:], sim.bodies.y[:] = 500.0, 500.0
    sim.senses.step()
    assert np.std(row(sim, "light")) == pytest.approx(0.5, rel=0.1)
    assert np.mean(row(sim, "light")) == pytest.approx(8.0, abs=0.05)
    assert not row(sim, "light_dx").any()


def test_robots_know_the_field_from_the_start_and_as_they_move(tmp_path: Path) -> None:
    sim = simulator(tmp_path, ('motion = "still"', 'motion = "wander"'), more=LIGHT.replace('"20m"', '"300m"'))
    before = row(sim, "light").copy()
    for _ in range(20):
        sim.step()
    (field,) = sim.scenario.fields
    assert isinstance(field, ScalarField)
    expected = values(field, sim.x, sim.y, (1000.0, 1000.0), PLAIN, no_walls)[0]
    assert np.array_equal(row(sim, "light"), expected)
    assert (before != expected).all()
    assert resume(state_of(sim)).state_hash() == sim.state_hash()


LAMP = """
[fields.light]
base = 2
hills = [
  { x = "4m", y = "10m", peak = 8, radius = "6m", hidden = true },
  { x = "15m", y = "5m", peak = 3, radius = "30m", shape = "linear", hidden = true },
  { x = "15m", y = "15m", peak = 1, radius = "9m" },
]
"""
WALLS = """
[[world.walls]]
name = "wall"
points = [["10m", "4m"], ["10m", "16m"]]

[[world.circles]]
center = ["7.5m", "13m"]
radius = "0.4m"
"""
ROOM = SMALL.replace("format = 1", "format = 2").replace('"1km"', '"20m"').replace('"500m"', '"5m"')
ROOM = ROOM.replace('y = "400m"', 'y = "4m"').replace('speed = "5m/s"', 'speed = "1m/s"')
ROOM = ROOM.replace('sonars = 16\nsonar_range = "100m"', "")
TORUS = ('height = "20m"', 'height = "20m"\nedge = "torus"')


class TestBehindWalls:
    def sim(
        self, folder: Path, more: str, *changes: tuple[str, str], machine: Machine | None = None, many: int = 60
    ) -> Simulator:
        """Robots here and there; the first one stands behind `WALLS`."""
        changes = ("count = 20", f"count = {many}"), *changes
        sim = Simulator(load(write(folder, *changes, more=more, text=ROOM)), machine=machine)
        sim.bodies.x[:], sim.bodies.y[:] = np.random.default_rng(8).uniform(0.0, 20.0, (2, many))
        sim.bodies.x[0], sim.bodies.y[0] = 12.0, 10.0
        sim.senses.step()
        return sim

    @pytest.mark.parametrize("machine", MACHINES)
    @pytest.mark.parametrize("around", ["plain", "torus"])
    def test_a_hidden_hill_adds_nothing_and_does_not_rise_there(
        self, tmp_path: Path, around: str, machine: Machine
    ) -> None:
        sim = self.sim(tmp_path, LAMP + WALLS, *((TORUS,) if around == "torus" else ()), machine=machine)
        (field,), bodies = sim.scenario.fields, sim.bodies
        assert isinstance(field, ScalarField)
        solids = exactly(sim.world.solids.tolist(), sim.scenario.around)
        size = (20.0, 20.0)
        expected, behind = np.zeros((3, bodies.count)), 0
        for robot in range(bodies.count):
            x, y = float(bodies.x[robot]), float(bodies.y[robot])
            lines = [(x, y, _image(x, hill.x, around), _image(y, hill.y, around)) for hill in field.hills]
            lit = [not (hill.hidden and blocked(line, solids)) for hill, line in zip(field.hills, lines, strict=True)]
            behind += lit.count(False)
            seen = ScalarField(
                "", "", "", 2.0, tuple(hill for hill, on in zip(field.hills, lit, strict=True) if on), (), None, None
            )
            found = values(seen, np.array([x]), np.array([y]), size, sim.scenario.around, no_walls)
            expected[:, robot] = np.concatenate(found)
        for name, wanted in zip(("light", "light_dx", "light_dy"), expected, strict=True):
            assert row(sim, name).tolist() == wanted.tolist()
        assert 10 < behind < 60

    def test_a_wall_that_moves_or_goes_hides_where_it_is(self, tmp_path: Path) -> None:
        sim = self.sim(tmp_path, LAMP + WALLS + '\n[[events]]\nat = "0.2s"\nremove = "wall"\n')
        number = next(number for number, shape in sim.world.shapes.items() if isinstance(shape, Wall))
        found = [row(sim, "light")[0]]
        sim.world.move(number, 7.0, 0.0)
        sim.senses.step()
        found.append(row(sim, "light")[0])
        again = resume(state_of(sim))
        assert row(again, "light").tolist() == row(sim, "light").tolist()
        assert again.state_hash() == sim.state_hash()
        sim.world.move(number, -7.0, 0.0)
        sim.step()
        found.append(row(sim, "light")[0])
        for _ in range(2):
            sim.step()
        found.append(row(sim, "light")[0])
        assert found[0] < found[1] == found[3]
        assert found[2] == found[0]

    def test_the_map_shows_it_as_walls_stand(self, tmp_path: Path) -> None:
        sim = self.sim(tmp_path, LAMP + WALLS)
        (field,), scenario = sim.scenario.fields, sim.scenario
        assert isinstance(field, ScalarField)
        start = still_map(field, scenario, 20).values
        middles = cell_middles(20, 20, (20.0, 20.0))
        wanted = values(field, *middles, (20.0, 20.0), PLAIN, sim.bodies.sight.from_points(*middles))[0]
        assert start.ravel().tolist() == wanted.tolist()
        assert still_map(field, scenario, 20, sim.world).values.tolist() == start.tolist()
        sim.world.clear()
        through = still_map(field, scenario, 20, sim.world).values
        assert (through >= start).all()
        assert (through > start).sum() > 50

    def test_a_growing_field_begins_with_it(self, tmp_path: Path) -> None:
        growth = '\n[fields.light.growth]\ncell = "1m"\nmost = 99\nrate = 0\n'
        sim = self.sim(tmp_path, LAMP + growth + WALLS)
        (field,) = sim.scenario.fields
        amount = sim.senses.amount("light")
        assert amount is not None
        assert amount.tolist() == still_map(field, sim.scenario, 20).values.tolist()

    def test_a_file_of_format_1_cannot_say_it(self, tmp_path: Path) -> None:
        with pytest.raises(SettingsError, match=r"hills\[0\]\.hidden: .*write format = 2"):
            self.sim(tmp_path, LAMP, ("format = 2", "format = 1"))
        with pytest.raises(SettingsError, match=r"hills\[0\]\.hidden"):
            self.sim(tmp_path, LAMP.replace("true", "1"))

    def test_worlds_of_a_batch_equal_the_run_alone(self) -> None:
        text, rule = ROOM + LAMP + WALLS, "(RULE up (DRIVE 1m/s (* 0.1deg/s light)))"
        together = sc.open_many(text, seeds=2, quiet=True)
        together.send(rule, everybody=True, wait=0)
        together.run(2, quiet=True)
        for number in (0, 1):
            alone = sc.open(text, seed=number + 1, threads=1)
            alone.send(rule, everybody=True, wait=0)
            assert alone.run(2, quiet=True).snapshot() == together[number].snapshot()


def _image(place: float, other: float, around: str) -> float:
    return min((other, other - 20.0, other + 20.0), key=lambda each: abs(each - place)) if around == "torus" else other
