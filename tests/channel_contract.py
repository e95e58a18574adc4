"""What every channel promises when the air is clear: derive from `ChannelContract` and give it an `air`.

Whatever a transport may lose, repeat or reorder on a bad day it must not invent, change or cut.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import inf

import pytest

from sleepcast.channel import Channel, Kind, Message
from sleepcast.channel.message import MAX_TEXT


@dataclass
class Air:
    """An operator and at least three robots on one channel; `settle` waits until nothing is on its way."""

    operator: Channel
    robots: Sequence[Channel]
    settle: Callable[[], None]


def message(kind: Kind = Kind.COMMAND, sequence: int = 1, sender: str = "desk", text: str = "(ST)") -> Message:
    return Message(sender, 1, sequence, kind, issued=0.0, text=text)


class ChannelContract:
    """The tests; a derived class has a fixture `air`."""

    def test_nothing_was_sent_nothing_is_heard(self, air: Air) -> None:
        air.settle()
        assert [party.receive() for party in (air.operator, *air.robots)] == [[]] * (len(air.robots) + 1)

    @pytest.mark.parametrize("kind", [Kind.COMMAND, Kind.ASK, Kind.STOP, Kind.RELEASE, Kind.HEARTBEAT])
    def test_the_operator_is_heard_by_every_robot_once(self, air: Air, kind: Kind) -> None:
        sent = message(kind)
        air.operator.send(sent)
        air.settle()
        assert [robot.receive() for robot in air.robots] == [[sent]] * len(air.robots)
        assert [robot.receive() for robot in air.robots] == [[]] * len(air.robots)

    def test_nobody_hears_itself(self, air: Air) -> None:
        air.operator.send(message())
        air.robots[0].send(message(sender="r1"))
        air.settle()
        assert air.operator.receive() == []
        assert all(heard.sender == "desk" for heard in air.robots[0].receive())

    @pytest.mark.parametrize("kind", [Kind.ANSWER, Kind.REPORT])
    def test_the_operator_hears_what_robots_answer_and_report(self, air: Air, kind: Kind) -> None:
        sent = [
            Message(f"r{i}", 0, 7, kind, 0.5, body={"command": "desk-1.1", "value": float(i), "fault": None})
            for i in range(len(air.robots))
        ]
        for robot, said in zip(air.robots, sent, strict=True):
            robot.send(said)
        air.settle()
        assert sorted(air.operator.receive(), key=lambda heard: heard.sender) == sent

    def test_a_robot_tells_the_others(self, air: Air) -> None:
        told = message(sender="r1", text="(WHEN (> fuel 50%) (JOIN convoy))")
        air.robots[0].send(told)
        air.settle()
        assert all(robot.receive() == [told] for robot in air.robots[1:])

    def test_messages_of_one_sender_stay_in_order(self, air: Air) -> None:
        sent = [message(sequence=i) for i in range(50)]
        for each in sent:
            air.operator.send(each)
        air.settle()
        for robot in air.robots:
            assert robot.receive() == sent

    @pytest.mark.parametrize(
        "text", ["", "grüße ✓ λ", 'TK "a\nb"', "x" * MAX_TEXT], ids=["empty", "unicode", "line", "long"]
    )
    def test_a_text_arrives_unchanged(self, air: Air, text: str) -> None:
        air.operator.send(message(text=text))
        air.settle()
        assert [heard.text for heard in air.robots[-1].receive()] == [text]

    def test_every_field_arrives_unchanged(self, air: Air) -> None:
        for number, deadline in enumerate((12.25, inf)):
            body = {"a": 1, "b": [1.5, "x"]}
            sent = Message("desk", 2**40, 2**41 + number, Kind.COMMAND, 0.1, deadline, "(ST)", True, body)
            air.operator.send(sent)
            air.settle()
            assert air.robots[0].receive() == [sent]
