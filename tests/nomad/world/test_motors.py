"""Axes travel their ways to the end, within their limits, whatever they did before."""

from __future__ import annotations

from math import nan

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sleepcast.nomad.world.nomad_world import Motors
from sleepcast.robot import Axes

TICK = 0.02
MOST = Axes(1.0, 0.8, nan)
ACCELERATION = Axes(2.0, 1.0, nan)


def turn(motors: Motors, speeds: np.ndarray[tuple[int, ...], np.dtype[np.float64]], gone: list[float]) -> None:
    """One tick of free axes: `speeds` become those of the next tick, `gone` grows by the way of the first axis."""
    speeds[:] = motors.next_speeds(speeds, TICK)
    motors.count(speeds * TICK, speeds, TICK)
    gone[0] += float(speeds[0, 0]) * TICK


def moving(motors: Motors, speeds: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> bool:
    return motors.moving(0, Axes(*speeds[:, 0].tolist()))[0]


@settings(max_examples=25, deadline=None)
@given(st.floats(-3.0, 3.0), st.floats(0.05, 1.0), st.floats(0.2, 2.0), st.floats(-1.0, 1.0), st.integers(0, 60))
def test_a_way_ends_exactly_and_within_the_limits(
    way: float, cruise: float, acceleration: float, before: float, ticks: int
) -> None:
    motors, speeds, gone = Motors(1, MOST, ACCELERATION), np.zeros((3, 1)), [0.0]
    motors.keep_speeds(0, Axes(before))
    for _ in range(ticks):
        turn(motors, speeds, gone)
    begin, fast = gone[0], abs(float(speeds[0, 0]))
    motors.set_cruise(0, Axes(cruise))
    motors.set_acceleration(0, Axes(acceleration))
    motors.travel(0, Axes(way))
    for _ in range(20_000):
        last = float(speeds[0, 0])
        turn(motors, speeds, gone)
        now = float(speeds[0, 0])
        assert abs(now - last) <= acceleration * TICK + 1e-12
        assert abs(now) <= max(cruise, fast) + 1e-12
        if not moving(motors, speeds):
            break
    assert gone[0] - begin == pytest.approx(way, abs=1e-8)
    assert speeds[0, 0] == pytest.approx(0.0, abs=1e-8)


@settings(max_examples=25, deadline=None)
@given(st.floats(0.001, 3.0), st.floats(0.05, 1.0), st.floats(0.2, 2.0))
def test_from_rest_it_never_turns_back_and_takes_no_more_time_than_it_must(
    way: float, cruise: float, acceleration: float
) -> None:
    """A trapezoid takes way / fastest + fastest / acceleration, with the fastest that its cruise or its way allows."""
    motors, speeds, gone, ticks = Motors(1, MOST, ACCELERATION), np.zeros((3, 1)), [0.0], 0
    motors.set_cruise(0, Axes(cruise))
    motors.set_acceleration(0, Axes(acceleration))
    motors.travel(0, Axes(way))
    while moving(motors, speeds):
        turn(motors, speeds, gone)
        assert speeds[0, 0] >= -1e-9
        ticks += 1
    fastest = min(cruise, (way * acceleration) ** 0.5)
    assert ticks * TICK <= way / fastest + fastest / acceleration + 4 * TICK


def test_an_axis_that_a_body_lacks_stays_at_rest() -> None:
    motors, speeds, gone = Motors(2, MOST, ACCELERATION), np.zeros((3, 2)), [0.0]
    motors.keep_speeds(1, Axes(0.5, 0.5, 0.5))
    motors.travel(1, Axes(third=1.0))
    for _ in range(100):
        turn(motors, speeds, gone)
    assert speeds.T.tolist() == [[0.0, 0.0, 0.0], pytest.approx([0.5, 0.5, 0.0])]
    assert motors.moving(1, Axes(0.5, 0.5, 0.0)) == (True, True, False)


@pytest.mark.parametrize("odd", [0.0, -1.0, nan])
def test_what_is_no_acceleration_changes_nothing(odd: float) -> None:
    motors = Motors(1, MOST, ACCELERATION)
    motors.set_acceleration(0, Axes(odd, 0.5))
    assert motors.acceleration[:2, 0].tolist() == [2.0, 0.5]
    motors.set_acceleration(0, Axes(50.0, 50.0, 50.0))
    assert motors.acceleration[:2, 0].tolist() == [2.0, 1.0]
