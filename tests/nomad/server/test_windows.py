"""What the windows show, bounded, and what a client can have erased."""

from __future__ import annotations

from dataclasses import replace
from math import isnan, nan, pi

import pytest

from sleepcast.nomad.server.windows import LAYERS, MAX_ECHOES, MAX_HISTORY, MAX_SKETCHES, MAX_TRACE, Sketch, Windows
from sleepcast.robot import Axes, Condition, Pose

RADIUS = 0.2


def condition(x: float, sonars: tuple[float, ...] = (nan,) * 4, slip: float = 0.0) -> Condition:
    rest = Axes(0.0, 0.0, 0.0)
    real, believed = Pose(x + slip, 0.0, pi / 2, pi / 2), Pose(x, 0.0, pi / 2, pi / 2)
    return Condition(0.0, believed, real, rest, (False, False, False), sonars, (), (), 1.0)


def test_a_trace_grows_when_the_body_has_moved_and_forgets_its_beginning() -> None:
    window = Windows(1).robots[0]
    for step in range(10):
        window.look(condition(0.006 * step, slip=1.0), RADIUS)
    assert list(window.encoder) == [(0.0, 0.0), (0.024, 0.0), (0.048, 0.0)]
    assert list(window.actual) == [(1.0, 0.0), (1.024, 0.0), (1.048, 0.0)]
    for step in range(3000):
        window.look(condition(float(step)), RADIUS)
    assert (len(window.encoder), window.encoder[-1]) == (MAX_TRACE, (2999.0, 0.0))


def test_echoes_are_placed_by_where_the_robot_believes_to_be() -> None:
    window = Windows(1).robots[0]
    window.look(condition(3.0, (1.0, nan, 2.0, 255 * 0.0254), slip=0.5), RADIUS)
    assert [pytest.approx(echo) for echo in window.echoes] == [(3.0, 1.2), (3.0, -2.2)]
    window.look(condition(3.0, (1.0, 0.5, 2.0, 255 * 0.0254)), RADIUS)
    assert window.echoes[-1] == pytest.approx((2.3, 0.0))
    assert len(window.echoes) == 3
    for step in range(2000):
        window.look(condition(3.0, (1.0 + 1e-6 * step, nan, nan, nan)), RADIUS)
    assert len(window.echoes) == MAX_ECHOES


def test_layers_are_erased_one_by_one_and_graphics_for_everybody() -> None:
    windows = Windows(2)
    for window in windows.robots:
        window.look(condition(0.0, (1.0, 1.0, 1.0, 1.0)), RADIUS)
    for number in range(MAX_SKETCHES + 5):
        windows.sketches.append(Sketch("line", (0.0, 0.0, 1.0, float(number)), 1))
    assert len(windows.sketches) == MAX_SKETCHES
    windows.erase(0, ["actual"])
    assert (len(windows.robots[0].actual), len(windows.robots[0].encoder), len(windows.robots[1].actual)) == (0, 1, 1)
    windows.erase(0, LAYERS)
    assert [len(each) for each in (windows.robots[0].encoder, windows.robots[0].echoes, windows.sketches)] == [0, 0, 0]
    assert windows.robots[0].erased == dict.fromkeys(LAYERS, 1) | {"actual": 2}
    assert windows.robots[1].erased == dict.fromkeys(LAYERS, 0) | {"graphics": 1}


def test_a_trace_has_a_gap_where_the_robot_was_put_elsewhere() -> None:
    window = Windows(1).robots[0]
    window.lift(window.actual)  # nothing is there yet, so there is no gap
    window.look(condition(0.0), RADIUS)
    for _ in range(2):  # one gap is enough
        window.lift(window.encoder)
    window.look(condition(0.0), RADIUS)  # not even a step away
    assert list(window.actual) == [(0.0, 0.0)]
    assert [isnan(x) for x, _ in window.encoder] == [False, True, False]


def test_the_last_minute_of_the_sensors_is_kept() -> None:
    window = Windows(1).robots[0]
    for tick in range(4000):  # 80 s
        felt = (0.5,) if tick == 3901 else ()  # between two looks, and over at the next one
        window.look(replace(condition(0.0, (tick / 1000, nan)), time=0.02 * tick, touched=felt), RADIUS)
    assert len(window.far) == MAX_HISTORY
    assert window.far[0].time == pytest.approx(window.far[-1].time - 60.0, abs=1.0)
    assert window.far[-1].ranges[0] == pytest.approx(4.0, abs=0.03)
    assert [look.time for look in window.near if look.touched] == [pytest.approx(78.02)]
    window.erase(["bumper"])
    assert (len(window.far), len(window.near)) == (MAX_HISTORY, 0)
    window.erase(["sonar"])
    assert len(window.far) == 0
