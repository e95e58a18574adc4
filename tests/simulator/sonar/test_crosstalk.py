"""Cross-talk: late echoes and other robots' pings shorten readings as computed by hand, a long pause cures."""

from __future__ import annotations

import tracemalloc
from math import pi
from pathlib import Path

import numpy as np
import pytest

from simulator.test_sorts import mixed
from sleepcast.simulator import SettingsError, Simulator, choose, load
from sleepcast.simulator.engine import Machine
from sleepcast.simulator.scenario.robot_settings import CrosstalkModel, Ring
from sleepcast.simulator.sonar.crosstalk import SOUND, Crosstalk
from sleepcast.simulator.world.grid import grid_over
from small_worlds import SCOUTS, scouts, write

INCH = 0.0254
MOST = 255 * INCH
AXES = np.arange(16) * (2 * pi / 16)
PAUSE = 0.004


def ring(pause: float = PAUSE) -> Ring:
    return Ring(16, 0.4, 6 * INCH, MOST, 0.0, 0.0, pi / 2, pause, tuple(range(16)))


def crosstalk(chance: float = 1.0, spread: float = 0.5, robots: bool = False, pause: float = PAUSE) -> Crosstalk:
    return Crosstalk(
        CrosstalkModel(chance, spread, robots), ring(pause), AXES, 0.17, 4, grid_over(20.0, 20.0, 4.0, 4), 7
    )


def reads(talk: Crosstalk, sonar: int, sent: float, own: float, robot: int = 0) -> float:
    """What one sonar of one robot reads."""
    found = talk.hear(0, np.array([robot]), np.array([sonar]), np.array([sent]), np.array([own], np.float32))
    return float(found[0])


class TestOneRing:
    def test_the_first_ping_is_undisturbed(self) -> None:
        assert reads(crosstalk(), 0, 0.0, 3.0) == 3.0

    def test_the_echo_of_something_farther_comes_late(self) -> None:
        """Sonar 0 sees something at 70 cm; sonar 1 pings when that echo is back and the pause over, and sees something
        at 4 m. The echo of the first ping from there has been on its way for all that time: what it needs yet is taken
        for the whole."""
        talk = crosstalk()
        reads(talk, 0, 0.0, 0.7)
        sent = 1.4 / SOUND + PAUSE
        assert reads(talk, 1, sent, 4.0) == pytest.approx(4.0 - 0.7 - SOUND * PAUSE / 2, abs=1e-6)

    def test_an_echo_thrown_back_once_more_comes_late(self) -> None:
        """As above, but sonar 1 sees nothing: what it hears is the echo of sonar 0 after twice its way."""
        talk = crosstalk()
        assert reads(talk, 0, 0.0, 2.0) == 2.0
        sent = 4.0 / SOUND + PAUSE
        assert reads(talk, 1, sent, MOST) == pytest.approx(2.0 - SOUND * PAUSE / 2, abs=1e-6)

    def test_what_comes_within_the_blanking_is_not_heard(self) -> None:
        talk = crosstalk()
        reads(talk, 0, 0.0, 2.0)
        sent = 4.0 / SOUND + 2.0 * (2.0 - 5 * INCH) / SOUND  # five inches of the second echo's way are left
        assert reads(talk, 1, sent, MOST) == pytest.approx(MOST)
        assert reads(talk, 15, sent - 2.0 * INCH * 2 / SOUND, MOST) < MOST  # with seven it is heard

    def test_an_own_nearer_echo_comes_first(self) -> None:
        talk = crosstalk()
        reads(talk, 0, 0.0, 2.0)
        assert reads(talk, 1, 4.0 / SOUND + PAUSE, 1.0) == 1.0

    def test_sonars_that_look_elsewhere_hear_nothing(self) -> None:
        talk = crosstalk(spread=0.5)  # neighbours are 0.39 rad apart
        reads(talk, 0, 0.0, 1.0)
        assert reads(talk, 2, 2.0 / SOUND + PAUSE, 4.0) == 4.0
        assert reads(talk, 15, 2.0 / SOUND + 2 * PAUSE, 4.0) < 4.0  # the other neighbour, across the turn

    def test_robots_have_rings_of_their_own(self) -> None:
        talk = crosstalk()
        reads(talk, 0, 0.0, 1.0, robot=0)
        assert reads(talk, 1, 2.0 / SOUND + PAUSE, 4.0, robot=1) == 4.0

    def test_chance_decides_whether_it_is_loud_enough(self) -> None:
        talk, robots, short = crosstalk(chance=0.3), np.arange(4), 0
        for tick in range(400):
            talk.hear(tick, robots, robots * 0, np.full(4, 10.0 * tick), np.full(4, 0.7, np.float32))
            late = np.full(4, 10.0 * tick + 1.4 / SOUND + PAUSE)
            short += int((talk.hear(tick, robots, robots * 0 + 1, late, np.full(4, 4.0, np.float32)) < 4.0).sum())
            talk.end()
        assert short / 1600 == pytest.approx(0.3, abs=0.04)


