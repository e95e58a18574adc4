"""The commands that a party stores for those who missed them, and what of reliable delivery outlasts its process.

Delivery gives its changes as a `DeliveryState`; all of them together, the latest of each, restore it.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import inf
from typing import NamedTuple

StreamId = tuple[bytes, int]
"""Of a stream: the id of its sender's key, and the epoch."""


class StreamProgress(NamedTuple):
    """How far a stream has come: numbers of the latest command that was dealt with (`done`, issued when it was `sent`,
    with its deadline `until`, s of Unix time, inf for one that stands), and of the latest standing one (`rules`)."""

    stream: StreamId
    done: int
    sent: float
    until: float
    rules: int


class StoredWindow(NamedTuple):
    """What was heard of one sender in one epoch. key: its id; numbers: bit i is message `latest - i`."""

    key: bytes
    sender: str
    epoch: int
    latest: int
    numbers: int

    def without(self, numbers: set[int]) -> StoredWindow:
        """The same, as if these messages had not been heard."""
        most = self.numbers.bit_length()
        gone = sum(1 << self.latest - number for number in numbers if 0 <= self.latest - number < most)
        return self._replace(numbers=self.numbers & ~gone)


class StandingCommand(NamedTuple):
    """A command that stands, and its bytes."""

    stream: StreamId
    number: int
    datagrams: tuple[bytes, ...]


class DeliveryState(NamedTuple):
    """What has changed since this was asked last."""

    streams: tuple[StreamProgress, ...] = ()
    windows: tuple[StoredWindow, ...] = ()
    standing: tuple[StandingCommand, ...] = ()


MAX_RECENT = 512
"""One-shot commands kept: all of the last seconds at a hundred a second."""
MAX_STANDING = 20_000
"""Standing commands kept, of all senders: months of a busy desk, some ten megabytes."""


@dataclass(slots=True)
class StoredCommand:
    """The bytes of a command, and when each part was last on the air (s)."""

    datagrams: tuple[bytes, ...]
    heard: list[float]


class MessageStore:
    """The bytes of commands, and when each datagram was last on the air."""

    def __init__(self) -> None:
        self._standing: OrderedDict[tuple[StreamId, int], StoredCommand] = OrderedDict()
        self._recent: OrderedDict[tuple[StreamId, int], StoredCommand] = OrderedDict()
        self._news: list[StandingCommand] = []

    def keep(self, stream: StreamId, number: int, standing: bool, datagrams: tuple[bytes, ...], now: float) -> None:
        """Keep a command that was heard or sent at `now` (s); the oldest ones make room."""
        shelf, most = (self._standing, MAX_STANDING) if standing else (self._recent, MAX_RECENT)
        if standing and (stream, number) not in shelf:
            self._news.append(StandingCommand(stream, number, datagrams))
        shelf[stream, number] = StoredCommand(datagrams, [now] * len(datagrams))
        if len(shelf) > most:
            shelf.popitem(last=False)

    def news(self) -> tuple[StandingCommand, ...]:
        """The standing commands that have come since this was asked last."""
        found = tuple(self._news)
        self._news.clear()
        return found

    def restore(self, standing: Iterable[StandingCommand]) -> None:
        """Put back what was kept, the oldest first; none of it has been on the air for long."""
        for each in standing:
            self.keep(each.stream, each.number, True, each.datagrams, -inf)
        self._news.clear()

    def heard(self, stream: StreamId, number: int, datagram: bytes, now: float) -> bool:
        """Whether this datagram is on the shelf; if so, it has been heard at `now` (s)."""
        kept = self._find(stream, number)
        if kept is None or datagram not in kept.datagrams:
            return False
        kept.heard[kept.datagrams.index(datagram)] = now
        return True

    def silent_since(self, stream: StreamId, number: int, time: float, parts: Sequence[int] = ()) -> bool:
        """Whether a command is kept of which any of these parts (all, if none is named) has not been on the air since
        `time` (s)."""
        kept = self._find(stream, number)
        return kept is not None and any(kept.heard[part] < time for part in _named(kept, parts))

    def take(
        self, stream: StreamId, number: int, now: float, since: float = inf, parts: Sequence[int] = ()
    ) -> tuple[bytes, ...]:
        """The bytes of those parts of a command that have not been on the air since that time (s), and are at `now`;
        none if it is not kept. parts: all, if none is named."""
        kept = self._find(stream, number)
        if kept is None:
            return ()
        found = [part for part in _named(kept, parts) if kept.heard[part] < since]
        for part in found:
            kept.heard[part] = now
        return tuple(kept.datagrams[part] for part in found)

    def standing(self, key: bytes) -> dict[tuple[StreamId, int], tuple[bytes, ...]]:
        """The standing commands of the key with this id that are kept: their bytes by stream and number."""
        return {which: kept.datagrams for which, kept in self._standing.items() if which[0][0] == key}

    def _find(self, stream: StreamId, number: int) -> StoredCommand | None:
        return self._standing.get((stream, number)) or self._recent.get((stream, number))


def _named(kept: StoredCommand, parts: Sequence[int]) -> Sequence[int]:
    """Those of these parts that there are; all, if none is named."""
    there = range(len(kept.datagrams))
    return [part for part in parts if part in there] if parts else there
