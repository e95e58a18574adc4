"""Authority in a fleet is authority in a node: whoever sends whatever, in whatever order and however late, the robots
of a fleet answer with the same outcome and sentence, tell the same of themselves, and end in the same state.

Two operators, a commander, an observer, another robot and somebody without a role send messages of every kind, and
grant what robots bid. Some are lost on some robots, repeated, late, early, or malformed.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from math import inf
from random import Random
from typing import Any

from hypothesis import given, note, settings
from hypothesis import strategies as st
from msgspec import structs

from fleet.twins import Twins, vocabulary
from language.cases import SENSORS, Body
from sleepcast.channel.message import (
    AUCTION,
    BID,
    DRIVER,
    ENDS,
    HOPS,
    KEYS,
    LEASE,
    LOOK,
    MATCHED,
    Inspection,
    Kind,
    LeaseAction,
    Message,
    Role,
)
from sleepcast.core.errors import SleepcastError
from sleepcast.core.serial import pack, unpack
from sleepcast.fleet import Fleet
from sleepcast.fleet.schema import FleetSnapshot
from sleepcast.fleet.snapshot import restore, state_of
from sleepcast.mind.auction import BidMessage, GrantMessage
from sleepcast.mind.authority import Tells
from sleepcast.robot import Reading, Setpoint

MOST = 1 << 20
EXAMPLES = max(50, settings().max_examples)
ROLES = {
    "anna": Role.OPERATOR,
    "bert": Role.OPERATOR,
    "chief": Role.COMMANDER,
    "watch": Role.OBSERVER,
    "r9": Role.ROBOT,
    "desk": "",
}
AUCTIONS = (
    "(BEST 2 (- fuel id) (> fuel 1) (PROGN (JOIN bravo) (RULE a (MARK)) (VM 1 1)) :lease 1s)",
    "(BEST 1 UNKNOWN (IN bravo) (MARK))",
    "(QUORUM 1 2 (NOT (IN charlie)) (PROGN (JOIN charlie) (TELL (JOIN bravo)) (+ fuel UNKNOWN)))",
    "(QUORUM 1 2 (NOT marked) (PROGN (MARK) (twice fuel)) :lease 10s)",
)
CALLS = (
    "(TELL (BEST 1 (ABS (- id 2)) TRUE (JOIN bravo) :window 0.2s :lease 1s))",
    "(RULE calls (TELL `(BEST 2 (- fuel ,id) (NOT marked) (PROGN (MARK) (VM 1 2)) :window 0.2s)))",
    "(RULE calls (TELL (QUORUM 1 2 TRUE (JOIN charlie) :window 0.2s :lease 1s)))",
    "(FORGET calls)",
)
TEXTS = (
    "(VM 1 1)",
    "(SETQ throttle 0.5)",
    "(WHEN (> fuel 2) (VM 1 0))",
    '(TK "hello")',
    "(MARK)",
    "(JOIN bravo)",
    "(LEAVE bravo)",
    "(WHEN (IN bravo) (JOIN charlie))",
    "(RULE a (MARK))",
    "(RULE a (VM 0 1))",
    "(RULE b (SETQ lamp 1) :priority 3)",
    "(RULE b (WHEN (> fuel 1) (SETQ throttle 1)))",
    "(RULE calls (TELL (VM 2 2)))",
    "(RULE built (MARK))",
    "(SETQQ E2 (VM 3 3))",
    "(SETQ E2 1)",
    "(ACTIVATE E2)",
    "(DEACTIVATE a)",
    "(FORGET a)",
    "(LEASE b 1s)",
    "(ROLLBACK)",
    "(DEFUN twice (v) (* 2 v))",
    "(DEFUN twice (v) (+ v v))",
    "(+ (twice fuel) 1)",
    "(SLEEP)",
    "(WAKE)",
    "(FREEZE)",
    "(UNFREEZE)",
    "(TELL (VM 1 1))",
    "(PROGN (VM 1 1) (TELL (JOIN bravo) :hops 2))",
    "(AFTER-ISSUE 0.4s (VM 2 0))",
    "(AFTER-ISSUE 0.8s (WHEN (IN bravo) (RULE a (MARK))))",
    "(AFTER-ISSUE 0.3s (PROGN (JOIN bravo) (CANCEL)))",
    "(AFTER-ISSUE 1h (MARK))",
    "(CANCEL)",
    "(nonsense",
    "(+ nobody 1)",
    *(3 * AUCTIONS),
    *(3 * CALLS),
)


class Machine(Body):
    """A body that is stopped, released and held by its mind, and knows whether it has come to rest."""

    stopped = False

    model: object = None

    def sense(self) -> Reading:
        raise NotImplementedError("the test gives the readings")

    def act(self, wanted: Setpoint) -> None:
        raise NotImplementedError("actuators stay in the mind")

    def stop(self) -> None:
        self.done.append("stop")

    def release(self) -> None:
        self.done.append("release")

    def hold(self, still: bool) -> None:
        self.done.append(f"hold {still}")

    def let_go(self) -> None:
        self.done.append("let go")


@dataclass
class Life:
    """Twins, and everybody who sends to them."""

    chance: Random
    twins: Twins
    seed: int
    rights: dict[str, Any]
    sent: dict[tuple[str, int], int] = field(default_factory=dict)
    said: list[Message] = field(default_factory=list)
    stops: list[Message] = field(default_factory=list)
    sequence: int = 0
    signed: str = Role.ROBOT
    """The role of the keys of these robots."""

    def some(self) -> list[int] | None:
        count = len(self.twins.nodes)
        if count == 1 or self.chance.random() < 0.6:
            return None
        return sorted(self.chance.sample(range(count), self.chance.randint(1, count - 1)))

    def step(self) -> None:
        chance, twins = self.chance, self.twins
        if chance.random() < 0.1:
            twins.sense([[chance.choice((0.0, 1.5, 3.0)) for _ in SENSORS] for _ in twins.nodes])
        if chance.random() < 0.1:
            self.disturb()
        if chance.random() < 0.15:
            self.put_away()
        for _ in range(chance.choice((1, 1, 1, 2, 5))):
            message = chance.choice(self.said) if self.said and chance.random() < 0.1 else self.message()
            self.said.append(message)
            those = self.some()
            note(f"{those}: {message}")
            twins.hear(message, those)
        twins.think(chance.choice((1, 1, 3, 8, 25, 700)), self.some() if chance.random() < 0.2 else None)
        for _ in range(chance.choice((1, 1, 10))):
            told = [said for node in twins.nodes for said in node.outbox if said.kind in (Kind.COMMAND, Kind.REQUEST)]
            self.compare()
            self.grant([said for said in told if BID in said.body])
            for said in told[:6]:
                twins.hear(structs.replace(said, role=self.signed))
            if not told:
                break
            twins.think()

    def grant(self, bids: list[Message]) -> None:
        """The callers of some robots that bid say something; some of it comes late, or twice."""
        chance, polls = self.chance, {each.id: each for each in self.said}
        for bid in chance.sample(bids, min(len(bids), 2)):
            said = BidMessage.of(bid.body)
            assert said is not None
            poll = polls.get(f"{said.caller}-{said.epoch}.{said.number}")
            if poll is None:
                continue  # a robot's own
            granted = {bid.sender: said.beat - chance.choice((0, 0, 0, 1))} if chance.random() < 0.8 else {}
            grants = GrantMessage(said.number, chance.random() < 0.8, granted, ((0.5, "r1"), (2.0, "r2")))
            self.sequence += 1
            about = {"role": poll.role, "key": poll.key, "ahead": chance.choice((0.0, 0.0, 0.0, 9.0))}
            sent = Message(
                *(poll.sender, poll.epoch, 1_000 + self.sequence, Kind.REQUEST, self.twins.now),
                body=grants.body(),
                **about,
            )
            note(f"{sent}")
            for _ in range(chance.choice((1, 1, 2))):
                self.twins.hear(sent, self.some())

    def divide_the_work(self) -> None:
        """Some robots are in a group, which anna takes."""
        take = {LEASE: {"do": LeaseAction.TAKE, "group": "bravo", "seconds": 60.0, "to": ""}}
        self.twins.hear(
            Message("chief", 1, 1, Kind.COMMAND, 0.0, text="(JOIN bravo)", role=Role.COMMANDER), self.some()
        )
        self.twins.hear(Message("anna", 1, 1, Kind.COMMAND, 0.0, body=take, role=Role.OPERATOR), self.some())
        self.sent |= {("chief", 1): 1, ("anna", 1): 1}
        self.twins.think()

    def put_away(self) -> None:
        """The fleet is replaced by one made from its snapshot."""
        twins, data = self.twins, pack(state_of(self.twins.fleet), MOST)
        again = Fleet(twins.fleet.names, vocabulary(), numbers=twins.fleet.numbers, seed=self.seed, **self.rights)
        restore(again, unpack(FleetSnapshot, data, MOST, "fleet"), 0.0)
        assert pack(state_of(again), MOST) == data
        twins.fleet, twins.views = again, list(again.values())

    def disturb(self) -> None:
        """A robot's own software does something."""
        robot, what = self.chance.randrange(len(self.twins.nodes)), self.chance.randrange(4)
        note(f"disturb {robot} {what}")
        minds = self.twins.views[robot], self.twins.nodes[robot]
        refused = []
        for mind in minds:
            if what == 0:
                mind.halt("it was off")
            elif what == 1:
                mind.catch_up(not mind.catching_up)
            else:
                try:
                    mind.install("built", "(WHEN (> fuel 1) (VM 9 9))", priority=what - 2)
                except SleepcastError as error:
                    refused.append(str(error))
        assert len(refused) in (0, 2)
        assert len({*refused}) <= 1

    def message(self) -> Message:
        chance, now = self.chance, self.twins.now
        sender, epoch = chance.choice((*ROLES, "anna", "bert")), chance.choice((1, 1, 1, 2))
        number = self.sent[sender, epoch] = self.sent.get((sender, epoch), 0) + chance.choice((1, 1, 2))
        kind, text, body = self.content(sender)
        issued = now - chance.choice((0.0, 0.0, 0.3, 2.0))
        standing = kind is Kind.COMMAND and chance.random() < 0.25
        seconds = inf if standing or kind not in (Kind.COMMAND, Kind.ASK) else chance.choice((5.0, 5.0, 0.05, inf))
        body = body | chance.choice(({}, {}, {}, {"for": ["r0"]}, {"not": ["r0"]}, {"for": 7}))
        role, heard = ROLES[sender], chance.choice((None, now))
        ahead = 9.0 if chance.random() < 0.05 else 0.0
        found = Message(
            sender, epoch, number, kind, issued, issued + seconds, text, standing, body, role, heard, ahead, role
        )
        self.stops += [found] if kind is Kind.STOP else []
        return found

    def content(self, sender: str) -> tuple[Kind, str, dict[str, object]]:
        chance = self.chance
        match chance.randrange(12):
            case 0 | 1:
                return Kind.COMMAND, "", self.lease()
            case 2:
                return Kind.STOP, "", chance.choice(({}, {}, {"age": 0.5}))
            case 3:
                ends = [[each.sender, each.epoch, each.sequence] for each in self.stops[-4:]]
                return Kind.RELEASE, "", chance.choice(({}, {"age": 20.0}, {ENDS: ends}, {ENDS: ends}))
            case 4:
                return Kind.HEARTBEAT, "", {}
            case 5:
                body = chance.choice(({}, {MATCHED: True}))
                return Kind.ASK, chance.choice((*TEXTS, "fuel", "(IF (IN bravo) fuel UNKNOWN)")), body
            case 6:
                what = chance.choice((*Inspection, "no such look", 5))
                return Kind.ASK, "", {LOOK: "mind" if what == Inspection.WHY else what}
            case 7 if chance.random() < 0.3:
                keys = chance.choice(({"revoke": ["00"]}, {"trust": 5}, "all of them"))
                return Kind.COMMAND, "", {KEYS: keys}
            case _:
                told = sender == "r9" or chance.random() < 0.05
                body = {HOPS: chance.choice((1, 2)), **chance.choice(({}, {DRIVER: "anna"}))} if told else {}
                text = chance.choice(TEXTS)
                called = told and (text in AUCTIONS or chance.random() < 0.1)
                return Kind.COMMAND, text, body | ({AUCTION: chance.choice((3, 4, -1, "5"))} if called else {})

    def lease(self) -> dict[str, object]:
        chance = self.chance
        wish: dict[str, object] = {
            "do": chance.choice((*LeaseAction, LeaseAction.TAKE, "steal")),
            "group": chance.choice(("bravo", "bravo", "BRAVO", "charlie", "")),
            "seconds": chance.choice((60.0, 60.0, 0.5, -1.0)),
            "to": chance.choice(("anna", "bert", "")),
        }
        return {LEASE: chance.choice((wish, wish, wish, wish, "bravo"))}

    def compare(self) -> None:
        """Raise AssertionError where what can be seen differs, or what nobody can see but decides what comes."""
        twins, authority = self.twins, self.twins.fleet.authority
        twins.compare()
        for place, node in enumerate(twins.nodes):
            assert authority.leases.of(place).held == node.authority.leases.held
            assert authority.driving.of(place) == node._driving
            assert twins.fleet.state.latch.of(place) == node.authority.latch
            assert twins.fleet.state.merging.of(place).key() == node.memory.base.merging.key()


def live(chance: Random, *, steps: int = 10) -> None:
    body = chance.choice((Body, Machine))
    rights: dict[str, Any] = {
        "lease": chance.choice((inf, 1.0, 1.0)),
        "tells": chance.choice((Tells.ALL, Tells.ALL, Tells.MARKS, Tells.NONE)),
        "on_air": chance.random() < 0.7,
    }
    note(f"{body.__name__} {rights}")
    seed = chance.randrange(2**32)
    twins = Twins(chance.choice((1, 1, 3)), seed=seed, body=body, **rights)
    life = Life(chance, twins, seed, {"bodies": twins.here, **rights})
    life.signed = chance.choice((Role.ROBOT, Role.ROBOT, ""))
    if chance.random() < 0.5:
        life.divide_the_work()
    for _ in range(steps):
        life.step()


@settings(max_examples=EXAMPLES)
@given(start=st.integers(0, 2**63))
def test_a_fleet_obeys_whom_nodes_obey(start: int) -> None:
    live(Random(start))