FIRING = '[robots.sonar]\npause = "%s"\n\n[robots.sonar.crosstalk]\nchance = "%s"\n'
ROOM = """
[[world.walls]]
points = [["3m", "0m"], ["4m", "5m"], ["2m", "9m"]]

[[world.circles]]
center = ["8m", "7m"]
radius = "60cm"
"""


def in_order(folder: Path, pause: str, chance: str, machine: Machine | None = None, count: int = 1) -> Simulator:
    table = FIRING % (pause, chance) if chance else f'[robots.sonar]\npause = "{pause}"\n'
    changes = (
        ("[robots.sonar]\n", table),
        ("count = 1\n", f"count = {count}\n"),
        ('motion = "still"', 'motion = "wander"'),
    )
    return scouts(folder, *changes, more=ROOM, machine=machine)


def shortest(simulator: Simulator, seconds: float = 30.0) -> tuple[float, float]:
    """How short readings are against those of a ring that fires at once: the share of those less than half as long and
    more than 20 in too short, and the greatest shortfall, m."""
    wrong, total, worst = 0, 0, 0.0
    for _ in range(round(seconds / 0.1)):
        simulator.step()
        bodies = simulator.bodies
        assert bodies.sonars
        view = bodies.sonars._view((bodies.x, bodies.y, bodies.heading))
        look = bodies.machine.ranges(view, np.arange(bodies.count))
        look = np.clip(look, bodies.sonars.ring.least, bodies.sonars.ring.most)
        short = look.astype(float) - bodies.sonars.readings
        wrong += int(((short > 20 * INCH) & (bodies.sonars.readings < look / 2)).sum())
        total += int(np.isfinite(short).sum())
        worst = max(worst, float(np.nanmax(short)))
    return wrong / total, worst


class TestTheThesis:
    """A pause of 4 ms gave readings that were far too short, 24 ms cured it."""

    def test_a_short_pause_gives_readings_far_too_short_and_a_longer_one_cures_it(self, tmp_path: Path) -> None:
        without, _ = shortest(in_order(tmp_path, "4ms", ""))
        quick, worst = shortest(in_order(tmp_path, "4ms", "100%"))
        slow, _ = shortest(in_order(tmp_path, "24ms", "100%"))
        assert without < 0.01  # what the body's own motion makes of old readings
        assert quick > 0.05
        assert worst > 1.0
        assert slow < 0.2 * quick

    def test_a_pause_as_long_as_the_longest_echo_leaves_none(self, tmp_path: Path) -> None:
        cured, alone = in_order(tmp_path, "38ms", "100%"), in_order(tmp_path, "38ms", "")
        assert 2.0 * MOST / SOUND < 0.038
        for _ in range(200):
            cured.step()
            alone.step()
            assert np.array_equal(cured.readings(), alone.readings(), equal_nan=True)


