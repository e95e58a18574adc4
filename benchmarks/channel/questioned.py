"""How many bytes of answers somebody gets out of robots who only asks, or leases, in simulated time.

Robots of one process, with minds that have learned as much as one message has room for, hear questions of one kind that
are all well signed: with an observer's key, the least of those that may ask, and leases with an operator's.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import count
from pathlib import Path
from random import Random

from sleepcast.channel import Kind, Message
from sleepcast.channel.admission import ROBOT_KINDS, Admission
from sleepcast.channel.answer_budget import LEAST_ANSWER
from sleepcast.channel.drops import DropCounter, DropReason
from sleepcast.channel.envelope import MAX_CONTENT, encode
from sleepcast.channel.keys import KeyPair, Trust
from sleepcast.channel.message import AGAIN, DO, GROUP, LEASE, LOOK, NOT, OF, SECONDS, TIME, Inspection, Role
from sleepcast.channel.reliable import TIME_REPLIES_A_SECOND, ReliableDelivery
from sleepcast.channel.session import ChannelSession, Multiplexer, Receiver, receiver_name
from sleepcast.core.clock import ManualClock
from sleepcast.loop import vocabulary_of
from sleepcast.node.node import Node
from sleepcast.simulator import Changes, Simulator, choose, find_scenario

FLEET = "lab"
RATE = 150
"""Datagrams of the attacker in a second: fewer than the robot verifies of one key."""
TICK = 0.1
START = 1_800_000_000.0
DESK = KeyPair("desk", Role.OPERATOR, b"d" * 32)
ROBOTS = KeyPair("r*", Role.ROBOT, b"r" * 32)
GUEST = KeyPair("guest", Role.OBSERVER, b"g" * 32)
YARD = Path(__file__).parent / "yard"
RULES = 22
"""Rules that each robot has, which nearly fill what one message has room for."""
SUM = f"(+ {'1.0625 ' * 95})"
LONG = f"(+ {' '.join([SUM] * 3)})"
ROOTS = f"(DOTIMES (i 90) (SQRT (- 0 1 {'1.0625 ' * 20})))"
"""A question with ninety faults, each of which shows its long text."""
QUESTIONS: dict[str, tuple[str, dict[str, object]]] = {
    "ask": ("(> id 3)", {}),
    "ask, long faults": (ROOTS, {}),
    "look telemetry": ("", {LOOK: Inspection.TELEMETRY}),
    "look vocabulary": ("", {LOOK: Inspection.VOCABULARY}),
    "look mind": ("", {LOOK: Inspection.MIND}),
    "look why": ("", {LOOK: Inspection.WHY, OF: "r0"}),
    "again": ("", {AGAIN: "desk-1.1", NOT: []}),
    "lease": ("", {LEASE: {DO: "take", GROUP: "g", SECONDS: 5.0}}),
}
"""What is asked, by kind: a text and the rest."""


@dataclass
class Asked:
    """Bytes that the attacker sent and that came back, those of his first message among them; bound: of what may come
    back; held_back: messages that were counted as such."""

    given: int = 0
    said: int = 0
    first_given: int = 0
    first_said: int = 0
    bound: float = 0.0
    held_back: int = 0


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
        return []

    def close(self) -> None:
        self.heard.clear()

    def count(self) -> int:
        """Bytes that were sent since the last call."""
        said, self.said = self.said, []
        return sum(map(len, said))


class Robots:
    """So many robots of one process."""

    def __init__(self, count: int, clock: ManualClock) -> None:
        self.clock, self.wire, self.tick = clock, Wire(), 0
        names = [f"r{number + 1}" for number in range(count)]
        self.shared = Multiplexer(self.wire, DropCounter(clock))
        self.listening = self._delivery(receiver_name(names) if count > 1 else "r1")
        port, self.answers = self.shared.port(ROBOT_KINDS), self.shared.answers
        self.receiver = Receiver(port, self.listening, clock, START, names=names, answers=self.answers)
        world = Simulator(find_scenario(str(YARD), Changes(1, None, True)), 1, choose("numpy", 1), threads=1)
        vocabulary = vocabulary_of(world.model)
        self.minds = [(Node(name, vocabulary, on_air=True), self._session(name)) for name in names]
        for node, session in self.minds:
            node.zero = session.zero = START
            for number in range(RULES):
                node.evaluate(f"(RULE r{number} (WHEN (< marked 0) {LONG}))")

    def _delivery(self, name: str) -> ReliableDelivery:
        trust = Trust(key.public for key in (DESK, ROBOTS, GUEST))
        admission = Admission(trust, FLEET, self.clock, robot=True)
        return ReliableDelivery(name, 1, ROBOTS, admission, Random(2))

    def _session(self, name: str) -> ChannelSession:
        port, delivery = self.shared.port(()), self._delivery(name)
        return ChannelSession(port, delivery, self.clock, Random(name), listens=False, answers=self.answers)

    def hear(self, datagrams: list[bytes]) -> None:
        """Let every robot hear these, evaluate and answer."""
        self.wire.heard += datagrams
        self.shared.gather()
        messages, self.tick = self.receiver.take(), self.tick + 1
        for node, session in self.minds:
            session.hear(messages)
            for message in session.heard():
                node.receive(message)
            node.think(self.tick, self.clock.now() - START)
            for message in node.outbox:
                session.send(message)
            node.outbox.clear()
            session.tend()

    def held_back(self) -> int:
        """Questions and answers that were held back."""
        parties = [self.listening, *(session.delivery for _, session in self.minds)]
        return sum(each.admission.counts[DropReason.HELD_BACK] for each in parties)


def questioned(kind: str, robots: int, seconds: float) -> Asked:
    """What becomes of questions of this kind to so many robots."""
    clock, found = ManualClock(START), Asked()
    fleet = Robots(robots, clock)
    text, body = QUESTIONS[kind]
    fleet.hear(_datagrams(DESK, 1, clock, "", {LOOK: Inspection.MIND}))  # what is asked for again is long
    fleet.wire.count()
    asker = DESK if kind == "lease" else GUEST
    numbers, due = count(2), 0.0
    first = _datagrams(asker, next(numbers), clock, text, body)
    fleet.hear(first)
    found.first_given, found.first_said = sum(map(len, first)), fleet.wire.count()
    found.given, found.said = found.first_given, found.first_said
    for _ in range(round(seconds / TICK)):
        clock.advance(TICK)
        due += RATE * TICK
        datagrams: list[bytes] = []
        while len(datagrams) < due:
            datagrams += _datagrams(asker, next(numbers), clock, text, body)
        due -= len(datagrams)
        found.given += sum(map(len, datagrams))
        fleet.hear(datagrams)
        found.said += fleet.wire.count()
    answers = fleet.answers
    longest = 1.2 * MAX_CONTENT + 3.0 * LEAST_ANSWER * robots  # what is on its way when the account is empty
    found.bound = answers.burst + seconds * answers.rate + longest
    if kind == "lease":
        found.bound = RATE * (seconds + TICK) * 1.5 * LEAST_ANSWER * robots
    found.held_back = fleet.held_back()
    return found


def timed(seconds: float) -> Asked:
    """What becomes of questions for the time, to an operator's desk."""
    clock, found, wire = ManualClock(START), Asked(), Wire()
    trust = Trust(key.public for key in (DESK, ROBOTS))
    delivery = ReliableDelivery("desk", 1, DESK, Admission(trust, FLEET, clock, robot=False), Random(1))
    session = ChannelSession(wire, delivery, clock, Random(1))
    for number in range(round(seconds * RATE)):
        now = clock.now()
        asked = Message("r1", 1, number + 1, Kind.REPORT, now, now + 5.0, body={TIME: Random(number).randbytes(16)})
        wire.heard += encode(asked, FLEET, ROBOTS)
        found.given += len(wire.heard[-1])
        session.receive()
        found.said += wire.count()
        if not number:
            found.first_given, found.first_said = found.given, found.said
        clock.advance(1.0 / RATE)
    found.bound = TIME_REPLIES_A_SECOND * (seconds + 1.0) * LEAST_ANSWER
    return found


def _datagrams(key: KeyPair, number: int, clock: ManualClock, text: str, body: dict[str, object]) -> list[bytes]:
    kind, now = Kind.COMMAND if LEASE in body else Kind.ASK, clock.now()
    link = {"after": 0, "until": None, "rules": 0} if kind is Kind.COMMAND else {}
    message = Message(key.public.owner, 1, number, kind, now, now + 5.0, text, body={**body, **link})
    return encode(message, FLEET, key)
