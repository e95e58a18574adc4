"""A session: answers have their moments, and are said again to whoever has missed them."""

from __future__ import annotations

import select
from random import Random

import msgspec
import pytest

from sleepcast.channel import Kind, Message
from sleepcast.channel.admission import ROBOT_KINDS, Admission
from sleepcast.channel.drops import DropCounter
from sleepcast.channel.envelope import MAX_CONTENT, kind_of
from sleepcast.channel.keys import KeyPair, Trust
from sleepcast.channel.message import AGAIN, FOR, OTHERS, WITHIN, Role
from sleepcast.channel.reliable import ReliableDelivery
from sleepcast.channel.session import GATHER_FOR, MAX_ANSWERED, ChannelSession, Multiplexer, wait_together
from sleepcast.channel.transports import open_transport
from sleepcast.core.clock import ManualClock, UnixClock

DESK = KeyPair("desk", Role.COMMANDER, b"d" * 32)
ROBOTS = KeyPair("r*", Role.ROBOT, b"r" * 32)
OBSERVER = KeyPair("obs", Role.OBSERVER, b"o" * 32)
START = 1_000.0


class Air:
    """All that is said reaches all others at once, unless `deaf` says of whom the desk hears nothing."""

    def __init__(self, *names: str) -> None:
        self.clock, self.deaf = ManualClock(START), ""
        self.desk = self._session("desk", DESK)
        self.robots = [self._session(name, ROBOTS) for name in names]

    def _session(self, name: str, key: KeyPair) -> ChannelSession:
        admission = Admission(
            Trust((DESK.public, ROBOTS.public, OBSERVER.public)), "lab", self.clock, robot=key is ROBOTS
        )
        return ChannelSession(Wire(), ReliableDelivery(name, 1, key, admission, Random(1)), self.clock, Random(name))

    def run(self, seconds: float) -> None:
        sessions = [self.desk, *self.robots]
        until = self.clock.now() + seconds
        while self.clock.now() < until:
            self.clock.advance(0.005)
            for line in sessions:
                line.pump()
                said, line.transport.said = line.transport.said, []
                for other in sessions:
                    if other is not line and not (other is self.desk and line.delivery.name == self.deaf):
                        other.transport.heard += said


class Wire:
    """Both ends of a transport."""

    def __init__(self) -> None:
        self.heard: list[bytes] = []
        self.said: list[bytes] = []

    def fileno(self) -> int:
        raise NotImplementedError("nobody waits in simulated time")

    def send(self, datagram: bytes) -> None:
        self.said.append(datagram)

    def receive(self) -> list[bytes]:
        found, self.heard = self.heard, []
        return found

    def receive_stops(self) -> list[bytes]:
        found = [datagram for datagram in self.heard if kind_of(datagram) is Kind.STOP]
        self.heard = [datagram for datagram in self.heard if kind_of(datagram) is not Kind.STOP]
        return found

    def close(self) -> None:
        self.heard.clear()


def answer(session: ChannelSession, to: Message, value: float) -> None:
    session.send(Message(session.delivery.name, 0, 0, Kind.ANSWER, 0.0, body={"command": to.id, "value": value}))


def ask(air: Air, **body: object) -> Message:
    return air.desk.delivery.post(Kind.ASK, air.clock.now(), text="" if AGAIN in body else "battery", body=body)


def values(air: Air) -> dict[str, object]:
    return {message.sender: message.body["value"] for message in air.desk.receive() if message.kind is Kind.ANSWER}


def test_answers_are_spread_over_the_time_that_was_asked_for() -> None:
    air = Air(*(f"r{number}" for number in range(20)))
    asked = ask(air, **{WITHIN: 1.0})
    air.run(0.02)
    for number, robot in enumerate(air.robots):
        assert [message.id for message in robot.receive()] == [asked.id]
        answer(robot, asked, float(number))
    heard = []
    for _ in range(10):
        air.run(0.1)
        heard.append(len(values(air)))
    assert sum(heard) == 20
    assert max(heard) < 8


