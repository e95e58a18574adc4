"""Series: samples over time, bounded, and what is made of the values of a fleet."""

from __future__ import annotations

from math import degrees, nan, pi
from typing import Any

import numpy as np
import pytest

from sleepcast.console.series import LEAST_EVERY, MAX_SAMPLES, QUANTILES, STATISTICS, Series, lines_of, sample_of
from sleepcast.console.values import Column
from sleepcast.language import Checked, Vocabulary, check
from sleepcast.language.learned_names import LearnedNames


def filled(seconds: float, step: float) -> Series:
    series = Series(1)
    for number in range(round(seconds / step)):
        time = number * step
        if series.due(time):
            series.take(time, [10.0 * time])
    return series


def test_samples_come_back_with_their_times() -> None:
    series = Series(2)
    series.take(0.0, [1.0, nan])
    series.take(1.0, [2.0, 5.0])
    assert series.after(-1.0) == [[0.0, 1.0], [1.0, 2.0], [None, 5.0]]
    assert series.after(0.0) == [[1.0], [2.0], [5.0]]


def test_a_long_run_is_thinned_and_covers_everything() -> None:
    series = filled(3_600.0, 0.1)
    times, values = series.after(-1.0)
    assert MAX_SAMPLES // 2 <= len(times) <= MAX_SAMPLES
    assert (times[0], values) == (0.0, [10.0 * float(time or 0.0) for time in times])
    assert float(times[-1] or 0.0) > 3_580.0
    gaps = np.diff(np.array(times, float))
    assert gaps.max() <= 2.0 * series.every
    assert series.thinned > 0
    assert filled(50.0, 0.1).every == LEAST_EVERY


def test_it_tells_how_close_together_the_samples_are() -> None:
    assert Series(1).told() == "0 samples"
    assert filled(10.0, 0.5).told() == "20 samples, one every 0.5 s"


def test_where_time_goes_back_the_future_is_forgotten() -> None:
    series = filled(10.0, 1.0)
    assert series.due(4.5)
    assert series.after(-1.0)[0] == [0.0, 1.0, 2.0, 3.0, 4.0]
    assert series.thinned == 1


def test_a_series_goes_on_from_a_time_and_what_came_later_is_another_future() -> None:
    series = filled(10.0, 1.0)
    following = series.until(4.0)
    assert not following.due(4.05)
    following.take(4.5, [7.0])
    assert following.after(-1.0) == [[0.0, 1.0, 2.0, 3.0, 4.0, 4.5], [0.0, 10.0, 20.0, 30.0, 40.0, 7.0]]
    assert following.thinned != series.thinned, "a page that knows the other one is told everything"
    assert series.since(4.5)[0] == [4.0, 5.0, 6.0, 7.0, 8.0, 9.0]
    assert series.since(-1.0)[0] == series.after(-1.0)[0]


class Given:
    """Values that a test gives."""

    def __init__(self, **columns: list[float]) -> None:
        self._columns = columns

    def of(self, text: str, robots: object = None) -> tuple[Column, int]:
        return np.array(self._columns[text]), 0

    def checked(self, text: str) -> Checked:
        angles = 3.0 in self._columns[text] and pi in self._columns[text]
        return check("(WRAP 0)" if angles else "0", LearnedNames(Vocabulary()))


def sampled(what: str, *, where: str = "", unit: str = "", **columns: list[float]) -> list[float]:
    values: Any = Given(**columns)
    return sample_of(values, what, "v", where, unit)


VALUES = [4.0, nan, 1.0, 3.0, 0.0]


@pytest.mark.parametrize(
    ("what", "expected"),
    [
        ("range", [2.0, 0.0, 4.0]),
        ("mean", [2.0]),
        ("median", [2.0]),
        ("min", [0.0]),
        ("max", [4.0]),
        ("sum", [8.0]),
        ("std", [np.std([4.0, 1.0, 3.0, 0.0])]),
        ("count", [3.0]),
        ("share", [0.6]),
    ],
)
def test_statistics_are_of_what_is_known(what: str, expected: list[float]) -> None:
    assert sampled(what, v=VALUES) == pytest.approx(expected)
    assert len(lines_of(what)) == len(expected)


def test_those_of_angles_lie_around_their_mean_direction() -> None:
    west = [3.0, nan, -3.0, pi]
    mean, low, high = sampled("range", v=west, unit="deg")
    assert abs(mean) == pytest.approx(180.0)
    assert (abs(low), high - low) == pytest.approx((degrees(3.0), 360.0 - 2.0 * degrees(3.0)))
    assert [sampled(what, v=west)[0] for what in ("min", "max")] == pytest.approx([3.0, -3.0])
    assert abs(sampled("median", v=west)[0]) == pytest.approx(pi)
    assert sampled("std", v=west) == pytest.approx([np.std([3.0 - pi, pi - 3.0, 0.0])], rel=0.01)
    assert len(sampled("quantiles", v=west)) == 5
    for what in STATISTICS:
        assert sampled(what, v=[0.0, pi, 3.0, 3.0 - pi]) == pytest.approx(
            [2.0 * 3.0] if what == "sum" else [nan] * len(lines_of(what)), nan_ok=True
        )


def test_quantiles_lie_around_the_median() -> None:
    values = [float(number) for number in range(101)]
    assert sampled("quantiles", v=values) == pytest.approx([50.0, 10.0, 25.0, 75.0, 90.0])
    assert lines_of("quantiles") == ["median", "10 %", "25 %", "75 %", "90 %"]
    assert len(QUANTILES) == 5


def test_a_test_and_a_unit() -> None:
    assert sampled("mean", where="w", v=VALUES, w=[1.0, 1.0, nan, 1.0, 0.0]) == [3.5]
    assert sampled("mean", unit="%", v=[0.5, 0.7]) == pytest.approx([60.0])


@pytest.mark.parametrize("what", STATISTICS)
def test_of_nothing_all_is_unknown(what: str) -> None:
    assert np.isnan(sampled(what, v=[nan])).all()
    assert sampled("count", v=[nan]) == [0.0]
    assert np.isnan(sampled("share", where="w", v=[1.0], w=[0.0])).all()
