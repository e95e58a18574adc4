"""A simulated body with a world of its own, whose time goes with a clock."""

from __future__ import annotations

from pathlib import Path

import pytest

from sleepcast.core.clock import ManualClock
from sleepcast.robot import Setpoint
from sleepcast.simulator import Simulator, SingleRobot, read_scenario
from sleepcast.simulator.single_robot import MAX_AT_ONCE
from sleepcast.testing.robot_contract import Rig, RobotContract
from small_worlds import simulator


class TestContract(RobotContract):
    @pytest.fixture
    def rig(self, tmp_path: Path) -> Rig:
        clock, world = ManualClock(50.0), simulator(tmp_path)
        body = SingleRobot(world, clock)
        world.place(0, 500.0, 500.0, 0.3)

        def wait(seconds: float) -> None:
            for _ in range(round(seconds / 0.1)):
                clock.advance(0.1)
                body.sense()

        return Rig(body, wait)


SKY = """
format = 2
title = "a sky"
seconds = "1min"

[world]
width = "1km"
height = "1km"

[robots]
like = "copter"
starts = [{ x = "500m", y = "500m", z = "8m" }]
"""


class TestFlyingContract(RobotContract):
    @pytest.fixture
    def rig(self) -> Rig:
        clock = ManualClock(50.0)
        body = SingleRobot(Simulator(read_scenario(SKY)), clock)

        def wait(seconds: float) -> None:
            for _ in range(round(seconds / 0.1)):
                clock.advance(0.1)
                body.sense()

        return Rig(body, wait)


def test_its_time_goes_with_the_clock_and_what_it_cannot_make_up_for_is_let_go(tmp_path: Path) -> None:
    clock, world = ManualClock(7.0), simulator(tmp_path)
    with SingleRobot(world, clock) as body:
        assert body.sense().time == 0.0
        clock.advance(0.5)
        assert body.sense().time == pytest.approx(0.5)
        clock.advance(60.0)
        assert body.sense().time == pytest.approx(0.5 + 0.1 * MAX_AT_ONCE)
        clock.advance(0.1)
        assert body.sense().time == body.now() == pytest.approx(0.6 + 0.1 * MAX_AT_ONCE)
        body.act(Setpoint(3.0, 0.0))
    assert body.stopped


def test_in_step_each_look_is_a_tick(tmp_path: Path) -> None:
    body = SingleRobot(simulator(tmp_path), None)
    assert [body.sense().time for _ in range(3)] == pytest.approx([0.1, 0.2, 0.3])
