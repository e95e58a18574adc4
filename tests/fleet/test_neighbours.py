"""Forms that go through neighbours, on the robots of a simulated world: all of them at once, compiled or not, come to
what each robot by itself comes to, bit for bit."""

from __future__ import annotations

from collections.abc import Iterator
from math import nan
from pathlib import Path

import numpy as np
import pytest

import sleepcast as sc
from machines import ALL, MACHINES
from sleepcast.core.errors import SleepcastError
from sleepcast.core.neighbours import nearest_id
from sleepcast.language import FreshNames, Vocabulary, check
from sleepcast.language.explain import explain
from sleepcast.loop import Swarm
from sleepcast.mind.telemetry import read_vocabulary, vocabulary_text
from sleepcast.node.node import Node
from sleepcast.simulator import Simulator, load
from sleepcast.simulator.engine import Machine
from small_worlds import write

ROBOTS = 60
ASKED = range(0, ROBOTS, 9)
"""Robots whose values are looked at."""
FORMS = """
[neighbours]
reach = "12m"
loss = {loss}
noise = {noise}
shows_groups = ["bravo"]
[neighbours.shares]
opinion = ""
fuel = "%"
"""
TORUS = (
    ('width = "1km"\nheight = "1km"', 'width = "45m"\nheight = "45m"\nedge = "torus"'),
    ('x = "500m"\ny = "400m"', 'x = "5m"\ny = "4m"'),
)
TEXTS = (
    "(SUM-OVER (n 10m) (OF n x))",
    "(MEAN-OVER (n 12m) (OF n y))",
    "(MIN-OVER (n 8m) (OF n opinion))",
    "(MAX-OVER (n 8m) (- (OF n opinion) (OF n distance)))",
    "(COUNT-OVER (n 12m) (> (OF n distance) 5m))",
    "(COUNT-OVER (n 12m 1) (< (OF n fuel) 50%))",
    "(BEST-OVER (n 12m) (OF n distance))",
    "(BEST-OVER (n 12m) (IF (< (OF n colour) 1) (OF n heading) (OF n bearing)))",
    "(SUM-OVER (n 12m) (LET ((d (OF n distance)) (k id)) (COND ((< d 3m) k) ((AND (> d 6m) (> n id)) (* d n)))))",
    "(MEAN-OVER (n 12m) (/ 1 (OF n colour)))",
    "(LET ((far 0)) (FOR-NEIGHBOURS (n 12m) (SETQ far (+ (/ far 2) (OF n distance)))) far)",
    "(SUM-OVER (n (* 2m (NEAREST_DIST 12m))) (OF n x))",
    "(SUM-OVER (n 12m) (IF (OF n bravo) n (- n)))",
    "(SUM-OVER (n 12m) (NEAREST_ID (- (OF n distance) 1cm)))",
    "(SUM-OVER (n 12m) (GAP (OF n distance)))",
    "(SUM-OVER (n 12m) (RANK_DIST (MOD n 3) (OF n distance)))",
    "(SUM-OVER (n 12m) (CELL_X (OF n distance) (MOD n 2)))",
    "(NEAREST_ID 12m)",
    "(NEAREST_ID 12m 1)",
    "(OF (NEAREST_ID 12m) heading)",
    "(OF (+ id 1) bearing)",
    "(OF id x)",
    "(SUM-OVER (n 12m) (PROB 50%))",
)


def world(
    folder: Path,
    on: Machine,
    *changes: tuple[str, str],
    robots: int = ROBOTS,
    loss: float = 0.0,
    noise: float = 0.0,
) -> Simulator:
    """Robots in one place of 40 m, some of them on others, which show colours and numbers."""
    written = write(folder, ("count = 20", f"count = {robots}"), *changes, more=FORMS.format(loss=loss, noise=noise))
    sim = Simulator(load(written), 3, on)
    chance = np.random.default_rng(5)
    bodies = sim.bodies
    bodies.x[:], bodies.y[:] = 40.0 * chance.random((2, robots))
    bodies.x[:3], bodies.y[:3] = 10.0, 10.0
    bodies.heading[:] = chance.uniform(-3.0, 3.0, robots)
    named = {each.name: each for each in sim.model.functions}
    for name, values in (
        ("COLOUR", chance.integers(0, 2, robots).astype(float)),
        ("SHARE_OPINION", chance.integers(-2, 3, robots).astype(float)),
        ("SHARE_FUEL", chance.random(robots)),
    ):
        many = named[name].many
        assert many
        showing = np.arange(0, robots, 1 if name == "COLOUR" else 2)
        many(sim.robots, showing, values[showing])
    sim.senses.show_groups(range(0, robots, 3), {"bravo": 1.0})
    bodies.forget()
    sim.senses.step()
    return sim


Found = list[tuple[str, tuple[str, ...]]]
"""The bits of each robot's value, and its faults."""


def together(sim: Simulator) -> Iterator[Found]:
    """What each text comes to on robots that are evaluated as columns."""
    fleet = Swarm(sim).fleet
    views = list(fleet.values())
    for text in TEXTS:
        (found,) = fleet.evaluate(text, list(ASKED))
        results = [views[robot].result(found, 0) for robot in ASKED]
        yield [(each.value.hex(), tuple(fault.reason for fault in each.faults)) for each in results]


