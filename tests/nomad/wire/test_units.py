"""The Nomad's units: what stands on the wire for what is measured."""

from __future__ import annotations

from math import inf, nan, pi

import pytest
from hypothesis import given
from hypothesis import strategies as st

from sleepcast.nomad.wire import units


@given(st.integers(units.LEAST_WORD, units.GREATEST_WORD))
def test_a_word_that_comes_in_goes_out_again(word: int) -> None:
    assert units.tenths(units.metres(word)) == word
    assert units.tenth_degrees(units.radians(word)) == word


@given(st.floats())
def test_every_number_becomes_a_word(value: float) -> None:
    assert units.LEAST_WORD <= units.word(value) <= units.GREATEST_WORD


@pytest.mark.parametrize(("angle", "written"), [(0.0, 0), (pi / 2, 900), (-pi / 2, 2700), (2 * pi, 0), (-1e-9, 0)])
def test_a_direction_has_no_sign(angle: float, written: int) -> None:
    assert units.direction(angle) == written


@pytest.mark.parametrize(
    ("metres", "inches"), [(nan, 255), (inf, 255), (0.0, 6), (0.254, 10), (0.2413, 10), (0.2159, 8), (9.0, 255)]
)
def test_a_sonar_tells_whole_inches_within_its_limits(metres: float, inches: int) -> None:
    assert units.inches(metres) == inches


@pytest.mark.parametrize(("metres", "told"), [(nan, 15), (2.0, 15), (24 * 0.0254, 15), (0.3048, 8), (0.0, 0)])
def test_an_infrared_sensor_tells_0_to_15(metres: float, told: int) -> None:
    assert units.infrared(metres) == told


def test_the_clock_begins_anew_rather_than_grow_too_large() -> None:
    assert units.milliseconds(2254.561) == 0x2266E1
    assert units.milliseconds(2**31 / 1000.0 + 0.005) == 5


def test_speed_and_batteries() -> None:
    assert (units.pace(1.0), units.pace(2.0), units.pace(inf)) == (10, 20, units.GREATEST_WORD)
    assert (units.battery(0.0), units.battery(1.0), units.battery(7.0)) == (0, 255, 255)
