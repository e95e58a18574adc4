"""Robots that eat others: who is caught, by whom, and who is not, whatever the order in which they ask."""

from __future__ import annotations

import pytest

import sleepcast as sc
from sleepcast.core.settings import SettingsError
from sleepcast.loop import Swarm
from sleepcast.simulator import Simulator, read_scenario
from sleepcast.simulator.bodies import predation

FIELD = """
format = 2
title = "a field"
seconds = "1min"

[world]
width = "20m"
height = "20m"
edge = "torus"

[[world.walls]]
points = [["15m", "10m"], ["15m", "12m"]]

[neighbours]
reach = "3m"

[predation]
reach = "2m"

[[robots]]
type = "sheep"
hatch = true
motion = "still"
starts = [["5m", "5m"], ["5m", "6m"], ["15.2m", "11m"], ["0.2m", "19.9m"]]

[robots.limits]
speed = "1m/s"
turn_rate = "90deg/s"
acceleration = "10m/s2"

[robots.body]
radius = "0.1m"

[[robots]]
type = "wolf"
hatch = true
motion = "still"
starts = [["5m", "5.2m"], ["5m", "5.1m"], ["14.8m", "11m"], ["19.8m", "0.1m"]]

[robots.limits]
speed = "1m/s"
turn_rate = "90deg/s"
acceleration = "10m/s2"

[robots.body]
radius = "0.1m"
"""


def field(old: str = "", new: str = "") -> Swarm:
    """Sheep 1 and 2 beside wolves 1 and 2; a wall between sheep 3 and wolf 3; an edge between sheep 4 and wolf 4."""
    swarm = Swarm(Simulator(read_scenario(FIELD.replace(old, new))))
    swarm.fleet.evaluate("(COLOUR (IF (< id 5) 1 2))", swarm.fleet.state.everybody())
    swarm.step()
    return swarm


def left(swarm: Swarm) -> set[str]:
    """Who is there after a tick."""
    swarm.step()
    return {*swarm.fleet}


def asks(swarm: Swarm, **texts: str) -> None:
    """Each of these robots evaluates a text."""
    for name, text in texts.items():
        assert not swarm.evaluate(name, text).faults


def known(swarm: Swarm, text: str, *names: str) -> list[float]:
    return [swarm.evaluate(name, text).value for name in names]


EVERYBODY = {f"{kind}{number}" for kind in ("sheep", "wolf") for number in (1, 2, 3, 4)}


def test_the_nearest_one_of_a_colour_is_gone_and_for_a_tick_its_eater_knows() -> None:
    swarm = field()
    asks(swarm, wolf2="(EAT 2m 1)")
    assert left(swarm) == EVERYBODY - {"sheep1"}
    assert known(swarm, "eaten", "wolf1", "wolf2", "sheep2") == [0.0, 1.0, 0.0]
    asks(swarm, wolf2="(EAT 0.5m 1)")
    assert left(swarm) == EVERYBODY - {"sheep1"}, "the next one is farther away"
    assert known(swarm, "eaten", "wolf2") == [0.0]


def test_without_a_colour_anybody_but_oneself_is_eaten() -> None:
    swarm = field()
    asks(swarm, wolf1="(EAT 2m)", sheep2="(EAT 0m)")
    assert left(swarm) == EVERYBODY - {"wolf2"}


@pytest.mark.parametrize("order", [("wolf1", "wolf2"), ("wolf2", "wolf1")])
def test_nobody_is_eaten_twice_and_chance_says_by_whom(order: tuple[str, str]) -> None:
    eaters = []
    for tick in range(12):
        swarm = field()
        swarm.run(0.1 * tick)
        asks(swarm, **dict.fromkeys(order, "(EAT 0.5m 1)"))
        assert left(swarm) == EVERYBODY - {"sheep1"}
        eaters.append(known(swarm, "eaten", "wolf1", "wolf2"))
    assert {*map(tuple, eaters)} == {(1.0, 0.0), (0.0, 1.0)}
    swarm = field()
    asks(swarm, **dict.fromkeys(order, "(EAT 2m 1)"))
    assert left(swarm) == EVERYBODY - {"sheep1", "sheep2"}, "the second one takes the next"


