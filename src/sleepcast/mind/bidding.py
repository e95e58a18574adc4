"""A robot's bids: commands with BEST or QUORUM that it has heard, from the poll until it is out (`mind.auction`).

Its mind evaluates: the test and the cost for the bid, the test and the command once the bid is granted. What a member
has joined and which rules it got by the command end with its lease, also if the robot was restarted meanwhile.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Collection, Iterator, Mapping
from math import isnan, nan
from typing import Protocol

import msgspec

from sleepcast.channel.message import AUCTION, GRANTS, HOPS, MAX_NUMBER, OUTBID, UNKNOWN, WITHIN, Message
from sleepcast.core.errors import MisuseError
from sleepcast.language.explain import BidStanding, BidState
from sleepcast.language.parts import Auction
from sleepcast.mind.auction import Bid, BidPhase, GrantMessage
from sleepcast.mind.rules import Rule
from sleepcast.mind.views import EvaluatedCommand

MAX_BIDS = 16
"""Auctions in which a robot takes part at once."""
MAX_OF_ONE = 8
"""The same of one caller, so that nobody has all of them."""
MAX_GRANTS = 64
"""Messages of callers that wait for the next tick; of more, the oldest go, since each is said again."""
MAX_ENDED = 64
"""Bids that are over of which a robot can tell, as many as commands that it can explain."""
TOO_MANY = f"it bids for {MAX_BIDS} commands at once, {MAX_OF_ONE} of one sender: no more"
STOPPED = "STOP has ended its bid"
CANCELLED = "CANCEL has ended its bid"
HELD_STILL = "it is held still, so it does not bid"


class Evaluating(Protocol):
    """A robot's mind, as its bids need it."""

    @property
    def name(self) -> str: ...
    @property
    def groups(self) -> frozenset[str]: ...
    @property
    def rules_by_key(self) -> Mapping[str, Rule]: ...
    @property
    def is_held_still(self) -> bool:
        """Whether it is stopped, catches up, or is at rest: nobody is to count on it."""

    @property
    def is_at_rest(self) -> bool:
        """Whether it sleeps or is frozen, so that its rules do not run."""

    def objection(self, message: Message, text: str, now: float) -> str:
        """Why this text of a message is not to be evaluated now, "" if it may be."""

    def outcome_of(self, message: Message, text: str, now: float) -> EvaluatedCommand:
        """Evaluate a text in the place of that of the message."""

    def end(self, text: str) -> None:
        """Evaluate a text of the robot's own."""

    def answer(self, message: Message, word: str, value: float, fault: str, details: Mapping[str, object]) -> None: ...

    def say_bid(self, body: dict[str, object]) -> None: ...


class OpenBid(msgspec.Struct):
    """A bid, the poll that it is for, whether that was answered, and the texts that end what the command has made of
    its member."""

    poll: Message
    bid: Bid
    answered: bool = False
    endings: tuple[str, ...] = ()

    def still_to_end(self, rules: Mapping[str, Rule]) -> Iterator[str]:
        """Those of the endings that still mean what the command has made: a later one may have changed a rule."""
        texts = dict(self.bid.auction.rules)
        for text in self.endings:
            key = text[len(_FORGET) : -1] if text.startswith(_FORGET) else ""
            if not key or (key in rules and rules[key].text == texts.get(key)):
                yield text

    def is_in_force(self, groups: Collection[str], rules: Mapping[str, Rule]) -> bool:
        """Whether something of what the command has made is still there, if it has made anything."""
        left = [text for text in self.still_to_end(rules) if text[len(_LEAVE) : -1] in groups or _LEAVE not in text]
        return bool(left) or not self.endings


class BiddingState(msgspec.Struct, array_like=True):
    """What is kept of a robot's bids in a snapshot: the bids, and what callers have said since the last tick."""

    open: list[OpenBid]
    grants: list[Message]
    stopped: bool


class EndedBids:
    """How the latest bids of one robot have ended, by the ids of their polls, for whoever asks why."""

    def __init__(self) -> None:
        self._standings: dict[str, BidStanding] = {}

    def get(self, command: str) -> BidStanding | None:
        return self._standings.get(command)

    def note(self, poll: Message, standing: BidStanding) -> None:
        self._standings[poll.id] = standing
        if len(self._standings) > MAX_ENDED:
            del self._standings[next(iter(self._standings))]

    def note_unsure(self, poll: Message, auction: Auction, outcome: EvaluatedCommand) -> None:
        """The robot does not bid by this outcome of test and cost: if that is for its cost, say so."""
        if outcome.word == "matched":
            self.note(poll, BidStanding(auction.name, nan, BidState.UNKNOWN))


