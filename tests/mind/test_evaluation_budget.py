"""What evaluations may cost: whose messages wait for a later tick, and when STOP is looked for."""

from __future__ import annotations

import pytest

from sleepcast.channel import Kind, Message
from sleepcast.channel.message import Role
from sleepcast.core.clock import ManualClock
from sleepcast.mind.evaluation_budget import LOOK_EVERY, EvaluationBudget
from sleepcast.mind.limits import ALL_QUESTIONS_SHARE, QUESTIONS_SHARE, SECONDS_AT_ONCE

TICK = 0.1
EACH = 0.001
"""Seconds of an evaluation."""


class Measured:
    """A budget, and evaluations that take time: of the processor, and of everybody."""

    def __init__(self) -> None:
        self.clock, self.work, self.looks, self.number = ManualClock(), ManualClock(), 0, 0
        self.budget = EvaluationBudget(self.clock, self.work, self._look)

    def _look(self) -> None:
        self.looks += 1

    def message(self, sender: str, kind: Kind, role: Role) -> Message:
        self.number += 1
        return Message(sender, 1, self.number, kind, 0.0, text="1", role=role.value)

    def evaluated(self, sender: str, kind: Kind, role: Role, each: float = EACH, most: int = 1_000) -> float:
        """Seconds that messages of this sender get in this tick, if each takes so long."""
        took = 0.0
        for _ in range(most):
            message = self.message(sender, kind, role)
            if not self.budget.allows(message):
                break
            self.budget.evaluate(message, lambda _: self.work.advance(each))
            took += each
        return took

    def tick(self) -> None:
        self.clock.advance(TICK)
        self.budget.begin()


def test_who_asks_gets_a_share_of_the_time_and_all_who_ask_another() -> None:
    measured, took = Measured(), dict.fromkeys("abc", 0.0)
    for _ in range(50):
        for guest in took:
            took[guest] += measured.evaluated(guest, Kind.ASK, Role.OBSERVER)
        measured.tick()
    seconds = 50 * TICK
    assert max(took.values()) <= SECONDS_AT_ONCE + QUESTIONS_SHARE * seconds + EACH
    assert sum(took.values()) == pytest.approx(2 * SECONDS_AT_ONCE + ALL_QUESTIONS_SHARE * seconds, abs=0.1)


def test_commands_go_on_whoever_asks_and_whatever_robots_tell() -> None:
    measured = Measured()
    measured.evaluated("desk", Kind.ASK, Role.OPERATOR)
    told = [measured.evaluated(f"r{number}", Kind.COMMAND, Role.ROBOT) for number in range(3)]
    assert told == pytest.approx([SECONDS_AT_ONCE] * 2 + [0.0], abs=2 * EACH), "they share an account besides"
    assert measured.evaluated("desk", Kind.COMMAND, Role.OPERATOR, most=50) == pytest.approx(50 * EACH)


def test_who_has_had_a_long_evaluation_waits_until_its_time_has_passed() -> None:
    measured = Measured()
    measured.evaluated("a", Kind.ASK, Role.OBSERVER, SECONDS_AT_ONCE + 3.5 * QUESTIONS_SHARE * TICK, 1)
    waited = 0
    while not measured.evaluated("a", Kind.ASK, Role.OBSERVER, most=1):
        assert measured.budget.held_back
        measured.tick()
        waited += 1
    assert waited == 4


def test_stop_is_looked_for_after_each_evaluation_unless_that_was_a_moment_ago() -> None:
    measured = Measured()
    for _ in range(4):
        measured.clock.advance(1.1 * LOOK_EVERY)
        measured.evaluated("a", Kind.COMMAND, Role.OPERATOR, most=10)
    assert measured.looks == 4
