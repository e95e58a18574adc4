"""How a value is written for people."""

from __future__ import annotations

from math import nan

import pytest

from sleepcast.core.units import value_in_words


@pytest.mark.parametrize(
    ("value", "unit", "shown"),
    [
        (0.9726716663131952, "%", "97.27 %"),
        (0.9726716663131952, "", "0.972672"),
        (1609.344, "mi", "1 mi"),
        (12345.678, "m", "12346 m"),
        (1234567.8, "", "1234568"),
        (999999.7, "", "1000000"),
        (1e15, "", "1e+15"),
        (0.0000123456, "m", "1.235e-05 m"),
        (-0.0, "deg", "0 deg"),
        (nan, "%", "unknown"),
        (None, "%", ""),
    ],
)
def test_a_value_is_rounded_and_has_its_unit(value: float | None, unit: str, shown: str) -> None:
    assert value_in_words(value, unit) == shown


def test_the_digits_can_be_chosen() -> None:
    assert value_in_words(6.4321, "kn", 3) == "12.5 kn"
