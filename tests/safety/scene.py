"""Operators and robots on one radio in simulated time: real desks, real doors, real minds, and bodies that note what
is asked of them. Only the radio is made: it loses, repeats and delays as it is told.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import dataclass, field
from heapq import heappop, heappush
from math import inf
from random import Random

from sleepcast.channel import Kind, Message
from sleepcast.channel.admission import Admission
from sleepcast.channel.envelope import kind_of
from sleepcast.channel.keys import KeyPair, PublicKey, Trust
from sleepcast.channel.message import Role
from sleepcast.channel.reliable import ReliableDelivery
from sleepcast.channel.session import ChannelSession
from sleepcast.core.clock import ManualClock
from sleepcast.core.model import Quantity
from sleepcast.language import HostFunction, Vocabulary
from sleepcast.mind.authority import Tells
from sleepcast.node.node import Node
from sleepcast.station.network import NetworkStation
from sleepcast.station.roster import NOBODY_SAID, Expectation
from sleepcast.station.validation import Minds, SendPolicy

START = 1_000_000.0
STEP = 0.01
FLEET = "lab"
KEYS = {
    "chief": KeyPair("chief", Role.COMMANDER, b"c" * 32),
    "anna": KeyPair("anna", Role.OPERATOR, b"a" * 32),
    "bert": KeyPair("bert", Role.OPERATOR, b"b" * 32),
    "watch": KeyPair("watch", Role.OBSERVER, b"w" * 32),
    "r*": KeyPair("r*", Role.ROBOT, b"r" * 32),
}


class Body:
    """A body that notes what is asked of it."""

    def __init__(self) -> None:
        self.driven: list[float] = []
        self.dropped = 0

    def drive(self, speed: float) -> None:
        self.driven.append(speed)

    def drop(self) -> None:
        self.dropped += 1


VOCABULARY = Vocabulary(
    "craft",
    sensors=(Quantity("x", "m"), Quantity("fuel", low=0, high=1, shown_as="%")),
    actuators=(Quantity("throttle", low=0, high=1),),
    functions=(
        HostFunction("DRIVE", Body.drive, dimensions=(None,), arguments="speed"),
        HostFunction("DROP", Body.drop, irreversible=True),
    ),
)


class Shifted:
    """A clock that is `by` s ahead of the scene's."""

    def __init__(self, clock: ManualClock, by: float = 0.0) -> None:
        self._clock, self.by = clock, by

    def now(self) -> float:
        return self._clock.now() + self.by


class Wire:
    """One party's end of the radio."""

    def __init__(self, scene: Scene, name: str) -> None:
        self.scene, self.name, self.heard = scene, name, list[bytes]()

    def fileno(self) -> int:
        raise NotImplementedError("nobody waits in simulated time")

    def send(self, datagram: bytes) -> None:
        self.scene.sent.append(datagram)
        self.scene.fly(self.name, datagram)

    def receive(self) -> list[bytes]:
        found, self.heard = self.heard, []
        return found

    def receive_stops(self) -> list[bytes]:
        found = [datagram for datagram in self.heard if kind_of(datagram) is Kind.STOP]
        self.heard = [datagram for datagram in self.heard if kind_of(datagram) is not Kind.STOP]
        return found

    def close(self) -> None:
        self.heard.clear()


@dataclass
class Robot:
    """A mind on the radio. on: whether it has power."""

    node: Node
    session: ChannelSession
    wire: Wire
    body: Body
    on: bool = True
    ticks: int = 0


