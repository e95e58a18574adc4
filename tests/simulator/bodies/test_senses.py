"""Lights are seen and pings heard: from how far, from which side, one at a time, and by chance of the seed alone."""

from __future__ import annotations

import subprocess
import sys
from collections import Counter
from math import isclose, isnan, radians
from pathlib import Path

import numpy as np
import pytest

from sleepcast.core.counter_rng import key, uniform
from sleepcast.simulator import Simulator, load
from sleepcast.simulator.scenario.signals import FRONT, LIGHT_NAMES, PING_NAMES, REAR
from small_worlds import simulator, write

PINGS = '\n[pings]\nreach = "100m"\n'
LAMP = '\n[lights.lamp]\nx = "600m"\ny = "500m"\nreach = "200m"\n'


def put(sim: Simulator, number: int, x: float, y: float, heading: float = 0.0) -> None:
    sim.bodies.x[number], sim.bodies.y[number], sim.bodies.heading[number] = x, y, heading


def sensed(sim: Simulator, number: int, names: tuple[str, ...]) -> tuple[float, ...]:
    """What a robot senses under these names."""
    found = {sensor.name: value for sensor, value in zip(sim.model.sensors, sim.readings([number])[0], strict=True)}
    return tuple(found[name] for name in names)


def heard(sim: Simulator, number: int) -> tuple[float, ...]:
    return sensed(sim, number, PING_NAMES)


def crowd(folder: Path, *changes: tuple[str, str], more: str = PINGS, seed: int | None = None) -> Simulator:
    """Twenty robots at one place but for robot 0, which stands 30 m to the east of them."""
    sim = simulator(folder, *changes, more=more, seed=seed)
    sim.bodies.x[:], sim.bodies.y[:], sim.bodies.heading[:] = 500.0, 500.0, 0.0
    put(sim, 0, 530.0, 500.0)
    return sim


def casts(sim: Simulator, number: int, ticks: int) -> list[float]:
    """The castes that a robot is presented in so many ticks."""
    found = []
    for _ in range(ticks):
        sim.step()
        flag, _, _, caste = heard(sim, number)
        if flag:
            found.append(caste)
    return found


