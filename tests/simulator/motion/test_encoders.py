"""Encoders that count whole steps: nothing is lost, odometry drifts, and where they are exact nothing changes."""

from __future__ import annotations

from math import hypot, pi
from pathlib import Path

import numpy as np
import pytest

from simulator.test_sorts import SORTS, mixed
from sleepcast.nomad.world.building import nomad_world
from sleepcast.nomad.world.setups import SETUPS
from sleepcast.robot import Axes
from sleepcast.simulator import SettingsError, Simulator
from sleepcast.simulator.engine import choose
from small_worlds import scouts

TRACK = 0.3452
ROOMY = ('width = "12m"\nheight = "12m"\nedge = "wall"', 'width = "900m"\nheight = "900m"')


def wheels(text: str) -> tuple[str, str]:
    return "[robots.sonar]", f"{text}\n\n[robots.sonar]"


def driven(folder: Path, counts: float, ticks: int, speed: float = 0.37, turn: float = 0.0) -> Simulator:
    many = ("count = 1\n", "count = 20\n")
    sim = scouts(folder, many, ROOMY, wheels(f"counts = {counts}"), seed=4, machine=choose())
    for number, body in enumerate(sim.robots):
        body.drive(speed + 0.013 * number, turn)
    for _ in range(ticks):
        sim.step()
    return sim


def off(sim: Simulator) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """How far each robot's odometry is from where it is, m."""
    bodies = sim.bodies
    return np.hypot(bodies.encoder_x - bodies.x, bodies.encoder_y - bodies.y)


@pytest.mark.parametrize("counts", [1.0, 50.0, 16_700.0])
def test_a_straight_way_is_known_to_a_step_however_long_it_is(tmp_path: Path, counts: float) -> None:
    for ticks in (3, 500):
        assert off(driven(tmp_path, counts, ticks)).max() <= 1.0 / counts + 1e-9


def test_a_turn_is_known_to_two_steps_and_what_is_not_counted_yet_is_kept(tmp_path: Path) -> None:
    sim = driven(tmp_path, 200.0, 400, turn=0.4)
    bodies = sim.bodies
    wrong = np.abs(np.mod(bodies.encoder_heading - bodies.heading + pi, 2.0 * pi) - pi)
    assert wrong.max() <= 1.0 / 200.0 / TRACK + 1e-9
    left, right = bodies.uncounted
    assert np.allclose(np.mod(bodies.heading - bodies.encoder_heading + pi, 2 * pi) - pi, (right - left) / TRACK)
    assert bodies.uncounted.min() > -1e-12
    assert bodies.uncounted.max() < 1.0 / 200.0 + 1e-12


def test_coarse_encoders_drift_and_those_of_the_thesis_hardly(tmp_path: Path) -> None:
    """A minute on circles: steps of 2 cm put robots centimetres beside their odometry, those of 0.06 mm do not."""
    coarse, thesis = (float(np.median(off(driven(tmp_path, counts, 600, turn=0.7)))) for counts in (50.0, 16_700.0))
    assert thesis < 1e-3
    assert 5e-3 < coarse < 0.5
    assert coarse > 20.0 * thesis


def test_exact_encoders_are_as_they_were(tmp_path: Path) -> None:
    plain = scouts(tmp_path, seed=4, machine=choose())
    exact = scouts(tmp_path, wheels("counts = 0"), seed=4, machine=choose())
    for sim in (plain, exact):
        sim.robots[0].drive(0.4, 0.3)
        for _ in range(50):
            sim.step()
    assert plain.state_hash() == exact.state_hash()
    assert "uncounted" not in plain.bodies.arrays()
    assert not off(exact).any()


def test_counting_does_not_move_anybody(tmp_path: Path) -> None:
    one, other = driven(tmp_path, 0.0, 100, turn=0.3), driven(tmp_path, 50.0, 100, turn=0.3)
    assert np.allclose(one.bodies.x, other.bodies.x, rtol=0.0, atol=1e-9)
    assert off(other).any()


def test_around_a_torus_and_after_a_hand_has_set_it_down_odometry_follows(tmp_path: Path) -> None:
    around = ('height = "12m"\nedge = "wall"', 'height = "20m"\nedge = "torus"')
    roomy = ('width = "12m"', 'width = "20m"')
    sim = scouts(tmp_path, roomy, around, wheels("counts = 200"), seed=4, machine=choose())
    sim.robots[0].drive(0.9, 0.0)
    for _ in range(600):
        sim.step()
    assert off(sim).max() <= 1.0 / 200.0 + 1e-9
    sim.place(0, 19.9, 3.0, 0.0)
    assert not off(sim).any()
    assert not sim.bodies.uncounted.any()
    for _ in range(20):
        sim.step()
    assert sim.bodies.x[0] < 19.0
    assert off(sim).max() <= 1.0 / 200.0 + 1e-9


def test_types_beside_it_keep_exact_encoders(tmp_path: Path) -> None:
    counting = ("[robots.stores.battery]", "[robots.wheels]\ncounts = 20\n\n[robots.stores.battery]")
    sim = mixed(tmp_path, SORTS.replace(*counting).replace('like = "nomad200"', 'like = "scout"'))
    for robot in sim.robots:
        robot.drive(0.2, 0.3)
    for _ in range(40):
        sim.step()
    assert off(sim)[:2].min() > 0.0
    assert not off(sim)[2:].any()


@pytest.mark.parametrize("text", ["counts = 0.5", "counts = -1", "counts = 1e9", 'counts = "5m"'])
def test_what_is_no_number_of_steps_is_refused(tmp_path: Path, text: str) -> None:
    with pytest.raises(SettingsError, match="counts"):
        scouts(tmp_path, wheels(text))


@pytest.mark.parametrize("name", ["ideal", "nomad200"])
def test_a_nomad_travels_as_far_as_it_is_told_and_knows_it_to_a_step(tmp_path: Path, name: str) -> None:
    setup = tmp_path / "counted.toml"
    setup.write_text((SETUPS / f"{name}.toml").read_text().replace("[wheels]\n", "[wheels]\ncounts = 100\n"))
    world = nomad_world(None, str(setup), 1)
    begin = world.observe(0).real
    world.travel(0, Axes(0.515, 0.515) if name == "ideal" else Axes(0.515, 0.3))
    for _ in range(2_000):
        world.step()
        if not any(world.observe(0).moving[:2]):
            break
    found = world.observe(0)
    assert not any(found.moving[:2])
    if name == "ideal":
        assert hypot(found.real.x - begin.x, found.real.y - begin.y) == pytest.approx(0.515, abs=1e-6)
        assert hypot(found.believed.x - begin.x, found.believed.y - begin.y) == pytest.approx(0.51, abs=1e-9)
    assert abs(found.believed.x - found.real.x) + abs(found.believed.y - found.real.y) <= 0.03
