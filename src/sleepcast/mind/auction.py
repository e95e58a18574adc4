"""Auctions: who of many robots obeys a command with BEST or QUORUM. Both halves, the caller's (`Auctioneer`) and a
robot's (`Bid`), without messages' envelopes, evaluations or a clock of their own.

poll      the command itself. A robot whose test is true, and whose cost is known, bids once: its cost stays as it is
bids      a robot says its cost again and again, each time with a higher beat, until it knows what becomes of it. The
          caller tells which bids are the best so far, and whoever hears of enough better ones is silent
grants    when the window is over, the caller names the least bids, each with the beat that it has heard last. A robot
          that is named looks at its test again, obeys, and is a member
leases    a member's lease runs from the moment at which it sent the beat that the latest grant names. The caller has
          heard that beat later, so it knows without anybody's clock until when the robot can be a member at most; until
          then, or until the robot itself says that it is out, it gives the place to nobody else

So there are never more members than places, whatever is lost, late, repeated or killed: a place exists before its
grant is sent, and outlasts it. All messages say how things stand, and are said again: losing one only takes time.
"""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from math import inf
from typing import NamedTuple
from zlib import crc32

from sleepcast.channel.message import BID, GRANTS, MAX_NAME, MAX_NUMBER, natural_order
from sleepcast.language.functions import MAX_CHOSEN
from sleepcast.language.parts import Auction

SOON = 0.1
"""Seconds between two messages about a bid that nobody has answered yet, or a grant that nobody has confirmed."""
QUIET, SELDOM = 10.0, 1.0
"""Seconds for which a robot bids that often although it hears nothing of the caller, who may be gone; and between two
of its bids from then on."""
LEAST_BEAT, MOST_BEAT, BEATS = 0.2, 5.0, 20
"""The same for a lease that goes on, at least and at most; and how often they come in it."""
DRIFT = 1e-3
"""By how much a robot's second may be longer than the caller's: more than any quartz drifts."""
LATE = 0.5
"""Seconds by which a member may leave late, since it looks at its lease once a tick."""
USEFUL = 0.3
"""Seconds of a lease that are left at least when a robot becomes a member by it."""
FRESH = 2.0
"""Seconds for which a bid is taken for one of a robot that is still there."""
FAREWELLS = 4
"""How often a robot says that it is out."""
CLOSING = 2.0
"""Seconds for which a caller says that nobody else is chosen, if it has no member to tell anything."""
MAX_BIDS = 10_000
"""Bids that a caller remembers, and robots that are out; when it has heard of twice as many, the worst bids go, and the
robots that went first."""


class BidPhase(StrEnum):
    """How a robot stands to an auction."""

    BIDDING = "bid"
    MEMBER = "in"
    OUT = "out"
    """For good: it never becomes a member of this auction any more."""


_PHASES = {phase.value: phase for phase in BidPhase}


class BidMessage(NamedTuple):
    """What a robot says. caller, epoch, number: of the poll; beat: grows from message to message."""

    caller: str
    epoch: int
    number: int
    beat: int
    phase: BidPhase
    cost: float

    def body(self) -> dict[str, object]:
        return {BID: [self.caller, self.epoch, self.number, self.beat, self.phase.value, self.cost]}

    @staticmethod
    def of(body: Mapping[str, object]) -> BidMessage | None:
        """The one in a message's body; None if there is none, or one that cannot be meant."""
        said = body.get(BID)
        if not isinstance(said, list) or tuple(map(type, said)) != (str, int, int, int, str, float):
            return None
        caller, epoch, number, beat, phase, cost = said
        fits = len(caller) <= MAX_NAME and min(epoch, number, beat) >= 0 and max(epoch, number, beat) <= MAX_NUMBER
        if fits and phase in _PHASES and -inf < cost < inf:
            return BidMessage(caller, epoch, number, beat, _PHASES[phase], cost)
        return None


