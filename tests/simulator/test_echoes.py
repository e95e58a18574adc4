"""Readings of sonars: noise, losses, limits, and the age that a firing order gives them."""

from __future__ import annotations

from math import isclose, isnan
from pathlib import Path

import numpy as np
import pytest

from machines import ALL
from sleepcast.channel.chance import key
from sleepcast.simulator import Simulator
from sleepcast.simulator.noise import Noise
from small_worlds import scouts

NOTHING = 255 * 0.0254
"""255 inches."""


def before_a_wall(folder: Path, sonar: str, robots: int = 400) -> Simulator:
    """Robots side by side along the wall of a long room, a metre before it, looking at it."""
    sim = scouts(
        folder, ("count = 1\n", f"count = {robots}\n"), ('height = "12m"', f'height = "{robots + 20}m"'), more=sonar
    )
    for number in range(robots):
        sim.place(number, 12.0 - 0.17 - 1.0, number + 10.0, 0.0)
    return sim


def ahead(sim: Simulator) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return sim.bodies.echo()[:, 0]


def test_noise_is_a_share_of_the_range(tmp_path: Path) -> None:
    sim = before_a_wall(tmp_path, 'noise = "3%"')
    first = ahead(sim).copy()
    assert isclose(float(first.std()), 0.03, rel_tol=0.12)
    assert abs(float(first.mean()) - 1.0) < 0.006
    assert (ahead(sim) == first).all()  # asked twice in a tick
    sim.step()
    assert abs(np.corrcoef(first, ahead(sim))[0, 1]) < 0.2


def test_noise_does_not_depend_on_who_is_asked(tmp_path: Path) -> None:
    every = before_a_wall(tmp_path, 'noise = "3%"').bodies.echo()
    some = before_a_wall(tmp_path, 'noise = "3%"').bodies.echo([7, 300])
    assert (some == every[[7, 300]]).all()


def test_machines_draw_the_same_noise() -> None:
    noise, which = Noise(0.02, 0.1, 6.0, key(1, "echo"), key(1, "dropout")), np.array([3, 8, 1_000_000])
    drawn = []
    for machine in ALL:
        seen = np.linspace(0.2, 6.0, 48, dtype=np.float32).reshape(3, 16)
        machine.disturb(seen, which, noise)
        drawn.append(seen.tolist())
    assert all(each == drawn[0] for each in drawn)
    assert drawn[0] != np.linspace(0.2, 6.0, 48, dtype=np.float32).reshape(3, 16).tolist()


def test_noise_is_close_to_normal() -> None:
    seen = np.ones((20_000, 16), np.float32)
    ALL[0].disturb(seen, np.arange(20_000), Noise(0.1, 0.0, 6.0, key(2), key(3)))
    deviates = (seen.astype(np.float64) - 1.0) / 0.1
    assert abs(float(deviates.mean())) < 0.01
    assert isclose(float(deviates.std()), 1.0, rel_tol=0.005)
    for bound, share in ((1.0, 0.3173), (2.0, 0.0455)):
        assert isclose(float((np.abs(deviates) > bound).mean()), share, rel_tol=0.1)
    assert np.abs(deviates).max() < 3.5
    assert np.abs(np.corrcoef(deviates.T) - np.eye(16)).max() < 0.04


def test_lost_echoes_read_as_nothing(tmp_path: Path) -> None:
    read = ahead(before_a_wall(tmp_path, 'dropout = "20%"'))
    assert set(np.round(read, 4).tolist()) == {1.0, round(NOTHING, 4)}
    assert isclose(float((read == NOTHING).mean()), 0.2, rel_tol=0.35)


def test_the_nearest_reads_as_six_inches(tmp_path: Path) -> None:
    sim = scouts(tmp_path)
    sim.place(0, 12.0 - 0.17 - 0.05, 6.0, 0.0)
    assert sim.bodies.echo()[0, 0] == 6 * 0.0254
    assert sim.bodies.echo()[0].max() <= NOTHING


def test_front_range_is_the_least_of_nine(tmp_path: Path) -> None:
    sim = scouts(tmp_path)
    for heading in np.linspace(-3.0, 3.0, 25):
        sim.place(0, 9.0, 4.0, float(heading))
        values = dict(zip([s.name for s in sim.model.sensors], sim.robots[0].sense().values, strict=True))
        assert values["front_range"] == min(values[f"sonar{i}"] for i in (12, 13, 14, 15, 0, 1, 2, 3, 4))
        assert sim.robots[0].nearest(-np.pi / 2, np.pi / 2) == values["front_range"]
        assert sim.robots[0].sonar(3) == values["sonar3"]


def test_looking_changes_no_state(tmp_path: Path) -> None:
    watched, alone = before_a_wall(tmp_path, 'noise = "3%"', 20), before_a_wall(tmp_path, 'noise = "3%"', 20)
    for _ in range(5):
        watched.step()
        alone.step()
        watched.readings()
    assert watched.state_hash() == alone.state_hash()


class TestFiringOrder:
    def test_sonars_fire_one_after_another_as_sound_travels(self, tmp_path: Path) -> None:
        """A metre ahead and all else farther: the first ping costs pause + 2 m / 343 m/s."""
        sim = before_a_wall(tmp_path, 'pause = "24ms"\norder = [0, 8]', 1)
        assert all(isnan(value) for value in sim.bodies.echo()[0])
        sim.step()
        read = sim.bodies.echo()[0]
        assert read[0] == pytest.approx(1.0, abs=1e-5)
        assert isnan(read[1])
        # 0, then 8 (nothing in reach), then 0 again ...
        assert sim.bodies.echoes is not None
        costs = [0.024 + 2 * 1.0 / 343.0, 0.024 + 2 * NOTHING / 343.0]
        fired, time = 0, 0.0
        while time < 0.1:
            time += costs[fired % 2]
            fired += 1
        assert isclose(float(sim.bodies.echoes.due[0]), time, rel_tol=1e-6)
        assert int(sim.bodies.echoes.turn[0]) == fired % 2

    def test_a_reading_is_as_old_as_it_would_be(self, tmp_path: Path) -> None:
        sim = before_a_wall(tmp_path, 'pause = "0.95s"\norder = [0]', 1)
        sim.step()
        sim.place(0, 5.0, 10.0, 0.0)
        seen = []
        for _ in range(12):
            sim.step()
            seen.append(float(sim.bodies.echo()[0, 0]))
        assert seen[0] == pytest.approx(1.0, abs=1e-5)
        assert seen[-1] == NOTHING
        # Fired in the first tick, the next ping goes out 0.956 s later: in the tenth tick.
        assert next(i for i, value in enumerate(seen) if value == NOTHING) == 8

    def test_old_readings_belong_to_the_state(self, tmp_path: Path) -> None:
        one, other = (before_a_wall(tmp_path, 'pause = "10ms"', 3) for _ in range(2))
        one.step()
        other.step()
        assert one.state_hash() == other.state_hash()
        assert one.bodies.echoes is not None
        one.bodies.echoes.readings[1, 2] += 0.5
        assert one.state_hash() != other.state_hash()
