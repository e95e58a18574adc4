"""The auctions of a desk: it collects the bids for commands with BEST or QUORUM that it has sent, grants the
best, and renews their leases as long as it is there (`mind.auction`)."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from math import inf

from sleepcast.channel.message import Message, Role
from sleepcast.language.parts import Auction
from sleepcast.mind.auction import Auctioneer, BidMessage
from sleepcast.station.sent import Command

MAX_AUCTIONS = 64
"""Auctions of a desk whose members are kept; beyond, the oldest is left to itself, so that its leases run out."""


class DeskAuctions:
    """See the module. say: sends the body of a request, now (s). Any thread may end them."""

    def __init__(self, say: Callable[[dict[str, object], float], None]) -> None:
        self._say = say
        self.running: dict[tuple[str, int, int], Auctioneer] = {}
        """By the sender of the poll, his epoch, and its number."""

    def begin(self, command: Command, auction: Auction) -> None:
        """A command was sent that chooses among robots."""
        message = command.message
        command.auctioneer = Auctioneer(auction, message.sequence, message.issued, message.deadline)
        self._run(command)

    def go_on(self, commands: Iterable[Command], now: float) -> None:
        """Run those of these commands, and no others."""
        self.running = {}
        for command in commands:
            if command.auctioneer is not None and not command.auctioneer.is_over(now):
                self._run(command)

    def _run(self, command: Command) -> None:
        message, auctioneer = command.message, command.auctioneer
        assert auctioneer is not None
        self.running[message.sender, message.epoch, message.sequence] = auctioneer
        if len(self.running) > MAX_AUCTIONS:
            self.running.pop(next(iter(self.running))).end()

    def hear(self, message: Message, now: float) -> None:
        """Take in a bid, if this is one for us."""
        said = BidMessage.of(message.body) if message.role in (Role.ROBOT, "") else None  # nobody signs: no roles
        auctioneer = None if said is None else self.running.get((said.caller, said.epoch, said.number))
        if said is not None and auctioneer is not None:
            auctioneer.hear(message.sender, message.epoch, said, now)

    def attend(self, now: float) -> None:
        """Say what is due."""
        for poll, auctioneer in tuple(self.running.items()):
            if (grants := auctioneer.step(now)) is not None:
                self._say(grants.body(), now)
            if auctioneer.is_over(now):
                self.running.pop(poll, None)

    def due(self, now: float) -> float:
        """When there is something to be said, s."""
        return min((auctioneer.due(now) for auctioneer in tuple(self.running.values())), default=inf)

    def end(self) -> None:
        """Say nothing more: somebody has stopped the robots."""
        ended, self.running = self.running, {}
        for auctioneer in ended.values():
            auctioneer.end()
