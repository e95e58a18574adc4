"""Rules that robots report to have deactivated: reports may say anything."""

from __future__ import annotations

import pytest

from sleepcast.station.failures import MAX_RULES, RuleFailures


@pytest.mark.parametrize("body", [{}, {"rule": None}, {"rule": 7}, {"rule": ""}, {"rule": "x" * 65}, {"rule": ["r"]}])
def test_a_report_without_a_rule_says_nothing(body: dict[str, object]) -> None:
    failures = RuleFailures()
    failures.hear(3, body, 1.0)
    assert failures.robots == {}


def test_each_robot_counts_once_and_as_it_said_last() -> None:
    failures = RuleFailures()
    for place, name, now in ((3, "Guard", 1.0), (4, "guard", 2.0), (3, "GUARD", 5.0)):
        failures.hear(place, {"rule": name}, now)
    assert failures.robots == {"guard": {3: 5.0, 4: 2.0}}
    assert failures.names == {"guard": "GUARD"}


def test_so_many_rules_are_remembered_and_no_more() -> None:
    failures = RuleFailures()
    for number in range(MAX_RULES + 9):
        failures.hear(0, {"rule": f"r{number}"}, 1.0)
    failures.hear(1, {"rule": "r0"}, 2.0)
    assert len(failures.robots) == MAX_RULES
    assert failures.robots["r0"] == {0: 1.0, 1: 2.0}
