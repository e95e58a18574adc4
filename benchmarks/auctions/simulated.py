"""Rounds of BEST and QUORUM in a simulated swarm, counted as `made` counts its own: the product's desk, fleet and
simulated radio, with its losses, delays and repeats. Bodies are left out, since nobody moves.

A desk in a simulated swarm sends a command once, so a robot that has not heard it cannot bid: the true four are those
of the robots that have heard it.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from functools import partial
from math import inf
from random import Random

import numpy as np

from benchmarks.auctions import made
from benchmarks.auctions.made import DYING, LEAST, MOST, PLACES, ROBOTS, SECONDS
from sleepcast.channel.message import Kind, Message
from sleepcast.channel.simulated_radio import OPERATOR, Radio, RadioModel
from sleepcast.core.model import Quantity
from sleepcast.fleet import Fleet
from sleepcast.language import Vocabulary
from sleepcast.mind.auction import rank
from sleepcast.station import Station

TICK = 0.1
JITTER, REPEATED = 0.25, 0.1
VOCABULARY = Vocabulary("craft", sensors=(Quantity("cost"), Quantity("willing")))
NAMES = [f"r{number}" for number in range(ROBOTS)]
TEXTS = (f"(BEST {PLACES} cost TRUE (JOIN red))", f"(QUORUM {LEAST} {MOST} (> willing 0) (JOIN blue))")
GROUPS = ("red", "blue")


class SimulatedRound:
    """One round. dies: when each robot does, s."""

    def __init__(self, loss: float, chance: Random) -> None:
        self.tick, self.posted = 0, list[Message]()
        self.dies = np.array([chance.uniform(0.0, SECONDS + 1.0) if chance.random() < DYING else inf for _ in NAMES])
        self.accepting = chance.randint(LEAST - 1, ROBOTS)
        self.costs = [chance.choice((0.0, 1.0, chance.uniform(0.0, 100.0))) for _ in NAMES]
        self.fleet = Fleet(NAMES, VOCABULARY, native=False)
        self.fleet.sense(np.array([[cost, i < self.accepting] for i, cost in enumerate(self.costs)], np.float64), 0.0)
        model = RadioModel(loss=loss, jitter=JITTER, duplication=REPEATED)
        place = np.zeros(ROBOTS)
        self.radio = Radio(model, place, place, seed=chance.getrandbits(32), clock=self, party=lambda name: OPERATOR)
        self.desk = Station(VOCABULARY, self.fleet, self.posted.append, self)
        self.sent = [self.desk.send(text, everybody=True, deadline=made_for(), confirmed=True) for text in TEXTS]
        self.heard: list[set[int]] = [set(), set()]
        self.most = [0, 0]

    def now(self) -> float:
        return self.tick * TICK

    def run(self) -> None:
        """Until nobody else is chosen in either auction."""
        while self.now() < SECONDS and any(each.auctioneer and each.auctioneer.is_open for each in self.sent):
            self.step()

    def step(self) -> None:
        """One tick."""
        self.tick += 1
        while self.posted:
            self.radio.send(OPERATOR, self.posted.pop(0))
        alive = np.flatnonzero(self.dies > self.now())
        for message, robots in self.radio.receive_all():
            there = np.intersect1d(robots, alive)
            self.fleet.receive(message, there)
            if message.kind is Kind.COMMAND:
                self.heard[message.sequence - 1].update(there.tolist())
        self.fleet.think(self.tick, self.now(), alive)
        for batch in self.fleet.take_messages():
            self.radio.send_all(batch)
        for said in self.radio.hear(OPERATOR):
            if isinstance(said, Message):
                self.desk.hear(said)
            else:
                self.desk.hear_many(said)
        self.desk.attend()
        for which, group in enumerate(GROUPS):
            members = self.fleet.groups.get(group)
            count = 0 if members is None else int(np.count_nonzero(members[alive]))
            self.most[which] = max(self.most[which], count)


def made_for() -> float:
    """Seconds for which the polls are good: half a second less than a round lasts."""
    return SECONDS - 0.5


def outcome(loss: float, seed: int) -> dict[str, bool]:
    """How one round ended, by the keys of `made.COLUMNS`."""
    each = SimulatedRound(loss, Random(f"simulated {loss} {seed}"))
    each.run()
    best, quorum = (each.desk.accounting(sent.id).auction for sent in each.sent)
    assert best is not None
    assert quorum is not None
    accepted = sum(robot < each.accepting for robot in each.heard[1])
    killed = any(each.dies[NAMES.index(name)] <= each.now() for name in quorum.chosen)
    true = set(best.members) in (_least(each, inf), _least(each, each.now()))
    return {
        "true": true,
        "others": len(best.members) >= PLACES and not true,
        "fewer": len(best.members) < PLACES and not true,
        "many": each.most[0] > PLACES,
        "accepted": accepted >= LEAST,
        "started": quorum.started,
        "hasty": quorum.started and accepted < LEAST,
        "short": quorum.short,
        "lost": quorum.short and not killed,
        "crowd": each.most[1] > MOST,
    }


def _least(each: SimulatedRound, time: float) -> set[str]:
    """Those that bid least, of whoever has heard the poll; time: whether who was dead by then counts as well (inf)."""
    there = [robot for robot in each.heard[0] if time == inf or each.dies[robot] > time]
    return {NAMES[robot] for robot in sorted(there, key=lambda robot: rank(each.costs[robot], NAMES[robot]))[:PLACES]}


def counted(loss: float, seeds: Sequence[int]) -> Counter[str]:
    """How many of the rounds with these seeds ended in which way."""
    found = Counter[str]()
    for seed in seeds:
        found.update(key for key, is_so in outcome(loss, seed).items() if is_so)
    return found


rows = partial(made.rows, count=counted)
