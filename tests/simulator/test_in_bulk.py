"""Many bodies at once: the table of what they sense, setpoints and pings in bulk mean what they mean for one body."""

from __future__ import annotations

from math import nan
from pathlib import Path

import numpy as np
import pytest

from machines import MACHINES
from sleepcast.core.errors import MisuseError
from sleepcast.robot import Setpoint
from sleepcast.simulator.engine import Machine
from small_worlds import scouts, simulator

NOISE = '\n[noise]\nx = "3m"\nheading = "5deg"\nbattery = "1%"\n'
MANY = ("count = 1\n", "count = 40\n")
SONARS = {"all at once": 'noise = "3%"', "in order": 'noise = "3%"\npause = "4ms"', "noisy": '\n[noise]\nx = "1cm"\n'}


class TestSensed:
    @pytest.mark.parametrize("more", SONARS.values(), ids=SONARS.keys())
    def test_a_column_is_what_a_body_senses(self, tmp_path: Path, more: str) -> None:
        sim = scouts(tmp_path, MANY, more=more)
        for _ in range(3):
            sim.step()
        sim.sense()
        table = sim.sensed.copy()
        assert table.shape == (len(sim.model.sensors), 40)
        assert sim.sensed.flags.c_contiguous
        other = scouts(tmp_path, MANY, more=more)
        for _ in range(3):
            other.step()
        values = [body.sense().values for body in other.robots]
        assert np.array_equal(table, np.array(values).T, equal_nan=True)
        other.sense()
        assert np.array_equal(table, other.sensed, equal_nan=True)
        assert np.array_equal(table.T, np.array(sim.readings()), equal_nan=True)

    def test_only_who_looks_measures(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path, more=NOISE)
        assert np.isnan(sim.sensed).all()
        sim.sense(np.array([3, 5]))
        measured = ~np.isnan(sim.sensed).any(axis=0)
        assert np.flatnonzero(measured).tolist() == [3, 5]
        assert 0.0 < abs(sim.sensed[0, 3] - sim.x[3]) < 20.0
        assert (sim.sensed[1, [3, 5]] == sim.y[[3, 5]]).all()

    def test_sonars_may_be_left_alone(self, tmp_path: Path) -> None:
        sim = scouts(tmp_path, MANY, more='\n[noise]\nx = "1cm"\n')
        names = [sensor.name for sensor in sim.model.sensors]
        first = names.index("sonar0")
        sim.sense(sonars=False)
        assert np.isnan(sim.sensed[first:]).all()
        assert not np.isnan(sim.sensed[:first]).any()
        sim.sense(np.array([7]))
        assert np.flatnonzero(~np.isnan(sim.sensed[first:]).any(axis=0)).tolist() == [7]
        front = [names.index(f"sonar{i}") for i in (12, 13, 14, 15, 0, 1, 2, 3, 4)]
        assert sim.sensed[names.index("front_range"), 7] == sim.sensed[front, 7].min()
        heard = sim.sensed[first:, 7].copy()
        sim.step()
        sim.sense(sonars=False)
        assert (sim.sensed[first:, 7] == heard).all()

    @pytest.mark.parametrize("machine", MACHINES)
    @pytest.mark.parametrize("more", SONARS.values(), ids=SONARS.keys())
    @pytest.mark.parametrize("sonars", [(0, 16), (3, 12), (8,), (16,)], ids=str)
    def test_only_the_sonars_that_are_asked_for_measure(
        self, tmp_path: Path, machine: Machine, more: str, sonars: tuple[int, ...]
    ) -> None:
        """What they read is what they would read if all were asked for, also later in the same tick."""
        sim, whole = (scouts(tmp_path, MANY, more=more, machine=machine) for _ in range(2))
        first = sim.sonar_rows.start
        asked = [first + sonar for sonar in sonars]
        others = [row for row in sim.sonar_rows if row not in asked]
        for _ in range(2):
            for some in (sim, whole):
                some.act("drive_speed", slice(None), np.full(40, 0.5))
                some.step()
            before = sim.sensed[others].copy()
            whole.sense()
            sim.sense(sonars=asked)
            assert np.array_equal(sim.sensed[asked], whole.sensed[asked], equal_nan=True)
            assert np.array_equal(sim.sensed[others], before, equal_nan=True)
        sim.sense(np.array([4, 5]))
        assert np.array_equal(sim.sensed[:, 4:6], whole.sensed[:, 4:6], equal_nan=True)
        sim.sense(sonars=[first + 5])
        assert np.array_equal(sim.sensed[first + 5], whole.sensed[first + 5], equal_nan=True)

    @pytest.mark.parametrize("machine", MACHINES)
    def test_bodies_touch_alike_whoever_has_looked_around(self, tmp_path: Path, machine: Machine) -> None:
        seeing, half, blind = (scouts(tmp_path, MANY, machine=machine) for _ in range(3))
        touched = 0
        for tick in range(60):
            for sim in (seeing, half, blind):
                sim.act("drive_speed", slice(None), np.full(40, 0.5))
                sim.act("drive_turn", slice(None), np.linspace(-0.5, 0.5, 40))
                sim.step()
            seeing.sense()
            half.sense(np.arange(0, 40, 2), sonars=[seeing.sonar_rows.start] if tick % 3 else True)
            touched += int((blind.bodies.hit_x != 0.0).sum())
        assert touched > 100
        assert seeing.state_hash() == half.state_hash() == blind.state_hash()

    @pytest.mark.parametrize("more", SONARS.values(), ids=SONARS.keys())
    def test_looking_changes_no_state(self, tmp_path: Path, more: str) -> None:
        watched, alone, glanced = (scouts(tmp_path, MANY, more=more) for _ in range(3))
        for tick in range(5):
            for sim in (watched, alone, glanced):
                sim.act("drive_speed", slice(None), np.full(40, 0.5))
                sim.step()
            watched.sense()
            glanced.sense(np.array([tick]), sonars=bool(tick % 2))
            assert watched.state_hash() == alone.state_hash() == glanced.state_hash()


