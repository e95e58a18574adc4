"""Times and ticks: one meaning for moments and for lengths."""

from fractions import Fraction
from math import ceil

import pytest

from sleepcast.core.ticks import Carried, Every, nearest_ticks, tick_at

TICKS = ("0.1", "0.07", "0.03", "0.5", "1")


@pytest.mark.parametrize("tick", TICKS)
def test_a_moment_falls_on_the_first_tick_that_ends_at_it_or_later(tick: str) -> None:
    for cents in range(0, 3_000, 7):
        exactly = ceil(Fraction(cents, 100) / Fraction(tick))
        assert tick_at(cents / 100, float(tick)) == exactly, cents


@pytest.mark.parametrize("tick", TICKS)
@pytest.mark.parametrize("every", ["0.25", "0.1", "0.21", "10", "0.01", "0.333"])
def test_what_is_due_is_the_first_tick_at_each_multiple(every: str, tick: str) -> None:
    due = Every(float(every), float(tick))
    step, last = Fraction(every) / Fraction(tick), 300
    wanted = {ceil(number * step) for number in range(ceil(last / step) + 1)}
    assert {number for number in range(last + 1) if due.due(number)} == {each for each in wanted if each <= last}
    assert all(due.following(number) == min(each for each in wanted if each > number) for number in range(0, last, 9))


def test_whole_ticks_stay_due_after_a_long_time() -> None:
    due = Every(10.0, 0.1)
    assert [number for number in range(100_000_000, 100_000_400) if due.due(number)] == [
        100_000_000 + 100 * step for step in range(4)
    ]


@pytest.mark.parametrize(
    ("seconds", "tick", "times"),
    [
        *[("0.05", "0.1", 2), ("0.1", "0.07", 100), ("0.1", "0.07", 20_000), ("0.3", "0.1", 20_000)],
        *[("0.01", "0.07", 7), ("0.001", "1", 10_000), ("0.33", "0.5", 3_000), ("1e-6", "0.1", 100_000)],
    ],
)
def test_many_short_lengths_are_as_long_as_one(seconds: str, tick: str, times: int) -> None:
    carried = Carried(float(tick))
    found = sum(carried.ticks(float(seconds)) for _ in range(times))
    assert found == round(times * Fraction(seconds) / Fraction(tick))
    assert abs(carried.rest) <= 0.5


def test_the_first_length_is_the_nearest_number_of_ticks() -> None:
    for cents in range(2_000):
        assert Carried(0.1).ticks(cents / 100) == nearest_ticks(cents / 100, 0.1) == round(cents / 100 / 0.1)
