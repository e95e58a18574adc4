"""Many bodies at once are asked for what each of them is asked for alone."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from sleepcast.core.settings import SettingsError
from sleepcast.loop import Swarm
from sleepcast.simulator import Changes, Simulator, find_scenario
from sleepcast.simulator.bodies.body import Body
from sleepcast.simulator.simulation import Robots
from small_worlds import scouts, simulator

SOME = np.array([1, 4, 5, 11, 19])
FIRST, SECOND = np.array([0.3, -1.0, 2.0, 0.0, 9.0]), np.array([0.1, 2.0, -0.4, 3.0, 0.0])

Deed = Callable[[Body, int], float | None]
Deeds = Callable[[Robots], object]
CASES: dict[str, tuple[Deed, Deeds]] = {
    "drive": (
        lambda body, i: body.drive(float(FIRST[i]), float(SECOND[i])),
        lambda robots: robots.drive(SOME, FIRST, SECOND),
    ),
    "go_to": (
        lambda body, i: body.go_to(float(900 * FIRST[i]), float(300 * SECOND[i])),
        lambda robots: robots.go_to(SOME, 900 * FIRST, 300 * SECOND),
    ),
    "wander": (lambda body, i: body.wander(), lambda robots: robots.wander(SOME)),
    "halt": (lambda body, i: body.halt(), lambda robots: robots.halt(SOME)),
    "tumble": (lambda body, i: body.tumble(), lambda robots: robots.tumble(SOME)),
    "stop": (lambda body, i: body.stop(), lambda robots: robots.stop(SOME)),
    "release": (lambda body, i: body.release(), lambda robots: robots.release(SOME)),
    "hold": (lambda body, i: body.hold(i % 2 == 0), lambda robots: robots.hold(SOME, np.arange(5) % 2 == 0)),
    "sonar": (lambda body, i: body.sonar(float(i)), lambda robots: robots.sonar(SOME, np.arange(5.0))),
    "sonar of a huge number": (
        lambda body, i: body.sonar(float(-7e29 * i)),
        lambda robots: robots.sonar(SOME, -7e29 * SOME),
    ),
    "nearest": (
        lambda body, i: body.nearest(float(FIRST[i]), float(FIRST[i] + SECOND[i])),
        lambda robots: robots.nearest(SOME, FIRST, FIRST + SECOND),
    ),
}


def moving(sim: Simulator) -> Simulator:
    """A simulator in which bodies do this and that, and some are stopped."""
    for number in (4, 7, 11):
        sim.robots[number].drive(1.0, 0.3)
    sim.robots[5].tumble()
    sim.robots[11].stop()
    sim.step()
    return sim


@pytest.fixture(params=["rovers", "scouts"])
def twins(request: pytest.FixtureRequest, tmp_path: Path) -> tuple[Simulator, Simulator]:
    def make() -> Simulator:
        if request.param == "scouts":
            return moving(Simulator(find_scenario("crowd", Changes(robots=20))))
        return moving(simulator(tmp_path))

    return make(), make()


@pytest.mark.parametrize("name", CASES)
def test_many_do_what_each_does(twins: tuple[Simulator, Simulator], name: str) -> None:
    one_by_one, at_once = twins
    each, many = CASES[name]
    wanted = [each(one_by_one.robots[number], i) for i, number in enumerate(SOME.tolist())]
    found = many(at_once.robots)
    assert (wanted == [None] * 5 and found is None) or np.array_equal(np.array(wanted), np.asarray(found))
    for _ in range(3):
        assert at_once.state_hash() == one_by_one.state_hash()
        at_once.step()
        one_by_one.step()


def test_wheels_turn_alike() -> None:
    one_by_one, at_once = (moving(Simulator(find_scenario("crowd", Changes(robots=20)))) for _ in range(2))
    for i, number in enumerate(SOME.tolist()):
        one_by_one.robots[number].turn_wheels(float(FIRST[i]), float(SECOND[i]))
    at_once.robots.turn_wheels(SOME, FIRST, SECOND)
    assert at_once.state_hash() == one_by_one.state_hash()


def test_wheels_turn_in_tenths_of_inches_where_the_scenario_says_so(tmp_path: Path) -> None:
    standard, nomad = scouts(tmp_path), scouts(tmp_path, ("seed = 3", 'seed = 3\nvocabulary = "nomad"'))
    Swarm(standard).evaluate("scout1", "(VM 7.5in/s 5in/s)")
    Swarm(nomad).evaluate("scout1", "(VM 75 50)")
    standard.step(), nomad.step()
    assert nomad.robots[0].sense().values == pytest.approx(standard.robots[0].sense().values)
    assert standard.robots[0].sense().values[3] > 0
    function = next(function for function in nomad.model.functions if function.name == "VM")
    assert "tenths of inches" in function.doc
    with pytest.raises(SettingsError, match="vocabulary"):
        scouts(tmp_path, ("seed = 3", 'vocabulary = "nomads"'))


def test_bodies_are_there_by_index_from_either_end(tmp_path: Path) -> None:
    sim = simulator(tmp_path)
    assert [body.number for body in sim.robots[2:5]] == [2, 3, 4]
    assert sim.robots[-1].number == len(sim.robots) - 1
    with pytest.raises(IndexError):
        sim.robots[20]
