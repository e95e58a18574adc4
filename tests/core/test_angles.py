"""Statistics of angles: around the half turn as around 0, and unknown where directions cancel."""

from __future__ import annotations

from math import isnan, log, pi, sqrt

import numpy as np
import pytest

from sleepcast.core.angles import around_mean, deviation, mean_direction, quantile, widest_gap, wrapped
from sleepcast.core.units import is_angle

WEST = np.radians([178.0, -179.0, 179.0, -178.0])
"""Four directions around the west."""
EAST = WEST + pi
"""The same around the east, where plain numbers have the same statistics."""


def test_west_has_the_statistics_of_east_half_a_turn_on() -> None:
    assert mean_direction(EAST) == pytest.approx(0.0)
    assert abs(mean_direction(WEST)) == pytest.approx(pi)
    assert deviation(WEST) == pytest.approx(deviation(EAST))
    assert deviation(EAST) == pytest.approx(np.radians([2.0, 1.0, -1.0, -2.0]).std(), rel=1e-3)
    for share, degrees in ((0.0, 178.0), (0.25, 178.75), (0.5, 180.0), (1.0, -178.0)):
        assert abs(wrapped(np.array(quantile(WEST, share) - np.radians(degrees)))) < 1e-12
    assert np.ptp(around_mean(WEST)) == pytest.approx(np.radians(4.0))


def test_the_deviation_is_the_circular_one() -> None:
    quarter = np.array([0.0, pi / 2])
    assert deviation(quarter) == pytest.approx(sqrt(-2.0 * log(sqrt(0.5))))
    assert str(deviation(np.full(7, 2.5))) == "0.0", "not -0.0, which tables would show"


@pytest.mark.parametrize("angles", [[], [0.0, pi], [-pi / 2, pi / 2], [0.1, 0.1 + pi], [0.0, 2 * pi / 3, 4 * pi / 3]])
def test_directions_that_cancel_have_no_mean_and_nothing_measured_from_it(angles: list[float]) -> None:
    values = np.array(angles)
    assert isnan(mean_direction(values))
    assert isnan(deviation(values))
    assert np.isnan(around_mean(values)).all()
    if angles:
        assert isnan(quantile(values, 0.5))


def test_a_gap_goes_around() -> None:
    assert widest_gap(np.radians([0.0, 90.0, -90.0])) == pytest.approx(pi)
    assert widest_gap(np.array([1.0])) == pytest.approx(2 * pi)


def test_an_angle_is_known_by_its_unit() -> None:
    assert [unit for unit in ("deg", "rad", "%", "", "deg/s", "m") if is_angle(unit)] == ["deg", "rad"]
