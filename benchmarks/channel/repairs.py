"""How often neighbours resend what one party misses, and how soon it has everything, by the delay of the network.

A group of robots has all standing commands, and their sender is gone. Newcomers that have none come one after another,
and each leaves when it has them all. In another group, one robot at a time misses a command and receives the next one.
Deliveries are real; the network between them is simulated, in simulated time, and all of it repeats exactly.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from heapq import heappop, heappush
from itertools import count
from math import floor, inf
from random import Random
from statistics import mean

from benchmarks.channel.proofs import Proof, seconds
from benchmarks.report import Bar, number
from sleepcast.channel import Kind, Message
from sleepcast.channel.admission import Admission
from sleepcast.channel.envelope import look
from sleepcast.channel.keys import KeyPair, PublicKey, Trust
from sleepcast.channel.message import Role
from sleepcast.channel.reliable import ReliableDelivery
from sleepcast.core.clock import ManualClock

FLEET = "lab"
DESK = KeyPair("desk", Role.COMMANDER, b"d" * 32)
ROBOTS = KeyPair("r*", Role.ROBOT, b"r" * 32)
START = 1_800_000_000.0
COMMANDS = 40
"""Standing commands of a group: more than are sent for one digest."""
QUIET = 150.0
"""Seconds after which a group says nothing but its rarest digests."""
PATIENCE = 120.0
"""Seconds for which a robot may miss something."""
AFTER, BETWEEN = 5.0, 60.0
"""Seconds for which datagrams count after a robot has everything, and those from then on until another one misses
something."""
LEARNED = 3
"""Newcomers after which a group knows its network."""
FEW = 10.0
"""Copies of a command that are wanted at most, when a hundred robots could send one."""


@dataclass(frozen=True)
class Network:
    """delay: s that each datagram takes; or, with beacons, between two moments at which an access point sends all that
    it was given. loss: share that each receiver loses."""

    delay: float
    loss: float = 0.0
    beacons: bool = False

    def arrives(self, now: float) -> float:
        """When a datagram of `now` is received, s."""
        return (floor(now / self.delay) + 1.0) * self.delay if self.beacons else now + self.delay

    def __str__(self) -> str:
        return f"{'each ' if self.beacons else ''}{1e3 * self.delay:g}"


NETWORKS = tuple(
    Network(delay, loss, beacons)
    for loss in (0.0, 0.1)
    for delay, beacons in ((0.001, False), (0.02, False), (0.1, False), (0.3, False), (0.3072, True))
)


class Remembered(PublicKey):
    """A key for parties in one process, which verifies each signature once for all of them."""

    def signed(self, content: bytes, signature: bytes) -> bool:
        return _signed(PublicKey(self.owner, self.role, self.public), content, signature)


@lru_cache(maxsize=100_000)
def _signed(key: PublicKey, content: bytes, signature: bytes) -> bool:
    return key.signed(content, signature)


@dataclass
class Party:
    """rules: numbers of the standing commands that it has handled. on: whether it is there. wake: when to, s."""

    delivery: ReliableDelivery
    rules: set[int] = field(default_factory=set)
    on: bool = True
    wake: float = inf

    def receive(self, messages: Iterable[Message]) -> None:
        self.rules.update(message.sequence for message in messages)


class Group:
    """Robots on one network, and a desk that is not on it. sent: datagrams on the air, by kind; bytes: of all."""

    def __init__(self, robots: int, network: Network, seed: int) -> None:
        self.clock, self.network, self.chance = ManualClock(START), network, Random(seed)
        self.parties: list[Party] = []
        self.sent: Counter[Kind] = Counter()
        self.bytes = 0
        self._names, self._tie = count(1), count()
        self._events: list[tuple[float, int, Callable[[], None]]] = []
        keys = (DESK.public, ROBOTS.public)
        self._trust = Trust(Remembered(key.owner, key.role, key.public) for key in keys)
        admission = Admission(self._trust, FLEET, self.clock, robot=False)
        self._desk = ReliableDelivery("desk", 1, DESK, admission, Random(seed))
        for _ in range(robots):
            self.join()

    def join(self) -> Party:
        """A robot that has nothing yet."""
        admission = Admission(self._trust, FLEET, self.clock, robot=True, rate=1e9)
        name, chance = f"r{next(self._names)}", Random(self.chance.random())
        party = Party(ReliableDelivery(name, 1, ROBOTS, admission, chance))
        party.delivery.start(self.clock.now())
        self.parties.append(party)
        self._plan(party)
        return party

    def leave(self, party: Party) -> None:
        party.on = False
        self.parties.remove(party)

    def command(self, deaf: Party | None = None) -> int:
        """A standing command, which all robots but a deaf one receive at once; gives its number."""
        return self.post("(RULE near (VM 0 0))", deaf=deaf).sequence

    def post(self, text: str, body: dict[str, object] | None = None, deaf: Party | None = None) -> Message:
        """The same with this text and body."""
        message = self._desk.post(Kind.COMMAND, self.clock.now(), text=text, standing=True, body=body)
        for datagram in self._desk.posted():
            for party in self.parties:
                if party is not deaf:
                    self._take(party, datagram)
        return message

    def run(self, patience: float, until: Callable[[], bool] = lambda: False) -> None:
        """Let time pass until this is so, at most `patience` s."""
        ends = self.clock.now() + patience
        while not until():
            time = self._events[0][0] if self._events else inf
            self.clock.advance(max(0.0, min(time, ends) - self.clock.now()))
            if time > ends:
                return
            heappop(self._events)[2]()

    def _plan(self, party: Party) -> None:
        """Wake a party when it is due."""
        wake = max(party.delivery.due(), self.clock.now())
        if wake != party.wake:
            party.wake = wake
            heappush(self._events, (wake, next(self._tie), lambda: self._step(party, wake)))

    def _step(self, party: Party, wake: float) -> None:
        if not party.on or wake != party.wake:
            return
        party.wake = inf
        out, found = party.delivery.step(self.clock.now())
        party.receive(found)
        for datagram in out:
            self._send(party, datagram)
        self._plan(party)

    def _send(self, sender: Party, datagram: bytes) -> None:
        self.sent[look(datagram).kind] += 1
        self.bytes += len(datagram)
        hearers = [each for each in self.parties if each is not sender and self.chance.random() >= self.network.loss]

        def arrive() -> None:
            for party in hearers:
                self._take(party, datagram)

        heappush(self._events, (self.network.arrives(self.clock.now()), next(self._tie), arrive))

    def _take(self, party: Party, datagram: bytes) -> None:
        if party.on:
            party.receive(party.delivery.take(datagram, self.clock.now()))
            self._plan(party)


@dataclass
class Found:
    """Of each robot that missed something: copies on the air of each command that it missed, other datagrams, and s
    until it had everything (inf: never)."""

    copies: list[float] = field(default_factory=list)
    others: list[float] = field(default_factory=list)
    took: list[float] = field(default_factory=list)

    def watch(self, group: Group, party: Party, missing: Sequence[int], since: float) -> None:
        """A party misses these commands since then, s."""

        def is_mended() -> bool:
            return party.rules.issuperset(missing)

        group.run(PATIENCE, is_mended)
        self.took.append(group.clock.now() - since if is_mended() else inf)
        group.run(AFTER)
        self.copies.append(group.sent[Kind.COMMAND] / len(missing))
        self.others.append(float(group.sent.total() - group.sent[Kind.COMMAND]))


def newcomers(robots: int, network: Network, times: int, seed: int = 1) -> Found:
    """So many newcomers, one after another."""
    group, found = Group(robots, network, seed), Found()
    everything = [group.command() for _ in range(COMMANDS)]
    group.run(QUIET)
    for _ in range(times):
        group.sent.clear()
        party = group.join()
        found.watch(group, party, everything, group.clock.now())
        group.leave(party)
        group.run(BETWEEN)
    return found


def gaps(robots: int, network: Network, times: int, seed: int = 1) -> Found:
    """So many times one robot misses one command, and receives the next one."""
    group, found = Group(robots, network, seed), Found()
    group.command()
    group.run(QUIET)
    for _ in range(times):
        group.sent.clear()
        deaf = group.parties[group.chance.randrange(robots)]
        missed, since = group.command(deaf), group.clock.now()
        group.command()
        found.watch(group, deaf, [missed], since)
        group.run(BETWEEN)
    return found


def repairs(sizes: Sequence[int], networks: Sequence[Network], times: int) -> Proof:
    """Groups of these sizes on each of these networks, so many robots that miss something in each."""
    rows: list[Sequence[str]] = []
    bars: list[Bar] = []
    for network in networks:
        for robots in sizes:
            new, gap = newcomers(robots, network, times), gaps(robots, network, times)
            later = mean(new.copies[LEARNED:])
            figures = (new.copies[0], later, mean(new.others), *_both(new.took), mean(gap.copies), *_both(gap.took))
            rows.append([str(network), f"{network.loss:.0%}", str(robots), *map(number, figures)])
            if robots == max(sizes):
                name = f"copies of each command, {robots} robots, {network} ms, {network.loss:.0%} loss"
                bars.append(Bar(name, later, FEW, "copies", at_least=False))
    heads = [
        "delay, ms",
        "loss",
        "robots",
        "newcomer: copies, first",
        f"after {LEARNED}",
        "other datagrams",
        "s, p50",
        "p95",
        "gap: copies",
        "s, p50",
        "p95",
    ]
    note = f"{times} newcomers without {COMMANDS} commands, and {times} gaps, in each group; copies of each command"
    return Proof("repairs", heads, rows, bars, note)


def _both(times: Sequence[float]) -> tuple[float, float]:
    return seconds(times, 0.5), seconds(times, 0.95)
