"""Many minds in one process, in simulated time on a medium of this process: what they hear, say and do, and when."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from itertools import count
from math import isnan
from pathlib import Path
from random import Random

import pytest

from sleepcast.channel import Kind, Message
from sleepcast.channel.admission import ROBOT_KINDS, Admission
from sleepcast.channel.drops import DropCounter
from sleepcast.channel.envelope import kind_of
from sleepcast.channel.keys import KeyPair, PublicKey, Trust
from sleepcast.channel.message import Role
from sleepcast.channel.reliable import BATCH, ReliableDelivery
from sleepcast.channel.sequencer import OLD, QUIET
from sleepcast.channel.session import ChannelSession, Multiplexer, Receiver
from sleepcast.channel.transports import open_transport
from sleepcast.channel.transports.transport import Transport
from sleepcast.core.clock import ManualClock
from sleepcast.language import Vocabulary
from sleepcast.loop import vocabulary_of
from sleepcast.loop.real import Member, NetworkSwarm
from sleepcast.mind.evaluation_budget import LOOK_EVERY, EvaluationBudget
from sleepcast.mind.limits import SECONDS_AT_ONCE
from sleepcast.node.node import Node
from sleepcast.robot import REACHED_AGAIN
from sleepcast.simulator import Body, Simulator
from sleepcast.simulator.bodies.links import LOST
from small_worlds import simulator

DESK = KeyPair("desk", Role.COMMANDER, b"d" * 32)
ROBOTS = KeyPair("r*", Role.ROBOT, b"r" * 32)
GUEST = KeyPair("guest", Role.OBSERVER, b"g" * 32)
NAMESAKE = KeyPair("r3", Role.OPERATOR, b"n" * 32)
START = 1_000.0
STEP = 0.01
_media = count()


class Field:
    """A crew, and somebody who commands it."""

    def __init__(self, folder: Path, robots: int = 20, more: str = "") -> None:
        self.clock, self.medium = ManualClock(START), f"memory:crew{next(_media)}"
        self.life = 1
        self._begin(simulator(folder, more=more), robots)
        self.bystander = open_transport(self.medium, self.clock)
        self.desk = self.session("desk", DESK, open_transport(self.medium, self.clock))
        self.desk.zero = START
        self.heard: list[Message] = []
        self.ticks = 0

    def _begin(self, world: Simulator, robots: int) -> None:
        self.multiplexer = Multiplexer(open_transport(self.medium, self.clock), DropCounter(self.clock))
        names = vocabulary_of(world.model)
        self.port = self.multiplexer.port(ROBOT_KINDS)
        self.receiver = Receiver(self.port, self.delivery(f"r0+{robots - 1}", ROBOTS), self.clock, START)
        members = self._members(robots, world.robots, names)
        self.crew = NetworkSwarm(world, members, self.multiplexer, self.receiver, self.clock, self.clock)

    def _members(self, robots: int, bodies: Sequence[Body], names: Vocabulary) -> list[Member]:
        found = []
        for i in range(robots):
            session = self.session(f"r{i}", ROBOTS, self.multiplexer.port(()))
            node = Node(f"r{i}", names, number=i, body=bodies[i])
            node.zero = session.zero = START
            found.append(Member(node, i, session))
        return found

    def session(self, name: str, key: KeyPair, transport: Transport) -> ChannelSession:
        return ChannelSession(transport, self.delivery(name, key), self.clock, Random(name), listens=key is not ROBOTS)

    def delivery(self, name: str, key: KeyPair) -> ReliableDelivery:
        trust = Trust((DESK.public, ROBOTS.public, GUEST.public, NAMESAKE.public))
        admission = Admission(trust, "lab", self.clock, robot=key is ROBOTS, rate=1e9)
        return ReliableDelivery(name, self.life, key, admission, Random(name))

    def run(self, seconds: float, *, ticking: bool = True) -> None:
        """Let time pass; the crew hears all the time, and ticks as the simulator does."""
        for _ in range(round(seconds / STEP)):
            self.clock.advance(STEP)
            self.crew.hear()
            self.ticks += 1
            if ticking and self.ticks % 10 == 0:
                self.crew.step()
            self.heard += self.desk.receive()

    def close(self) -> None:
        self.bystander.close()
        self.desk.close()
        self.receiver.close()
        for member in self.crew.members:
            member.session.close()

    def say(self, text: str = "", kind: Kind = Kind.COMMAND, *, standing: bool = False) -> None:
        self.desk.send(Message("desk", 1, 1, kind, self.clock.now() - START, text=text, standing=standing))

    def lose(self, seconds: float) -> None:
        """Let time pass in which the crew hears nothing."""
        for _ in range(round(seconds / STEP)):
            self.clock.advance(STEP)
            self.desk.pump()
            self.multiplexer.gather()
            self.port.waiting.clear()

    def overheard(self, kind: Kind) -> int:
        """How many datagrams of this kind were on the air since this was asked last."""
        return sum(kind_of(datagram) is kind for datagram in self.bystander.receive())

    def answers(self) -> list[object]:
        return [message.body["outcome"] for message in self.heard if message.kind is Kind.ANSWER]


@pytest.fixture
def field(tmp_path: Path) -> Iterator[Field]:
    found = Field(tmp_path)
    yield found
    found.close()


def test_every_robot_decides_and_answers_for_itself(field: Field) -> None:
    field.say("(WHEN (> id 14) (DRIVE 2 0))")
    field.run(1.0)
    assert sorted(map(str, field.answers())) == ["matched"] * 5 + ["not matched"] * 15
    assert [node.node.name for node in field.crew.members if node.node.driven] == [f"r{i}" for i in range(15, 20)]
    assert {message.sender for message in field.heard} == {f"r{i}" for i in range(20)}


def test_neighbours_see_who_is_in_a_group_that_is_shown(tmp_path: Path) -> None:
    field = Field(tmp_path, 6, more='[neighbours]\nreach = "2km"\nshows_groups = ["bravo"]\n')
    counted = "(COUNT-OVER (n 2km) (OF n bravo))"

    def seen() -> list[float]:
        return [member.node.evaluate(counted).value for member in field.crew.members]

    for text, found in (
        ("(WHEN (< id 2) (JOIN bravo) (JOIN hidden))", [1.0, 1.0, 2.0, 2.0, 2.0, 2.0]),
        ("(WHEN (= id 1) (LEAVE bravo))", [0.0, 1.0, 1.0, 1.0, 1.0, 1.0]),
    ):
        field.say(text)
        field.run(1.0)
        assert seen() == found
    assert isnan(field.crew.members[1].node.evaluate("(OF 0 hidden)").value), "the scenario does not show it"
    field.close()


def test_what_befalls_a_body_is_reported_by_a_mind_that_sleeps(tmp_path: Path) -> None:
    field = Field(tmp_path, 6, more='[[events]]\nat = "1s"\ncut_off = "rover4"\nlasts = "1s"\n')
    field.run(3.0)
    reports = [(each.sender, each.body["label"]) for each in field.heard if each.kind is Kind.REPORT]
    assert reports == [("r3", LOST), ("r3", REACHED_AGAIN)]
    issued = [each.issued for each in field.heard if each.kind is Kind.REPORT]
    assert issued == pytest.approx([1.0, 2.0], abs=0.15)
    field.close()


def test_stop_waits_for_no_tick(field: Field) -> None:
    field.say("(DRIVE 2 0)")
    field.run(0.5)
    field.say(kind=Kind.STOP)
    field.run(0.02, ticking=False)
    assert all(body.stopped for body in field.crew.simulator.robots[:20])
    assert field.answers().count("stopped") == 20, "and it is told at once"


def test_a_stop_that_comes_while_minds_evaluate_halts_all_bodies_between_two_of_them(
    field: Field, monkeypatch: pytest.MonkeyPatch
) -> None:
    field.say("(PROGN (DRIVE 2 0) (DEFVAR a 1))")
    field.run(0.05, ticking=False)
    field.bystander.receive()
    bodies, halted, think = field.crew.simulator.robots[:20], list[int](), Node.think

    def thinking(node: Node, tick: int, now: float) -> None:
        if node.name == "r5":
            field.say(kind=Kind.STOP)
        field.clock.advance(LOOK_EVERY)
        think(node, tick, now)
        halted.append(sum(body.stopped for body in bodies))
        assert field.overheard(Kind.ANSWER) == 0, "nothing is answered before the tick is over"

    monkeypatch.setattr(Node, "think", thinking)
    field.crew.step()
    assert halted == [0] * 6 + [20] * 14, "the fifth and all others, before the sixth evaluates"
    monkeypatch.undo()
    field.run(0.1)
    assert field.answers().count("stopped") == 20
    assert field.answers().count("matched") == 20, "they have moved before, or been held"


def test_a_question_with_more_faults_than_a_message_has_room_for_ends_no_robot(field: Field) -> None:
    field.say(f"(DOTIMES (i 90) (SQRT (- 0 1 {'1.2345678901234 ' * 95})))", Kind.ASK)
    field.run(0.5)
    assert field.answers() == ["answer"] * 20


def test_who_had_to_wait_evaluates_first_in_the_next_tick(field: Field, monkeypatch: pytest.MonkeyPatch) -> None:
    asker = field.session("guest", GUEST, open_transport(field.medium, field.clock))
    asker.send(Message("guest", 1, 1, Kind.ASK, field.clock.now() - START, text="(+ 1 id)"))
    evaluate, work, order = EvaluationBudget.evaluate, ManualClock(), list[list[str]]()
    monkeypatch.setattr(field.crew.budget, "_work", work)

    def evaluated(budget: EvaluationBudget, message: Message, evaluation: Callable[[Message], None]) -> None:
        def slow(message: Message) -> None:
            work.advance(SECONDS_AT_ONCE / 4.5)
            evaluation(message)

        evaluate(budget, message, slow)

    monkeypatch.setattr(EvaluationBudget, "evaluate", evaluated)
    for _ in range(4):
        field.run(1.0, ticking=False)
        field.crew.step()
        heard = asker.receive()
        order.append(sorted(message.sender for message in heard if message.kind is Kind.ANSWER))
    assert order == [sorted(f"r{5 * turn + number}" for number in range(5)) for turn in range(4)]
    asker.close()


def test_a_datagram_is_verified_once_for_all(field: Field, monkeypatch: pytest.MonkeyPatch) -> None:
    field.run(1.0)
    verified: list[tuple[str, bytes]] = []
    usual = PublicKey.signed

    def counted(key: PublicKey, content: bytes, signature: bytes) -> bool:
        verified.append((key.owner, signature))
        return usual(key, content, signature)

    monkeypatch.setattr(PublicKey, "signed", counted)
    field.say("(DEFVAR a 1)", standing=True)
    field.run(3.0)
    assert field.answers() == ["matched"] * 20
    assert len(set(verified)) == len(verified), "once, though the command came five times, and for twenty robots"
    assert len(verified) <= 1 + 20 + 15, "the command, twenty answers, and some digests"


@pytest.mark.parametrize("standing", [True, False])
def test_what_all_have_missed_one_asks_for_and_all_get(field: Field, standing: bool) -> None:
    field.run(1.0)
    field.say("(DEFVAR missed 5)", standing=standing)
    field.lose(0.3)
    field.bystander.receive()
    field.say("(DEFVAR a 1)")
    field.run(1.0)
    assert [dict(member.node.variables())["missed"] for member in field.crew.members] == [5.0] * 20
    assert field.answers() == ["matched"] * 40
    assert 1 <= field.overheard(Kind.REQUEST) <= 3, "twenty robots missed it"


def test_rules_that_were_replaced_meanwhile_move_nobody(field: Field) -> None:
    """Robots that were out of reach get more commands than fit into one repair, with the rules of that time."""
    field.run(1.0)
    places = [body.sense().values[:2] for body in field.crew.simulator.robots[:20]]
    field.say("(RULE go (DRIVE 2 0))", standing=True)
    for number in range(2 * BATCH):
        field.say(f"(RULE other (+ {number} 1))", standing=True)
    field.say("(RULE go (DRIVE 0 0))", standing=True)
    field.lose(OLD)
    field.desk.delivery.repeat(1, field.clock.now())
    caught_up = 0
    while caught_up < 20:
        field.run(0.1)
        minds = [member.node for member in field.crew.members]
        assert field.clock.now() < START + 2.0 * OLD, [len(mind.rules()) for mind in minds]
        assert all(mind.catching_up for mind in minds if mind.rules())
        caught_up = sum("0 0" in rule.text for mind in minds for rule in mind.rules())
    field.run(QUIET)
    assert not any(mind.catching_up for mind in minds)
    field.run(1.0)
    assert [body.sense().values[:2] for body in field.crew.simulator.robots[:20]] == places
    field.say("(RULE go (DRIVE 2 0))", standing=True)
    field.run(1.0)
    assert all(
        body.sense().values[:2] != place for body, place in zip(field.crew.simulator.robots, places, strict=False)
    )


def test_what_robots_tell_each_other_reaches_their_neighbours(field: Field) -> None:
    field.say("(DEFVAR told 0)", standing=True)
    field.run(0.5)
    field.say("(WHEN (= id 3) (TELL (SETQ told 7)))")
    field.run(0.5)
    told = [dict(member.node.variables())["told"] for member in field.crew.members]
    assert told == [7.0] * 3 + [0.0] + [7.0] * 16


def test_who_commands_under_a_robots_name_is_heard_by_that_robot_too(field: Field) -> None:
    namesake = field.session("r3", NAMESAKE, open_transport(field.medium, field.clock))
    namesake.zero = START
    namesake.send(Message("r3", 1, 1, Kind.STOP, field.clock.now() - START))
    field.run(0.02, ticking=False)
    assert all(body.stopped for body in field.crew.simulator.robots[:20])
    namesake.close()


def test_a_robot_hears_another_one_of_its_name_and_not_itself(field: Field) -> None:
    """They are told apart by their epochs, before an echo is dropped."""
    for epoch, heard in ((field.life, False), (field.life + 1, True)):
        told = Message("r3", epoch, 90 + epoch, Kind.COMMAND, field.clock.now(), text="(MARK)", role=Role.ROBOT)
        field.crew._give([told])
        queues = {member.node.name: len(member.node._queue) for member in field.crew.members}
        assert queues["r4"] == epoch - field.life + 1
        assert queues["r3"] == heard


def test_a_quiet_crew_is_quiet_and_its_minds_sleep(field: Field) -> None:
    field.run(20.0)
    before = field.receiver.delivery.admission.passed
    field.run(10.0)
    assert field.answers() == []
    assert not any(member.node.awake for member in field.crew.members)
    assert field.receiver.delivery.admission.passed - before <= 4


def test_bodies_are_stopped_at_the_end_whatever_happens(field: Field) -> None:
    def going() -> bool:
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        field.crew.run(going)
    assert all(body.stopped for body in field.crew.simulator.robots[:20])
