"""What keeps simulated copters, planes and Crazyflies safe, and what befalls them: each is told in a sentence at the
desk and on the page, in the words of the bridges."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest

from console.asking import put
from sleepcast.console.adapters.swarm import SwarmAdapter
from sleepcast.console.backend import Backend
from sleepcast.console.driver import Driver
from sleepcast.console.features.send import Send
from sleepcast.console.outgoing import Safety, WatchedRobot
from sleepcast.core.clock import ManualClock
from sleepcast.loop import Pace, Swarm
from sleepcast.mind.authority import AT_REST
from sleepcast.robot import FENCE_AHEAD, REACHED_AGAIN, brought_to_rest, hovering
from sleepcast.simulator import read_scenario
from sleepcast.simulator.bodies.fences import HELD_BACK
from sleepcast.simulator.bodies.links import LOST
from sleepcast.simulator.motion.flying import AT_FENCE
from swarms import desk_of, swarm_of

SKY = """
format = 2
title = "a sky of three types"
seconds = "10min"
tick = "0.1s"

[world]
width = "400m"
height = "400m"

[[robots]]
like = "copter"
starts = [{ x = "100m", y = "100m", heading = "0deg", z = "8m" }]

[[robots]]
like = "plane"
starts = [{ x = "200m", y = "200m", heading = "0deg", z = "60m" }]

