"""SCAN-MIN, SCAN-GAP and SEES on the robots of a simulated world: all at once, compiled or not, in batches, rewound and
recorded, they come to what each robot by itself comes to, bit for bit."""

from __future__ import annotations

import re
from math import inf, isnan, nan, pi
from pathlib import Path

import numpy as np
import pytest

import sleepcast as sc
from cli.calling import called_warm
from machines import ALL, MACHINES
from sleepcast.core.errors import MisuseError
from sleepcast.core.settings import SettingsError
from sleepcast.language import FreshNames, check
from sleepcast.language.explain import explain
from sleepcast.loop import Swarm
from sleepcast.mind.telemetry import read_vocabulary, vocabulary_text
from sleepcast.node.node import Node
from sleepcast.simulator import Simulator
from sleepcast.simulator.engine import Machine
from sleepcast.simulator.laser.sectors import within
from sleepcast.simulator.scenario.scenario import Scenario, read_scenario

TEXT = """
format = 2
title = "scanners"
seconds = "1min"

[world]
width = "20m"
height = "20m"
edge = "wall"
rooms = { size = "5m", door = "1.5m" }

[[world.circles]]
center = ["7m", "7m"]
radius = "0.4m"
name = "barrel"

[[events]]
at = "1s"
move = "barrel"
by = ["1m", "0m"]

[robots]
count = 40
type = "scout"

[robots.limits]
speed = "1m/s"
turn_rate = "90deg/s"
acceleration = "1m/s2"

[robots.body]
radius = "0.2m"
bumpers = 8

[constants]
red = 3

[neighbours]
reach = "4m"

[laser]
beams = 90
range = "6m"
least = "0.25m"
noise = "1cm"

[camera]
range = "9m"
"""
TEXTS = (
    "(SCAN-MIN -30deg 30deg)",
    "(SCAN-MIN 30deg -30deg)",
    "(SCAN-MIN (* id 10deg) (* id 25deg))",
    "(SCAN-MIN UNKNOWN 1)",
    "(SCAN-MIN 0.5deg 1deg)",
    "(SCAN-GAP -90deg 90deg)",
    "(SCAN-GAP -180deg 180deg 3m)",
    "(SCAN-GAP (* id 10deg) (* id 25deg) (* id 10cm))",
    "(SCAN-GAP -90deg 90deg 1km)",
    "(SEES red -90deg 90deg)",
    "(SEES (MOD id 2) -180deg 180deg)",
    "(SEES red (* id 10deg) (* id 25deg))",
    "(SEES UNKNOWN 0 1)",
    "(SUM-OVER (n 4m) (SEES (MOD n 2) (OF n bearing) (+ (OF n bearing) (* n 5deg))))",
    "(SUM-OVER (n 4m) (SCAN-MIN (OF n bearing) (+ (OF n bearing) 30deg)))",
    "(SUM-OVER (n 4m) (SCAN-GAP (OF n bearing) (+ (OF n bearing) 90deg) (* n 10cm)))",
    "(/ (SEES red -10deg 10deg) (SEES 9 -10deg 10deg))",
)
RULES = """
(RULE steer (DRIVE (IF (< (SCAN-MIN -20deg 20deg) 60cm) 0m/s 0.5m/s) (/ (SCAN-GAP -100deg 100deg) 0.5s)))
(RULE show (COLOUR (IF (> (SEES red -180deg 180deg) 2) 1 red)))
"""


def scenario(*changes: tuple[str, str]) -> Scenario:
    text = TEXT
    for old, new in changes:
        assert old in text, old
        text = text.replace(old, new)
    return read_scenario(text)


def world(machine: Machine | None = None, *changes: tuple[str, str]) -> Simulator:
    """Some of the robots are red."""
    sim = Simulator(scenario(*changes), 3, machine)
    many = next(each.many for each in sim.model.functions if each.name == "COLOUR")
    assert many
    many(sim.robots, np.arange(0, 40, 3), np.full(14, 3.0))
    sim.step()
    return sim


def together(sim: Simulator, robots: range = range(40)) -> list[list[tuple[str, tuple[str, ...]]]]:
    """What each text comes to on robots that are evaluated as columns: the bits, and faults."""
    fleet, told = Swarm(sim).fleet, []
    views = list(fleet.values())
    for text in TEXTS:
        (found,) = fleet.evaluate(text, list(robots))
        results = [views[robot].result(found, 0) for robot in robots]
        told.append([(each.value.hex(), tuple(fault.reason for fault in each.faults)) for each in results])
    return told