class TestAct:
    @pytest.mark.parametrize(("actuator", "field"), [("drive_speed", "speed"), ("drive_turn", "turn_rate")])
    def test_it_is_what_each_body_would_do(self, tmp_path: Path, actuator: str, field: str) -> None:
        one, bulk = simulator(tmp_path), simulator(tmp_path)
        for sim in (one, bulk):
            sim.robots[2].stop()
            sim.robots[3].wander()
            sim.robots[4].go_to(1.0, 1.0)
            sim.robots[5].drive(1.0, 0.5)
        values = np.linspace(-9.0, 9.0, 20)
        values[5] = values[3] = nan
        for body, value in zip(one.robots, values.tolist(), strict=True):
            body.act(Setpoint(**{field: value}))
        bulk.act(actuator, slice(None), values)
        assert one.state_hash() == bulk.state_hash()
        one.robots[7].act(Setpoint(**{field: 0.25}))
        one.robots[1].act(Setpoint())
        bulk.act(actuator, np.array([7, 1]), np.array([0.25, nan]))
        for _ in range(5):
            one.step()
            bulk.step()
        assert one.state_hash() == bulk.state_hash()

    def test_others_are_left_alone(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path)
        before = sim.bodies.mode.copy()
        sim.robots[0].wander()
        sim.act("drive_turn", np.array([9, 4]), np.array([0.5, -0.5]))
        assert sim.bodies.wanted_turn[[4, 9]].tolist() == [-0.5, 0.5]
        assert np.count_nonzero(sim.bodies.wanted_turn) == 2
        assert sim.bodies.mode[0] == 0
        assert (sim.bodies.mode[1:] == before[1:]).all()

    def test_an_unknown_actuator(self, tmp_path: Path) -> None:
        with pytest.raises(MisuseError, match=r'no actuator "drive_sped" \(did you mean drive_speed\?\)'):
            simulator(tmp_path).act("drive_sped", slice(None), np.zeros(20))


def test_pings_in_bulk_are_heard_as_one_by_one(tmp_path: Path) -> None:
    pings = '\n[pings]\nreach = "1km"\nloss = 0.3\n'
    one, bulk = simulator(tmp_path, more=pings), simulator(tmp_path, more=pings)
    draw = np.random.default_rng(3)
    for _ in range(30):
        robots, castes = draw.integers(0, 20, 8), draw.uniform(0.0, 5.0, 8)
        for number, caste in zip(robots.tolist(), castes.tolist(), strict=True):
            one.ping(number, caste)
        bulk.pings(robots[:5], castes[:5])
        bulk.pings(robots[5:], castes[5:])
        assert one.state_hash() == bulk.state_hash()
        one.step()
        bulk.step()
    assert one.state_hash() == bulk.state_hash()
    assert simulator(tmp_path, more=pings).state_hash() != one.state_hash()
