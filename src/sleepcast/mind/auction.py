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
from math import inf, nan
from zlib import crc32

import msgspec

from sleepcast.channel.message import BID, GRANTS, MAX_NAME, MAX_NUMBER, natural_order
from sleepcast.core.errors import MisuseError
from sleepcast.core.records import NamedTuple
from sleepcast.language.explain import BidStanding, BidState
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
GIVEN_AGAIN = 2.0
"""Seconds that it takes, even on a bad radio, to give a place to the next one."""
USUALLY_GOOD, MOST_GOOD = 5.0, 30.0
"""Seconds for which polls are good unless it is said: at least, and for short leases at most."""
TENTH = 0.1
"""Seconds by which a robot's bids for one poll are apart at least."""
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


def outlasting(lease: float) -> float:
    """Seconds after which a robot cannot be a member any more by a beat that was heard before."""
    return lease * (1.0 + DRIFT) + LATE


def good_for(auction: Auction) -> float:
    """Seconds for which its poll is good unless it is said: long enough that a place whose robot died before it obeyed
    is given once more, or as long as any command where nobody would wait so long for a lease."""
    again = auction.window + outlasting(auction.lease) + GIVEN_AGAIN
    return max(again, USUALLY_GOOD) if again <= MOST_GOOD else USUALLY_GOOD


def rank(cost: float, name: str) -> tuple[float, object, str]:
    """The order of bids: the least cost, of equal ones the smaller name, r2 before r10."""
    return cost, natural_order(name), name


def validate_kept(auction: Auction) -> None:
    """Raises MisuseError for an auction in a snapshot that nobody can have begun."""
    fits = auction.name in ("BEST", "QUORUM") and 1 <= auction.least <= auction.most <= MAX_CHOSEN
    if not (fits and 0.0 < auction.window < inf and 0.0 < auction.lease < inf):
        raise MisuseError(f"an auction of {auction.most} robots with a lease of {auction.lease} s")


# ---- a robot's half