@pytest.mark.parametrize("machine", MACHINES)
def test_all_robots_at_once_come_to_what_each_comes_to(machine: Machine) -> None:
    sim, robots = world(machine), range(0, 40, 5)
    found = together(sim, robots)
    fleet, vocabulary = Swarm(sim).fleet, Swarm(sim).vocabulary
    minds = [Node("one", vocabulary, number=robot + 1, seed=sim.seed, body=sim.robots[robot]) for robot in robots]
    for text, values in zip(TEXTS, found, strict=True):
        results = [mind.evaluate(text) for mind in minds]
        assert values == [(each.value.hex(), tuple(fault.reason for fault in each.faults)) for each in results], text
        if not any(faults for _, faults in values):
            asked = fleet.values_of(text, 0.0)[list(robots)].tolist()
            assert [value.hex() for value in asked] == [bits for bits, _ in values], text


@pytest.mark.skipif(len(ALL) == 1, reason="there is one machine")
@pytest.mark.parametrize("edge", ['"wall"', '"torus"'])
def test_compiled_code_sees_the_same(edge: str) -> None:
    assert together(world(ALL[0], ('"wall"', edge))) == together(world(ALL[1], ('"wall"', edge)))


def commanded(robots: sc.SimulatedFleet) -> sc.SimulatedFleet:
    """Robots that drive by their scanners."""
    for rule in RULES.strip().splitlines():
        robots.send(rule, everybody=True)
    return robots


def test_worlds_and_runs_that_go_on_and_more_threads_equal_one_run() -> None:
    with sc.open(TEXT, seed=4, threads=1) as alone:
        commanded(alone).run(3.0 - alone.time)
        middle = alone.snapshot()
        alone.run(1.0)
        assert len({*alone["speed"].tolist()}) > 1
        worlds = sc.open_many(TEXT, seeds=[3, 4])
        for each in worlds:
            commanded(each)
        worlds.run(4.0 - worlds.time)
        resumed = sc.resume(middle)
        resumed.run(1.0)
        more = sc.open(TEXT, seed=4, threads=3)
        commanded(more).run(4.0 - more.time)
        for other in (worlds[1], resumed, more):
            assert other.time == alone.time
            assert other.hash == alone.hash
            assert np.array_equal(other["(SCAN-MIN 0 6)"], alone["(SCAN-MIN 0 6)"], equal_nan=True)


def test_a_recorded_run_comes_again_and_so_does_a_fork(tmp_path: Path) -> None:
    folder = tmp_path / "scanners"
    folder.mkdir()
    (folder / "scenario.toml").write_text(TEXT, encoding="utf-8")
    file = tmp_path / "run.mcap"
    with sc.open(folder, seed=4) as robots:
        recording = robots.record(file)
        commanded(robots).run(1.0)
        fork = robots.fork()
        robots.run(0.5)
        fork.run(0.5)
        assert fork.hash == robots.hash
        recording.close()
    told = called_warm("replay", str(file), "--verify")
    assert "the same to the last bit" in told.out, told