def facing(folder: Path, *more: str, gap: float = 2.0) -> Simulator:
    """Two scouts face to face, `gap` m from rim to rim, each with one sonar."""
    table = '[robots.sonar]\ncount = 1\npause = "50ms"\n[robots.sonar.crosstalk]\n' + "\n".join(more) + "\n"
    simulator = scouts(folder, ("count = 1\n", "count = 2\n"), ("[robots.sonar]\n", table))
    simulator.place(0, 4.0, 6.0, 0.0)
    simulator.place(1, 4.0 + gap + 0.34, 6.0, pi)
    return simulator


class TestTwoRobots:
    def test_who_pings_at_the_same_moment_reads_half_the_way(self, tmp_path: Path) -> None:
        simulator = facing(tmp_path)
        simulator.step()
        assert [row[-1] for row in simulator.readings()] == pytest.approx([1.0, 1.0], abs=1e-5)

    def test_without_hearing_each_other_they_read_all_of_it(self, tmp_path: Path) -> None:
        simulator = facing(tmp_path, "robots = false")
        simulator.step()
        assert [row[-1] for row in simulator.readings()] == pytest.approx([2.0, 2.0], abs=1e-5)

    def test_a_ping_sent_a_little_later_comes_later(self, tmp_path: Path) -> None:
        simulator = facing(tmp_path)
        assert simulator.bodies.sonars
        simulator.bodies.sonars.firing.due[1] = 0.002
        simulator.step()
        first, second = (row[-1] for row in simulator.readings())
        assert first == pytest.approx((2.0 + SOUND * 0.002) / 2, abs=1e-5)
        assert second == pytest.approx((2.0 - SOUND * 0.002) / 2, abs=1e-5)

    def test_who_looks_away_neither_sends_nor_hears(self, tmp_path: Path) -> None:
        simulator = facing(tmp_path)
        simulator.place(1, 6.34, 6.0, 0.0)
        simulator.step()
        assert simulator.readings()[0][-1] == pytest.approx(2.0, abs=1e-5)

    def test_a_wall_between_them_stops_it(self, tmp_path: Path) -> None:
        from sleepcast.simulator import Wall

        simulator = facing(tmp_path)
        simulator.world.add(Wall(((5.5, 5.0), (5.5, 7.0))))
        simulator.step()
        assert [row[-1] for row in simulator.readings()] == pytest.approx([1.33, 0.67], abs=1e-5)

    def test_many_pings_in_a_tick_do_not_fill_the_memory(self, tmp_path: Path) -> None:
        """Some millions of pairs of pings, of which some are looked at in one go."""
        quick = 'pause = "0s"\nleast = 0\n[robots.sonar.crosstalk]\nchance = 0.5'
        changes = ("count = 1\n", "count = 16\n"), ('"12m"\nheight = "12m"', '"2m"\nheight = "2m"'), ("0.1s", "0.6s")
        simulator = scouts(tmp_path, *changes, more=quick, machine=choose("numpy"))
        tracemalloc.start()
        simulator.step()
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert peak < 100e6

    def test_how_many_pairs_are_looked_at_in_one_go_does_not_matter(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        hashes = set()
        for most in (1 << 20, 50):
            monkeypatch.setattr("sleepcast.simulator.sonar.crosstalk.MAX_PAIRS", most)
            simulator = in_order(tmp_path, "1ms", "60%", count=12)
            for _ in range(10):
                simulator.step()
            hashes.add(simulator.state_hash())
        assert len(hashes) == 1

    def test_a_ping_of_the_tick_before_is_heard(self, tmp_path: Path) -> None:
        simulator = facing(tmp_path)
        assert simulator.bodies.sonars
        due = simulator.bodies.sonars.firing.due
        due[:] = 0.098, 0.101  # just before the end of the first tick, and just after it
        simulator.step()
        simulator.step()
        assert simulator.readings()[1][-1] == pytest.approx((2.0 - SOUND * 0.003) / 2, abs=1e-5)


BOTH_SORTS = """
[[robots]]
like = "scout"
count = 1
motion = "still"

[robots.sonar]
count = 1
pause = "50ms"
[robots.sonar.crosstalk]

[[robots]]
like = "nomad200"
type = "nomad"
count = 1
motion = "still"

[robots.sonar]
count = 2
pause = "50ms"
order = [0]
[robots.sonar.crosstalk]
"""


class TestTwoSorts:
    """A Scout and a Nomad 200, 2 m from rim to rim, each with its sonar towards the other."""

    @staticmethod
    def facing(folder: Path, robots: str = BOTH_SORTS) -> Simulator:
        simulator = mixed(folder, robots)
        simulator.place(0, 4.0, 6.0, 0.0)
        simulator.place(1, 4.0 + 2.0 + 0.17 + 0.225, 6.0, pi)
        return simulator

    @staticmethod
    def reads(simulator: Simulator) -> list[float]:
        simulator.step()
        return [float(ring.readings[0, 0]) for ring in simulator.bodies.rings]

    def test_who_pings_at_the_same_moment_reads_half_the_way(self, tmp_path: Path) -> None:
        assert self.reads(self.facing(tmp_path)) == pytest.approx([1.0, 1.0], abs=1e-5)

    def test_who_pings_later_is_heard_later(self, tmp_path: Path) -> None:
        simulator = self.facing(tmp_path)
        simulator.bodies.rings[1].firing.due[0] = 0.002
        late = SOUND * 0.002
        assert self.reads(simulator) == pytest.approx([(2.0 + late) / 2, (2.0 - late) / 2], abs=1e-5)

    def test_a_ping_of_the_tick_before_is_heard_though_its_sender_is_silent_now(self, tmp_path: Path) -> None:
        simulator = self.facing(tmp_path)
        for robot, (ring, due) in enumerate(zip(simulator.bodies.rings, (0.098, 0.101), strict=True)):
            ring.arrange(robot, [0], 0.3)
            ring.firing.due[:] = due
        simulator.step()
        assert self.reads(simulator)[1] == pytest.approx((2.0 - SOUND * 0.003) / 2, abs=1e-5)

    def test_a_turret_that_looks_away_neither_sends_nor_hears(self, tmp_path: Path) -> None:
        simulator = self.facing(tmp_path)
        simulator.bodies.rings[1].turret = np.array([pi / 2])
        assert self.reads(simulator)[0] == pytest.approx(2.0, abs=1e-5)

    def test_a_sort_without_cross_talk_neither_sends_nor_hears(self, tmp_path: Path) -> None:
        quiet = BOTH_SORTS.removesuffix("[robots.sonar.crosstalk]\n")
        assert self.reads(self.facing(tmp_path, quiet)) == pytest.approx([2.0, 2.0], abs=1e-5)


class TestRepeating:
    @pytest.mark.parametrize("machine", ["numpy", "numba"])
    def test_threads_change_nothing_and_the_seed_changes_all(self, tmp_path: Path, machine: str) -> None:
        def state(threads: int | None, chance: str = "50%") -> str:
            simulator = in_order(tmp_path, "4ms", chance, choose(machine, threads), count=30)
            for _ in range(30):
                simulator.step()
            return simulator.state_hash()

        assert state(1) == state(2 if machine == "numba" else None)
        assert state(1) != state(1, "60%")

    def test_it_is_off_unless_it_is_asked_for(self, tmp_path: Path) -> None:
        simulator = in_order(tmp_path, "4ms", "")
        assert simulator.bodies.sonars
        assert simulator.bodies.sonars.crosstalk is None

    @pytest.mark.parametrize(
        ("table", "said"),
        [
            ("[robots.sonar]\n[robots.sonar.crosstalk]\n", "robots.sonar.crosstalk: needs sonars that fire one after"),
            (FIRING % ("4ms", "130%"), "robots.sonar.crosstalk.chance: wanted"),
            (
                FIRING % ("4ms", "10%") + "sprad = 1\n",
                "robots.sonar.crosstalk.sprad: unknown key (did you mean spread?)",
            ),
        ],
    )
    def test_a_mistake_is_told_with_its_place(self, tmp_path: Path, table: str, said: str) -> None:
        with pytest.raises(SettingsError) as caught:
            load(write(tmp_path, ("[robots.sonar]\n", table), text=SCOUTS))
        assert said in str(caught.value)
