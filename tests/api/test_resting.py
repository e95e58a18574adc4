"""Worlds that rest while nothing is done with them: they go on as if they never had."""

from __future__ import annotations

import gc

import pytest

import sleepcast as sc
from sleepcast.api import worlds as many
from swarms import settle


def worlds(**given: object) -> sc.Worlds:
    wanted: dict[str, object] = {"seeds": (3, 7), "over": {"radio.loss": [0.0, 0.3]}, "robots": 6, "quiet": True}
    return sc.open_many("bravo", **(wanted | given))  # type: ignore[arg-type]  # any of them


@pytest.fixture(autouse=True)
def resting(monkeypatch: pytest.MonkeyPatch) -> None:
    """No world stays awake longer than something is done with it."""
    monkeypatch.setattr(many, "AWAKE", 0)


@pytest.mark.parametrize("scenario", ["bravo", "crowd", "stop", "energy", "maze"])
def test_a_world_that_has_rested_equals_the_run_alone(scenario: str) -> None:
    given: dict[str, object] = {"mission": True, "over": {"robots.count": 12}}
    together = sc.open_many(scenario, seeds=(3, 7), quiet=True, **given)  # type: ignore[arg-type]  # as above
    sampled = together.history("x", every=1)
    together.run(3, quiet=True).run(2, quiet=True)
    assert not any(world.is_awake for world in together._worlds.values())
    found = together.values("x")
    for number, plan in enumerate(together.plans):
        alone = sc.open(scenario, seed=plan.seed, threads=1, **given)  # type: ignore[arg-type]
        history = alone.history("x", every=1)
        alone.run(3, quiet=True).run(2, quiet=True)
        assert (found[12 * number : 12 * number + 12] == alone["x"]).all()
        world = together[number]
        assert world.snapshot() == alone.snapshot()
        assert world._inputs is not None
        assert alone._inputs is not None
        assert world._inputs.inputs == alone._inputs.inputs, "a test can be made of what was sent"
        assert (sampled[number]["x"] == history["x"]).all()
        assert world.swarm.measures() == alone.swarm.measures()


def test_a_woken_world_knows_why_robots_did_something_before() -> None:
    together = sc.open_many("bravo", seeds=1, mission=True, quiet=True).run(12, quiet=True).run(1, quiet=True)
    alone = sc.open("bravo", seed=1, mission=True, threads=1).run(13, quiet=True)
    robot = alone.names[0]
    assert alone.why(robot).time < 12.0
    assert str(together[0].why(robot)) == str(alone.why(robot))


def test_a_world_rests_no_more_once_somebody_has_it() -> None:
    together = worlds()
    second = together[1]
    second.send("(WHEN (> fuel 50%) (JOIN mine))", wait=2)
    together.run(4, quiet=True)
    assert together[1] is second
    assert second.time == 4.0
    assert [world.is_awake for world in together._worlds.values()] == [False, True, False, False]
    assert len(together.table("x")) == 4 * 6


def test_what_is_sent_is_answered_in_worlds_that_have_rested() -> None:
    together = worlds(seeds=2, over={}).run(2, quiet=True)
    asked = together.ask("id", wait=5)
    assert asked[1].values == {f"scout{number}": number for number in range(1, 7)}


def test_one_in_which_something_goes_wrong_is_left_out() -> None:
    together = worlds(seeds=2, over={})
    together._worlds[0].length_of_tick = 0.0
    together.run(1, quiet=True)
    assert together.failed.keys() == {0}
    assert [each.time for each in together] == [1.0]


def test_a_world_whose_robots_have_reported_a_failing_rule_stays_awake() -> None:
    together = worlds(seeds=1, over={})
    [world] = together._worlds.values()
    world.act(lambda fleet: fleet.station.failures.hear(0, {"rule": "home"}, 0.0))
    assert world.is_awake


def run_and_settle(fleet: sc.Fleet) -> None:
    """Run for 3 s, and wait for what is compiled beside it."""
    fleet.run(3, quiet=True)
    settle(fleet.swarm)


@pytest.mark.parametrize("scenario", ["bravo", "maze", "mixed", "recruit", "two-desks"])
def test_the_fleet_of_a_resting_world_is_gone_at_once(scenario: str) -> None:
    """At once: nothing is left for the collector of garbage, which does not run here."""
    alike = [sc.open_many(scenario, seeds=1, mission=True, quiet=True, threads=1) for _ in range(2)]
    first, second = (world for together in alike for world in together._worlds.values())
    first.act(run_and_settle)  # which imports, loads and compiles all that the second one needs
    while gc.collect():  # what ends may leave something, too
        pass
    gc.disable()
    try:
        second.act(run_and_settle)
        assert gc.collect() == 0
    finally:
        gc.enable()
    assert not second.is_awake
