"""`radio.wall`: what walls between robots, and between them and their operator, leave of the radio's reach."""

from __future__ import annotations

from math import inf
from pathlib import Path

import numpy as np
import pytest

import sleepcast as sc
from channel_contract import message
from machines import MACHINES
from simulator.world.sight_reference import count, exactly
from sleepcast.channel import Kind
from sleepcast.channel.message_batch import AnswerColumns, MessageBatch
from sleepcast.channel.simulated_radio import OPERATOR
from sleepcast.core.settings import SettingsError
from sleepcast.loop import Swarm
from sleepcast.simulator import Simulator, load
from sleepcast.simulator.engine import Machine
from sleepcast.simulator.world.sight import joined
from small_worlds import SMALL, write

SIDE = 20.0
TEXT = SMALL.replace("format = 1", "format = 2").replace('"1km"', '"20m"').replace('"500m"', '"5m"')
TEXT = TEXT.replace('y = "400m"', 'y = "4m"').replace('radius = "0.5m"', 'radius = "0.25m"')
TEXT = TEXT.replace('sonars = 16\nsonar_range = "100m"', "").replace('speed = "5m/s"', 'speed = "1m/s"')
TORUS = ('height = "20m"', 'height = "20m"\nedge = "torus"')
WALL = '\n[[world.walls]]\nname = "wall"\npoints = [["10m", "4m"], ["10m", "12m"]]\n'
ROOMS = '\n[world.rooms]\nsize = "5m"\ndoor = "1.5m"\n'
MORE = """
[[world.circles]]
center = ["7.5m", "13m"]
radius = "0.4m"

[[world.walls]]
points = [["1m", "18m"], ["6m", "13m"], ["8m", "19m"]]
"""
SEATED = 'operator = ["8m", "10m"]\noperator_reach = "5m"\n'


def swarm(folder: Path, radio: str, more: str, *changes: tuple[str, str], machine: Machine | None = None) -> Swarm:
    """A swarm with these lines in its table [radio]."""
    file = write(folder, ('delay = "0s"', f'delay = "0s"\n{radio}'), *changes, more=more, text=TEXT)
    return Swarm(Simulator(load(file), machine=machine))


def beside_a_wall(folder: Path, radio: str, *changes: tuple[str, str], more: str = "") -> Swarm:
    """Robots 0 and 1 stand on both sides of where `WALL` is, robot 2 beyond its end, the others in a corner."""
    made = swarm(folder, radio, WALL + more, *changes)
    bodies = made.simulator.bodies
    bodies.x[:], bodies.y[:] = 19.0, 1.0
    bodies.x[:3], bodies.y[:3] = (8.0, 12.0, 10.0), (10.0, 10.0, 13.0)
    return made


def hearing(made: Swarm, number: int) -> list[int]:
    """The robots that hear this party."""
    made.radio.send(number, message(sender=f"sender {number}"))
    return [robot for _, robots in made.radio.receive_all() for robot in robots.tolist()]


@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize("wall", [0.5, 0.0])
@pytest.mark.parametrize("around", ["plain", "torus"])
def test_each_wall_between_shortens_the_reach(tmp_path: Path, around: str, wall: float, machine: Machine) -> None:
    torus = (TORUS,) if around == "torus" else ()
    radio = f'reach = "9m"\nwall = {wall}'
    made = swarm(tmp_path, radio, ROOMS + MORE, ("count = 20", "count = 60"), *torus, machine=machine)
    bodies = made.simulator.bodies
    bodies.x[:], bodies.y[:] = np.random.default_rng(8).uniform(0.0, SIDE, (2, 60))
    solids = exactly(joined(made.simulator.world.solids).tolist(), (SIDE, SIDE) if torus else (inf, inf))
    x, y, walls = bodies.x.tolist(), bodies.y.tolist(), set[int]()
    for i in range(0, 60, 4):
        heard = []
        for j in range(60):
            to_x, to_y = (_nearest(*ends, bool(torus)) for ends in ((x[i], x[j]), (y[i], y[j])))
            between = count((x[i], y[i], to_x, to_y), solids)
            near = (x[i] - to_x) ** 2 + (y[i] - to_y) ** 2 <= (9.0 * wall**between) ** 2
            if j != i and near:
                heard.append(j)
                walls.add(between)
        assert hearing(made, i) == heard
    assert walls == ({0, 1, 2} if wall else {0})


def _nearest(place: float, other: float, torus: bool) -> float:
    return min((other, other - SIDE, other + SIDE), key=lambda each: abs(each - place)) if torus else other


