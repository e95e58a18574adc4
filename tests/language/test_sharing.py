"""Values that robots share: a row of nodes, each of which hears its neighbours, with losses."""

from __future__ import annotations

from collections.abc import Iterator
from random import Random

import pytest

from language.cases import Setting
from sleepcast.channel.message import Kind
from sleepcast.language import check
from sleepcast.node.node import Node

COUNT = 12


class Row:
    """Robots in a row: what one tells, the next on each side hears, unless it is lost."""

    def __init__(self, loss: float = 0.3) -> None:
        vocabulary = Setting().vocabulary()
        self.robots = [Node(f"r{i}", vocabulary, number=i, seed=3) for i in range(COUNT)]
        self.chance, self.loss, self.tick = Random(5), loss, 0
        self.tells = [0] * COUNT

    def do(self, text: str, which: Iterator[int] | range | None = None) -> None:
        for i in range(COUNT) if which is None else which:
            self.robots[i].run(check(text, self.robots[i]))

    def go(self, ticks: int) -> None:
        for _ in range(ticks):
            self.tick += 1
            for robot in self.robots:
                robot.think(self.tick, self.tick / 10)
            for i, robot in enumerate(self.robots):
                for message in (each for each in robot.outbox if each.kind is Kind.COMMAND):
                    self.tells[i] += 1
                    for j in (i - 1, i + 1):
                        if 0 <= j < COUNT and self.chance.random() >= self.loss:
                            self.robots[j].receive(message)
                robot.outbox.clear()

    def values(self, name: str) -> list[float]:
        return [dict(robot.variables())[name] for robot in self.robots]


def test_the_robot_with_the_highest_number_is_elected() -> None:
    row = Row()
    row.do("(PROGN (DEFVAR leader id) (RULE elect (SHARE leader MAX)))")
    row.go(600)
    assert row.values("leader") == [COUNT - 1] * COUNT


def test_a_step_makes_a_gradient() -> None:
    row = Row()
    row.do("(RULE field (SHARE hops MIN 1))")
    row.do("(SETQ hops 0)", range(3, 4))
    row.go(600)
    assert row.values("hops") == [abs(i - 3) for i in range(COUNT)]


def test_the_newest_value_wins_and_of_two_at_once_the_larger() -> None:
    row = Row()
    row.do("(RULE order (SHARE course NEWEST))")
    row.do("(SETQ course 9)", range(1))
    row.go(600)
    assert row.values("course") == [9] * COUNT
    row.do("(SETQ course 4)", range(COUNT - 1, COUNT))
    row.go(600)
    assert row.values("course") == [4] * COUNT
    row.do("(SETQ course 2)", range(1))
    row.do("(SETQ course 3)", range(COUNT - 1, COUNT))
    row.go(600)
    assert row.values("course") == [3] * COUNT


def test_who_has_no_such_rule_takes_the_value_and_does_not_hand_it_on() -> None:
    row = Row(loss=0)
    row.do("(PROGN (DEFVAR best id) (RULE gossip (SHARE best MAX)))", range(5))
    row.go(200)
    assert dict(row.robots[5].variables())["best"] == 4
    assert "best" not in dict(row.robots[6].variables())


@pytest.mark.parametrize("how", ["MAX", "NEWEST"])
def test_a_value_that_changes_all_the_time_is_told_twice_a_second(how: str) -> None:
    row = Row()
    row.do(f"(PROGN (DEFVAR n 0) (RULE count (SETQ n (+ n 1))) (RULE gossip (SHARE n {how})))")
    row.go(500)
    assert max(row.tells) <= 2 * 50 + 8
    quiet = Row()
    quiet.do(f"(PROGN (DEFVAR n 1) (RULE gossip (SHARE n {how})))")
    quiet.go(500)
    assert max(quiet.tells) <= 12
    assert min(quiet.tells) >= 10