[[robots]]
like = "crazyflie"
starts = [{ x = "10m", y = "10m", heading = "0deg", z = "2m" }]
"""
COPTER, PLANE, TINY = range(3)
TYPES_OF = ("copter", "plane", "crazyflie")
TYPES = pytest.mark.parametrize("robot", [COPTER, PLANE, TINY])
MOVE = "(COND ((= id 1) (GOTO 300m 100m)) ((= id 2) (GOTO 300m 300m)) (1 (GOTO 20m 10m)))"


@dataclass
class Stand:
    """A swarm with its desk, and what a page is told of it."""

    swarm: Swarm
    page: Backend

    def told(self, robot: int) -> list[str]:
        """What the page shows of what a robot has reported, the oldest first, which the desk has heard."""
        name = self.swarm.simulator.names[robot]
        (shown,) = (news for news in self.page.news(robot) if isinstance(news, WatchedRobot))
        sentences = [each.text for each in reversed(shown.reports)]
        heard = [report.body["label"] for report in desk_of(self.swarm).reports if report.robot == name]
        assert sentences == heard
        return sentences

    def states(self, robot: int) -> list[str]:
        return next(news.state for news in self.page.news(robot) if isinstance(news, WatchedRobot))


def stand(*changes: tuple[str, str], more: str = "") -> Stand:
    """The sky, with these changes of its text, and more of it."""
    text = SKY + more
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    swarm, clock = swarm_of(read_scenario(text)), ManualClock()
    adapter = SwarmAdapter(swarm)
    return Stand(swarm, Backend(adapter, desk_of(swarm), Driver(adapter, Pace(clock, swarm, 1.0), clock), clock))


@TYPES
def test_the_end_of_the_operators_lease_and_what_it_does_then(robot: int) -> None:
    sky = stand(('like = "copter"', 'like = "copter"\nflight = { failsafe = "rtl" }'), more=OPERATORS)
    put(sky.page, Send, 1, MOVE, True)
    sky.swarm.run(0.8)
    assert sky.told(robot) == []
    sky.swarm.run(6.0)
    does = (hovering.FAILSAFES["rtl"], hovering.FAILSAFES_OF_PLANES["hover"], hovering.FAILSAFES["hover"])[robot]
    assert sky.told(robot) == [AT_REST, hovering.let_go(does)]


def test_stop_holds_all_of_them_in_the_air() -> None:
    sky = stand()
    put(sky.page, Send, 1, MOVE, True)
    sky.swarm.run(2.0)
    desk_of(sky.swarm).stop()
    sky.swarm.run(8.0)
    flight = sky.swarm.simulator.bodies.flight
    assert flight is not None
    assert flight.flying.tolist() == [1.0] * 3
    (safety,) = (news for news in sky.page.news(-1) if isinstance(news, Safety))
    assert safety.latched
    assert safety.sentence == "STOP: all 3 robots are at rest."
    assert [sky.states(robot) for robot in range(3)] == [["at rest"]] * 3


@TYPES
def test_fence_floor_and_ceiling_are_faults_in_the_words_of_the_bridges(robot: int) -> None:
    sky = stand()
    for place, sentence in (
        ("1000m 100m", "(1000, 100) m lies outside of the fence"),
        ("100m 100m 0.01m", "it flies from {:g} to {:g} m high, not at 0.01 m"),
        ("100m 100m 900m", "it flies from {:g} to {:g} m high, not at 900 m"),
    ):
        sent = desk_of(sky.swarm).send(f"(WHEN (= id {robot + 1}) (GOTO {place}))", everybody=True)
        sky.swarm.run(0.5)
        limits = sky.swarm.simulator.bodies.part_of(robot).limits
        (fault,) = desk_of(sky.swarm).accounting(sent.id).faults.values()
        assert sentence.format(limits.floor, limits.ceiling) in fault


def test_an_empty_battery_lands_them_and_is_told_once() -> None:
    empty = [(f'like = "{name}"', f'like = "{name}"\nflight = {{ hovers = "2s" }}') for name in TYPES_OF]
    sky = stand(*empty, ('z = "60m"', 'z = "40m"'))
    sky.swarm.run(1.5)
    assert [sky.told(robot) for robot in range(3)] == [[], [], []]
    sky.swarm.run(1.0)
    assert [sky.told(robot) for robot in range(3)] == [[hovering.exhausted(in_air=True)]] * 3
    assert sky.told(TINY) == ["its battery is empty: it lands"]
    assert sky.states(COPTER) == ["no battery left"]
    sky.swarm.run(25.0)
    assert [len(sky.told(robot)) for robot in range(3)] == [1, 1, 1]
    flight = sky.swarm.simulator.bodies.flight
    assert flight is not None
    assert flight.flying.tolist() == [0.0] * 3


OPERATORS = '[operators.anna]\nrole = "operator"\n[minds]\nlease = "1s"\n'
CUT = '[[events]]\nat = "1s"\ncut_off = "{}1"\nlasts = "5s"\n'


def test_setpoints_that_are_lost_stop_the_motors_of_a_crazyflie() -> None:
    sky = stand(more=CUT.format("crazyflie"))
    sky.swarm.run(8.0)
    assert sky.told(TINY) == [LOST, hovering.LOCKED_MOTORS, REACHED_AGAIN]


def test_a_link_that_is_lost_lets_a_copter_do_what_its_failsafe_says() -> None:
    sky = stand(more=CUT.format("copter"))
    sky.swarm.run(8.0)
    assert sky.told(COPTER) == [LOST, hovering.let_go("hovers"), REACHED_AGAIN]


def test_an_emergency_stop_locks_motors_and_is_told_once() -> None:
    sky = stand()
    for _ in range(2):
        put(sky.page, Send, 1, "(WHEN (= id 3) (MOTORS-OFF))", True)
        sky.swarm.run(1.0)
    assert sky.told(TINY) == [hovering.LOCKED_MOTORS]
    assert sky.swarm.simulator.sayings == [], "it has spoken nothing"


def test_a_crash_is_told_of_both_and_they_are_marked_as_crashed() -> None:
    beside = 'starts = [{ x = "101.5m", y = "100m", heading = "0deg", z = "8m" }, { x = "100m"'
    sky = stand(('starts = [{ x = "100m"', beside))
    put(sky.page, Send, 1, "(WHEN (= id 1) (GOTO 90m 100m))", True)
    sky.swarm.run(5.0)
    assert sky.told(0) == ["has crashed into copter2"]
    assert sky.told(1) == ["has crashed into copter1"]
    assert sky.states(0) == ["crashed"]
    flags = np.frombuffer(sky.page.driver.flags(), np.uint8)
    assert (flags & 64 > 0).tolist() == [True, True, False, False]


def test_a_wind_that_is_too_fast_is_told() -> None:
    sky = stand(more='[wind]\nuniform = { x = "9m/s" }\n')
    sky.swarm.run(1.0)
    carried = ["is carried away: the wind is faster than it flies"]
    assert (sky.told(COPTER), sky.told(PLANE), sky.told(TINY)) == (carried, [], carried)


@pytest.mark.parametrize(
    ("robot", "order", "sentence"),
    [
        (COPTER, "(SETQ drive_speed -5m/s)", brought_to_rest(FENCE_AHEAD)),
        (TINY, "(SETQ drive_side -1m/s)", brought_to_rest(FENCE_AHEAD)),
        (COPTER, "(SETQ drive_speed -5m/s) (SETQ drive_side 1m/s)", HELD_BACK),
    ],
)
def test_what_is_driven_against_its_fence_says_so_once_in_the_words_of_the_bridges(
    robot: int, order: str, sentence: str
) -> None:
    sky = stand()
    put(sky.page, Send, 1, f"(RULE on (WHEN (= id {robot + 1}) {order}))", True)
    simulator = sky.swarm.simulator
    for _ in range(400):
        sky.swarm.step()
        if min(simulator.x[robot], simulator.y[robot]) <= AT_FENCE:
            break
        assert sky.told(robot) == []
    assert sky.told(robot) == [sentence]
    sky.swarm.run(8.0)
    assert sky.told(robot) == [sentence]


def test_who_comes_back_to_its_fence_is_told_again_but_not_all_the_time() -> None:
    sky, held = stand(('x = "10m"', 'x = "1m"')), brought_to_rest(FENCE_AHEAD)

    def drive(speed: float, seconds: float) -> list[str]:
        put(sky.page, Send, 1, f"(WHEN (= id 3) (SETQ drive_speed {speed}m/s))", True)
        sky.swarm.run(seconds)
        return sky.told(TINY)

    assert drive(-0.2, 4.0) == []
    assert drive(-0.2, 2.0) == [held]
    assert drive(0.2, 1.0) == [held]
    assert drive(-0.2, 2.0) == [held]
    assert sky.swarm.simulator.x[TINY] == 0.0, "it has gone, and is there again"
    assert drive(0.2, 1.0) == [held]
    assert drive(0.0, 5.0) == [held]
    assert drive(-0.2, 2.0) == [held, held]
