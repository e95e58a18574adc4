"""In which units people read expressions, and which of them are angles."""

from __future__ import annotations

from math import nan

import pytest

import sleepcast as sc
from sleepcast.api.fleet import SimulatedFleet
from sleepcast.core.model import HostFunction, Quantity
from sleepcast.language import Vocabulary, check
from sleepcast.language.learned_names import LearnedNames
from sleepcast.language.reading_units import report_in_words


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


UNITS = {
    "fuel": "%",
    "(- 1 fuel)": "%",
    "(MIN fuel 50%)": "%",
    "(IF (> id 2) fuel 0)": "%",
    "(ROUND fuel)": "%",
    "(* 2 fuel)": "",
    "(IF (> id 2) fuel heading)": "",
    "(IF (> id 2) fuel id)": "",
    "(IF (> id 2) fuel x)": "",
    "(IF (> id 2) x heading)": "",
    "(IF (> id 2) heading x)": "",
    "(IF (> id 2) x speed)": "",
    "(IF (> id 2) (* x y) 50%)": "",
    "(IF (> id 2) x mine)": "",
    "(IF (> id 2) x 0)": "mi",
    "(IF (> id 2) 0 x)": "mi",
    "(IF (> id 2) (/ x 2s) (* 2 speed))": "kn",
    "(COND ((> id 2) x) (TRUE heading))": "",
    "(MAX fuel id)": "",
    "(+ fuel id)": "",
    "(+ id heading)": "deg",
    "(+ 3cm 2m)": "cm",
    "x": "mi",
    "(DIST x y 0 0)": "mi",
    "(* 2 x)": "mi",
    "(* speed 10s)": "mi",
    "(* x y)": "",
    "3ft": "ft",
    "(- x 3ft)": "mi",
    "speed": "kn",
    "(/ x 2s)": "kn",
    "(/ speed 2s)": "m/s2",
    "time": "s",
    "heading": "deg",
    "(ABS (- heading 90deg))": "deg",
    "(> fuel 50%)": "",
    "id": "",
    "3": "",
    "mine": "",
}


def test_a_value_is_read_in_the_unit_of_what_it_is_made_of() -> None:
    station = sc.open("bravo", robots=2).station
    assert {text: station.check(text).unit for text in UNITS} == UNITS


def test_lengths_are_read_as_positions_are_and_without_them_in_metres() -> None:
    inches, nothing = Vocabulary("a", (Quantity("x", "m", shown_as="in"),)), Vocabulary("b")
    assert check("(* 2 3m)", LearnedNames(inches)).unit == "in"
    assert check("(* 2 3m)", LearnedNames(nothing)).unit == "m"


def test_what_is_reported_is_a_label_and_plain_numbers() -> None:
    assert report_in_words("low", [0.4312345678, nan, None]) == "low: 0.431235 unknown unknown"
    assert report_in_words("", [2.0]) == "2"
    assert report_in_words("here", []) == "here"
    assert report_in_words(None, "no list") == ""
    assert report_in_words("long", [10**400, 7]) == "long: unknown 7"


def test_the_unit_of_a_deep_expression_is_found_at_once(fleet: SimulatedFleet) -> None:
    deep = "(+ " * 30 + "heading" + " 1)" * 30
    assert fleet.station.check(deep).unit == "deg"