class GrantMessage(NamedTuple):
    """What a caller says. number: of its poll; is_open: whether others may still be chosen; granted: who is chosen,
    each with the beat that this goes by; best: the least bids that the caller knows, as many as may be chosen."""

    number: int
    is_open: bool
    granted: Mapping[str, int]
    best: tuple[tuple[float, str], ...]

    def body(self) -> dict[str, object]:
        costs, names = [cost for cost, _ in self.best], [name for _, name in self.best]
        chosen = {"granted": list(self.granted), "beats": list(self.granted.values())}
        return {GRANTS: {"of": self.number, "open": self.is_open, **chosen, "best": names, "costs": costs}}

    @staticmethod
    def of(body: Mapping[str, object]) -> GrantMessage | None:
        """The one in a message's body; None if there is none, or one that cannot be meant."""
        match body.get(GRANTS):
            case {
                "of": int() as number,
                "open": bool() as is_open,
                "granted": list() as granted,
                "beats": list() as beats,
                "best": list() as best,
                "costs": list() as costs,
            }:
                named = _are(granted, str) and _are(beats, int) and len(granted) == len(beats)
                if named and _are(best, str) and _are(costs, float) and len(best) == len(costs):
                    pairs = zip(granted, beats, strict=True)
                    return GrantMessage(number, is_open, dict(pairs), tuple(zip(costs, best, strict=True)))
        return None


def _are(items: list[object], kind: type) -> bool:
    return len(items) <= MAX_CHOSEN and all(type(item) is kind for item in items)


def beat_of(lease: float) -> float:
    """Seconds between two messages about a member with such a lease."""
    return min(max(lease / BEATS, LEAST_BEAT), MOST_BEAT)


def rank(cost: float, name: str) -> tuple[float, object, str]:
    """The order of bids: the least cost, of equal ones the smaller name, r2 before r10."""
    return cost, natural_order(name), name


# ---- a robot's half


class Bid:
    """One robot's bid. Times are s of its mind.

    caller, epoch, number: of the poll
    cost: what it bids
    until: when the poll's deadline is over
    spread: s over which the first bids of all robots are to be spread
    """

    def __init__(
        self,
        auction: Auction,
        poll: tuple[str, int, int],
        name: str,
        cost: float,
        now: float,
        until: float,
        spread: float,
    ) -> None:
        self.auction, self.name, self.cost, self.until = auction, name, cost, until
        self.caller, self.epoch, self.number = poll
        self.phase = BidPhase.BIDDING
        self.outbid: tuple[str, ...] = ()
        """Once it is out: who was chosen instead, as far as it has heard."""
        self.lease_ends = -inf
        self._beats: dict[int, float] = {}
        """When each beat was sent that a grant may still name."""
        chance = crc32(f"{name} {poll} {now!r}".encode())
        # Of two robots of one name, a grant means the one whose beats it names.
        self._beat, self._pace = chance, beat_of(auction.lease)
        self._next = now + chance / 2**32 * min(spread, auction.window / 2)
        self._latest, self._heard, self._farewells = -1, now, FAREWELLS
        self._best: tuple[tuple[float, str], ...] = ()

    def hear(self, grants: GrantMessage, sequence: int, now: float) -> bool:
        """Take in what the caller says in its message of this number; whether the robot is to obey now, and then to
        say whether it `settle`s."""
        if self.phase is BidPhase.OUT or grants.number != self.number:
            return False
        if sequence > self._latest:
            self._latest, self._heard, self._best = sequence, now, grants.best
        beat = grants.granted.get(self.name)
        if beat in self._beats:
            self.lease_ends = max(self.lease_ends, self._beats[beat] + self.auction.lease)
            return self.phase is BidPhase.BIDDING and now <= self.until and now + USEFUL < self.lease_ends
        if self.phase is BidPhase.BIDDING and beat is None and not grants.is_open:
            self.outbid = tuple(grants.granted)
            self.leave()
        return False

    def settle(self, obeys: bool) -> None:
        """The robot has been granted its bid, and obeys from now on, or does not."""
        if obeys:
            self.phase = BidPhase.MEMBER
        else:
            self.leave()

    def leave(self) -> None:
        """The robot has nothing to do with this auction any more."""
        self.phase = BidPhase.OUT

    def tick(self, now: float) -> None:
        """Leave if that is due: the lease has ended, or nobody has chosen this robot in time."""
        over = now >= self.lease_ends if self.phase is BidPhase.MEMBER else now > self.until
        if over:
            self.leave()

    def say(self, now: float) -> BidMessage | None:
        """What to tell the caller now, if anything."""
        out = self.phase is BidPhase.OUT
        if now < self._next or (out and not self._farewells) or (self.phase is BidPhase.BIDDING and self._is_beaten()):
            return None
        self._farewells -= out
        hopeful = SOON if now < self._heard + QUIET else SELDOM
        pause = hopeful if self.phase is BidPhase.BIDDING else self._pace
        self._next, self._beat = now + pause, self._beat + 1
        self._beats = {beat: sent for beat, sent in self._beats.items() if now < sent + self.auction.lease}
        self._beats[self._beat] = now
        return BidMessage(self.caller, self.epoch, self.number, self._beat, self.phase, self.cost)

    def _is_beaten(self) -> bool:
        mine = rank(self.cost, self.name)
        return sum(rank(cost, name) < mine for cost, name in self._best) >= self.auction.most

    @property
    def is_over(self) -> bool:
        """Whether there is nothing left to be said."""
        return self.phase is BidPhase.OUT and not self._farewells