def alone(sim: Simulator) -> Iterator[Found]:
    """The same of each robot by itself."""
    vocabulary = Swarm(sim).vocabulary
    minds = [Node("one", vocabulary, number=robot + 1, seed=sim.seed, body=sim.robots[robot]) for robot in ASKED]
    for text in TEXTS:
        results = [mind.evaluate(text) for mind in minds]
        yield [(each.value.hex(), tuple(fault.reason for fault in each.faults)) for each in results]


@pytest.mark.parametrize("machine", MACHINES)
@pytest.mark.parametrize(("loss", "noise"), [(0.0, 0.0), (0.3, 0.1)])
def test_all_robots_at_once_come_to_what_each_comes_to(
    tmp_path: Path, machine: Machine, loss: float, noise: float
) -> None:
    sim = world(tmp_path, machine, loss=loss, noise=noise)
    for text, values, wanted in zip(TEXTS, together(sim), alone(sim), strict=True):
        assert values == wanted, text


@pytest.mark.parametrize("machine", MACHINES)
def test_all_neighbours_at_once_come_to_what_one_after_the_other_does(tmp_path: Path, machine: Machine) -> None:
    sim = world(tmp_path, machine)
    fleet, told = Swarm(sim).fleet, 0
    for text, wanted in zip(TEXTS, together(sim), strict=True):
        if not any(faults for _, faults in wanted) and "PROB" not in text:
            values = fleet.values_of(text, 0.0)[list(ASKED)].tolist()
            assert [value.hex() for value in values] == [bits for bits, _ in wanted], text
            told += 1
    assert told > 12


@pytest.mark.skipif(len(ALL) == 1, reason="there is one machine")
@pytest.mark.parametrize("changes", [(), TORUS])
def test_compiled_code_senses_the_same_neighbours(tmp_path: Path, changes: tuple[tuple[str, str], ...]) -> None:
    first, second = (world(tmp_path, on, *changes, loss=0.2, noise=0.1) for on in ALL)
    for text, values, wanted in zip(TEXTS, together(first), together(second), strict=True):
        assert values == wanted, text


@pytest.mark.parametrize("machine", MACHINES)
def test_of_very_many_neighbours_the_nearest_count(tmp_path: Path, machine: Machine) -> None:
    sim = world(tmp_path, machine, robots=402)
    bodies = sim.bodies
    bodies.x[:], bodies.y[:] = 500.0 + 0.01 * np.arange(402), 500.0
    bodies.x[401] = 900.0
    bodies.forget()
    fleet = Swarm(sim).fleet
    ids = np.arange(402) + 1.0
    for text, robot, wanted in (
        ("(COUNT-OVER (n 10m) TRUE)", 0, 256.0),
        ("(SUM-OVER (n 10m) n)", 0, ids[1:257].sum()),
        ("(SUM-OVER (n 10m) n)", 400, ids[144:400].sum()),
        ("(MAX-OVER (n 10m) (OF n distance))", 0, bodies.x[256] - bodies.x[0]),
        ("(LET ((sum 0)) (FOR-NEIGHBOURS (n 10m) (SETQ sum (+ sum n))) sum)", 400, ids[336:400].sum()),
        ("(COUNT-OVER (n 10m) TRUE)", 401, 0.0),
        ("(COUNT 10m)", 0, 400.0),
    ):
        (found,) = fleet.evaluate(text, [robot])
        assert found.values.tolist() == [wanted], text


@pytest.mark.parametrize("machine", MACHINES)
def test_who_goes_through_the_nearest_only_reports_it_once(tmp_path: Path, machine: Machine) -> None:
    """258 robots in one place, and 257 in another, of which each has 256 neighbours."""
    sim = world(tmp_path, machine, robots=515)
    sim.bodies.x[:], sim.bodies.y[:] = np.where(np.arange(515) < 258, 100.0, 900.0), 500.0
    sim.bodies.forget()
    swarm = Swarm(sim)
    fleet, text = swarm.fleet, "(WHEN (> (SUM-OVER (n 10m) 1) 9999) (MARK))"
    assert set(fleet.values_of("(SUM-OVER (n 10m) 1)", 0.0).tolist()) == {256.0}
    assert fleet.outbox.empty, "who asks makes nobody report"
    some = [0, 300]
    views, whole = list(fleet.values()), "goes through the nearest 256 neighbours only, of"
    nodes = [Node("one", swarm.vocabulary, number=robot + 1, seed=sim.seed, body=sim.robots[robot]) for robot in some]
    for turn in range(2):
        (found,) = fleet.evaluate(text, some)
        for robot, node in zip(some, nodes, strict=True):
            together, single = views[robot].result(found, 0), node.evaluate(text)
            assert together.printed == single.printed == (((whole, (257.0,)),) if (robot, turn) == (0, 0) else ())
            for why in (node.why().render(), explain(together.recall()).render()):
                assert f"256 neighbours{': the nearest of 257' if robot == 0 else ''}\n" in why
    assert [message.body["values"] for message in fleet.outbox.of(0)] == [[257.0]]
    again = Swarm(sim).fleet
    again.state.restore(fleet.state.state())
    again.evaluate(text, some)
    assert again.outbox.empty, "it goes on as it was"