def test_across_the_edge_of_a_torus_but_not_through_walls() -> None:
    swarm = field()
    asks(swarm, wolf3="(EAT 2m 1)", wolf4="(EAT 2m 1)")
    assert left(swarm) == EVERYBODY - {"sheep4"}


def test_not_beyond_the_reach_of_the_scenario() -> None:
    swarm = field('reach = "2m"', 'reach = "0.4m"')
    asks(swarm, wolf4="(EAT 2m)", wolf1="(EAT 2m)")
    assert left(swarm) == EVERYBODY - {"wolf2"}


def test_only_on_the_same_patch_where_the_scenario_says_so() -> None:
    swarm = field('reach = "2m"', 'reach = "2m"\ncell = "1m"')
    asks(swarm, wolf1="(EAT 2m 1)", wolf2="(EAT 2m 1)", wolf4="(EAT 2m)")
    assert left(swarm) == EVERYBODY - {"sheep1"}, "on the patch of both, while sheep 2 and 4 are on others"


def test_who_is_stopped_eats_nobody_and_may_be_eaten() -> None:
    swarm = field()
    for name in ("wolf1", "sheep1"):
        swarm.simulator.robots[swarm.minds[name].index].stop()
    asks(swarm, wolf1="(EAT 2m 1)")
    assert left(swarm) == EVERYBODY
    asks(swarm, wolf2="(EAT 2m 1)")
    assert left(swarm) == EVERYBODY - {"sheep1"}


def test_who_goes_by_itself_neither_eats_nor_is_eaten_and_young_come_before_their_parent_is_gone() -> None:
    swarm = field()
    asks(swarm, sheep1="(DIE)", wolf1="(PROGN (EAT 2m 1) (DIE))", sheep2="(HATCH sheep 1)", wolf2="(EAT 2m 1)")
    assert left(swarm) == EVERYBODY - {"sheep1", "wolf1", "sheep2"} | {"sheep9"}


def test_in_small_blocks_the_same_are_eaten_by_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    results = set()
    for pairs in (1, predation.MAX_PAIRS):
        monkeypatch.setattr(predation, "MAX_PAIRS", pairs)
        swarm = field()
        swarm.fleet.evaluate("(EAT 1.5m)", swarm.fleet.state.everybody())
        swarm.step()
        results.add((swarm.simulator.state_hash(), *swarm.fleet))
    assert len(results) == 1


def test_one_at_a_time_and_all_at_once_come_to_the_same() -> None:
    together, alone = field(), field()
    text = "(EAT (* 0.3 id) (IF (< id 5) 2 1))"
    for name in reversed([*alone.fleet]):
        alone.evaluate(name, text)
    together.fleet.evaluate(text, together.fleet.state.everybody())
    alone.step()
    together.step()
    assert alone.simulator.state_hash() == together.simulator.state_hash()
    assert {*alone.fleet} == {*together.fleet} < EVERYBODY


@pytest.mark.parametrize(("minds", "others"), [("", 0), ("\n[minds]\ntells_hatch = true\n", 1)])
def test_robots_are_told_to_eat_only_where_the_scenario_says_so(minds: str, others: int) -> None:
    with sc.open(FIELD + minds) as fleet:
        fleet.run(1)
        fleet.send("(WHEN (= id 1) (TELL (WHEN (= id 6) (EAT 0.15m))))")
        fleet.run(1)
        assert len(fleet.names) == 8 - others


@pytest.mark.parametrize(
    ("old", "new", "sentence"),
    [
        ("hatch = true", "", r"predation: who is eaten is gone: say hatch = true in \[robots\]"),
        ('[neighbours]\nreach = "3m"\n', "", r"a table \[neighbours\] lets them"),
        ('reach = "2m"', 'reach = "0m"', "predation.reach"),
        ('reach = "2m"', 'reach = "15m"', "a torus of 20 m is too small"),
        ('reach = "2m"', 'reach = "2m"\nloss = 1', "unknown key"),
    ],
)
def test_a_table_that_cannot_be(old: str, new: str, sentence: str) -> None:
    with pytest.raises(SettingsError, match=sentence):
        read_scenario(FIELD.replace(old, new))