# ---- a caller's half


class HeardBid(NamedTuple):
    """A bid as the caller knows it: of which life of the robot, its latest beat and when that was heard, s."""

    cost: float
    life: int
    beat: int
    heard: float


class TakenPlace(NamedTuple):
    """A place that is taken. beat: which the grants name; ends: until when the robot can be a member at most, s;
    confirmed: whether it has said that it is one."""

    beat: int
    ends: float
    confirmed: bool = False


class AuctionStatus(NamedTuple):
    """How an auction stands. bids: the cost of all that were heard; chosen: who was granted, in the order of bids;
    members: who has obeyed; started: whether there were enough bids; short: whether fewer have obeyed than wanted,
    although it was started; over: whether nobody else is chosen any more."""

    auction: Auction
    bids: Mapping[str, float]
    chosen: tuple[str, ...]
    members: tuple[str, ...]
    started: bool
    short: bool
    over: bool

    def outbid(self) -> dict[str, tuple[str, ...]]:
        """Those whose bid was heard and not chosen, each with who was chosen before it."""
        ranks = {name: rank(cost, name) for name, cost in self.bids.items()}
        left = sorted((name for name in ranks if name not in self.chosen), key=ranks.__getitem__)
        return {name: tuple(each for each in self.chosen if ranks[each] < ranks[name]) for name in left}

    def outbid_by(self) -> dict[tuple[str, ...], list[str]]:
        """The same the other way around: who was outbid by the same robots."""
        found: dict[tuple[str, ...], list[str]] = {}
        for name, by in self.outbid().items():
            found.setdefault(by, []).append(name)
        return found

    def to_dict(self) -> dict[str, object]:
        """For journals and scripts."""
        outbid = {name: list(by) for name, by in self.outbid().items()}
        counts = {"started": self.started, "short": self.short, "over": self.over}
        return {"bids": dict(self.bids), "chosen": list(self.chosen), "outbid": outbid, **counts}

    def sentence(self) -> str:
        """For a person: `12 bids; chosen r3 (1.5), r7 (2)`."""
        chosen = ", ".join(
            f"{name} ({self.bids[name]:.6g})" if self.auction.name == "BEST" else name for name in self.chosen
        )
        bids = f"{len(self.bids)} bid{'' if len(self.bids) == 1 else 's'}"
        if not self.started and self.over:
            few = f", wanted {self.auction.least}: nobody was chosen" if self.auction.least > 1 else ""
            return bids + few
        short = f"; short: only {len(self.members)} obeyed, wanted {self.auction.least}" if self.short else ""
        return f"{bids}; chosen {chosen or 'nobody yet'}{short}"


