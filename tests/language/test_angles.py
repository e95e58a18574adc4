"""Which expressions are angles."""

from __future__ import annotations

import pytest

import sleepcast as sc
from sleepcast.api.fleet import SimulatedFleet
from sleepcast.core.model import HostFunction, Quantity
from sleepcast.language import Vocabulary, check
from sleepcast.language.learned_names import LearnedNames


@pytest.fixture(scope="module")
def fleet() -> SimulatedFleet:
    return sc.open("couzin", robots=2)


@pytest.mark.parametrize(
    "text",
    [
        "heading",
        "(- heading 90deg)",
        "(+ 1 heading)",
        "90deg",
        "(ATAN2 y x)",
        "(BEARING x y 0 0)",
        "(WRAP id)",
        "(IF (> x 1) heading 0)",
        "(WHEN (> x 1) heading)",
        "(COND ((> x 1) 1) (TRUE (WRAP id)))",
        "(PROGN x heading)",
        "(LET ((a 1)) (+ a heading))",
        "(CLAMP heading -20deg 20deg)",
        "(MEAN_HEADING 5m)",
        "(GAP_BEARING 5m)",
    ],
)
def test_what_has_the_unit_of_one_is_one(fleet: SimulatedFleet, text: str) -> None:
    assert fleet.station.check(text).is_angle


@pytest.mark.parametrize(
    "text",
    [
        "x",
        "3",
        "50%",
        "(ABS (- heading 90deg))",
        "(* 2 heading)",
        "(SIN heading)",
        "(> heading 90deg)",
        "(GAP 5m)",
        "(CLAMP (/ x 1m) 0deg 20deg)",
        "(IF heading 1 0)",
        "(AND heading heading)",
        "(+",
        "(nothing-known heading)",
    ],
)
def test_other_numbers_are_none(fleet: SimulatedFleet, text: str) -> None:
    try:
        assert not fleet.station.check(text).is_angle
    except sc.errors.SleepcastError:
        assert text == "(+"


def test_the_unit_that_is_shown_counts_too() -> None:
    host = HostFunction("WIND", lambda body: 0.0, acts=False, unit="deg")
    vocabulary = Vocabulary("boat", (Quantity("roll", "", shown_as="deg"),), functions=(host,))
    assert all(check(text, LearnedNames(vocabulary)).is_angle for text in ("roll", "(WIND)"))
