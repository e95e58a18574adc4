"""A radio that loses, repeats, delays and reorders, in simulated time, and parties on it."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from heapq import heappop, heappush
from math import inf
from random import Random

from sleepcast.channel import Kind, Message
from sleepcast.channel.admission import Admission
from sleepcast.channel.envelope import look
from sleepcast.channel.keys import KeyPair, PublicKey, Trust
from sleepcast.channel.message import Role
from sleepcast.channel.reliable import ReliableDelivery
from sleepcast.core.clock import ManualClock

DESK = KeyPair("desk", Role.COMMANDER, b"d" * 32)
ROBOTS = KeyPair("r*", Role.ROBOT, b"r" * 32)
START = 1_000.0
STEP = 0.005


@dataclass
class Party:
    """A party's delivery, and the messages it has passed on, with the times."""

    delivery: ReliableDelivery
    got: list[Message] = field(default_factory=list)
    when: dict[int, float] = field(default_factory=dict)
    on: bool = True


class Air:
    """A desk and robots. loss, twice: shares of what each receiver loses and hears twice; delay: s at most. trusted:
    by everybody, besides these."""

    def __init__(
        self,
        robots: int,
        seed: int,
        loss: float = 0.0,
        twice: float = 0.0,
        delay: float = 0.01,
        trusted: Iterable[PublicKey] = (),
    ) -> None:
        self.clock = ManualClock(START)
        self.chance = Random(seed)
        self.loss, self.twice, self.delay = loss, twice, delay
        self.trusted = (DESK.public, ROBOTS.public, *trusted)
        self.desk = self.party("desk", DESK)
        self.robots = [self.party(f"r{number}", ROBOTS) for number in range(robots)]
        self.others: list[Party] = []
        self.sent: Counter[Kind] = Counter()
        self.bytes = 0
        self._flying: list[tuple[float, int, int, bytes]] = []
        self._tie = 0
        self.cut: set[frozenset[int]] = set()
        """Pairs of parties, by their index with the desk as 0, that do not hear each other."""

    def party(self, name: str, key: KeyPair, epoch: int = 1) -> Party:
        robot = key.public.role is Role.ROBOT
        admission = Admission(Trust(self.trusted), "lab", self.clock, robot=robot, rate=1e9)
        delivery = ReliableDelivery(name, epoch, key, admission, Random(self.chance.random()))
        delivery.start(self.clock.now())
        return Party(delivery)

    def another_desk(self) -> Party:
        """The desk in its next life, beside the first one."""
        return self.join("desk", DESK)

    def join(self, name: str, key: KeyPair) -> Party:
        """Somebody who was not there at the beginning."""
        self.others.append(self.party(name, key, len(self.others) + 2))
        return self.others[-1]

    def everybody(self) -> list[Party]:
        return [self.desk, *self.robots, *self.others]

    def run(self, seconds: float) -> None:
        until, next_due = self.clock.now() + seconds, -inf
        while self.clock.now() < until:
            self.clock.advance(STEP)
            if self.clock.now() >= next_due:  # to ask hundreds of parties takes longer than what most of them do
                next_due = self.step()

    def step(self) -> float:
        """Let everybody do what is due. Gives when somebody is due next, s."""
        now = self.clock.now()
        parties = self.everybody()
        while self._flying and self._flying[0][0] <= now:
            _, _, to, datagram = heappop(self._flying)
            party = parties[to]
            if party.on:
                self._give(party, party.delivery.take(datagram, now))
        for number, party in enumerate(parties):
            if party.on and party.delivery.due() <= now:
                out, freed = party.delivery.step(now)
                self._give(party, freed)
                for datagram in out:
                    self._send(number, datagram, now)
        arrives = self._flying[0][0] if self._flying else inf
        return min(arrives, *(party.delivery.due() for party in parties if party.on), inf)

    def _give(self, party: Party, found: Iterable[Message]) -> None:
        for message in found:
            party.got.append(message)
            party.when[message.sequence] = self.clock.now()

    def _send(self, who: int, datagram: bytes, now: float) -> None:
        self.sent[look(datagram).kind] += 1
        self.bytes += len(datagram)
        for to in range(len(self.everybody())):
            if to == who or frozenset((who, to)) in self.cut:
                continue
            for _ in range(1 + (self.chance.random() < self.twice)):
                if self.chance.random() >= self.loss:
                    self._tie += 1
                    arrives = now + self.chance.random() * self.delay
                    heappush(self._flying, (arrives, self._tie, to, datagram))
