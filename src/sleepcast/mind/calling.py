"""The auctions of a robot that tells a BEST or QUORUM: it is their caller (`mind.auction`), as a desk is of what it
sends.

A rule tells the same in every tick, so an auction goes by how the TELL is written. Telling it again renews the auction:
its poll goes out again, twice a second at most, and whoever waits bids anew what it costs now. Once the robot tells it
no more, or is stopped, it says nothing more, and members leave as their leases end; their places stay taken until
then, so that telling it again cannot make them too many.
"""

from __future__ import annotations

from collections import deque
from math import inf

import msgspec

from sleepcast.channel.message import BID, Message, Role
from sleepcast.core.errors import MisuseError
from sleepcast.language.parts import Auction
from sleepcast.mind.auction import Auctioneer, BidMessage, GrantMessage, outlasting
from sleepcast.mind.limits import MAX_CALLS, TELL_SECONDS, TELLS_A_SECOND

MAX_HEARD = 4_096
"""Bids that wait for the next tick; of more, the oldest go, since each is said again."""


class Call(msgspec.Struct):
    """An auction, and when its poll was last told, s."""

    auctioneer: Auctioneer
    told: float


class CallsState(msgspec.Struct, array_like=True):
    """What is kept of a robot's calls in a snapshot."""

    calls: dict[int, Call]
    heard: list[tuple[str, int, BidMessage]]


class Calls:
    """See the module. Times are s of the robot's mind.

    name: of the robot
    since: when its life began, if there was one before: robots may still be members from then
    """

    def __init__(self, name: str) -> None:
        self._name, self.since = name, -inf
        self._calls: dict[int, Call] = {}
        self._heard: deque[tuple[str, int, BidMessage]] = deque(maxlen=MAX_HEARD)

    @property
    def is_busy(self) -> bool:
        """Whether the next tick has something to do."""
        return bool(self._calls)

    def has_room(self, number: int) -> bool:
        """Whether this auction may be called."""
        return number in self._calls or len(self._calls) < MAX_CALLS

    def renew(self, auction: Auction, number: int, now: float) -> bool:
        """The robot tells this again; whether its poll need not go out again yet."""
        call = self._calls.get(number)
        if call is None or now >= call.told + 1.0 / TELLS_A_SECOND or call.auctioneer.until <= now:
            return False
        call.auctioneer.renew(auction, now + TELL_SECONDS)
        return True

    def begin(self, auction: Auction, number: int, now: float) -> None:
        """The poll of an auction goes out."""
        until = now + TELL_SECONDS
        if (call := self._calls.get(number)) is not None:
            call.told = now
            call.auctioneer.renew(auction, until)
            return
        safe = self.since + outlasting(auction.lease)
        self._calls[number] = Call(Auctioneer(auction, number, now, until, is_told=True, not_before=safe), now)

    def hear(self, message: Message) -> None:
        """Take in a bid, if this is one for this robot, for the next tick."""
        if BID not in message.body or not self._calls or message.role not in (Role.ROBOT, ""):  # nobody signs: no roles
            return
        said = BidMessage.of(message.body)
        if said is not None and (said.caller, said.epoch) == (self._name, 0) and said.number in self._calls:
            self._heard.append((message.sender, message.epoch, said))

    def stop(self) -> None:
        """STOP: it chooses and keeps nobody any more."""
        for call in self._calls.values():
            call.auctioneer.hush()

    def tick(self, now: float) -> list[GrantMessage]:
        """Do what is due; what to say to all robots."""
        while self._heard:
            name, life, said = self._heard.popleft()
            if (call := self._calls.get(said.number)) is not None:
                call.auctioneer.hear(name, life, said, now)
        grants = [call.auctioneer.step(now) for call in self._calls.values()]
        self._calls = {number: call for number, call in self._calls.items() if not call.auctioneer.is_over(now)}
        return [each for each in grants if each is not None]

    def state(self) -> CallsState:
        return CallsState(dict(self._calls), list(self._heard))

    def restore(self, state: CallsState) -> None:
        """Have what was kept. Raises MisuseError for what no robot calls."""
        if len(state.calls) > MAX_CALLS:
            raise MisuseError(f"{len(state.calls)} auctions of a robot, which has {MAX_CALLS} at most")
        for call in state.calls.values():
            call.auctioneer.validate()
        self._calls = dict(state.calls)
        self._heard.extend(state.heard)
