"""How long ago something was."""

from __future__ import annotations

from math import inf, nan

import pytest

from sleepcast.core.ages import ago


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