class TestBadInput:
    @pytest.mark.parametrize(
        ("changes", "message"),
        [
            (("beams = 90", "beams = 0"), "laser.beams: wanted a whole number from 1 to 1080"),
            (("beams = 90", "beams = 1081"), "laser.beams: wanted a whole number from 1 to 1080"),
            (("beams = 90", 'beams = 9\nfrom = "30deg"\nto = "10deg"'), "laser.to: beams go counter-clockwise"),
            (("beams = 90", 'beams = 9\nfrom = "0deg"\nto = "361deg"'), "laser.to: beams go counter-clockwise"),
            (("beams = 90", "beams = 9\nfrom = nan"), "laser.from"),
            (("beams = 90", "beams = 9\nto = inf"), "laser.to"),
            (('range = "6m"', "range = inf"), "laser.range"),
            (('range = "6m"', 'range = "0m"'), "laser.range"),
            (('least = "0.25m"', 'least = "7m"'), "laser.least"),
            (('noise = "1cm"', "noise = nan"), "laser.noise"),
            (('noise = "1cm"', 'noises = "1cm"'), "laser.noises"),
            (('range = "9m"', 'range = "-1m"'), "camera.range"),
            (('[neighbours]\nreach = "4m"\n', ""), "camera: robots show colours to their neighbours: add a table"),
            (("format = 2", "format = 1"), "laser: it does not see through walls, so it is of format 2"),
            (("count = 40", "count = 900000"), "laser.beams: 900000 robots with 90 beams each"),
            (('"wall"', '"torus"'), "a torus of 20 m is too small: their scanners see up to 12.2 m"),
        ],
    )
    def test_in_the_scenario(self, changes: tuple[str, str], message: str) -> None:
        more = [('range = "6m"', 'range = "12m"')] if "torus" in changes[1] else []
        more += [("beams = 90", "beams = 190")] if "900000" in changes[1] else []
        message = message.replace("90 beams", "190 beams")
        with pytest.raises(SettingsError) as raised:
            scenario(changes, *more)
        assert message in str(raised.value)

    @pytest.mark.parametrize("machine", MACHINES)
    def test_a_body_inside_a_wall_and_angles_that_are_none(self, machine: Machine) -> None:
        sim = world(machine, ('noise = "1cm"', 'noise = "0cm"'))
        sim.place(0, 7.0, 7.0, 0.0)  # in the barrel
        sim.place(1, 5.0, 1.0, 0.0)  # in the wall of a room
        assert (sim.scans(np.array([0])) == -inf).all()
        assert (sim.scans(np.array([1])) == -inf).any()
        least = next(each.many for each in sim.model.functions if each.name == "SCAN-MIN")
        assert least
        found = least(sim.robots, np.array([0, 1, 2, 2, 2]), np.array([0.0, 0, inf, nan, 1e300]), np.zeros(5))
        assert found[:2].tolist() == [0.25, 0.25]
        assert all(isnan(each) or 0.25 <= each <= 6.0 for each in found[2:].tolist())

    def test_robots_without_a_scanner(self) -> None:
        without = TEXT[: TEXT.index("[laser]")]
        sim = Simulator(read_scenario(without), 1)
        with pytest.raises(MisuseError, match=r"no laser scanner: a table \[laser\]"):
            sim.scans()
        swarm = Swarm(sim)
        fleet = swarm.fleet
        for text, lacking in (("(SCAN-MIN 0 1)", "laser scanner"), ("(SEES 3 0 1)", "camera")):
            (found,) = fleet.evaluate(text, [0])
            result = next(iter(fleet.values())).result(found, 0)
            assert isnan(result.value)
            assert [fault.reason for fault in result.faults] == [f"this robot has no function {text.split()[0][1:]}"]
            (warning,) = check(text, FreshNames(swarm.vocabulary)).findings
            assert (
                warning.message == f"{text.split()[0][1:]} at 1:2 is a fault on these robots, which have no {lacking}"
            )


@pytest.mark.parametrize("wrong", [[-1], [0, 99], [0.5], [True, False], [[0]], [nan]])
def test_indices_of_robots_that_there_are_not(wrong: list[float]) -> None:
    simulator = world()
    measured = simulator.scans()
    with pytest.raises(MisuseError, match="robots are numbered from 0 to "):
        simulator.scans(np.array(wrong))
    assert simulator.scans(np.array([])).shape == (0, measured.shape[1])
    assert np.array_equal(simulator.scans(np.array([1, 0, 1])), measured[[1, 0, 1]])


def test_nothing_is_measured_where_nobody_asks(monkeypatch: pytest.MonkeyPatch) -> None:
    sim, asked = world(), list[int]()
    scan = sim.bodies.machine.scan
    monkeypatch.setattr(sim.bodies.machine, "scan", lambda *given: asked.append(len(given[2])) or scan(*given))
    swarm = Swarm(sim)
    swarm.fleet.evaluate("(WHEN (> id 5) (MARK))")
    sim.step()
    assert asked == []
    swarm.fleet.evaluate("(SCAN-MIN 0 1)", [3, 7])
    swarm.fleet.evaluate("(SCAN-GAP 0 1)", [3, 7, 9])
    assert asked == [2, 1], "and once a tick of each robot"


