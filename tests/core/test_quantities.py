"""Values with units: the same words in files, options and calls."""

from __future__ import annotations

import pytest

from sleepcast.core.quantities import QuantityError, in_si
from sleepcast.core.units import LENGTH, TIME


@pytest.mark.parametrize(("said", "meant"), [("30s", 30.0), ("2 min", 120.0), (5, 5.0), (0.5, 0.5), ("1.5 H", 5400.0)])
def test_a_value_may_have_its_unit_or_none(said: object, meant: float) -> None:
    assert in_si(said, TIME) == meant


@pytest.mark.parametrize("said", ["", "s", "5m", "5 parsecs", True, None, "nan", "inf", float("nan"), "1e999s", [5]])
def test_what_is_no_time_is_refused(said: object) -> None:
    with pytest.raises(QuantityError, match="wanted a time"):
        in_si(said, TIME)


def test_bounds_are_said_in_the_units_that_people_write() -> None:
    with pytest.raises(QuantityError, match=r"wanted a length from 1m to 3km, not \"5km\""):
        in_si("5km", LENGTH, 1.0, 3_000.0)
