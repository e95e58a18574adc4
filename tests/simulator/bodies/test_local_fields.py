"""What robots sense of fields: values and slopes against differences, their frames, noise and torus."""

from __future__ import annotations

from math import exp, pi
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from sleepcast.simulator import Simulator, load
from sleepcast.simulator.bodies.bodies import Floats
from sleepcast.simulator.bodies.local_fields import flow, values
from sleepcast.simulator.scenario.fields import Hill, ScalarField, Swirl, VectorField
from sleepcast.simulator.snapshot import resume, state_of
from small_worlds import SCOUTS, simulator, small, write

SIZE, PLAIN = (100.0, 80.0), (np.inf, np.inf)
X, Y = (np.random.default_rng(3).uniform(5.0, side - 5.0, 500) for side in SIZE)
LIGHT = '\n[fields.light]\nhills = [{ x = "500m", y = "500m", peak = 8, radius = "20m" }]\n'


def of_hill(*, gaussian: bool) -> ScalarField:
    return ScalarField("light", "", "", 2.0, (Hill(40.0, 30.0, 5.0, 12.0, gaussian),), (), None, None)


def row(sim: Simulator, name: str) -> Floats:
    """What all robots sense under this name."""
    sim.sense()
    found: Floats = sim.sensed[[sensor.name for sensor in sim.model.sensors].index(name)]
    return found


def rises(field: ScalarField, x: Floats, y: Floats, around: tuple[float, float] = PLAIN) -> None:
    """The slopes are the differences between values nearby."""
    step = 1e-5
    _, across, up = values(field, x, y, SIZE, around)
    for slope, dx, dy in ((across, step, 0.0), (up, 0.0, step)):
        ends = [values(field, x + side * dx, y + side * dy, SIZE, around)[0] for side in (1.0, -1.0)]
        assert np.median(np.abs((ends[0] - ends[1]) / (2.0 * step) - slope)) < 1e-7


def test_a_gaussian_hill() -> None:
    value, _, _ = values(of_hill(gaussian=True), np.array([40.0, 52.0]), np.array([30.0, 30.0]), SIZE, PLAIN)
    assert value == pytest.approx([7.0, 2.0 + 5.0 * exp(-0.5)])
    rises(of_hill(gaussian=True), X, Y)


def test_a_linear_hill() -> None:
    x, y = np.array([40.0, 46.0, 60.0]), np.array([30.0, 30.0, 30.0])
    value, across, up = values(of_hill(gaussian=False), x, y, SIZE, PLAIN)
    assert value == pytest.approx([7.0, 4.5, 2.0])
    assert across == pytest.approx([0.0, -5.0 / 12.0, 0.0])
    assert up == pytest.approx([0.0, 0.0, 0.0])
    rises(of_hill(gaussian=False), X, Y)


def test_a_hill_is_seen_across_the_edge_of_a_torus() -> None:
    field = ScalarField("light", "", "", 0.0, (Hill(99.0, 1.0, 5.0, 4.0, True),), (), None, None)
    (value,), (across,), (up,) = values(field, np.array([1.0]), np.array([79.0]), SIZE, SIZE)
    assert value == pytest.approx(5.0 * exp(-8.0 / 32.0))
    assert across < 0.0 < up
    assert values(field, np.array([1.0]), np.array([79.0]), SIZE, PLAIN)[0][0] < 1e-9


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
    value, _, _ = values(field, x, y, SIZE, PLAIN)
    assert value == pytest.approx([10.0, 20.0, 20.0, (20.0 + 12.0) / 2.0])
    rises(field, X, Y)


def test_a_picture_of_one_pixel_is_even(tmp_path: Path) -> None:
    Image.fromarray(np.array([[51]], np.uint8)).save(tmp_path / "grey.png")
    (field,) = small(tmp_path, more='\n[fields.depth]\nimage = { file = "grey.png" }\n').fields
    assert isinstance(field, ScalarField)
    value, across, up = values(field, X, Y, SIZE, PLAIN)
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
    expected = values(field, sim.x, sim.y, (1000.0, 1000.0), PLAIN)[0]
    assert np.array_equal(row(sim, "light"), expected)
    assert (before != expected).all()
    assert resume(state_of(sim)).state_hash() == sim.state_hash()
