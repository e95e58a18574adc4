"""What a mission has come to: which of its orders a desk has sent already, whoever pressed the key.

A command counts as the first order with its words, its kind and its robots that has not been sent yet. So it does not
matter who sent it: the mission itself, a person at the prompt, or a program. STOP and RELEASE have no words of their
own, and everybody may press them: they count at the very time of the order alone, unless whoever plays it says more.

A person's STOP is ended by a person: it ends the mission, whose RELEASE would set the robots free otherwise.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from functools import lru_cache
from itertools import islice
from typing import Protocol, TypeAlias

from sleepcast.channel import Kind, Message
from sleepcast.channel.message import ENDS, FOR, NOT
from sleepcast.core.errors import SleepcastError, in_file
from sleepcast.language.reader import read
from sleepcast.simulator import MissionError, Order
from sleepcast.simulator.scenario.mission import OrderKind, instruction

_KINDS: Mapping[Kind, OrderKind] = {Kind.COMMAND: "once", Kind.ASK: "ask", Kind.STOP: "STOP", Kind.RELEASE: "RELEASE"}
_WORDLESS = (Kind.STOP, Kind.RELEASE)
RELEASES: frozenset[OrderKind] = frozenset({"RELEASE", "RELEASE ALL"})
Words: TypeAlias = tuple[str, OrderKind, str, frozenset[str] | None, frozenset[str] | None]
"""What orders are told apart by: who sends them, their kind, their text, whom they are for, and whom they are not
for."""


def readable(order: Order) -> Order:
    """The order itself. Raises MissionError, with its place, for a text that nobody can read."""
    _check_text(order)
    return order


@lru_cache(maxsize=256)  # runs of a sweep have the same orders
def _check_text(order: Order) -> None:
    try:
        if (wanted := instruction(order)).is_expression:
            read(wanted.text)
    except SleepcastError as error:
        raise MissionError(in_file(order.place, str(error))) from error


def is_stopped_by_others(messages: Iterable[Message], own: Collection[str]) -> bool:
    """Whether a STOP among these messages, oldest first, holds that the mission has not sent. own: the ids of what it
    has sent."""
    holds = False
    for message in messages:
        if message.kind is Kind.RELEASE:
            holds = False
        elif message.kind is Kind.STOP and message.id not in own:
            holds = True
    return holds


class SentMessage(Protocol):
    """What a desk keeps of a message that it has sent."""

    @property
    def message(self) -> Message: ...


def order_kind(message: Message) -> OrderKind | None:
    """The kind of order that a message of a desk is; None for what no mission sends."""
    if message.kind is Kind.RELEASE and message.body.get(ENDS):
        return "RELEASE ALL"
    return "standing" if message.standing and message.kind is Kind.COMMAND else _KINDS.get(message.kind)


def named_robots(message: Message, key: str) -> tuple[str, ...] | None:
    """The robots that a message is for (`FOR`) or not for (`NOT`); None if it names none."""
    names = message.body.get(key)
    return tuple(map(str, names)) if isinstance(names, list) else None


class MissionLog:
    """The orders of a mission, and what was sent of them.

    commands: what all desks have sent, oldest first.
    tick: s by which an order is sent before its time, so that it is on the air then.
    given: orders that are known to have been sent, with the ids of their messages, "" where they have none; it grows,
        and belongs to the run.
    first: the operator who sends what names nobody.
    """

    def __init__(
        self,
        orders: Sequence[Order],
        commands: Callable[[], Iterable[SentMessage]],
        tick: float,
        given: list[tuple[Order, str]],
        first: str,
    ) -> None:
        self.orders, self._first = tuple(orders), first
        self._commands, self._tick, self._given = commands, tick, given
        self._sent: dict[int, Message] = {}
        self._seen: set[str] = set()
        self._waiting: dict[Words, list[int]] = {}
        for number, order in enumerate(self.orders):
            self._waiting.setdefault(self._words(order), []).append(number)

    def sent(self) -> Mapping[int, Message]:
        """The messages of the orders that were sent, by their index in `orders`."""
        new = [command.message for command in self._commands() if command.message.id not in self._seen]
        given = {sent: order for order, sent in self._given} if new else {}
        for message in new:
            self._seen.add(message.id)
            order = given.get(message.id)
            number = self._like(message) if order is None else self._number_of(order)
            if number is not None:
                self._take(number, message)
        return self._sent

    def note(self, number: int, message: Message) -> None:
        """This message is the order of this number, once more if it was sent before."""
        before = self._sent.get(number)
        self._given[:] = [each for each in self._given if before is None or each[1] != before.id]
        self._given.append((self.orders[number], message.id))
        self._seen.add(message.id)
        self._take(number, message)

    def take_over(self, sent: Mapping[int, Message]) -> None:
        """What was sent of the same mission in the run that this one was forked from, as far as it is known here."""
        known = {command.message.id for command in self._commands()}
        for number, message in sent.items():
            if message.id in known:
                self.note(number, message)

    def _take(self, number: int, message: Message) -> None:
        self._sent[number] = message
        waiting = self._waiting[self._words(self.orders[number])]
        if number in waiting:
            waiting.remove(number)

    def _like(self, message: Message) -> int | None:
        """The first order of its words that was not sent."""
        words = _words_of(message)
        waiting = None if words is None else self._waiting.get(words)
        if not waiting:
            return None
        in_time = abs(message.issued - self.orders[waiting[0]].time) < 1.5 * self._tick
        return waiting[0] if in_time or message.kind not in _WORDLESS else None

    def _number_of(self, order: Order) -> int | None:
        """The index of this order, the first that was not sent of several that are the same."""
        alike = [number for number, each in enumerate(self.orders) if is_same(each, order)]
        return next((number for number in alike if number not in self._sent), next(iter(alike), None))

    def wordless(self) -> set[int]:
        """The indices of those that were given, and of which there is no message: HOLD and AWAY."""
        wordless = set[int]()
        for given in [order for order, sent in self._given if not sent]:
            alike = (i for i, each in enumerate(self.orders) if is_same(each, given) and i not in wordless)
            wordless.update(islice(alike, 1))
        return wordless

    def rest(self) -> list[int]:
        """The indices of those that were not sent yet."""
        settled = self.sent().keys() | self.wordless()
        return [number for number in range(len(self.orders)) if number not in settled]

    def _words(self, order: Order) -> Words:
        wanted = instruction(order)
        by = wanted.by or self._first
        return by, _told_apart(wanted.kind), " ".join(wanted.text.split()), _names(wanted.only), _names(wanted.but)


def is_same(order: Order, other: Order) -> bool:
    """A snapshot keeps of an order little more than when it is sent, and its text."""
    return (order.time, order.text) == (other.time, other.text)


def _words_of(message: Message) -> Words | None:
    kind = order_kind(message)
    if kind is None:
        return None
    text = "" if message.kind in _WORDLESS else " ".join(message.text.split())
    return (
        message.sender,
        _told_apart(kind),
        text,
        _names(named_robots(message, FOR)),
        _names(named_robots(message, NOT)),
    )


def _told_apart(kind: OrderKind) -> OrderKind:
    """What an order counts as: RELEASE ALL is a mere RELEASE where others have sent no STOP."""
    return "RELEASE" if kind in RELEASES else kind


def _names(names: Sequence[str] | None) -> frozenset[str] | None:
    return None if names is None else frozenset(names)