STEERED = (
    "(RULE steer (PROGN (DEFVAR v 0) (SETQ v (SUM-OVER (n 5m) (* (OF n distance) (OF n heading)))) "
    "(FOR-NEIGHBOURS (n 2m) (SETQ v (+ v (OF n x)))) (COLOUR (NEAREST_ID 5m)) "
    "(DRIVE 0.5m/s (CLAMP (/ (WRAP (- (OF (NEAREST_ID 5m) bearing) heading)) 2s) -1 1))))"
)


def test_worlds_and_runs_that_go_on_equal_one_run() -> None:
    with sc.open("couzin", seed=4) as alone:
        alone.send(STEERED, everybody=True)
        alone.run(1.0 - alone.time)
        middle = alone.snapshot()
        alone.run(1.0)
        assert len(set(alone["v"].tolist())) > 1, "they differ, and have moved"
        worlds = sc.open_many("couzin", seeds=[3, 4])
        for world in worlds:
            world.send(STEERED, everybody=True)
        worlds.run(2.0 - worlds.time)
        resumed = sc.resume(middle)
        resumed.run(1.0)
        for other in (worlds[1], resumed):
            assert other.time == alone.time
            assert np.array_equal(other["v"], alone["v"])
            assert other.hash == alone.hash


SHOWING = '[neighbours]\nreach = "2km"\nshows_groups = ["bravo", "Late"]\n'
SEEN = "(RULE look (PROGN (DEFVAR v 0) (SETQ v (COUNT-OVER (n 2km) (OF n bravo))) (SETQ w (OF 1 late))))"


def test_neighbours_see_who_is_in_a_group_from_the_next_tick_on(tmp_path: Path) -> None:
    file = write(tmp_path, ("count = 20", "count = 12"), more=SHOWING)
    with sc.open(file, seed=4) as alone:
        for text in ("(DEFVAR w 0)", SEEN, "(WHEN (< id 5) (JOIN bravo))", "(WHEN (= id 1) (JOIN late))"):
            alone.send(text, everybody=True)
            alone.run(1.0)
        assert alone["v"].tolist() == [3.0] * 4 + [4.0] * 8
        assert np.array_equal(alone["w"], [nan] + [1.0] * 11, equal_nan=True), "nobody is its own neighbour"
        alone.send("(WHEN (= id 2) (LEAVE bravo))", everybody=True)
        alone.run(0.2)
        middle = alone.snapshot()
        alone.run(0.8)
        assert alone["v"].tolist() == [2.0, 3.0, 2.0, 2.0] + [3.0] * 8
        with sc.resume(middle) as resumed:
            resumed.run(0.8)
            assert (resumed["v"].tolist(), resumed.hash) == (alone["v"].tolist(), alone.hash)
        worlds = sc.open_many(file, seeds=[3, 4])
        for text in ("(DEFVAR w 0)", SEEN, "(WHEN (< id 5) (JOIN bravo))"):
            worlds.send(text, everybody=True)
            worlds.run(1.0)
        assert [world["v"].tolist() for world in worlds] == [[3.0] * 4 + [4.0] * 8] * 2
        shown = check("(OF 3 brvo)", FreshNames(alone.swarm.vocabulary)).findings
        assert [finding.message for finding in shown] == ['neighbours show no "brvo" at 1:7 (did you mean bravo?)']


@pytest.mark.parametrize(
    ("names", "why"),
    [
        ('["x"]', "neighbours show something else as x"),
        ('["a", "A"]', "neighbours show something else as A"),
        ('["2a"]', "is no name: wanted a letter"),
        ('"bravo"', "wanted a list of up to 8 names"),
    ],
)
def test_groups_that_cannot_be_shown_are_refused(tmp_path: Path, names: str, why: str) -> None:
    file = write(tmp_path, more=SHOWING.replace('["bravo", "Late"]', names))
    with pytest.raises(SleepcastError, match=why):
        load(file)


def test_what_neighbours_show_is_known_far_away() -> None:
    near = nearest_id(lambda *_: 0.0, lambda *_: (), lambda *_: 0.0, more={"fuel": "%"})
    vocabulary = Vocabulary("rover", functions=(near,))
    far = read_vocabulary(vocabulary_text(vocabulary))
    found = check("(MEAN-OVER (n 5m) (OF n feul))", FreshNames(far)).findings
    assert [finding.message for finding in found] == ['neighbours show no "feul" at 1:25 (did you mean fuel?)']
    assert check("(MEAN-OVER (n 5m) (OF n fuel))", FreshNames(far)).unit == "%"
    deaf = read_vocabulary(vocabulary_text(Vocabulary("buoy")))
    (warning,) = check("(SUM-OVER (n 5m) 1)", FreshNames(deaf)).findings
    assert warning.message == "SUM-OVER at 1:2 is a fault on these robots, which tell no neighbours apart"