class TestSees:
    @pytest.fixture
    def sim(self) -> Simulator:
        plain = ('rooms = { size = "5m", door = "1.5m" }', 'walls = [{ points = [["10m", "4m"], ["10m", "6m"]] }]')
        sim = Simulator(scenario(plain, ("count = 40", "count = 4"), ('radius = "0.4m"', 'radius = "0.1m"')), 3)
        self.show(sim, (3.0, 3.0, 3.0, 1.0))
        for number, (x, y) in enumerate([(4.0, 5.0), (6.0, 5.0), (9.0, 5.0), (12.0, 5.0)]):
            sim.place(number, x, y, pi if number == 1 else 0.0)
        return sim

    def show(self, sim: Simulator, colours: tuple[float, ...]) -> None:
        many = next(each.many for each in sim.model.functions if each.name == "COLOUR")
        assert many
        many(sim.robots, np.arange(4), np.array(colours))
        sim.senses.step()

    def seen(self, sim: Simulator, colour: float, first: float, last: float) -> list[float]:
        many = next(each.many for each in sim.model.functions if each.name == "SEES")
        assert many
        ends = np.radians((first, last))
        found: list[float] = many(
            sim.robots, np.arange(4), np.full(4, colour), *np.repeat(ends, 4).reshape(2, 4)
        ).tolist()
        return found

    def test_in_a_sector_from_the_heading(self, sim: Simulator) -> None:
        assert self.seen(sim, 3, -45, 45) == [2, 1, 0, 0]
        assert self.seen(sim, 3, 135, -135) == [0, 1, 2, 0]
        assert self.seen(sim, 3, 45, 135) == [0, 0, 0, 0]

    def test_walls_hide_and_so_does_the_range(self, sim: Simulator) -> None:
        assert self.seen(sim, 1, -180, 180) == [0, 0, 0, 0]
        sim.place(3, 9.0, 9.0, 0.0)
        assert self.seen(sim, 1, -180, 180) == [1, 1, 1, 0]
        sim.place(0, 0.5, 5.0, 0.0)
        assert self.seen(sim, 1, -180, 180) == [0, 1, 1, 0], "9.4 m away"

    def test_bodies_hide_if_the_scenario_says_so(self) -> None:
        text = TEXT.replace("count = 40", "count = 4").replace('rooms = { size = "5m", door = "1.5m" }', "")
        sim = Simulator(read_scenario(text + "\n[sight]\nbodies_hide = true\n"), 3)
        self.show(sim, (3.0, 3.0, 3.0, 1.0))
        for number, x in enumerate((4.0, 6.0, 9.0, 12.0)):
            sim.place(number, x, 15.0, 0.0)
        assert self.seen(sim, 3, -180, 180) == [1, 2, 1, 1]
        assert self.seen(sim, 1, -180, 180) == [0, 0, 1, 0]


def test_an_explanation_shows_what_was_seen() -> None:
    sim = world()
    swarm, text = Swarm(sim), "(IF (< (SCAN-MIN -180deg 180deg) 6m) (SCAN-GAP -90deg 90deg 0m) (SEES red 0 1))"
    node = Node("one", swarm.vocabulary, number=1, seed=sim.seed, body=sim.robots[0])
    node.evaluate(text)
    (found,) = swarm.fleet.evaluate(text, [0])
    together = next(iter(swarm.fleet.values())).result(found, 0)
    for why in (node.why().render(), explain(together.recall()).render()):
        assert re.search(r"0\.[0-9]+ m +\(SCAN-MIN -180deg 180deg\)\n", why), why
        assert re.search(r"deg +\(SCAN-GAP -90deg 90deg 0m\)\n", why), why


def test_names_of_the_scenario_come_first() -> None:
    swarm = Swarm(Simulator(scenario(("red = 3", "red = 3\nsees = 5")), 3))
    (found,) = swarm.fleet.evaluate("(+ sees red)", [0])
    assert found.values.tolist() == [8.0]
    (error,) = check("(SEES 3 0 1)", FreshNames(swarm.vocabulary)).errors
    assert error.message == "SEES at 1:2 is a constant, not a function: its name alone gives its value"
    area = ("[neighbours]", '[areas.sees]\ncenter = ["5m", "5m"]\nradius = "30m"\n[neighbours]')
    swarm = Swarm(Simulator(scenario(area), 3))
    (found,) = swarm.fleet.evaluate("(INSIDE sees)", [0])
    assert found.values.tolist() == [1.0]


def test_a_far_desk_knows_their_arguments() -> None:
    far = read_vocabulary(vocabulary_text(Swarm(world()).vocabulary))
    assert check("(SCAN-MIN 0deg 90deg)", FreshNames(far)).unit == "m"
    (error,) = check("(SEES 1m 0 1)", FreshNames(far)).findings
    assert "SEES" in error.message, error
    (error,) = check("(SCAN-GAP 1)", FreshNames(far)).findings
    assert error.message.startswith("(SCAN-GAP a b [free]) takes 2 to 3 arguments, got 1")


def test_a_sector_that_rounding_has_made_narrower_than_nothing_is_one_direction() -> None:
    angles = np.radians([-90.0, 0.0, 17.0, 90.0])
    first, last = (
        np.array([[0.1 + 0.2], [0.0], [np.radians(370.0)], [2e-10]]),
        np.array([[0.3], [-1e-12], [np.radians(10.0)], [0.0]]),
    )
    assert not within(np.array([-1.0, 0.2, 0.4, 3.0]), first, last).any()
    assert within(angles, 0.0, np.nextafter(2.0 * np.pi, 0.0)).all()
    assert within(angles, np.radians(17.0), np.radians(17.0)).tolist() == [False, False, True, False]
