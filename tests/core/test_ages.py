"""How long ago something was."""

from __future__ import annotations

from math import inf, nan

import pytest

from sleepcast.core.ages import age, ago, duration


@pytest.mark.parametrize(
    ("seconds", "said"),
    [
        (0.0, "0 s ago"),
        (8.4, "8 s ago"),
        (119.0, "119 s ago"),
        (121.0, "2 min ago"),
        (7_300.0, "2 h ago"),
        (400_000.0, "5 days ago"),
        (-0.5, "0 s ago"),
        (-3_461.0, "at an unknown time, since a clock was wrong"),
    ],
)
def test_it_is_said_in_the_unit_in_which_people_think(seconds: float, said: str) -> None:
    assert ago(seconds) == said


@pytest.mark.parametrize("seconds", [inf, -inf, nan])
def test_whatever_comes_it_is_a_text(seconds: float) -> None:
    assert ago(seconds)


@pytest.mark.parametrize(
    ("seconds", "said"),
    [
        (0.0, "0 s"),
        (0.25, "0.25 s"),
        (59.4, "59.4 s"),
        (59.9, "1 min"),
        (125.0, "2 min 5 s"),
        (3_599.9, "1 h"),
        (86_339.0, "23 h 59 min"),
        (86_400.0, "24 h"),
        (400_000.0, "5 days"),
        (1.8e9, "57 years"),
        (1e300, "3.16881e+292 years"),
    ],
)
def test_a_duration_is_said_in_units_of_people(seconds: float, said: str) -> None:
    assert duration(seconds) == said


@pytest.mark.parametrize(
    ("seconds", "said"),
    [(-0.1, "0.0 s"), (0.5, "0.5 s"), (42.0, "42 s"), (119.0, "2 min"), (5_900.0, "98 min"), (7_300.0, "2 h")],
)
def test_an_age_has_room_in_a_column(seconds: float, said: str) -> None:
    assert age(seconds) == said
