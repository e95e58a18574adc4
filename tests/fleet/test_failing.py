"""Rules that fail: on which robots, and whether those have deactivated them."""

from __future__ import annotations

from math import inf

import numpy as np

from fleet.twins import vocabulary
from sleepcast.channel.message import RULE, Kind, Message
from sleepcast.fleet import Fleet
from sleepcast.fleet.failing import failing_rules
from sleepcast.mind.limits import MAX_FAULTS_IN_ROW


class Flock:
    """Six robots that think together."""

    def __init__(self) -> None:
        self.fleet = Fleet([f"r{i}" for i in range(6)], vocabulary())
        self.tick = self.sent = 0

    def think(self, ticks: int = 1) -> None:
        for _ in range(ticks):
            self.tick += 1
            self.fleet.think(self.tick, self.tick / 10)

    def do(self, text: str, ticks: int = 1) -> None:
        self.sent += 1
        self.fleet.receive(Message("desk", 1, self.sent, Kind.COMMAND, 0.0, text=text))
        self.think(ticks)

    def failing(self, since: float = inf) -> list[tuple[str, list[int], int, str]]:
        found = failing_rules(self.fleet.memory, since)
        return [(rule.name, rule.robots.tolist(), rule.inactive, rule.reason) for rule in found]


def test_nothing_fails_at_first() -> None:
    flock = Flock()
    flock.do("(RULE well (MARK))", 3)
    assert flock.failing() == []


def test_a_rule_that_fails_is_told_until_it_is_another_one() -> None:
    flock = Flock()
    flock.do("(WHEN (> id 4) (RULE Guard (/ 1 0)))")
    flock.do("(RULE all (MOD id 0))")
    fault = "division by zero in"
    assert flock.failing() == [
        ("all", [0, 1, 2, 3, 4, 5], 0, f"{fault} (MOD id 0)"),
        ("Guard", [4, 5], 0, f"{fault} (/ 1 0)"),
    ]
    flock.think(MAX_FAULTS_IN_ROW)
    assert [(name, inactive) for name, _, inactive, _ in flock.failing()] == [("all", 6), ("Guard", 2)]
    flock.do("(FORGET all)")
    assert [name for name, *_ in flock.failing()] == ["Guard"]
    flock.do("(WHEN (= id 5) (RULE guard (MARK)))")
    assert [robots for _, robots, *_ in flock.failing()] == [[5]]


def test_a_rule_that_works_again_does_not_fail() -> None:
    flock = Flock()
    flock.do("(RULE now (/ 1 (- id (MOD tick 8))))", 1)
    seen = set()
    for _ in range(8):
        seen |= {place for _, robots, *_ in flock.failing() for place in robots}
        assert all(len(robots) == 1 for _, robots, *_ in flock.failing())
        flock.think()
    assert seen == set(range(6))


def test_robots_name_the_rule_that_they_deactivate() -> None:
    flock = Flock()
    flock.do("(RULE Guard (/ 1 0))", MAX_FAULTS_IN_ROW)
    reports = [
        message for batch in flock.fleet.take_messages() for message in batch.messages() if message.kind is Kind.REPORT
    ]
    assert [report.body for report in reports] == [
        {"label": "rule Guard deactivated", "values": [], RULE: "Guard"} for _ in range(6)
    ]
    assert np.array_equal(failing_rules(flock.fleet.memory, inf)[0].robots, np.arange(6))


def test_a_rule_that_fails_now_and_then_keeps_failing_for_a_while() -> None:
    flock = Flock()
    flock.do("(RULE Guard (/ 1 (- 3 (MOD tick 10))))")
    flock.think(11)
    assert flock.failing() == []
    assert [(name, robots) for name, robots, *_ in flock.failing(0.3)] == [("Guard", [0, 1, 2, 3, 4, 5])]
    assert flock.failing(0.31) == [], "its last fault was at 0.3 s"
    for _ in range(25):
        flock.think()
        told = flock.failing(flock.tick / 10 - 1.0)
        assert [robots for _, robots, *_ in told] == [list(range(6))], "it fails once a second: nothing flickers"
    flock.do("(WHEN (> id 3) (FORGET guard))")
    assert [robots for _, robots, *_ in flock.failing(0.0)] == [[0, 1, 2]]
    flock.do("(WHEN (= id 1) (RULE guard (MARK)))")
    assert [robots for _, robots, *_ in flock.failing(0.0)] == [[1, 2]], "another rule of that name has had no fault"