class Bid(msgspec.Struct):
    """One robot's bid. Times are s of its mind.

    poll: its caller, the caller's epoch and the number
    cost: what it bids
    began, until: when it heard the poll, and the poll's deadline
    spread: s over which the first bids of all robots are to be spread
    outbid: once it is out: who was chosen instead, as far as it has heard

    Plain data, so that a snapshot can keep it.
    """

    auction: Auction
    poll: tuple[str, int, int]
    name: str
    cost: float
    began: float
    until: float
    spread: float
    phase: BidPhase = BidPhase.BIDDING
    outbid: tuple[str, ...] = ()
    lease_ends: float = -inf
    beats: dict[int, float] = {}
    """When each beat was sent that a grant may still name."""
    beat: int = -1
    next: float = -inf
    latest: int = -1
    """The number of the caller's latest message."""
    heard: float = -inf
    best: tuple[tuple[float, str], ...] = ()
    placed: tuple[str, ...] = ()
    farewells: int = FAREWELLS
    state: BidState = BidState.WAITING
    ticked: float = inf
    """When it was last looked whether the lease had ended."""

    def __post_init__(self) -> None:
        if self.beat < 0:
            chance = crc32(f"{self.name} {self.poll} {self.began!r}".encode())
            # Of two robots of one name, a grant means the one whose beats it names. If a poll is told again and again,
            # what a robot bids later has greater ones.
            self.beat, self.heard = (int(self.began / TENTH) % 2**30 << 32) + chance, self.began
            self.next = self.began + chance / 2**32 * min(self.spread, self.auction.window / 2)

    def validate(self) -> None:
        """Raises MisuseError for a bid in a snapshot that no robot can have made."""
        validate_kept(self.auction)
        if not (-inf < self.cost < inf and 0 <= self.beat < MAX_NUMBER // 2 and 0 <= self.farewells <= FAREWELLS):
            raise MisuseError(f"a bid of {self.cost} with the beat {self.beat}")

    def hear(self, grants: GrantMessage, sequence: int, now: float) -> bool:
        """Take in what the caller says in its message of this number; whether the robot is to obey now, and then to
        say whether it `settle`s."""
        if self.phase is BidPhase.OUT or grants.number != self.poll[2]:
            return False
        if sequence > self.latest:
            self.latest, self.heard, self.best = sequence, now, grants.best
            self.placed = tuple(grants.granted)
        beat = grants.granted.get(self.name)
        if beat in self.beats:
            self.lease_ends = max(self.lease_ends, self.beats[beat] + self.auction.lease)
            return self.phase is BidPhase.BIDDING and now <= self.until and now + USEFUL < self.lease_ends
        if self.phase is BidPhase.BIDDING and beat is None and not grants.is_open:
            self.outbid = tuple(grants.granted)
            self.leave(BidState.OUTBID if grants.granted else BidState.UNCHOSEN)
        return False

    def renew(self, auction: Auction, cost: float, until: float) -> None:
        """The poll was told again while the robot waits: it bids what that costs now."""
        self.auction, self.cost, self.until = auction, cost, until

    def settle(self, obeys: bool) -> None:
        """The robot has been granted its bid, and obeys from now on, or does not."""
        if obeys:
            self.phase, self.state = BidPhase.MEMBER, BidState.MEMBER
        else:
            self.leave(BidState.DECLINED)

    def leave(self, why: BidState) -> None:
        """The robot has nothing to do with this auction any more. why: if it was no member."""
        if self.phase is not BidPhase.OUT:
            self.state = BidState.LEFT if self.phase is BidPhase.MEMBER else why
        self.phase = BidPhase.OUT

    def tick(self, now: float) -> None:
        """Leave if that is due: the lease has ended, or will have ended for too long at the next look if that comes as
        late as this one; or nobody has chosen this robot in time."""
        again, self.ticked = now + max(0.0, now - self.ticked), now
        is_leased = now < self.lease_ends and again <= self.lease_ends + LATE
        over = not is_leased if self.phase is BidPhase.MEMBER else now > self.until
        if over:
            self.leave(BidState.UNHEARD)

    def say(self, now: float) -> BidMessage | None:
        """What to tell the caller now, if anything."""
        out = self.phase is BidPhase.OUT
        if now < self.next or (out and not self.farewells) or (self.phase is BidPhase.BIDDING and self._is_beaten()):
            return None
        self.farewells -= out
        hopeful = SOON if now < self.heard + QUIET else SELDOM
        pause = hopeful if self.phase is BidPhase.BIDDING else beat_of(self.auction.lease)
        self.next, self.beat = now + pause, self.beat + 1
        self.beats = {beat: sent for beat, sent in self.beats.items() if now < sent + self.auction.lease}
        self.beats[self.beat] = now
        return BidMessage(*self.poll, self.beat, self.phase, self.cost)

    def _is_beaten(self) -> bool:
        """Whether all places are taken, or wanted by better bids."""
        mine = rank(self.cost, self.name)
        better = {name for cost, name in self.best if rank(cost, name) < mine}
        return len(better.union(self.placed) - {self.name}) >= self.auction.most

    def standing(self) -> BidStanding:
        """What the robot can tell of it."""
        costs, mine = {name: cost for cost, name in self.best}, rank(self.cost, self.name)
        known = [name for name in costs if rank(costs[name], name) < mine]
        better = sorted(self.outbid or known, key=lambda name: rank(costs.get(name, inf), name))
        return BidStanding(
            self.auction.name, self.cost, self.state, tuple((name, costs.get(name, nan)) for name in better)
        )

    @property
    def is_over(self) -> bool:
        """Whether there is nothing left to be said."""
        return self.phase is BidPhase.OUT and not self.farewells


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


class KnownRobot(NamedTuple):
    """What an account says of a robot: what it has bid, and when it first did, was chosen, and has obeyed, s."""

    cost: float
    bid: float
    chosen: float = inf
    obeyed: float = inf


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
        """Those whose bid was heard and not chosen, each with who was chosen before it: nobody where a better bid came
        too late."""
        if not self.chosen:
            return {}
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


class Auctioneer(msgspec.Struct):
    """The caller of one auction. Times are s of its clock.

    number: of the poll
    began, until: when it was sent, and its deadline
    is_told: whether the poll is what a robot tells again and again, as long as it wants members: then the auction stays
        open until its deadline, which `renew` puts off, and who was out may bid anew
    not_before: when it may choose first, since robots may be members that it knows nothing of
    closed: since when nobody else is chosen

    Plain data, so that a snapshot can keep it.
    """

    auction: Auction
    number: int
    began: float
    until: float
    is_told: bool = False
    not_before: float = -inf
    is_open: bool = True
    ended: bool = False
    closed: float = inf
    known: dict[str, KnownRobot] = {}
    """Everybody whose bid was heard."""
    bids: dict[str, HeardBid] = {}
    """Of those who may still have a place."""
    places: dict[str, TakenPlace] = {}
    gone: dict[str, tuple[int, int]] = {}
    """Who is out, or was not heard until its place was over: in which life, and the latest beat."""
    chose: bool = False
    changed: float = -inf
    """When a place was last given or has become free."""
    next: float = -inf
    version: int = 0
    """Another one whenever the status may be another one."""
    returned: float = -inf
    """When it was put back to an earlier moment: members that it has forgotten tell it that they are there."""

    def validate(self) -> None:
        """Raises MisuseError for what no caller can know: of an auction in a snapshot."""
        validate_kept(self.auction)
        if not self.places.keys() <= self.bids.keys() <= self.known.keys() or self.number < 0:
            raise MisuseError("an auction in which robots have places that have bid nothing")
        if max(len(self.known), len(self.gone)) > 2 * MAX_BIDS + 1:
            raise MisuseError(f"an auction of {len(self.known)} robots")

    @property
    def window_ends(self) -> float:
        """When bids were collected long enough."""
        return max(min(self.began + self.auction.window, self.until), self.not_before)

    def hear(self, name: str, life: int, said: BidMessage, now: float) -> None:
        """Take in what a robot says, in which life it is; of robots of one name the first one counts."""
        if self.ended or self._is_stale(name, life, said):
            return
        if said.phase is BidPhase.OUT:
            self._part_with(name, life, said.beat, now)
            return
        known, confirmed = self.bids.get(name), said.phase is BidPhase.MEMBER
        if confirmed and name not in self.places and self.returned == -inf:
            return  # it is one by what this caller does not know of: a life before this one
        cost = said.cost if known is None or self.is_told else known.cost
        self.bids[name] = HeardBid(cost, life, said.beat, now)
        robot = self.known.get(name, KnownRobot(cost, now))._replace(cost=cost)
        if name in self.places or confirmed:
            if confirmed:
                robot = robot._replace(chosen=min(robot.chosen, now), obeyed=min(robot.obeyed, now))
            self.places[name] = TakenPlace(said.beat, self._outlasting(now), confirmed)
        self._note(name, robot)
        if len(self.known) > 2 * MAX_BIDS:
            self._forget_the_worst()

    def _is_stale(self, name: str, life: int, said: BidMessage) -> bool:
        """Whether a message says nothing that counts."""
        bid, gone = self.bids.get(name), self.gone.get(name)
        if bid is not None:
            return life != bid.life or said.beat <= bid.beat
        return gone is not None and (not self.is_told or said.phase is BidPhase.MEMBER or (life, said.beat) <= gone)

    def renew(self, auction: Auction, until: float) -> None:
        """The robot tells it again."""
        self.auction, self.until = auction, until

    def hush(self) -> None:
        """The robot is stopped, and tells it no more."""
        self.until = -inf

    def step(self, now: float) -> GrantMessage | None:
        """Do what is due; what to say to all robots now, if anything."""
        if self.ended:
            return None
        for name in [name for name, place in self.places.items() if place.ends < now]:
            self._part_with(name, self.bids[name].life, self.bids[name].beat, now)
        if self.is_told and now > self.until:
            return None
        if self.is_open and now >= self._chooses_at:
            self._choose(now)
        if now < self.next or self.is_over(now):
            return None
        self.next = now + (beat_of(self.auction.lease) if self._is_settled else SOON)
        if not self.bids and self.is_open:
            return None
        granted = {name: place.beat for name, place in self.places.items()}
        return GrantMessage(self.number, self.is_open, granted, self._best(now))

    def end(self) -> None:
        """Say nothing more: members leave when their leases are over."""
        self.ended, self.closed = True, min(self.closed, self.window_ends)
        self.is_open, self.version = False, self.version + 1

    def go_back(self, time: float) -> None:
        """Know what it knew at an earlier time, s. Who is a member then tells so again."""
        kept = {name: robot for name, robot in self.known.items() if robot.bid <= time}
        self.known = {
            name: robot._replace(
                chosen=robot.chosen if robot.chosen <= time else inf,
                obeyed=robot.obeyed if robot.obeyed <= time else inf,
            )
            for name, robot in kept.items()
        }
        self.bids, self.places, self.gone = {}, {}, {}
        self.chose, self.ended = self.chose and self.window_ends <= time, False
        if self.closed > time:
            self.is_open, self.closed = True, inf
        if self.chose:
            self.not_before = self._outlasting(time)
        self.changed, self.next, self.returned, self.version = time, -inf, time, self.version + 1

    def is_over(self, now: float) -> bool:
        """Whether there is nothing left to be said."""
        quiet_since = self.until if self.is_told else max(self.closed + CLOSING, self._outlasting(self.returned))
        return self.ended or (not self.places and now >= quiet_since)

    def due(self, now: float) -> float:
        """When to `step` next, s."""
        return inf if self.is_over(now) else self.next

    def status(self) -> AuctionStatus:
        ranked = sorted(self.known, key=lambda name: rank(self.known[name].cost, name))
        chosen = tuple(name for name in ranked if self.known[name].chosen < inf)
        members = tuple(name for name in chosen if self.known[name].obeyed < inf)
        costs = {name: robot.cost for name, robot in self.known.items()}
        short = bool(chosen) and not self.is_open and len(members) < self.auction.least
        return AuctionStatus(self.auction, costs, chosen, members, bool(chosen), short, not self.is_open)

    @property
    def _chooses_at(self) -> float:
        """When places are given. One that has become free later waits for the bids of those who were silent."""
        wait = self.auction.window if self.is_told and self.chose else 0.0
        return max(self.window_ends, self.changed + wait)

    def _choose(self, now: float) -> None:
        """Give free places to the least bids, and close when all is said."""
        waiting = sorted(self._waiting(now), key=self._rank)
        begins = not self.places if self.is_told else not self.chose
        self.chose = True
        if begins and self.auction.name == "QUORUM" and len(waiting) < self.auction.least:
            self._close(now)
            return
        if now < self.until:
            for name in waiting[: self.auction.most - len(self.places)]:
                bid = self.bids[name]
                self.places[name] = TakenPlace(bid.beat, self._outlasting(bid.heard))
                self._note(name, self.known[name]._replace(chosen=min(self.known[name].chosen, now)))
                self.changed = now
        quiet = (
            len(self.places) == self.auction.most or now >= max(self.changed, self.window_ends) + self.auction.window
        )
        if now >= self.until or (quiet and self._is_settled):
            self._close(now)

    def _close(self, now: float) -> None:
        if not self.is_told:
            self.is_open, self.closed, self.version = False, now, self.version + 1

    def _note(self, name: str, robot: KnownRobot) -> None:
        if self.known.get(name) != robot:
            self.known[name], self.version = robot, self.version + 1

    @property
    def _is_settled(self) -> bool:
        """Whether each robot that was chosen has said that it obeys."""
        return self.chose and all(place.confirmed for place in self.places.values())

    def _waiting(self, now: float) -> list[str]:
        """Whose bids wait for a place."""
        since = now - max(FRESH, self.auction.window if not self.chose else 0.0)
        return [name for name, bid in self.bids.items() if bid.heard >= since and name not in self.places]

    def _best(self, now: float) -> tuple[tuple[float, str], ...]:
        """The least bids: of those who have a place, and who may still have one."""
        names = sorted((*self.places, *self._waiting(now)), key=self._rank)
        return tuple((self.bids[name].cost, name) for name in names[: self.auction.most])

    def _rank(self, name: str) -> tuple[float, object, str]:
        return rank(self.bids[name].cost, name)

    def _forget_the_worst(self) -> None:
        """Keep MAX_BIDS bids, those of all who were chosen among them."""
        ranks = {name: (robot.chosen == inf, rank(robot.cost, name)) for name, robot in self.known.items()}
        kept = set(sorted(ranks, key=ranks.__getitem__)[:MAX_BIDS])
        self.known = {name: robot for name, robot in self.known.items() if name in kept}
        self.bids = {name: bid for name, bid in self.bids.items() if name in kept}

    def _part_with(self, name: str, life: int, beat: int, now: float) -> None:
        """A robot is out, or has had its time: its place is free."""
        self.gone[name] = life, beat
        if len(self.gone) > 2 * MAX_BIDS:
            self.gone = dict([*self.gone.items()][-MAX_BIDS:])
        self.bids.pop(name, None)
        if self.places.pop(name, None) is not None:
            self.changed = now

    def _outlasting(self, heard: float) -> float:
        """Until when a robot can be a member at most by a beat that was heard then."""
        return heard + outlasting(self.auction.lease)
