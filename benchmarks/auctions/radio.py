"""Rounds of BEST and QUORUM on a radio that loses, delays and repeats, with robots and callers that die.

Nothing waits in real time: robots and callers are the product's own (`mind.auction`), time and radio are made here.
Each party hears everything that is not lost. A robot's tick takes 0.1 s; its clock is off, and drifts by up to 0.1 %.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from heapq import heappop, heappush
from itertools import count
from math import inf
from random import Random

from sleepcast.language.explain import BidState
from sleepcast.language.parts import Auction
from sleepcast.mind.auction import Auctioneer, Bid, BidMessage, BidPhase, GrantMessage

TICK, STEP = 0.1, 0.05
"""Seconds of a robot's tick, and between two looks of a caller."""
POLLED = (0.0, 0.03, 0.09, 0.21, 0.45)
"""When a poll is sent again, s, as every command is."""
SLOWEST = 0.25
"""Seconds that a message takes at most."""
REPEATED = 0.1
"""Share of messages that arrive twice."""
LIFE = 7.5
"""Seconds from a poll to its deadline."""


@dataclass
class SimulatedRobot:
    """A robot with its bids by the number of the auction. Its clock shows `offset + rate * time`."""

    name: str
    cost: float
    offset: float
    rate: float
    next_tick: float
    dies: float = inf
    stopped: float = inf
    willing: bool = True
    accepts: bool = True
    """Whether the test of a QUORUM is true on it."""
    bids: dict[int, Bid | None] = field(default_factory=dict)
    """None: it does not bid, or has nothing more to say."""
    inbox: list[tuple[int, int, object]] = field(default_factory=list)
    """Messages: of which auction, their numbers, and what they say."""

    def now(self, time: float) -> float:
        return self.offset + self.rate * time

    def member_of(self, auction: int, time: float) -> bool:
        """Whether it obeys at present."""
        bid = self.bids.get(auction)
        return bid is not None and bid.phase is BidPhase.MEMBER and time < self.dies


class Rounds:
    """One round: some auctions among some robots.

    loss: share of messages that are lost, of each receiver by itself
    """

    def __init__(self, chance: Random, auctions: list[Auction], robots: int, loss: float) -> None:
        self.chance, self.auctions, self.loss, self.time = chance, auctions, loss, 0.0
        self.robots = [
            SimulatedRobot(
                f"r{number}",
                chance.choice((0.0, 1.0, chance.uniform(0.0, 100.0))),
                chance.uniform(-100.0, 100.0),
                1.0 + chance.uniform(-1e-3, 1e-3),
                chance.uniform(0.0, TICK),
            )
            for number in range(robots)
        ]
        self.callers = [Auctioneer(auction, number, 0.0, LIFE) for number, auction in enumerate(auctions)]
        self.caller_dies = [inf] * len(auctions)
        self.most_members = [0] * len(auctions)
        self._air: list[tuple[float, int, SimulatedRobot | Auctioneer, str, int, object]] = []
        self._tie, self._sequence = count(), count(1)
        for number in range(len(auctions)):
            for later in POLLED:
                self._broadcast(number, number, later)

    def run(self, seconds: float) -> None:
        """Let time pass."""
        until = self.time + seconds
        while self.time < until:
            self.time += STEP
            self._deliver()
            for robot in self.robots:
                if robot.next_tick <= self.time < robot.dies:
                    robot.next_tick += TICK
                    self._think(robot)
            for number, caller in enumerate(self.callers):
                if self.time < self.caller_dies[number] and (grants := caller.step(self.time)) is not None:
                    self._broadcast(number, grants)
            for number in range(len(self.callers)):
                self.most_members[number] = max(self.most_members[number], len(self.members(number)))

    def members(self, number: int) -> list[str]:
        """Who obeys at present."""
        return [robot.name for robot in self.robots if robot.member_of(number, self.time)]

    def _broadcast(self, number: int, said: object, later: float = 0.0) -> None:
        sequence = next(self._sequence)
        for robot in self.robots:
            self._send(robot, "", number, (sequence, said), later)

    def _send(self, to: SimulatedRobot | Auctioneer, name: str, number: int, said: object, later: float = 0.0) -> None:
        for _ in range(1 + (self.chance.random() < REPEATED)):
            if self.chance.random() >= self.loss:
                arrives = self.time + later + self.chance.uniform(0.0, SLOWEST)
                heappush(self._air, (arrives, next(self._tie), to, name, number, said))

    def _deliver(self) -> None:
        while self._air and self._air[0][0] <= self.time:
            arrives, _, to, name, number, said = heappop(self._air)
            if isinstance(to, SimulatedRobot):
                if isinstance(said, tuple):
                    to.inbox.append((number, *said))
            elif arrives < self.caller_dies[number] and isinstance(said, BidMessage):
                to.hear(name, 1, said, self.time)

    def _think(self, robot: SimulatedRobot) -> None:
        now, stopped = robot.now(self.time), self.time >= robot.stopped
        for number, sequence, said in robot.inbox:
            bid = robot.bids.get(number)
            if isinstance(said, GrantMessage):
                if bid is not None and bid.hear(said, sequence, now):
                    bid.settle(robot.willing and not stopped)
            elif number not in robot.bids and not stopped:
                robot.bids[number] = self._bid(robot, number, now)
        robot.inbox.clear()
        for number, bid in robot.bids.items():
            if bid is None:
                continue
            if stopped:
                bid.leave(BidState.STOPPED)
            bid.tick(now)
            if (said := bid.say(now)) is not None:
                self._send(self.callers[number], robot.name, number, BidMessage.of(said.body()))
            if bid.is_over:
                robot.bids[number] = None

    def _bid(self, robot: SimulatedRobot, number: int, now: float) -> Bid | None:
        """What a robot bids that hears a poll."""
        auction, is_best = self.auctions[number], self.auctions[number].name == "BEST"
        if not (is_best or robot.accepts):
            return None
        cost, until = robot.cost if is_best else 0.0, robot.now(LIFE)
        return Bid(auction, ("desk", 1, number), robot.name, cost, now, until, 0.02)


def best(most: int, lease: float = 4.0) -> Auction:
    return Auction("BEST", 1, most, "", "", 1.0, lease, (), ())


def quorum(least: int, most: int, lease: float = 4.0) -> Auction:
    return Auction("QUORUM", least, most, "", "", 1.0, lease, (), ())
