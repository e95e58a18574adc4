"""A node's part in auctions: its bids for what others call, and what it calls itself by TELL.

It comes to be with the first such message or TELL: most robots never see one.
"""

from __future__ import annotations

from collections.abc import Mapping
from contextlib import suppress

from sleepcast.channel.message import Kind, Message
from sleepcast.core.errors import SleepcastError
from sleepcast.language.parts import Auction
from sleepcast.language.program import evaluate
from sleepcast.language.vocabulary import FROZEN, SLEEPING
from sleepcast.mind.bidding import Bidding
from sleepcast.mind.calling import Calls
from sleepcast.mind.rules import Rule
from sleepcast.node.evaluating import NodeEvaluator, Thinking


class NodeAuctions:
    """See the module."""

    def __init__(self, node: Thinking) -> None:
        self._robot = BiddingNode(node)
        self.bidding, self.calls = Bidding(), Calls(node.name)

    @property
    def is_busy(self) -> bool:
        """Whether the next tick has something to do."""
        return self.bidding.is_busy or self.calls.is_busy

    def hear(self, message: Message) -> None:
        """A caller or a bidder says something."""
        if not message.ahead:
            self.bidding.hear(message)
            self.calls.hear(message)

    def poll(self, message: Message, auction: Auction, now: float) -> None:
        """Bid for a command, or answer why not."""
        self.bidding.poll(self._robot, message, auction, now)

    def stop(self) -> None:
        """STOP has come."""
        self.bidding.stop()
        self.calls.stop()

    def end_left_over(self) -> None:
        """See `Bidding`."""
        self.bidding.end_left_over(self._robot)

    def tick(self, now: float) -> None:
        """Do what is due."""
        self.bidding.tick(self._robot, now)
        for grants in self.calls.tick(now):
            self._robot.say_bid(grants.body())


class BiddingNode(NodeEvaluator):
    """A node as its bids need it (`mind.bidding.Evaluating`)."""

    @property
    def name(self) -> str:
        return self._node.name

    @property
    def groups(self) -> frozenset[str]:
        return self._node.groups

    @property
    def rules_by_key(self) -> Mapping[str, Rule]:
        return self._node.memory.base.rules

    @property
    def is_held_still(self) -> bool:
        return super().is_held_still or self.is_at_rest

    @property
    def is_at_rest(self) -> bool:
        values = self._node.memory.values
        return values[SLEEPING] > 0 or values[FROZEN] > 0

    def end(self, text: str) -> None:
        self._node.memory.faults = []
        with suppress(SleepcastError):  # it means nothing any more
            evaluate(self._node.program(text), self._node.memory)

    def answer(self, message: Message, word: str, value: float, fault: str, details: Mapping[str, object]) -> None:
        self._node.answer(message, word, value, fault, details)

    def say_bid(self, body: dict[str, object]) -> None:
        self._node.say(Kind.REQUEST, body=body)
