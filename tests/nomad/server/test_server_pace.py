"""How fast time goes, and how much the terminal is told."""

from __future__ import annotations

from math import inf

import pytest

from sleepcast.core.clock import ManualClock
from sleepcast.nomad.server.nserver import BURST, LONGEST_DEBT, STANDSTILL, ServerPace, ThrottledLog

TICK = 0.02


def ticks(pace: ServerPace) -> int:
    pace.look(TICK)
    count = 0
    while count < 10_000 and pace.due(TICK):
        count += 1
    return count


@pytest.mark.parametrize(("speed", "made"), [(1.0, 10), (2.0, 20), (0.5, 5), (0.0, 0)])
def test_as_many_ticks_are_due_as_time_has_passed(speed: float, made: int) -> None:
    clock = ManualClock()
    pace = ServerPace(clock, speed)
    total = 0
    for _ in range(20):
        clock.advance(0.01)
        total += ticks(pace)
    assert total in (made, made - 1)  # the last may be a rounding error away


def test_what_could_not_be_kept_up_with_is_let_go() -> None:
    clock = ManualClock()
    pace = ServerPace(clock)
    clock.advance(10.0)
    assert ticks(pace) == int(LONGEST_DEBT / TICK)
    assert pace.let_go == pytest.approx(10.0 - LONGEST_DEBT)


def test_how_long_to_wait() -> None:
    clock = ManualClock()
    pace = ServerPace(clock)
    assert pace.wait(TICK) == pytest.approx(TICK)
    pace.speed = 2.0
    assert pace.wait(TICK) == pytest.approx(TICK / 2)
    pace.speed = 0.0
    assert pace.wait(TICK) == STANDSTILL
    pace.speed = 0.01
    assert pace.wait(TICK) == STANDSTILL
    pace.speed = inf
    assert pace.wait(TICK) == 0.0
    assert pace.due(TICK)


def test_a_flood_of_lines_is_left_out_and_counted() -> None:
    said: list[str] = []
    clock = ManualClock()
    notes = ThrottledLog(said.append, clock)
    for number in range(1000):
        notes(f"line {number}")
    assert said == [f"line {number}" for number in range(BURST)]
    clock.advance(60.0)
    notes("at last")
    assert said[BURST:] == [f"... and {1000 - BURST} more lines that are left out", "at last"]
