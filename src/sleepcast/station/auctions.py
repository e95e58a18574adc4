"""The auctions of a desk on the air: it collects the bids for commands with BEST or QUORUM that it has sent, grants the
best, and renews their leases as long as it is there (`mind.auction`)."""

from __future__ import annotations

from collections import deque
from math import inf

from sleepcast.channel.message import Kind, Message, Role
from sleepcast.channel.reliable import LIFE, ReliableDelivery
from sleepcast.language.parts import Auction
from sleepcast.mind.auction import Auctioneer, BidMessage
from sleepcast.station.sent import Command

MAX_AUCTIONS = 64
"""Auctions of a desk whose members are kept; beyond, the oldest is left to itself, so that its leases run out."""


class DeskAuctions:
    """See the module. delivery: where messages leave."""

    def __init__(self, delivery: ReliableDelivery) -> None:
        self._delivery = delivery
        self._running: deque[Auctioneer] = deque()

    def begin(self, command: Command, auction: Auction) -> None:
        """A command was sent that chooses among robots."""
        message = command.message
        command.auctioneer = Auctioneer(auction, message.sequence, message.issued, message.deadline)
        self._running.append(command.auctioneer)
        if len(self._running) > MAX_AUCTIONS:
            self._running.popleft().end()

    def hear(self, message: Message, now: float) -> None:
        """Take in a bid, if this is one for us."""
        said = BidMessage.of(message.body) if message.role in (Role.ROBOT, "") else None  # nobody signs: no roles
        if said is None or (said.caller, said.epoch) != (self._delivery.name, self._delivery.epoch):
            return
        for auctioneer in self._running:
            if auctioneer.number == said.number:
                auctioneer.hear(message.sender, message.epoch, said, now)

    def attend(self, now: float) -> None:
        """Say what is due."""
        for auctioneer in tuple(self._running):
            if (grants := auctioneer.step(now)) is not None:
                self._delivery.post(Kind.REQUEST, now, deadline=now + LIFE, body=grants.body())
            if auctioneer.is_over(now):
                self._running.remove(auctioneer)

    def due(self, now: float) -> float:
        """When there is something to be said, s of Unix time."""
        return min((auctioneer.due(now) for auctioneer in self._running), default=inf)

    def end(self) -> None:
        """Say nothing more: somebody has stopped the robots."""
        while self._running:
            self._running.popleft().end()