def test_an_answer_that_was_missed_is_said_again_and_the_mind_hears_nothing_of_it() -> None:
    air = Air("r1", "r2")
    asked = ask(air)
    air.run(0.02)
    air.deaf = "r2"
    for number, robot in enumerate(air.robots):
        robot.receive()
        answer(robot, asked, float(number))
    air.run(0.1)
    assert values(air) == {"r1": 0.0}
    air.deaf = ""
    ask(air, **{AGAIN: asked.id, FOR: ["r2"], WITHIN: 0.2})
    air.run(0.5)
    assert values(air) == {"r2": 1.0}
    assert [robot.receive() for robot in air.robots] == [[], []]


def test_an_observers_questions_push_out_no_answer_that_an_operator_has_missed() -> None:
    air = Air("r1")
    (robot,) = air.robots
    observer = air._session("obs", OBSERVER)
    asked = ask(air, **{WITHIN: 0.5})
    air.run(0.05)
    questions = (observer.delivery.post(Kind.ASK, air.clock.now()) for _ in range(2 * MAX_ANSWERED))
    robot.hear(msgspec.structs.replace(each, key=OBSERVER.id.hex()) for each in questions)
    for message in robot.heard():
        answer(robot, message, 1.0)
    air.deaf = "r1"
    air.run(0.6)
    air.deaf = ""
    ask(air, **{AGAIN: asked.id, FOR: ["r1"]})
    air.run(0.2)
    assert asked.id in {message.body["command"] for message in air.desk.receive() if message.kind is Kind.ANSWER}


def test_whoever_has_not_heard_the_command_has_no_answer_to_say_again() -> None:
    air = Air("r1")
    for nonsense in ({AGAIN: "desk-1.77", FOR: ["r1"]}, {AGAIN: 5, FOR: "r1"}, {AGAIN: None}):
        ask(air, **nonsense)
    air.run(0.5)
    assert air.desk.receive() == []
    assert air.robots[0].receive() == []


def test_an_answer_that_still_waits_for_its_moment_is_said_once() -> None:
    air = Air("r1")
    asked = ask(air, **{WITHIN: 2.0})
    air.run(0.02)
    answer(air.robots[0], asked, 1.0)
    ask(air, **{AGAIN: asked.id, FOR: ["r1"]})
    air.run(2.5)
    assert len([message for message in air.desk.receive() if message.kind is Kind.ANSWER]) == 1


def test_only_the_latest_answers_are_kept() -> None:
    air = Air("r1")
    first = ask(air)
    air.run(0.02)
    answer(air.robots[0], first, 1.0)
    others = [ask(air) for _ in range(MAX_ANSWERED)]
    air.run(0.1)
    for asked in others:
        answer(air.robots[0], asked, 0.0)
    air.run(0.1)
    air.desk.receive()
    ask(air, **{AGAIN: first.id, FOR: ["r1"]})
    air.run(0.5)
    assert air.desk.receive() == []


def test_a_robot_reports_the_commands_that_it_missed() -> None:
    air = Air("r1")
    lost = [air.desk.delivery.post(Kind.COMMAND, START, text="(ST)", deadline=START + 0.5) for _ in range(2)]
    for _ in range(180):
        air.clock.advance(0.005)
        air.desk.pump()
        air.desk.transport.said.clear()
    air.desk.delivery.post(Kind.COMMAND, air.clock.now(), text="(GO)")
    air.run(0.2)
    assert [message.text for message in air.robots[0].receive()] == ["(GO)"]
    told = [message.body for message in air.desk.receive() if message.kind is Kind.REPORT]
    assert told == [{"label": "missed", "values": [1.0], "missed": [lost[1].id]}], "the one before that is not known"


