"""What questions may cost: bytes of answers for each who asks, at one robot and in a process with many."""

from __future__ import annotations

from random import Random

import pytest
from benchmarks.channel.questioned import QUESTIONS, Wire, questioned

from sleepcast.channel import Kind, Message
from sleepcast.channel.admission import Admission
from sleepcast.channel.answer_budget import HELD_BACK, LEAST_ANSWER, AnswerBudget, BudgetDecision
from sleepcast.channel.drops import DropReason
from sleepcast.channel.envelope import MAX_CONTENT, encode, encoded_size
from sleepcast.channel.keys import KeyPair, Trust
from sleepcast.channel.message import AGAIN, FOR, NOT, Role
from sleepcast.channel.reliable import ReliableDelivery
from sleepcast.channel.session import MAX_ANSWERED, MAX_FAULT, ChannelSession
from sleepcast.core.clock import ManualClock

DESK = KeyPair("desk", Role.COMMANDER, b"d" * 32)
GUEST = KeyPair("guest", Role.OBSERVER, b"g" * 32)
ROBOTS = KeyPair("r*", Role.ROBOT, b"r" * 32)
START = 1_000.0
LONG = "x" * 20_000


class Asked:
    """A robot, and those who ask it."""

    def __init__(self) -> None:
        self.clock, self.numbers = ManualClock(START), dict.fromkeys(("desk", "guest"), 0)
        self.admission = Admission(
            Trust(key.public for key in (DESK, GUEST, ROBOTS)), "lab", self.clock, robot=True, rate=1e6
        )
        delivery = ReliableDelivery("r1", 1, ROBOTS, self.admission, Random(1))
        self.wire = Wire()
        self.robot = ChannelSession(self.wire, delivery, self.clock, Random(1))

    def ask(self, key: KeyPair, text: str = "", kind: Kind = Kind.ASK, **body: object) -> Message:
        """A question that the robot hears."""
        owner, now = key.public.owner, self.clock.now()
        self.numbers[owner] += 1
        found = Message(owner, 1, self.numbers[owner], kind, now, now + 5.0, text, body=body)
        self.wire.heard += encode(found, "lab", key)
        return found

    def answer(self, told: object = LONG, outcome: str = "answer", **body: object) -> int:
        """Let the robot answer what it hears; how many questions reach its mind."""
        heard = self.robot.receive()
        for message in heard:
            found: dict[str, object] = {"command": message.id, "outcome": outcome, "told": told, **body}
            self.robot.send(Message("r1", 0, 0, Kind.ANSWER, 0.0, body=found))
        return len(heard)

    def said(self) -> list[bytes]:
        found, self.wire.said = self.wire.said, []
        return found


def test_whoever_asks_without_end_is_held_back_and_told_so_once_a_second() -> None:
    asked, budget, out, told, reached = Asked(), AnswerBudget(), 0, 0, 0
    budget.robots = 1
    for _ in range(100):
        asked.ask(GUEST)
        reached += asked.answer()
        said = asked.said()
        out += sum(map(len, said))
        told += sum(HELD_BACK.encode() in datagram for datagram in said)
        asked.clock.advance(0.1)
    assert 0.9 * budget.burst < out < budget.burst + 10.0 * budget.rate + 1.2 * len(LONG)
    assert reached < 100
    assert 2 <= told <= 11
    assert asked.admission.counts[DropReason.HELD_BACK] >= 100 - out / len(LONG) - 1
    assert "guest" in asked.admission.drops.notices(asked.admission.trust)[0].text


def test_what_one_asks_costs_nobody_else_anything_and_is_over_after_a_while() -> None:
    asked = Asked()
    for _ in range(50):
        asked.ask(GUEST)
        asked.answer()
    asked.said()
    asked.ask(DESK)
    assert asked.answer() == 1
    assert sum(map(len, asked.said())) > len(LONG)
    asked.ask(GUEST)
    assert asked.answer() == 0
    asked.clock.advance(10.0)
    asked.said()
    asked.ask(GUEST)
    assert asked.answer() == 1
    assert sum(map(len, asked.said())) > len(LONG)


def test_an_answer_that_is_asked_for_again_costs_what_it_costs() -> None:
    asked = Asked()
    first = asked.ask(DESK)
    asked.answer()
    asked.said()
    for _ in range(50):
        asked.ask(GUEST, **{AGAIN: first.id, FOR: ["r1"]})
        asked.answer()
    assert sum(map(len, asked.said())) < AnswerBudget().burst + 2 * len(LONG)
    assert asked.admission.counts[DropReason.HELD_BACK] > 0


def test_commands_are_answered_however_much_their_sender_has_asked() -> None:
    asked = Asked()
    for _ in range(50):
        asked.ask(DESK)
        asked.answer()
    asked.said()
    asked.ask(DESK, "(MARK)", Kind.COMMAND, after=0, until=None, rules=0)
    asked.answer(None, "matched")
    assert [datagram for datagram in asked.said() if b"matched" in datagram]


def test_an_answer_that_no_message_has_room_for_is_a_fault() -> None:
    asked = Asked()
    asked.ask(GUEST)
    asked.answer("x" * (MAX_CONTENT + 1))
    (datagram,) = asked.said()
    assert b"a message has room for 69,632" in datagram


def test_a_long_fault_is_cut() -> None:
    asked = Asked()
    asked.ask(GUEST)
    asked.answer(None, fault="f" * 100_000)
    assert MAX_FAULT < sum(map(len, asked.said())) < 2 * MAX_FAULT


def test_who_asks_much_does_not_make_a_robot_forget_what_it_answered_to_others() -> None:
    asked = Asked()
    first = asked.ask(DESK)
    asked.answer("first")
    for _ in range(2 * MAX_ANSWERED):
        asked.ask(GUEST)
        asked.answer("")
    asked.said()
    asked.ask(DESK, **{AGAIN: first.id, FOR: ["r1"]})
    asked.answer()
    assert [datagram for datagram in asked.said() if b"first" in datagram]


@pytest.mark.parametrize(
    ("body", "cost"),
    [({}, 3), ({FOR: ["a", "z", 5]}, 1), ({FOR: "a"}, 0), ({NOT: ["a"]}, 3), ({AGAIN: "x", NOT: ["a"]}, 0)],
)
def test_a_question_costs_at_once_what_its_robots_answer_at_least(body: dict[str, object], cost: int) -> None:
    budget = AnswerBudget()
    question = Message("guest", 1, 1, Kind.ASK, 0.0, body=body, key="9e")
    assert budget.ask(question, ("a", "b", "c"), 0.0) is BudgetDecision.LET_IN
    assert budget._account("9e", 0.0).left == budget.burst - LEAST_ANSWER * cost


def test_the_size_of_a_message_is_that_of_its_datagrams() -> None:
    for length in (0, 900, 1_100, 5_000):
        message = Message("r1", 1, 1, Kind.ANSWER, 1.0, 2.0, body={"told": "y" * length})
        real = sum(map(len, encode(message, "lab", ROBOTS)))
        assert real <= encoded_size(message, "lab") <= real + 10 * (1 + length // 1_000)


@pytest.mark.parametrize(
    ("kind", "robots"),
    [
        pytest.param(kind, robots, marks=pytest.mark.nightly if robots == 1 and number else ())
        for robots in (1, 5)
        for number, kind in enumerate(QUESTIONS)
    ],
)
def test_no_kind_of_question_brings_more_bytes_than_the_bound(kind: str, robots: int) -> None:
    found = questioned(kind, robots, 3.0)
    assert 0 < found.said <= found.bound
