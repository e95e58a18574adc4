"""The roster: names, news and times, and a bound."""

from __future__ import annotations

from math import inf

import pytest

from sleepcast.station import UnknownRobotError, roster
from sleepcast.station.roster import Roster
from station.fleet import Fleet


def test_news_is_copied_so_that_it_stays_what_was_told(fleet: Fleet) -> None:
    fleet.report()
    fleet.minds["s3"].sense((0.0, 1.0, 1.0), 2.0)
    assert "s3" in fleet.station.preview("(WHEN (< fuel 50%) (MARK))").yes


def test_hearing_is_not_news() -> None:
    found = Roster(["s1"])
    place = found.hear("s1", 5.0)
    assert place == 0
    assert (found.heard[place], found.reported[place]) == (5.0, -inf)


def test_an_unknown_robot_is_named_with_what_might_be_meant() -> None:
    with pytest.raises(UnknownRobotError, match=r"did you mean scout12\?"):
        Roster(["scout12", "other"]).place("skout12")


def test_a_full_roster_takes_in_no_more_names(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(roster, "MAX_ROBOTS", 3)
    found = Roster(["a", "b", "c", "d"])
    assert found.hear("e", 1.0) is None
    assert list(found.names) == ["a", "b", "c"]


def test_names_that_one_key_invents_leave_room_for_robots_of_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """Robots may share a key, so whoever has it can speak as any number of them."""
    monkeypatch.setattr(roster, "MAX_ROBOTS", 6)
    monkeypatch.setattr(roster, "MAX_OF_KEY", 3)
    full = Roster()
    assert [full.hear(f"s{number}", 1.0, "key of s*") for number in range(5)] == [0, 1, 2, None, None]
    assert [full.hear(name, 2.0, "key of r*") for name in ("r1", "r2", "s1")] == [3, 4, 1]
    assert list(full.names) == ["s0", "s1", "s2", "r1", "r2"]
