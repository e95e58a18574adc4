"""Times of day: the next moment at which clocks here show one."""

from __future__ import annotations

from datetime import datetime

import pytest

from sleepcast.core.errors import MisuseError
from sleepcast.core.time_of_day import instant_of, time_of_day

NOON = datetime(2026, 6, 1, 12, 0, 0).timestamp()


@pytest.mark.parametrize(
    ("text", "later"),
    [("12:30:05", 1_805.0), ("12:00:00.5", 0.5), ("13:00", 3_600.0), ("12:00", 86_400.0), (" 00:10 ", 43_800.0)],
)
def test_a_time_of_day_is_the_next_moment_that_clocks_show(text: str, later: float) -> None:
    assert instant_of(text, NOON, 86_400.0) == pytest.approx(NOON + later)
    assert time_of_day(instant_of(text, NOON, 86_400.0)).startswith(text.strip()[:5])


@pytest.mark.parametrize(
    "text", ["noon", "24:00", "12:60", "12:30:60", "12", "-1:00", "12:30:05pm", "", "1" * 400, "²1:00"]
)
def test_what_is_no_time_of_day_is_refused_with_what_was_wanted(text: str) -> None:
    with pytest.raises(MisuseError, match="wanted hours, minutes and seconds, such as 12:30:05") as refused:
        instant_of(text, NOON, 86_400.0)
    assert len(str(refused.value)) < 200


@pytest.mark.parametrize(
    ("text", "told"),
    [
        (
            "11:58:59",
            "11:58:59 was 1 min 1 s ago, and next is in 23 h 59 min: wanted one within the next 1 h",
        ),
        ("18:30", "18:30 is in 6 h 30 min: wanted"),
    ],
)
def test_a_time_of_day_that_is_over_or_far_ahead_is_refused_in_hours_and_minutes(text: str, told: str) -> None:
    with pytest.raises(MisuseError, match=told):
        instant_of(text, NOON, 3_600.0)