def test_robots_of_one_process_wait_together_and_all_hear_stop() -> None:
    clock, trust = UnixClock(), Trust((DESK.public, ROBOTS.public, OBSERVER.public))

    def delivery(name: str, key: KeyPair) -> ReliableDelivery:
        return ReliableDelivery(name, 1, key, Admission(trust, "lab", clock, robot=key is ROBOTS), Random(1))

    shared = Multiplexer(open_transport("memory:together", clock), DropCounter(clock))
    robots = [
        ChannelSession(shared.port(ROBOT_KINDS), delivery(name, ROBOTS), clock, Random(2)) for name in ("r1", "r2")
    ]
    desk = ChannelSession(open_transport("memory:together", clock), delivery("desk", DESK), clock, Random(2))
    begin = clock.now()
    wait_together(robots, shared, 0.1, clock)
    assert clock.now() - begin >= 0.1
    robots[0].send(Message("r1", 1, 1, Kind.COMMAND, clock.now(), text="(ST)"))
    assert [message.text for message in robots[1].receive()] == ["(ST)"], "what one tells the others"
    desk.send(Message("desk", 1, 1, Kind.STOP, clock.now()))
    begin = clock.now()
    wait_together(robots, shared, 20.0, clock)
    assert clock.now() - begin < 20.0
    assert [[message.kind for message in robot.receive()] for robot in robots] == [[Kind.STOP]] * 2
    for session in (desk, *robots):
        session.close()


def waits_as_long(kind: Kind, robot: bool, seconds: float) -> bool:
    """Whether somebody waits as long as he is told to who hears this at once."""
    medium, clock = f"memory:waiting-{kind}-{robot}", UnixClock()
    trust = Trust((DESK.public, ROBOTS.public, OBSERVER.public))
    sessions = []
    for name, key, is_robot in (("desk", DESK, False), ("r1" if robot else "desk", ROBOTS if robot else DESK, robot)):
        admission = Admission(trust, "lab", clock, robot=is_robot)
        delivery = ReliableDelivery(name, len(sessions) + 1, key, admission, Random(1))
        sessions.append(ChannelSession(open_transport(medium, clock), delivery, clock, Random(2)))
    desk, listener = sessions
    desk.send(Message("desk", 1, 1, kind, clock.now(), text="(ST)" if kind is Kind.COMMAND else ""))
    begin = clock.now()
    listener.wait(seconds)
    took = clock.now() - begin
    assert [message.kind for message in listener.receive()] == [kind]
    for line in sessions:
        line.close()
    return took >= seconds


def test_a_robot_that_hears_stop_waits_no_longer() -> None:
    assert not waits_as_long(Kind.STOP, robot=True, seconds=20.0)
    assert waits_as_long(Kind.COMMAND, robot=True, seconds=0.1)
    assert waits_as_long(Kind.STOP, robot=False, seconds=0.1)


def test_an_answer_tells_of_other_robots_of_the_name_where_there_is_room() -> None:
    air = Air("r1")
    (robot,) = air.robots
    robot.conflicts.begin(START)
    robot.conflicts.hear(Message("r1", 9, 1, Kind.STOP, START + 0.5, role=Role.ROBOT), START + 0.5)
    asked = ask(air)
    air.run(1.0)
    answer(robot, asked, 1.0)
    longest = MAX_CONTENT - 45
    robot.send(Message("r1", 0, 0, Kind.ANSWER, 0.0, body={"command": asked.id, "value": "9" * longest}))
    air.run(0.1)
    first, second = [message.body.get(OTHERS) for message in air.desk.receive() if message.kind is Kind.ANSWER]
    assert isinstance(first, list)
    assert first[0][0] == 9
    assert 0.4 < first[0][1] < 0.7
    assert second is None, "the answer itself goes before"


@pytest.mark.parametrize(("came", "longer"), [(100, 0.1), (1_000, GATHER_FOR)])
def test_an_operator_takes_a_flood_at_once(came: int, longer: float, monkeypatch: pytest.MonkeyPatch) -> None:
    """What comes together is gathered; in a flood there would soon be no room for it."""
    desk, waits = Air().desk, list[float]()

    def readable(reads: list[object], writes: object, errors: object, seconds: float) -> tuple[list[object], ...]:
        waits.append(seconds)
        return reads, [], []

    monkeypatch.setattr(select, "select", readable)
    desk.transport.heard += [b"?"] * came
    desk.pump()
    desk.listen(1.0, 0.1)
    assert waits == [1.0, longer]
