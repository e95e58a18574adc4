"""Questions without end: what they may take of a robot's time, and of the room in which others wait."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from language.cases import Setting
from sleepcast.channel.message import Kind, Message, Role
from sleepcast.core.clock import ManualClock
from sleepcast.mind.evaluation_budget import EvaluationBudget
from sleepcast.mind.limits import MAX_QUESTIONS, MAX_QUEUE, SECONDS_AT_ONCE
from sleepcast.node.node import MAX_BACKLOG, Node

TICK = 0.1
EACH = 0.01
"""Seconds that every evaluation takes."""


class Slow:
    """A robot that takes its time."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.clock, self.work, self.numbers, self.ticks = ManualClock(), ManualClock(), 0, 0
        self.robot = Node("r1", Setting().vocabulary(), on_air=True)
        self.robot.budget = EvaluationBudget(self.clock, self.work, lambda: None)
        obey: Callable[[Message, float], None] = self.robot._obey

        def slow(message: Message, now: float) -> None:
            self.work.advance(EACH)
            obey(message, now)

        monkeypatch.setattr(self.robot, "_obey", slow)

    def hear(self, sender: str, kind: Kind, text: str, role: Role, issued: float = 0.0) -> Message:
        self.numbers += 1
        found = Message(sender, 1, self.numbers, kind, issued, text=text, role=role.value)
        self.robot.receive(found)
        return found

    def ask(self, count: int, sender: str = "guest") -> None:
        for _ in range(count):
            self.hear(sender, Kind.ASK, "(+ 1 1)", Role.OBSERVER)

    def tick(self) -> list[tuple[str, object]]:
        """Whom it answers in one tick, and what."""
        self.ticks += 1
        self.clock.advance(TICK)
        assert self.robot.budget is not None
        self.robot.budget.begin()
        self.robot.think(self.ticks, self.ticks * TICK)
        said = self.robot.take_outbox()
        return [(str(message.body["command"]).partition("-")[0], message.body["outcome"]) for message in said]


@pytest.fixture
def slow(monkeypatch: pytest.MonkeyPatch) -> Slow:
    return Slow(monkeypatch)


def test_an_operator_is_answered_in_the_same_tick_whatever_others_ask(slow: Slow) -> None:
    slow.ask(MAX_QUESTIONS)
    slow.hear("desk", Kind.COMMAND, "(MARK)", Role.OPERATOR, issued=1.0)
    slow.hear("desk", Kind.ASK, "marked", Role.OPERATOR, issued=1.1)
    found = slow.tick()
    assert [each for each in found if each[0] == "desk"] == [("desk", "matched"), ("desk", "answer")]
    assert len(found) - 2 == pytest.approx(SECONDS_AT_ONCE / EACH, abs=1.0)


def test_every_question_that_waits_is_answered_in_the_end(slow: Slow) -> None:
    slow.ask(30)
    found = [answer for _ in range(10) for answer in slow.tick()]
    assert found == [("guest", "answer")] * 30
    assert not list(slow.robot.waiting)


def test_who_asks_takes_no_room_from_others_and_is_told(slow: Slow) -> None:
    slow.ask(MAX_BACKLOG)
    assert len(list(slow.robot.waiting)) == MAX_QUESTIONS
    refused = [message.body["fault"] for message in slow.robot.take_outbox()]
    assert refused
    assert {str(fault)[:13] for fault in refused} == {"not answered:"}
    slow.hear("desk", Kind.COMMAND, "(MARK)", Role.OPERATOR)
    assert ("desk", "matched") in slow.tick()


def test_a_tick_evaluates_no_more_commands_than_elsewhere(slow: Slow) -> None:
    for _ in range(2 * MAX_QUEUE):
        slow.hear("desk", Kind.COMMAND, "(MARK)", Role.OPERATOR)
    answered = 0
    while list(slow.robot.waiting):
        found = len(slow.tick())
        assert 0 < found <= MAX_QUEUE
        answered += found
    assert answered == 2 * MAX_QUEUE
