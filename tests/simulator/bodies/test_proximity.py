"""Readings of sonars: noise, losses, limits, and the age that a firing order gives them."""

from __future__ import annotations

from math import isclose, isnan
from pathlib import Path

import numpy as np
import pytest

from machines import ALL
from sleepcast.core.counter_rng import key
from sleepcast.core.errors import MisuseError
from sleepcast.simulator import Simulator
from sleepcast.simulator.bodies.proximity import Sonars
from sleepcast.simulator.sonar.noise import Noise
from small_worlds import scouts

NOTHING = 255 * 0.0254
"""255 inches."""
BOTH = np.arange(2)


def before_a_wall(folder: Path, sonar: str, robots: int = 400) -> Simulator:
    """Robots side by side along the wall of a long room, a metre before it, looking at it."""
    sim = scouts(
        folder, ("count = 1\n", f"count = {robots}\n"), ('height = "12m"', f'height = "{robots + 20}m"'), more=sonar
    )
    for number in range(robots):
        sim.place(number, 12.0 - 0.17 - 1.0, number + 10.0, 0.0)
    return sim


def ahead(sim: Simulator) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
    return sim.bodies.sonar_ranges()[:, 0]


def test_noise_is_a_share_of_the_range(tmp_path: Path) -> None:
    sim = before_a_wall(tmp_path, 'noise = "3%"')
    first = ahead(sim).copy()
    assert isclose(float(first.std()), 0.03, rel_tol=0.12)
    assert abs(float(first.mean()) - 1.0) < 0.006
    assert (ahead(sim) == first).all()  # asked twice in a tick
    sim.step()
    assert abs(np.corrcoef(first, ahead(sim))[0, 1]) < 0.2


def test_noise_does_not_depend_on_who_is_asked(tmp_path: Path) -> None:
    every = before_a_wall(tmp_path, 'noise = "3%"').bodies.sonar_ranges()
    some = before_a_wall(tmp_path, 'noise = "3%"').bodies.sonar_ranges([7, 300])
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
    assert sim.bodies.sonar_ranges()[0, 0] == 6 * 0.0254
    assert sim.bodies.sonar_ranges()[0].max() <= NOTHING


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
        assert all(isnan(value) for value in sim.bodies.sonar_ranges()[0])
        sim.step()
        read = sim.bodies.sonar_ranges()[0]
        assert read[0] == pytest.approx(1.0, abs=1e-5)
        assert isnan(read[1])
        # 0, then 8 (nothing in reach), then 0 again ...
        assert sim.bodies.sonars is not None
        costs = [0.024 + 2 * 1.0 / 343.0, 0.024 + 2 * NOTHING / 343.0]
        fired, time = 0, 0.0
        while time < 0.1:
            time += costs[fired % 2]
            fired += 1
        assert isclose(float(sim.bodies.sonars.firing.due[0]), time, rel_tol=1e-6)
        assert int(sim.bodies.sonars.firing.turn[0]) == fired % 2

    def test_a_reading_is_as_old_as_it_would_be(self, tmp_path: Path) -> None:
        sim = before_a_wall(tmp_path, 'pause = "0.95s"\norder = [0]', 1)
        sim.step()
        sim.place(0, 5.0, 10.0, 0.0)
        seen = []
        for _ in range(12):
            sim.step()
            seen.append(float(sim.bodies.sonar_ranges()[0, 0]))
        assert seen[0] == pytest.approx(1.0, abs=1e-5)
        assert seen[-1] == NOTHING
        # Fired in the first tick, the next ping goes out 0.956 s later: in the tenth tick.
        assert next(i for i, value in enumerate(seen) if value == NOTHING) == 8

    def test_old_readings_belong_to_the_state(self, tmp_path: Path) -> None:
        one, other = (before_a_wall(tmp_path, 'pause = "10ms"', 3) for _ in range(2))
        one.step()
        other.step()
        assert one.state_hash() == other.state_hash()
        assert one.bodies.sonars is not None
        one.bodies.sonars.readings[1, 2] += 0.5
        assert one.state_hash() != other.state_hash()


def rings(sim: Simulator) -> Sonars:
    assert isinstance(sim.bodies.sonars, Sonars)
    return sim.bodies.sonars


def run(sim: Simulator, ticks: int) -> None:
    for _ in range(ticks):
        sim.step()


def fired(sim: Simulator, robot: int) -> set[int]:
    """Sonars of this robot that have ever fired."""
    return set(np.flatnonzero(~np.isnan(rings(sim).readings[robot])).tolist())


