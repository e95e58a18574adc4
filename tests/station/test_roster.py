"""The roster: names, news and times, and a bound."""

from __future__ import annotations

import pytest

from sleepcast.station import UnknownRobotError, roster
from sleepcast.station.roster import Roster
from station.fleet import Fleet


def test_news_is_copied_so_that_it_stays_what_was_told(fleet: Fleet) -> None:
    found = Roster()
    node = fleet.minds["s3"]
    found.observe(1.0, [node])
    told = found["s3"].values
    node.sense((0.0, 1.0, 1.0), 2.0)
    assert told is not None
    assert told is not node.values
    assert told[node.vocabulary.first_sensor + 1] == 0.3


def test_hearing_is_not_news() -> None:
    found = Roster(["s1"])
    found.hear("s1", 5.0)
    assert (found["s1"].heard, found["s1"].values) == (5.0, None)


def test_an_unknown_robot_is_named_with_what_might_be_meant() -> None:
    with pytest.raises(UnknownRobotError, match=r"did you mean scout12\?"):
        Roster(["scout12", "other"])["skout12"]


def test_a_full_roster_takes_in_no_more_names(monkeypatch: pytest.MonkeyPatch, fleet: Fleet) -> None:
    monkeypatch.setattr(roster, "MAX_ROBOTS", 3)
    found = Roster(["a", "b", "c", "d"])
    found.hear("e", 1.0)
    found.observe(1.0, fleet.minds.values())
    assert found.names() == ("a", "b", "c")