class TestOperator:
    def test_through_a_wall_it_hears_and_reaches_less_far(self, tmp_path: Path) -> None:
        for wall, heard in ((1, [0, 1, 2]), (0.5, [0, 2]), (0, [0, 2])):
            made = beside_a_wall(tmp_path, f"{SEATED}wall = {wall}")
            assert made.radio.samples().tolist() == heard
            assert hearing(made, OPERATOR) == heard
            for robot in range(4):
                made.radio.send(robot, message(Kind.ANSWER, sender=f"r{robot}"))
            assert [each.sender for each in made.radio.receive(OPERATOR)] == [f"r{robot}" for robot in heard]
            assert made.radio.counts.out_of_reach == 20 - len(heard) + 4 - len(heard)

    def test_many_answers_at_once_fare_as_one_by_one(self, tmp_path: Path) -> None:
        made = beside_a_wall(tmp_path, f"{SEATED}wall = 0.5")
        names, four = made.simulator.names, np.arange(4)
        answers = AnswerColumns.alike("desk:1:1", 4, "matched")
        made.radio.send_all(
            MessageBatch(Kind.ANSWER, names, 1, four, four, np.ones(4, np.int32), np.zeros(4), 5.0, answers)
        )
        assert [each.sender for each in made.radio.receive(OPERATOR)] == [names[0], names[2]]

    def test_without_a_place_it_reaches_all(self, tmp_path: Path) -> None:
        made = beside_a_wall(tmp_path, "wall = 0")
        assert made.radio.reaches_all
        assert len(hearing(made, OPERATOR)) == 20

    def test_a_wall_that_blocks_needs_no_reach_and_does_not_leave_all_in_it(self, tmp_path: Path) -> None:
        made = beside_a_wall(tmp_path, f"{SEATED.replace('5m', '1000km')}wall = 0")
        assert not made.radio.reaches_all
        assert 1 not in made.radio.samples()
        assert 1 not in hearing(made, 0)
        assert 2 in hearing(made, 0)


def test_walls_count_where_they_are_now(tmp_path: Path) -> None:
    made = beside_a_wall(tmp_path, 'reach = "5m"\nwall = 0.5', more='\n[[events]]\nat = "0.2s"\nremove = "wall"\n')
    world = made.simulator.world
    number = next(iter(world.shapes))
    assert hearing(made, 0) == [2]
    world.move(number, 4.0, 0.0)
    assert hearing(made, 0) == [1, 2]
    world.move(number, -4.0, 0.0)
    assert hearing(made, 0) == [2]
    for _ in range(3):
        made.simulator.step()
    assert hearing(made, 0) == [1, 2], "the event has removed it"


class TestRefusals:
    @pytest.mark.parametrize(
        ("radio", "changes", "sentence"),
        [
            ('reach = "9m"\nwall = 0.5', (("format = 2", "format = 1"),), r"radio\.wall: .*write format = 2"),
            ("wall = 0.5", (), r"radio\.wall: shortens a limited reach only: give a reach, or write 0"),
            ('reach = "9m"\nwall = 1.5', (), r"radio\.wall: .*from 0 to 1"),
            ('reach = "9m"\nwall = "1m"', (), r"radio\.wall: .*a plain number"),
        ],
    )
    def test_what_makes_no_sense_is_told(
        self, tmp_path: Path, radio: str, changes: tuple[tuple[str, str], ...], sentence: str
    ) -> None:
        with pytest.raises(SettingsError, match=sentence):
            swarm(tmp_path, radio, WALL, *changes)


class TestRuns:
    RULE = "(RULE call (WHEN (> id 5) (TELL (SETQ heard (+ heard 1)))))"
    RADIO = 'delay = "0s"\nreach = "9m"\n'

    def fleet(self, wall: str) -> sc.SimulatedFleet:
        fleet = sc.open(self.text(wall), seed=2, threads=1)
        self.begin(fleet)
        return fleet

    def text(self, wall: str) -> str:
        return TEXT.replace('delay = "0s"', self.RADIO + wall) + ROOMS

    def begin(self, fleet: sc.SimulatedFleet | sc.Worlds) -> None:
        fleet.send("(DEFVAR heard 0)", everybody=True, wait=0)
        fleet.send(self.RULE, everybody=True, wait=0)

    def test_a_snapshot_carries_it_on(self) -> None:
        fleet = self.fleet("wall = 0.5")
        fleet.run(1, quiet=True)
        again = sc.resume(fleet.snapshot())
        assert again.swarm.simulator.scenario.radio.wall == 0.5
        for each in (fleet, again):
            each.run(1, quiet=True)
        assert again.snapshot() == fleet.snapshot()
        through = self.fleet("wall = 1")
        through.run(2, quiet=True)
        with_walls, without = fleet.swarm.radio.counts, through.swarm.radio.counts
        assert 0 < with_walls.delivered / with_walls.sent < 0.8 * without.delivered / without.sent

    def test_worlds_of_a_batch_equal_the_run_alone(self) -> None:
        together = sc.open_many(self.text("wall = 0"), seeds=2, quiet=True)
        self.begin(together)
        together.run(1, quiet=True)
        for number in (0, 1):
            alone = sc.open(self.text("wall = 0"), seed=number + 1, threads=1)
            self.begin(alone)
            assert alone.run(1, quiet=True).snapshot() == together[number].snapshot()