class TestArranging:
    """Orders and pauses of each robot's own, while it runs."""

    def test_each_robot_has_its_own_order(self, tmp_path: Path) -> None:
        sim = before_a_wall(tmp_path, 'pause = "1ms"', 3)
        rings(sim).arrange(1, [0, 2, 4], 0.002)
        run(sim, 10)
        assert [fired(sim, robot) for robot in range(3)] == [set(range(16)), {0, 2, 4}, set(range(16))]

    def test_each_robot_has_its_own_pause(self, tmp_path: Path) -> None:
        sim = before_a_wall(tmp_path, 'pause = "24ms"\norder = [0]', 2)
        rings(sim).arrange(1, [0], 0.5)
        sim.step()
        assert (rings(sim).firing.due >= 0.1).tolist() == [True, True]
        assert rings(sim).firing.due[1] == pytest.approx(0.5 + 2.0 / 343.0, abs=1e-6)
        assert rings(sim).firing.due[0] < 0.2

    def test_without_an_order_the_readings_stay(self, tmp_path: Path) -> None:
        sim = before_a_wall(tmp_path, 'pause = "1ms"', 2)
        run(sim, 10)
        before = sim.bodies.sonar_ranges()[0].copy()
        rings(sim).arrange(0, [], 0.0)
        sim.place(0, 5.0, 10.0, 0.0)
        run(sim, 100)
        assert (sim.bodies.sonar_ranges()[0] == before).all()
        rings(sim).arrange(0, [8], 0.03)  # goes on from now, and does not make up for what it has missed
        assert rings(sim).firing.due[0] == pytest.approx(sim.time - 0.1)
        sim.step()
        assert (np.flatnonzero(sim.bodies.sonar_ranges()[0] != before) == [8]).all()

    def test_the_pause_that_has_begun_comes_first(self, tmp_path: Path) -> None:
        sim = before_a_wall(tmp_path, 'pause = "0.5s"\norder = [0]', 1)
        sim.step()
        rings(sim).arrange(0, [8], 0.0)
        run(sim, 4)
        assert fired(sim, 0) == {0}
        run(sim, 1)
        assert fired(sim, 0) == {0, 8}

    def test_where_all_fire_at_once_others_still_do(self, tmp_path: Path) -> None:
        sim = before_a_wall(tmp_path, "", 2)
        run(sim, 30)
        rings(sim).arrange(1, [8, 0], 0.04)
        sim.step()
        first, second = sim.bodies.sonar_ranges()
        assert (~np.isnan(first)).all()
        assert set(np.flatnonzero(~np.isnan(second)).tolist()) == {0, 8}
        assert second[[0, 8]] == pytest.approx(first[[0, 8]], abs=1e-5)
        assert rings(sim).firing.due[1] > sim.time

    def test_arranging_what_is_already_so_changes_nothing(self, tmp_path: Path) -> None:
        for sonar in ('pause = "4ms"\nnoise = "2%"', 'pause = "4ms"\n[robots.sonar.crosstalk]\nchance = 1'):
            as_it_is, arranged = before_a_wall(tmp_path, sonar, 5), before_a_wall(tmp_path, sonar, 5)
            rings(arranged).arrange(2, range(16), 0.004)
            for _ in range(20):
                as_it_is.step()
                arranged.step()
                assert np.array_equal(as_it_is.bodies.sonar_ranges(), arranged.bodies.sonar_ranges(), equal_nan=True)

    def test_a_long_pause_cures_one_robot_of_cross_talk(self, tmp_path: Path) -> None:
        """Two robots side by side in one room, the second of which waits until no echo is left."""
        sonar = 'pause = "4ms"\nbeam = "25deg"\n[robots.sonar.crosstalk]\nrobots = false'
        sim = before_a_wall(tmp_path, sonar, 2)
        sim.place(1, 10.83, 25.0, 0.0)
        run(sim, 3)
        rings(sim).arrange(1, range(16), 0.04)
        wrong = np.zeros(2)
        for _ in range(60):
            sim.step()
            look = sim.bodies.machine.ranges(rings(sim)._view((sim.bodies.x, sim.bodies.y, sim.bodies.heading)), BOTH)
            wrong += (
                (np.clip(look, 6 * 0.0254, NOTHING) - rings(sim).readings > 0.5).sum(axis=1) if sim.tick > 20 else 0
            )
        assert wrong[0] > 50
        assert wrong[1] == 0

    @pytest.mark.parametrize(
        ("robot", "order", "pause", "said"),
        [
            (0, [16], 0.1, "sonars from 0 to 15"),
            (0, [-1], 0.1, "sonars from 0 to 15"),
            (0, [0] * 257, 0.1, "at most 256 sonars"),
            (0, [0], -0.001, "is 0 to 60 s"),
            (0, [0], float("nan"), "is 0 to 60 s"),
        ],
    )
    def test_a_mistake_is_told_and_changes_nothing(
        self, tmp_path: Path, robot: int, order: list[int], pause: float, said: str
    ) -> None:
        sim = before_a_wall(tmp_path, 'pause = "4ms"', 1)
        with pytest.raises(MisuseError, match=said):
            rings(sim).arrange(robot, order, pause)
        assert not rings(sim).firing.arranged

    def test_a_robot_that_there_is_not(self, tmp_path: Path) -> None:
        sim = before_a_wall(tmp_path, 'pause = "4ms"', 1)
        for robot in (-1, 1):
            with pytest.raises(IndexError):
                rings(sim).arrange(robot, [0], 0.1)


@pytest.mark.parametrize("sonar", ["", 'pause = "1ms"'])
def test_a_turret_turns_the_ring(tmp_path: Path, sonar: str) -> None:
    """A quarter to the left is four sonars; the heading stays."""
    plain, turned = before_a_wall(tmp_path, sonar, 3), before_a_wall(tmp_path, sonar, 3)
    rings(turned).turret = np.array([0.0, np.pi / 2, -np.pi / 2])
    run(plain, 10)
    run(turned, 10)
    straight, read = plain.bodies.sonar_ranges(), turned.bodies.sonar_ranges()
    for robot, sonars in enumerate((0, 4, -4)):
        assert read[robot] == pytest.approx(np.roll(straight[robot], -sonars), abs=1e-5)
    assert turned.bodies.heading.tolist() == [0.0, 0.0, 0.0]