class Auctioneer:
    """The caller of one auction. Times are s of its clock.

    number: of the poll
    began, until: when it was sent, and its deadline
    """

    def __init__(self, auction: Auction, number: int, began: float, until: float) -> None:
        self.auction, self.number, self.until = auction, number, until
        self.window_ends = min(began + auction.window, until)
        self.is_open, self.started, self.ended = True, False, False
        self._bids: dict[str, HeardBid] = {}
        self._places: dict[str, TakenPlace] = {}
        self._gone: dict[str, None] = {}
        """Who is out, or was not heard until its place was over."""
        self._costs: dict[str, float] = {}
        self._chosen: dict[str, None] = {}
        self._obeyed: dict[str, None] = {}
        self._chose = False
        self._changed = self.window_ends
        self.closed = inf
        """Since when nobody else is chosen, s."""
        self._pace, self._next = beat_of(auction.lease), began
        self.version = 0
        """Another one whenever the status may be another one."""

    def hear(self, name: str, life: int, said: BidMessage, now: float) -> None:
        """Take in what a robot says, in which life it is; of robots of one name the first one counts."""
        known = self._bids.get(name)
        if self.ended or name in self._gone or (known is not None and (life != known.life or said.beat <= known.beat)):
            return
        if said.phase is BidPhase.OUT:
            self._part_with(name, now)
            return
        cost = said.cost if known is None else known.cost
        self._bids[name] = HeardBid(cost, life, said.beat, now)
        if self._costs.get(name) != cost:
            self._costs[name], self.version = cost, self.version + 1
        place = self._places.get(name)
        if place is not None:
            confirmed = said.phase is BidPhase.MEMBER
            if confirmed and name not in self._obeyed:
                self._obeyed[name], self.version = None, self.version + 1
            self._places[name] = TakenPlace(said.beat, self._outlasting(now), confirmed)
        if len(self._costs) > 2 * MAX_BIDS:
            self._forget_the_worst()

    def step(self, now: float) -> GrantMessage | None:
        """Do what is due; what to say to all robots now, if anything."""
        if self.ended:
            return None
        for name in [name for name, place in self._places.items() if place.ends < now]:
            self._part_with(name, now)
        if self.is_open and now >= self.window_ends:
            self._choose(now)
        if now < self._next or self.is_over(now):
            return None
        self._next = now + (self._pace if self._is_settled else SOON)
        if not self._bids and self.is_open:
            return None
        granted = {name: place.beat for name, place in self._places.items()}
        return GrantMessage(self.number, self.is_open, granted, self._best(now))

    def end(self) -> None:
        """Say nothing more: members leave when their leases are over."""
        self.ended, self.closed = True, min(self.closed, self.window_ends)
        self.is_open, self.version = False, self.version + 1

    def is_over(self, now: float) -> bool:
        """Whether there is nothing left to be said."""
        return self.ended or (not self._places and now >= self.closed + CLOSING)

    def due(self, now: float) -> float:
        """When to `step` next, s."""
        return inf if self.is_over(now) else self._next

    def status(self) -> AuctionStatus:
        chosen = tuple(sorted(self._chosen, key=lambda name: rank(self._costs[name], name)))
        members = tuple(name for name in chosen if name in self._obeyed)
        short = self.started and not self.is_open and len(members) < self.auction.least
        return AuctionStatus(self.auction, dict(self._costs), chosen, members, self.started, short, not self.is_open)

    def _choose(self, now: float) -> None:
        """Give free places to the least bids, and close when all is said."""
        waiting = sorted(self._waiting(now), key=self._rank)
        if not self._chose:
            self._chose, self.started = True, len(waiting) >= self.auction.least
            if not self.started and self.auction.name == "QUORUM":
                self._close(now)
                return
        if now < self.until:
            for name in waiting[: self.auction.most - len(self._places)]:
                bid = self._bids[name]
                self._places[name] = TakenPlace(bid.beat, self._outlasting(bid.heard))
                self._chosen[name], self.version = None, self.version + 1
                self.started, self._changed = True, now
        quiet = len(self._places) == self.auction.most or now >= self._changed + self.auction.window
        if now >= self.until or (quiet and self._is_settled):
            self._close(now)

    def _close(self, now: float) -> None:
        self.is_open, self.closed, self.version = False, now, self.version + 1

    @property
    def _is_settled(self) -> bool:
        """Whether each robot that was chosen has said that it obeys."""
        return self._chose and all(place.confirmed for place in self._places.values())

    def _waiting(self, now: float) -> list[str]:
        """Whose bids wait for a place."""
        since = now - max(FRESH, self.auction.window if not self._chose else 0.0)
        return [name for name, bid in self._bids.items() if bid.heard >= since and name not in self._places]

    def _best(self, now: float) -> tuple[tuple[float, str], ...]:
        """The least bids: of those who have a place, and who may still have one."""
        names = sorted((*self._places, *self._waiting(now)), key=self._rank)
        return tuple((self._bids[name].cost, name) for name in names[: self.auction.most])

    def _rank(self, name: str) -> tuple[float, object, str]:
        return rank(self._bids[name].cost, name)

    def _forget_the_worst(self) -> None:
        """Keep MAX_BIDS bids, those of all who were chosen among them."""
        ranks = {name: (name not in self._chosen, rank(cost, name)) for name, cost in self._costs.items()}
        kept = set(sorted(ranks, key=ranks.__getitem__)[:MAX_BIDS])
        self._costs = {name: cost for name, cost in self._costs.items() if name in kept}
        self._bids = {name: bid for name, bid in self._bids.items() if name in kept}

    def _part_with(self, name: str, now: float) -> None:
        """A robot is out, or has had its time: its place is free."""
        self._gone[name] = None
        if len(self._gone) > 2 * MAX_BIDS:
            self._gone = dict.fromkeys([*self._gone][-MAX_BIDS:])
        self._bids.pop(name, None)
        if self._places.pop(name, None) is not None:
            self._changed = now

    def _outlasting(self, heard: float) -> float:
        """Until when a robot can be a member at most by a beat that was heard then."""
        return heard + self.auction.lease * (1.0 + DRIFT) + LATE
