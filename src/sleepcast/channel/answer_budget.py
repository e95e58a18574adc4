"""What questions may cost a process with robots: bytes of answers, for each who asks.

A question of 200 bytes may bring 49,152 of a mind, or an answer of each of a thousand robots, and the least of all keys
may ask. So each asker has an account that fills at a steady rate. A question is let in while something is left, and a
long answer is sent while something is left; so nobody gets more bytes out of robots in the long run than the rate,
however he asks. What is held back is counted, and told to the asker by a fault, by each robot once in `TELL_EVERY`.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Collection, Mapping
from enum import Enum, auto

import msgspec

from sleepcast.channel.message import AGAIN, FOR, NOT, Message

ANSWER_RATE = 64_000.0
"""Bytes of answers to one asker in a second, from one process: two hundred short answers, or one long one."""
ANSWER_RATE_EACH = 1_000.0
"""The same for each of its robots besides: ten questions a second to all of sixty."""
ANSWER_RATE_MOST = 640_000.0
"""The same for all of them: three thousand short answers, fewer than an operator verifies, and three times what a desk
asks for."""
ANSWER_BURST = 256_000.0
"""Bytes that may go at once: all that one robot can tell of itself, twice."""
ANSWER_BURST_SECONDS = 2.0
"""Seconds' worth of what each robot adds that may go at once besides."""
LEAST_ANSWER = 200
"""Bytes of a short answer, which every question costs as soon as it is let in."""
TELL_EVERY = 1.0
"""Seconds between two faults of a robot that tell an asker that it is held back."""
MAX_ASKERS = 1_024
"""Askers whose accounts are kept; beyond, the one that has not asked for longest is forgotten."""
_MAX_REFUSED = 256
"""Refused questions that robots are still to answer with a fault."""
HELD_BACK = "held back: you have asked for more than is answered at a time; ask again more slowly"
"""The fault that tells it."""


class BudgetDecision(Enum):
    """What becomes of a question."""

    LET_IN = auto()
    REFUSED = auto()
    """Refused, and its robots are to say so."""
    DROPPED = auto()


class _Account(msgspec.Struct):
    """left: bytes; since: when that was so, s."""

    left: float
    since: float


class AnswerBudget:
    """The accounts of all who ask the robots of one process, by the ids of their keys; its sessions share it. robots:
    how many there are."""

    def __init__(self) -> None:
        self.robots = 0
        self._accounts: OrderedDict[str, _Account] = OrderedDict()
        self._refused_at: OrderedDict[tuple[str, str], float] = OrderedDict()
        """When each asker was told, by each receiver."""
        self._refused: OrderedDict[str, None] = OrderedDict()

    @property
    def rate(self) -> float:
        """Bytes a second for each asker."""
        return min(ANSWER_RATE + ANSWER_RATE_EACH * self.robots, ANSWER_RATE_MOST)

    @property
    def burst(self) -> float:
        """Bytes at once for each asker."""
        return ANSWER_BURST + ANSWER_BURST_SECONDS * (self.rate - ANSWER_RATE)

    def ask(self, question: Message, names: Collection[str], now: float) -> BudgetDecision:
        """Whether to let in a question to robots of these names, at `now` (s), which then costs its least."""
        asker, cost = question.key, LEAST_ANSWER * _answering(question.body, names)
        if self._account(asker, now).left > 0.0:
            self.spend(asker, cost, now)
            return BudgetDecision.LET_IN
        if AGAIN in question.body or not self.may_tell(asker, min(names, default=""), now):
            return BudgetDecision.DROPPED
        self.spend(asker, cost, now)
        self._refused[question.id] = None
        if len(self._refused) > _MAX_REFUSED:
            self._refused.popitem(last=False)
        return BudgetDecision.REFUSED

    def has_refused(self, question: Message) -> bool:
        """Whether a question has come only to be answered with a fault."""
        return question.id in self._refused

    def answer(self, asker: str, size: int, now: float) -> bool:
        """Whether an answer of so many bytes more than the least may go to an asker; if so, it costs them."""
        if size > 0 and self._account(asker, now).left <= 0.0:
            return False
        self.spend(asker, size, now)
        return True

    def spend(self, asker: str, size: int, now: float) -> None:
        """So many bytes more than the least go to an asker in any case."""
        self._account(asker, now).left -= max(size, 0)

    def may_tell(self, asker: str, teller: str, now: float) -> bool:
        """Whether this receiver may tell the asker now that it is held back."""
        last = self._refused_at.get((asker, teller))
        if last is not None and 0.0 <= now - last < TELL_EVERY:
            return False
        self._refused_at[asker, teller] = now
        self._refused_at.move_to_end((asker, teller))
        if len(self._refused_at) > MAX_ASKERS + self.robots:
            self._refused_at.popitem(last=False)
        return True

    def _account(self, asker: str, now: float) -> _Account:
        account = self._accounts.get(asker)
        if account is None:
            account = self._accounts[asker] = _Account(self.burst, now)
            if len(self._accounts) > MAX_ASKERS:
                self._accounts.popitem(last=False)
        account.left = min(self.burst, account.left + max(0.0, now - account.since) * self.rate)
        account.since = now
        self._accounts.move_to_end(asker)
        return account


def _answering(body: Mapping[str, object], names: Collection[str]) -> int:
    """How many of these robots a question makes answer at least; of those who may have answered before, none."""
    named = body.get(FOR)
    if FOR in body:
        return (
            len({each for each in named if isinstance(each, str)}.intersection(names)) if isinstance(named, list) else 0
        )
    others = body.get(NOT, [])
    return 0 if AGAIN in body or not isinstance(others, list) else len(names)