class Bidding:
    """All bids of one robot. ended: of those before, by default none."""

    def __init__(self, ended: EndedBids | None = None) -> None:
        self.ended = EndedBids() if ended is None else ended
        self._open: list[OpenBid] = []
        self._grants: deque[Message] = deque(maxlen=MAX_GRANTS)
        self._left_over: tuple[str, ...] = ()
        """Endings of a life before this one."""
        self._stopped = False

    def state(self) -> BiddingState:
        return BiddingState(list(self._open), list(self._grants), self._stopped)

    @classmethod
    def restored(cls, state: BiddingState) -> Bidding:
        """Those that were kept. Raises MisuseError for bids that no robot has."""
        bidding = cls()
        if len(state.open) > MAX_BIDS:
            raise MisuseError(f"{len(state.open)} bids of a robot, which has {MAX_BIDS} at most")
        for each in state.open:
            each.bid.validate()
        bidding._open, bidding._stopped = list(state.open), state.stopped
        bidding._grants.extend(state.grants)
        return bidding

    @property
    def is_busy(self) -> bool:
        """Whether the next tick has something to do."""
        return bool(self._open) or bool(self._left_over)

    def endings(self, rules: Mapping[str, Rule]) -> tuple[str, ...]:
        """The texts that end what it is a member by, for its store. rules: that the robot has, by key."""
        return (*self._left_over, *(text for each in self._open for text in each.still_to_end(rules)))

    def restore(self, endings: tuple[str, ...]) -> None:
        """The robot was a member when its life before this one ended: that ends now."""
        self._left_over = endings

    def hear(self, message: Message) -> None:
        """Keep what a caller says for the next tick. What others say, such as their bids, takes no room from it."""
        if GRANTS in message.body and any(_is_of(message, each.poll) for each in self._open):
            self._grants.append(message)

    def stop(self) -> None:
        """STOP: every bid and membership is over, and none comes back."""
        self._stopped = bool(self._open)
        for each in self._open:
            each.bid.leave(BidState.STOPPED)

    def cancel(self, sender: str) -> int:
        """Who has called for them does not want these bids and memberships any more; gives how many there were."""
        ended = [each for each in self._open if each.poll.sender == sender and each.bid.phase is not BidPhase.OUT]
        for each in ended:
            each.bid.leave(BidState.CANCELLED)
        return len(ended)

    def poll(self, robot: Evaluating, message: Message, auction: Auction, now: float) -> None:
        """Bid for a command, or answer why not."""
        if refusal := self.refusal(message, held_still=robot.is_held_still):
            robot.answer(message, "fault", float("nan"), refusal, {})
        elif not self.is_member(message):
            found = robot.outcome_of(message, auction.bid, now)
            outcome = bid_of(found)
            if outcome.word == "matched":
                self.begin(message, auction, robot.name, outcome.value, now)
            else:
                self.withdraw(message)
                self.ended.note_unsure(message, auction, found)
                robot.answer(message, outcome.word, outcome.value, outcome.fault, {})

    def refusal(self, message: Message, *, held_still: bool) -> str:
        """Why the robot bids for no command of this poll, "" if it may. held_still: see `Evaluating`."""
        if held_still:
            return HELD_STILL
        of_one = sum(each.poll.sender == message.sender for each in self._open)
        full = of_one >= MAX_OF_ONE or len(self._open) >= MAX_BIDS
        return TOO_MANY if full and self._known(message) is None else ""

    def is_member(self, message: Message) -> bool:
        """Whether it has nothing to bid for, since it has obeyed this poll, which is told again, or has just left."""
        known = self._known(message)
        return known is not None and known.bid.phase is not BidPhase.BIDDING

    def begin(self, message: Message, auction: Auction, name: str, cost: float, now: float) -> None:
        """Bid this cost, if the robot has not yet; else it is what it bids from now on."""
        if (known := self._known(message)) is not None:
            known.poll = message
            known.bid.renew(auction, cost, message.deadline)
            return
        within = message.body.get(WITHIN)
        spread = within if isinstance(within, float) and within > 0.0 else 0.0
        bid = Bid(auction, poll_of(message), name, cost, now, message.deadline, spread)
        self._open.append(OpenBid(message, bid))

    def withdraw(self, message: Message) -> None:
        """A poll was told again, and is none for this robot any more, which answers it."""
        if (known := self._known(message)) is not None:
            known.answered = True
            known.bid.leave(BidState.WITHDRAWN)

    def _known(self, message: Message) -> OpenBid | None:
        """The bid for a poll that was told before."""
        if not is_told(message):
            return None
        poll = poll_of(message)
        return next((each for each in self._open if each.bid.poll == poll and _is_of(message, each.poll)), None)

    def standing(self, command: str) -> BidStanding | None:
        """How the bid for the command with this id stands, or how it ended if that was not too long ago."""
        open_bids = (each.bid.standing() for each in self._open if each.poll.id == command)
        return next(open_bids, None) or self.ended.get(command)

    def end_left_over(self, robot: Evaluating) -> None:
        """End what a life before this one was a member by, before the robot hears anything new."""
        for text in self._left_over:
            robot.end(text)
        self._left_over = ()

    def tick(self, robot: Evaluating, now: float) -> None:
        """Do what the callers have said, leave what is over, and say how the robot stands."""
        while self._grants:
            message = self._grants.popleft()
            grants = GrantMessage.of(message.body)
            for each in self._open if grants is not None else ():
                if grants is not None and _is_of(message, each.poll) and each.bid.hear(grants, message.sequence, now):
                    self._obey(robot, each, now)
        for each in tuple(self._open):
            if robot.is_at_rest or not each.is_in_force(robot.groups, robot.rules_by_key):
                each.bid.leave(BidState.WITHDRAWN)
            each.bid.tick(now)
            if each.bid.phase is BidPhase.OUT:
                self._part(robot, each)
        for each in tuple(self._open):  # a fleet says what all its robots bid at once, after what they answer
            if (said := each.bid.say(now)) is not None:
                robot.say_bid(said.body())
            if each.bid.is_over:
                self.ended.note(each.poll, each.bid.standing())
                self._open.remove(each)
        self._stopped = False

    def _obey(self, robot: Evaluating, each: OpenBid, now: float) -> None:
        """The bid is granted: obey, if the test still holds."""
        auction, poll, before = each.bid.auction, each.poll, robot.groups
        fault = HELD_STILL if robot.is_held_still else robot.objection(poll, auction.command, now)
        word, value, fault = (
            EvaluatedCommand("fault", float("nan"), fault) if fault else robot.outcome_of(poll, auction.command, now)
        )
        each.endings = _endings(auction, before, robot.groups, robot.rules_by_key)
        each.answered = True
        each.bid.settle(word == "matched")
        robot.answer(poll, word, value, fault, {})

    def _part(self, robot: Evaluating, each: OpenBid) -> None:
        """The robot is out: end what the command has made of it, or answer that it was not chosen."""
        for text in tuple(each.still_to_end(robot.rules_by_key)):
            robot.end(text)
        each.endings = ()
        if not each.answered:
            each.answered = True
            if self._stopped or each.bid.state is BidState.CANCELLED:
                robot.answer(each.poll, "fault", float("nan"), STOPPED if self._stopped else CANCELLED, {})
            else:
                robot.answer(each.poll, "not matched", float("nan"), "", {OUTBID: list(each.bid.outbid)})


