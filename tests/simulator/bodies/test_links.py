"""Links that a scenario cuts: what a body does on its own then, and what its mind and the desk learn of it."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from math import inf, isnan

import numpy as np
import pytest

import sleepcast as sc
from machines import MACHINES
from simulated import outcome, steps
from sleepcast import FleetEvent
from sleepcast.core.settings import SettingsError
from sleepcast.robot import DOES_NOTHING, OutOfReachError, Setpoint, hovering
from sleepcast.simulator import Simulator, read_scenario
from sleepcast.simulator.bodies.links import DRIVEN_ON, LOST
from sleepcast.simulator.engine import Machine
from sleepcast.simulator.snapshot import resume, state_of

SKY = """
format = 2
title = "a sky"
seconds = "2min"
tick = "0.1s"

[world]
width = "400m"
height = "400m"

[[robots]]
like = "crazyflie"
starts = [{ x = "10m", y = "10m", heading = "0deg", z = "2m" }, ["20m", "10m"]]

[[robots]]
like = "copter"
starts = [{ x = "100m", y = "100m", heading = "0deg", z = "8m" }, ["100m", "120m", "0deg"]]

[[robots]]
type = "rover"
body = { radius = "0.2m" }
limits = { speed = "0.5m/s", turn_rate = "1rad/s", acceleration = "1m/s2" }
motion = "still"
starts = [["50m", "50m", "0deg"]]