class TestPings:
    def ping_world(self, folder: Path) -> Simulator:
        sim = simulator(folder, more=PINGS)
        sim.bodies.x[:], sim.bodies.y[:] = 1.0, 1.0
        put(sim, 0, 500.0, 500.0)
        put(sim, 1, 560.0, 500.0, radians(100))
        put(sim, 2, 460.0, 500.0, radians(80))
        put(sim, 3, 500.0, 650.0)
        return sim

    def test_those_in_reach_hear_range_side_and_caste_for_one_tick(self, tmp_path: Path) -> None:
        sim = self.ping_world(tmp_path)
        assert heard(sim, 1)[0] == 0.0
        assert all(isnan(value) for value in heard(sim, 1)[1:])
        sim.ping(0, 3.0)
        sim.step()
        assert heard(sim, 1) == (1.0, 60.0, FRONT, 3.0)
        assert heard(sim, 2) == (1.0, 40.0, FRONT, 3.0)
        assert [heard(sim, number)[0] for number in (0, 3, 4)] == [0.0, 0.0, 0.0]
        sim.step()
        assert heard(sim, 1) == (0.0, 60.0, FRONT, 3.0)

    @pytest.mark.parametrize(("degrees", "side"), [(0, REAR), (91, FRONT), (180, FRONT), (269, FRONT), (271, REAR)])
    def test_the_side_changes_at_a_right_angle(self, tmp_path: Path, degrees: float, side: float) -> None:
        sim = self.ping_world(tmp_path)
        put(sim, 1, 560.0, 500.0, radians(degrees))
        sim.ping(0, 3.0)
        sim.step()
        assert heard(sim, 1)[2] == side

    def test_pings_of_one_tick_are_presented_one_after_the_other(self, tmp_path: Path) -> None:
        sim = crowd(tmp_path)
        for number in (3, 1, 2):
            sim.ping(number, float(number))
        assert sorted(casts(sim, 0, 3)) == [1.0, 2.0, 3.0]
        assert casts(sim, 0, 2) == []

    def test_a_full_queue_lets_the_oldest_go(self, tmp_path: Path) -> None:
        sim = crowd(tmp_path, more=f"{PINGS}queue = 2\n")
        for number in (1, 2, 3):
            sim.ping(number, 1.0)
        assert casts(sim, 0, 1) == [1.0]
        for number in (1, 2, 3):
            sim.ping(number, 2.0)
        assert casts(sim, 0, 4) == [2.0, 2.0]

    def test_what_waits_has_the_range_of_when_it_came(self, tmp_path: Path) -> None:
        sim = crowd(tmp_path)
        for number in (1, 2):
            sim.ping(number, 1.0)
        sim.step()
        put(sim, 0, 580.0, 500.0, radians(180))
        sim.step()
        assert heard(sim, 0) == (1.0, 30.0, REAR, 1.0)

    def test_a_body_pings_once_in_a_tick(self, tmp_path: Path) -> None:
        sim = crowd(tmp_path)
        sim.ping(1, 7.0)
        sim.ping(1, 8.0)
        assert casts(sim, 0, 3) == [7.0]

    def test_who_comes_first_is_chance_and_not_his_number(self, tmp_path: Path) -> None:
        sim = crowd(tmp_path, more=f"{PINGS}queue = 1\n")
        first: Counter[float] = Counter()
        for _ in range(600):
            for number in (1, 10, 19):
                sim.ping(number, float(number))
            first.update(casts(sim, 0, 1))
        assert sorted(first) == [1.0, 10.0, 19.0]
        # 200 each, with a standard deviation of 11.5
        assert all(150 < count < 250 for count in first.values())

    def test_two_hearers_draw_their_own_order(self, tmp_path: Path) -> None:
        sim = crowd(tmp_path, more=f"{PINGS}queue = 1\n")
        same = 0
        for _ in range(200):
            for number in (2, 3):
                sim.ping(number, float(number))
            sim.step()
            same += heard(sim, 0)[3] == heard(sim, 1)[3]
        assert 70 < same < 130

    def test_the_order_in_which_robots_are_asked_changes_nothing(self, tmp_path: Path) -> None:
        hashes = []
        for order in (range(20), reversed(range(20))):
            sim = crowd(tmp_path)
            for number in order:
                sim.ping(number, float(number))
            sim.step()
            hashes.append(sim.state_hash())
        assert hashes[0] == hashes[1]

    def test_one_in_four_is_lost(self, tmp_path: Path) -> None:
        sim = crowd(tmp_path, ("count = 20", "count = 2001"), more=f'{PINGS}loss = "25%"\n')
        sim.ping(0, 1.0)
        sim.step()
        heard_by = float(np.mean(sim.bodies.sensed[-4, 1:]))
        assert isclose(heard_by, 0.75, abs_tol=0.05)

    def test_many_at_once_are_heard_as_one_by_one(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        """Looked at in blocks, hearers hear what they would hear all together."""
        hashes = []
        for pairs in (1 << 20, 7):
            monkeypatch.setattr("sleepcast.simulator.bodies.senses.MAX_PAIRS", pairs)
            sim = crowd(tmp_path)
            for number in range(20):
                sim.ping(number, float(number))
            sim.step()
            hashes.append(sim.state_hash())
        assert hashes[0] == hashes[1]

    def test_what_waits_is_part_of_the_state(self, tmp_path: Path) -> None:
        seen = set()
        for castes in ((), (1.0,), (2.0,)):
            sim = crowd(tmp_path)
            for caste in castes:
                sim.ping(1, caste)
            seen.add(sim.state_hash())
        assert len(seen) == 3
        waiting = set()
        for first, second in ((1.0, 2.0), (1.0, 3.0)):
            sim = crowd(tmp_path, more=f"{PINGS}queue = 9\n")
            sim.ping(1, first)
            sim.step()
            sim.ping(1, second)
            sim.ping(2, second)
            sim.step()
            waiting.add(sim.state_hash())
        assert len(waiting) == 2

    def test_without_pings_there_are_no_such_names(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path)
        assert not {sensor.name for sensor in sim.model.sensors} & {*PING_NAMES, *LIGHT_NAMES}
        assert sim.model.constants == ()
        before = sim.state_hash()
        sim.ping(0, 1.0)
        assert sim.state_hash() == before


class TestLights:
    def test_the_light_is_seen_from_the_start_with_range_and_side(self, tmp_path: Path) -> None:
        sim = simulator(tmp_path, more=LAMP)
        put(sim, 0, 540.0, 420.0)
        put(sim, 1, 500.0, 500.0, radians(95))
        put(sim, 2, 300.0, 500.0)
        sim.step()
        assert sensed(sim, 0, LIGHT_NAMES) == (1.0, 100.0, FRONT)
        assert sensed(sim, 1, LIGHT_NAMES) == (1.0, 100.0, REAR)
        flag, *rest = sensed(sim, 2, LIGHT_NAMES)
        assert flag == 0.0
        assert all(map(isnan, rest))

    def test_of_two_lights_the_nearer_is_seen(self, tmp_path: Path) -> None:
        more = f'{LAMP}\n[lights.other]\nx = "520m"\ny = "500m"\n'
        sim = simulator(tmp_path, more=more)
        put(sim, 0, 540.0, 500.0)
        put(sim, 1, 580.0, 500.0)
        put(sim, 2, 100.0, 500.0)
        sim.step()
        assert [sensed(sim, number, LIGHT_NAMES)[1] for number in (0, 1, 2)] == [20.0, 20.0, 420.0]
        assert [sensed(sim, number, LIGHT_NAMES)[2] for number in (0, 1, 2)] == [REAR, FRONT, FRONT]

    def test_who_has_no_eye_knows_nothing_of_lights(self, tmp_path: Path) -> None:
        groups = "\n[robots.groups.eyes]\ncount = 5\n[robots.groups.body]\ncount = 15\nsees_light = false\n"
        sim = simulator(tmp_path, more=LAMP + groups)
        sim.bodies.x[:], sim.bodies.y[:] = 550.0, 500.0
        sim.step()
        assert [sensed(sim, number, LIGHT_NAMES)[0] for number in (0, 4)] == [1.0, 1.0]
        assert all(map(isnan, sensed(sim, 5, LIGHT_NAMES)))


RUN = """
import sys
from pathlib import Path
from sleepcast.core.counter_rng import key, uniform
from sleepcast.simulator import Simulator, load
sim = Simulator(load(Path(sys.argv[1])), int(sys.argv[2]))
for tick in range(50):
    for number in range(tick % 3, 20, 3):
        sim.ping(number, float(tick))
    sim.step()
print(sim.state_hash())
"""


def test_processes_agree_on_what_is_heard(tmp_path: Path) -> None:
    file = write(
        tmp_path, ('motion = "still"', 'motion = "wander"'), more=f'{LAMP}\n[pings]\nreach = "1km"\nloss = 0.3\n'
    )

    def in_a_process(seed: int) -> str:
        command = [sys.executable, "-c", RUN, str(file), str(seed)]
        return subprocess.run(command, capture_output=True, text=True, check=True).stdout.strip()

    sim = Simulator(load(file), 5)
    for tick in range(50):
        for number in reversed(range(tick % 3, 20, 3)):
            sim.ping(number, float(tick))
        sim.step()
    assert in_a_process(5) == sim.state_hash() != in_a_process(6)


def test_everybody_hears_just_those_in_reach_in_the_order_that_chance_draws(tmp_path: Path) -> None:
    """Against a slow reference that tries every sender with every hearer."""
    more = '\n[pings]\nreach = "120m"\nloss = 0.3\nqueue = 64\n'
    sim = simulator(tmp_path, ("count = 20", "count = 150"), more=more)
    senders = list(range(0, 150, 2))
    sim.pings(np.array(senders), np.array(senders, float))
    sim.step()
    lost, order = (key(sim.seed, f"ping {what}", sim.tick) for what in ("lost", "order"))
    expected: dict[int, list[float]] = {}
    for hearer in range(150):
        near = [
            i for i in senders if i != hearer and np.hypot(sim.x[i] - sim.x[hearer], sim.y[i] - sim.y[hearer]) <= 120
        ]
        pairs = [np.array([(i << 32) + hearer], np.uint64) for i in near]
        drawn = [(float(uniform(order, pair)[0]), i) for i, pair in zip(near, pairs, strict=True)]
        kept = [each for each, pair in zip(drawn, pairs, strict=True) if uniform(lost, pair)[0] >= 0.3]
        expected[hearer] = [float(i) for _, i in sorted(kept)]
    assert max(map(len, expected.values())) > 3
    for number in range(6):
        for hearer, castes in expected.items():
            flag, _, _, caste = heard(sim, hearer)
            assert flag == float(number < len(castes))
            assert not flag or caste == castes[number]
        sim.step()