def is_told(message: Message) -> bool:
    """Whether a robot tells this poll, perhaps again and again."""
    return HOPS in message.body


def poll_of(message: Message) -> tuple[str, int, int]:
    """What a poll is known by: its caller, his epoch, and its number. Of what a robot tells again and again, the number
    is that of the TELL, and the epoch 0, since minds do not know in which life they speak."""
    number = message.body.get(AUCTION)
    if is_told(message) and isinstance(number, int) and 0 <= number <= MAX_NUMBER:
        return message.sender, 0, number
    return message.sender, message.epoch, message.sequence


def bid_of(outcome: EvaluatedCommand) -> EvaluatedCommand:
    """What comes of the test and the cost of a poll: matched, with the cost, for who is to bid."""
    unknown = outcome.word == "matched" and isnan(outcome.value)
    return EvaluatedCommand(UNKNOWN, outcome.value, "") if unknown else outcome


def _is_of(message: Message, poll: Message) -> bool:
    """Whether the caller of this poll says this."""
    return (message.sender, message.epoch, message.key, message.role) == (poll.sender, poll.epoch, poll.key, poll.role)


_LEAVE, _FORGET = "(LEAVE ", "(FORGET "


def _endings(
    auction: Auction, before: Collection[str], groups: Collection[str], rules: Mapping[str, Rule]
) -> tuple[str, ...]:
    """The texts that end what a member has got by a command."""
    joined = (f"{_LEAVE}{key})" for key in auction.joins if key in groups and key not in before)
    made = (f"{_FORGET}{key})" for key, text in auction.rules if key in rules and rules[key].text == text)
    return (*joined, *made)