@dataclass
class Scene:
    """Robots `r0`, `r1`, ... and operators, who join when they are first asked for. loss: share of what each receiver
    loses of everything; twice: what he hears twice; delay: s at most, which also changes the order. lease: the dead
    man's, s. tells: what robots have each other do. on_air: see `Node`. deaf: pairs of speaker and hearer between whom
    nothing goes. vocabulary: of robots, whose first sensor says their number, and the others 0.5."""

    robots: int = 3
    loss: float = 0.0
    twice: float = 0.0
    delay: float = 0.0
    seed: int = 1
    policy: SendPolicy | None = None
    lease: float = inf
    tells: Tells = Tells.ALL
    on_air: bool = False
    clock: ManualClock = field(default_factory=lambda: ManualClock(START))
    sent: list[bytes] = field(default_factory=list)
    deaf: set[tuple[str, str]] = field(default_factory=set)
    vocabulary: Vocabulary = VOCABULARY

    def __post_init__(self) -> None:
        self.chance = Random(self.seed)
        self.trust = Trust(key.public for key in KEYS.values())
        self._flying: list[tuple[float, int, str, bytes]] = []
        self._tie = 0
        self._wires: dict[str, Wire] = {}
        self._clocks: dict[str, Shifted] = {}
        self._desks: dict[str, NetworkStation] = {}
        self.fleet = {f"r{i}": self._robot(f"r{i}", i) for i in range(self.robots)}

    def _session(
        self, name: str, key: KeyPair, robot: bool, zero: float = 0.0, end: str = ""
    ) -> tuple[ChannelSession, Wire]:
        wire = self._wires[end or name] = Wire(self, end or name)
        clock = self._clocks.setdefault(name, Shifted(self.clock))
        admission = Admission(self.trust, FLEET, clock, robot=robot)
        epoch = int(self.clock.now() * 1000.0)
        delivery = ReliableDelivery(name, epoch, key, admission, Random(self.chance.random()))
        return ChannelSession(wire, delivery, clock, Random(self.chance.random()), zero), wire

    def _robot(self, name: str, number: int, end: str = "") -> Robot:
        body = Body()
        session, wire = self._session(name, KEYS["r*"], robot=True, zero=self.clock.now(), end=end)
        knows = self.vocabulary
        node = Node(name, knows, number=number, body=body, lease=self.lease, tells=self.tells, on_air=self.on_air)
        node.sense((float(number), *[0.5] * (len(knows.sensors) - 1)), 0.0)
        return Robot(node, session, wire, body)

    def another(self, name: str, number: int = 7) -> Robot:
        """Another robot of this name, as `NAME again`, with another id. It begins to listen now."""
        end = f"{name} again"
        self.fleet[end] = self._robot(name, number, end)
        return self.fleet[end]

    def restart(self, name: str) -> Robot:
        """The robot's process ends, and another one begins, with nothing in its mind."""
        self.fleet[name] = self._robot(name, self.fleet[name].node.number)
        self.fleet[name].node.began = 0.0
        return self.fleet[name]

    def desk(
        self,
        owner: str = "chief",
        heard: Iterable[str] | None = None,
        minds: Minds | None = None,
        expected: Expectation = NOBODY_SAID,
    ) -> NetworkStation:
        """The desk of an operator. heard: who was heard before, by default all robots. minds: that it knows of.
        expected: which robots there are, as somebody has said."""
        if owner not in self._desks:
            session, _ = self._session(owner, KEYS[owner], robot=False)
            names = [robot.node.name for robot in self.fleet.values()] if heard is None else heard
            self._desks[owner] = NetworkStation(
                session,
                self._clocks[owner],
                VOCABULARY,
                {} if minds is None else minds,
                heard=dict.fromkeys(names, START - 8.0),
                policy=self.policy,
                expected=expected,
            )
        return self._desks[owner]

    def set_clock(self, name: str, by: float) -> None:
        """The clock of a robot, or of an operator who has not joined yet, is so many s ahead from now on."""
        clock = self._clocks.setdefault(name, Shifted(self.clock))
        if name in self.fleet:
            session = self.fleet[name].session
            session.zero += by - clock.by
        clock.by = by
        if name in self.fleet:
            session.delivery.start(clock.now())

    def admission(self, robot: str) -> Admission:
        return self.fleet[robot].session.delivery.admission

    def trusted(self, owner: str) -> PublicKey:
        return KEYS[owner].public

    def run(self, seconds: float, busy: Collection[str] = ()) -> None:
        """Let time pass. busy: operators whose desks hear nothing meanwhile."""
        until = self.clock.now() + seconds
        while self.clock.now() < until:
            self.clock.advance(STEP)
            self._deliver()
            for robot in self.fleet.values():
                if robot.on:
                    self._tick(robot)
            for owner, desk in self._desks.items():
                if owner not in busy:
                    desk.pump()

    def _tick(self, robot: Robot) -> None:
        robot.ticks += 1
        for message in robot.session.receive():
            robot.node.receive(message)
        robot.node.think(robot.ticks, self._clocks[robot.node.name].now() - robot.session.zero)
        for said in robot.node.outbox:
            robot.session.send(said)
        robot.node.outbox.clear()

    def fly(self, speaker: str, datagram: bytes) -> None:
        """What somebody says goes to everybody else."""
        for name in self._wires:
            if name == speaker or (speaker, name) in self.deaf:
                continue
            for _ in range(1 + (self.chance.random() < self.twice)):
                if self.chance.random() >= self.loss:
                    self._tie += 1
                    arrives = self.clock.now() + self.chance.random() * self.delay
                    heappush(self._flying, (arrives, self._tie, name, datagram))

    def _deliver(self) -> None:
        while self._flying and self._flying[0][0] <= self.clock.now():
            _, _, name, datagram = heappop(self._flying)
            if name not in self.fleet or self.fleet[name].on:
                self._wires[name].heard.append(datagram)

    def say(self, message: Message, key: KeyPair) -> None:
        """Somebody who keeps to no rules of ours sends this."""
        from sleepcast.channel.envelope import encode

        for datagram in encode(message, FLEET, key):
            self.fly("stranger", datagram)

    def isolate(self, name: str) -> None:
        """Nobody hears a robot, and it hears nobody."""
        for other in self._wires:
            self.deaf |= {(name, other), (other, name)}

    def join(self, name: str) -> None:
        """The robot is back."""
        self.deaf = {pair for pair in self.deaf if name not in pair}
