"""Rounds of BEST and QUORUM on a radio that loses, delays and repeats, with robots and callers that die: how often the
four robots with the least costs obey, how often a quorum comes out short, and that there are never too many.

    python -m benchmarks.auctions                 10,000 rounds of each, 0 to 50 % lost
    python -m benchmarks.auctions --rounds 100

Nothing waits in real time: robots and callers are the product's own (`mind.auction`), time and radio are made here.
Each party hears everything that is not lost. A robot's tick takes 0.1 s; its clock is off, and drifts by up to 0.1 %.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass, field
from heapq import heappop, heappush
from itertools import count
from math import inf
from random import Random

from sleepcast.language.parts import Auction
from sleepcast.mind.auction import Auctioneer, Bid, BidMessage, BidPhase, GrantMessage, rank

TICK, STEP = 0.1, 0.05
"""Seconds of a robot's tick, and between two looks of a caller."""
POLLED = (0.0, 0.03, 0.09, 0.21, 0.45)
"""When a poll is sent again, s, as every command is."""
SLOWEST = 0.25
"""Seconds that a message takes at most."""
REPEATED = 0.1
"""Share of messages that arrive twice."""
LIFE = 5.0
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
    bids: dict[int, Bid] = field(default_factory=dict)
    inbox: list[tuple[int, int, object]] = field(default_factory=list)
    """Messages: of which auction, their numbers, and what they say."""

    def now(self, time: float) -> float:
        return self.offset + self.rate * time

    def member_of(self, auction: int, time: float) -> bool:
        """Whether it obeys at present."""
        return time < self.dies and auction in self.bids and self.bids[auction].phase is BidPhase.MEMBER


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
            elif bid is None and not stopped:
                auction = self.auctions[number]
                cost = robot.cost if auction.name == "BEST" else 0.0
                until = robot.now(LIFE)
                robot.bids[number] = Bid(auction, ("desk", 1, number), robot.name, cost, now, until, 0.02)
        robot.inbox.clear()
        for number, bid in robot.bids.items():
            if stopped:
                bid.leave()
            bid.tick(now)
            if (said := bid.say(now)) is not None:
                self._send(self.callers[number], robot.name, number, BidMessage.of(said.body()))


def best(most: int, lease: float = 4.0) -> Auction:
    return Auction("BEST", 1, most, "", "", 1.0, lease, (), ())


def quorum(least: int, most: int, lease: float = 4.0) -> Auction:
    return Auction("QUORUM", least, most, "", "", 1.0, lease, (), ())


def best_of(rounds: Rounds, most: int) -> set[str]:
    """The robots that have the least costs of all."""
    return {robot.name for robot in sorted(rounds.robots, key=lambda each: rank(each.cost, each.name))[:most]}


def main() -> None:
    parser = argparse.ArgumentParser(description="Rounds of BEST and QUORUM on a radio that loses.")
    parser.add_argument("--rounds", type=int, default=10_000)
    parser.add_argument("--loss", type=float, action="append", help="share of messages that are lost, e.g. 0.5")
    options = parser.parse_args()
    rounds = options.rounds
    print(f"{rounds:,} rounds each: BEST 4 of 12, QUORUM 5 8 of 12, one robot in eight dies on the way")
    print("lost   the true four   four of others   fewer   too many   quorum started   short   too many")
    for loss in options.loss or (0.0, 0.1, 0.2, 0.3, 0.4, 0.5):
        print(f"{loss:4.0%}   {'   '.join(_row(loss, rounds))}", flush=True)


def _row(loss: float, rounds: int) -> list[str]:
    true = others = fewer = many = started = short = crowd = 0
    for seed in range(rounds):
        chance = Random(f"{loss} {seed}")
        each = Rounds(chance, [best(4), quorum(5, 8)], 12, loss)
        for robot in each.robots:
            robot.dies = chance.uniform(0.0, 8.0) if chance.random() < 0.125 else inf
        each.run(7.0)
        obeyed = set(each.callers[0].status().members)
        alive = {robot.name for robot in each.robots if robot.dies > each.time}
        living = sorted((robot for robot in each.robots if robot.name in alive), key=lambda r: rank(r.cost, r.name))
        true += obeyed in (best_of(each, 4), {robot.name for robot in living[:4]})
        others += len(obeyed) >= 4 and obeyed not in (best_of(each, 4), {robot.name for robot in living[:4]})
        fewer += len(obeyed) < 4
        many += each.most_members[0] > 4
        status = each.callers[1].status()
        started, short, crowd = started + status.started, short + status.short, crowd + (each.most_members[1] > 8)
    shares = (true, others, fewer, many, started, short)
    wide = (13, 14, 5, 8, 14, 5)
    return [f"{share / rounds:{width}.2%}" for share, width in zip(shares, wide, strict=True)] + [f"{crowd:8}"]


if __name__ == "__main__":
    main()