[[events]]
at = "1s"
cut_off = "ROBOT"
"""
TINY, TINY_BELOW, COPTER, COPTER_BELOW, ROVER = range(5)
FOREVER = inf


def sky(robot: str, lasts: float = FOREVER, failsafe: str = "hover", machine: Machine | None = None) -> Simulator:
    text = SKY.replace("ROBOT", robot) + (f'lasts = "{lasts}s"\n' if lasts < inf else "")
    text = text.replace('like = "copter"', f'like = "copter"\nflight = {{ failsafe = "{failsafe}" }}')
    return Simulator(read_scenario(text), machine=machine)


async def all_of(events: AsyncIterator[FleetEvent]) -> list[FleetEvent]:
    return [event async for event in events]


def said(simulator: Simulator) -> list[tuple[float, str]]:
    """What was said so far, and at the end of which second."""
    return [(round(saying.time + simulator.scenario.tick, 3), saying.text) for saying in simulator.news]


@pytest.mark.parametrize("machine", MACHINES)
def test_a_crazyflie_levels_out_and_its_motors_stop_for_good_after_two_seconds(machine: Machine) -> None:
    simulator = sky("crazyflie1", machine=machine)
    body, flight = simulator.robots[TINY], simulator.bodies.flight
    assert flight is not None
    body.act(Setpoint(0.5, 0.0))
    steps(simulator, 0.9)
    assert body.rest_state().speed == pytest.approx(0.5)
    steps(simulator, 0.7)
    assert body.rest_state().speed == 0.0, "it is level"
    steps(simulator, 1.3)
    assert flight.flying[TINY] == 1.0
    assert flight.z[TINY] == pytest.approx(2.0)
    steps(simulator, 1.0)
    assert flight.z[TINY] == 0.0, "it has fallen from 2 m"
    assert flight.flying[TINY] == flight.armed[TINY] == 0.0
    assert said(simulator) == [(1.0, LOST), (3.0, hovering.LOCKED_MOTORS)]


def test_one_that_is_reached_again_in_time_hovers_until_a_command_moves_it() -> None:
    simulator = sky("crazyflie1", lasts=1.9)
    body, flight = simulator.robots[TINY], simulator.bodies.flight
    assert flight is not None
    body.act(Setpoint(0.5, 0.0))
    steps(simulator, 10.0)
    assert flight.z[TINY] == pytest.approx(2.0)
    assert body.rest_state().speed == 0.0
    again = "the body is within reach again, and at rest until a command moves it"
    assert said(simulator) == [(1.0, LOST), (2.9, again)]
    body.act(Setpoint(0.5, 0.0))
    steps(simulator, 1.0)
    assert body.rest_state().speed == pytest.approx(0.5)


def test_on_the_ground_the_watchdog_stops_nothing() -> None:
    simulator = sky("crazyflie2", lasts=4.0)
    steps(simulator, 6.0)
    simulator.robots[TINY_BELOW].take_off(1.0)
    steps(simulator, 4.0)
    assert simulator.bodies.flight is not None
    assert simulator.bodies.flight.z[TINY_BELOW] == pytest.approx(1.0)


@pytest.mark.parametrize("machine", MACHINES)
def test_a_copter_flies_on_for_three_seconds_and_then_hovers(machine: Machine) -> None:
    simulator = sky("copter1", machine=machine)
    body = simulator.robots[COPTER]
    body.act(Setpoint(4.0, 0.0))
    steps(simulator, 3.9)
    assert body.rest_state().speed == pytest.approx(4.0)
    steps(simulator, 3.0)
    assert body.rest_state().speed == 0.0
    assert said(simulator) == [(1.0, LOST), (1.0 + DRIVEN_ON, "nobody drives it any more: it hovers")]


def test_its_failsafe_lands_it_also_while_its_mind_holds_it() -> None:
    simulator = sky("copter1", failsafe="land")
    body, flight = simulator.robots[COPTER], simulator.bodies.flight
    assert flight is not None
    steps(simulator, 2.0)
    body.hold(True)
    steps(simulator, 25.0)
    assert flight.z[COPTER] == 0.0
    assert flight.armed[COPTER] == flight.crashed[COPTER] == 0.0
    assert said(simulator)[-1] == (4.0, "nobody drives it any more: it lands")


@pytest.mark.parametrize("machine", MACHINES)
def test_or_returns_it_to_where_it_took_off_at_the_height_of_that(machine: Machine) -> None:
    text = SKY.replace("ROBOT", "copter2").replace('at = "1s"', 'at = "20s"')
    text = text.replace('like = "copter"', 'like = "copter"\nflight = { failsafe = "rtl" }')
    simulator = Simulator(read_scenario(text), machine=machine)
    body, flight = simulator.robots[COPTER_BELOW], simulator.bodies.flight
    assert flight is not None
    body.take_off(6.0)
    steps(simulator, 8.0)
    body.go_to(150.0, 150.0, 3.0)
    steps(simulator, 18.0)
    assert flight.z[COPTER_BELOW] == pytest.approx(6.0, abs=1.0)
    way = []
    for _ in range(600):
        simulator.step()
        way.append((float(simulator.x[COPTER_BELOW]), float(flight.z[COPTER_BELOW])))
    assert max(z for _, z in way) == pytest.approx(6.0)
    assert flight.z[COPTER_BELOW] == 0.0
    assert (simulator.x[COPTER_BELOW], simulator.y[COPTER_BELOW]) == pytest.approx((100.0, 120.0), abs=0.15)
    assert said(simulator)[-1] == (23.0, "nobody drives it any more: it returns home and lands")


def test_a_command_ends_the_way_home() -> None:
    simulator = sky("copter1", lasts=5.0, failsafe="rtl")
    body, flight = simulator.robots[COPTER], simulator.bodies.flight
    assert flight is not None
    body.go_to(150.0, 100.0)
    steps(simulator, 6.5)
    before = float(simulator.x[COPTER])
    steps(simulator, 1.0)
    assert simulator.x[COPTER] < before, "it goes on by itself, although the link is back"
    body.go_to(150.0, 100.0)
    steps(simulator, 60.0)
    assert (simulator.x[COPTER], flight.z[COPTER]) == pytest.approx((150.0, 8.0), abs=0.01)


def test_a_plane_circles_and_may_circle_at_home() -> None:
    for failsafe, wanted, home in (
        ("hover", "circles", False),
        ("rtl", "circles at home", True),
    ):
        text = SKY.replace("ROBOT", "plane1").replace('at = "1s"', 'at = "12s"').replace("400m", "900m")
        plane = f'like = "plane"\nflight = {{ failsafe = "{failsafe}" }}\n'
        plane += 'starts = [{ x = "450m", y = "450m", heading = "0deg", z = "60m" }]'
        rover = text[text.index('type = "rover"') : text.index("\n\n[[events]]")]
        simulator = Simulator(read_scenario(text.replace(rover, plane)))
        robot = len(simulator.robots) - 1
        simulator.robots[robot].go_to(800.0, 450.0)
        steps(simulator, 75.0)
        away = np.hypot(simulator.x[robot] - 450.0, simulator.y[robot] - 450.0)
        assert (away < 61.0) == home
        assert said(simulator)[-1][1] == f"nobody drives it any more: it {wanted}"


def test_a_rover_stands_and_rests_when_it_is_reached_again() -> None:
    simulator = sky("rover1", lasts=3.0)
    body = simulator.robots[ROVER]
    body.act(Setpoint(0.5, 0.0))
    steps(simulator, 0.9)
    assert body.rest_state().speed > 0.4
    steps(simulator, 2.0)
    assert body.rest_state().speed == 0.0
    steps(simulator, 3.0)
    assert body.rest_state().speed == 0.0
    body.act(Setpoint(0.5, 0.0))
    steps(simulator, 1.0)
    assert body.rest_state().speed > 0.4


def test_what_its_mind_asks_for_is_a_fault_and_what_it_senses_is_unknown() -> None:
    with sc.open(SKY.replace("ROBOT", "copter1") + 'lasts = "10s"\n') as fleet:
        events = asyncio.run(all_of(fleet.events(2.5)))
        assert isnan(fleet["z"][COPTER])
        assert isnan(fleet["x"][COPTER])
        assert fleet["z"][TINY] == pytest.approx(2.0)
        assert [(each.robot, each.text) for each in events] == [("copter1", LOST)]
        sent = fleet.send("(WHEN (= id 3) (LAND))")
        fleet.run(2.0)
        assert DOES_NOTHING in sent.account.faults["copter1"]
        fleet.run(10.0)
        assert fleet["z"][COPTER] == pytest.approx(8.0)


def test_neither_stop_nor_actuators_nor_functions_reach_it_but_stop_holds_when_it_is_back() -> None:
    simulator = sky("copter1", lasts=2.0)
    body = simulator.robots[COPTER]
    body.act(Setpoint(4.0, 0.0))
    steps(simulator, 1.5)
    body.act(Setpoint(0.0, 0.0))
    simulator.act("drive_speed", slice(None), np.zeros(5))
    simulator.robots.stop(np.array([COPTER]))
    functions = {each.name: each for each in simulator.model.functions}
    assert outcome(functions["LAND"].call, body) == (OutOfReachError, DOES_NOTHING)  # type: ignore[arg-type]
    steps(simulator, 1.0)
    assert body.rest_state().speed == pytest.approx(4.0)
    assert all(isnan(value) for value in body.sense().values)
    steps(simulator, 5.0)
    assert body.rest_state().speed == 0.0
    assert body.stopped
    body.act(Setpoint(4.0, 0.0))
    steps(simulator, 1.0)
    assert body.rest_state().speed == 0.0


def test_an_emergency_stop_for_all_reaches_it_by_the_radio() -> None:
    simulator = sky("crazyflie1")
    steps(simulator, 1.5)
    functions = {each.name: each for each in simulator.model.functions}
    cut_own: Callable[..., object] = functions["MOTORS-OFF"].call
    assert outcome(cut_own, simulator.robots[TINY]) == (OutOfReachError, DOES_NOTHING)  # type: ignore[arg-type]
    functions["ALL-MOTORS-OFF"].call(simulator.robots[TINY])
    steps(simulator, 0.2)
    assert simulator.bodies.flight is not None
    assert simulator.bodies.flight.flying[TINY] == 0.0


@pytest.mark.parametrize("when", [0.5, 2.0, 4.5, 9.0])
def test_a_snapshot_goes_on_with_a_link_that_is_cut(when: float) -> None:
    simulator = sky("copter1", lasts=6.0, failsafe="rtl")
    simulator.robots[COPTER].go_to(150.0, 100.0)
    steps(simulator, when)
    other = resume(state_of(simulator))
    assert other.bodies.cut_off.tolist() == simulator.bodies.cut_off.tolist()
    for each in (simulator, other):
        steps(each, 12.0)
    assert other.state_hash() == simulator.state_hash()
    assert said(other) == said(simulator)


@pytest.mark.parametrize(
    ("old", "new", "wanted"),
    [
        ('"ROBOT"', '"copter3"', 'events[0].cut_off: there is no robot called "copter3" (did you mean copter'),
        ('"ROBOT"', '"copter1"\nadd = "box"', "wanted one of add, remove, move and cut_off in each event"),
        ('"ROBOT"', '"copter1"\n[[events]]\nat = "2s"\ncut_off = "copter1"', "it is cut off already at that time"),
        ('type = "rover"', 'type = "rover"\nhatch = true', "robots that come and go are not cut off"),
    ],
)
def test_a_mistake_is_refused_in_a_sentence(old: str, new: str, wanted: str) -> None:
    assert old in SKY
    text = SKY.replace(old, new).replace("ROBOT", "copter1")
    with pytest.raises(SettingsError) as caught:
        read_scenario(text)
    assert wanted in str(caught.value)


def test_many_worlds_and_a_fork_come_to_the_same_as_one_alone() -> None:
    text = SKY.replace("ROBOT", "copter1") + 'lasts = "4s"\n'
    text = text.replace('like = "copter"', 'like = "copter"\nflight = { failsafe = "rtl" }')
    order = "(WHEN (> z 5m) (GOTO 150m 100m))"
    together = sc.open_many(text, seeds=2, quiet=True)
    together.send(order, wait=0)
    together.run(9, quiet=True)
    for number, plan in enumerate(together.plans):
        alone = sc.open(text, seed=plan.seed)
        alone.send(order, wait=0)
        fork = alone.run(3, quiet=True).fork()
        assert alone.run(6, quiet=True).snapshot() == fork.run(6, quiet=True).snapshot() == together[number].snapshot()
