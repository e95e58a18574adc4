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
"""Identifies a stream of commands: the id of the sender's key, and the epoch."""


class StreamProgress(NamedTuple):
    """How far a stream has come. done: number of the latest command that was dealt with; sent, until: when that was
    issued, and its deadline (s of Unix time, inf for a standing one); rules: number of the latest standing one."""

    stream: StreamId
    done: int
    sent: float
    until: float
    rules: int


class StoredWindow(NamedTuple):
    """The messages heard from one sender in one epoch. key: its id; numbers: bit i is message `latest - i`."""

    key: bytes
    sender: str
    epoch: int
    latest: int
    numbers: int

    def without(self, numbers: set[int]) -> StoredWindow:
        """The same without these messages."""
        most = self.numbers.bit_length()
        gone = sum(1 << self.latest - number for number in numbers if 0 <= self.latest - number < most)
        return self._replace(numbers=self.numbers & ~gone)


class StandingCommand(NamedTuple):
    """A standing command and its datagrams."""

    stream: StreamId
    number: int
    datagrams: tuple[bytes, ...]


class DeliveryState(NamedTuple):
    """What has changed since the last call."""

    streams: tuple[StreamProgress, ...] = ()
    windows: tuple[StoredWindow, ...] = ()
    standing: tuple[StandingCommand, ...] = ()


_MAX_RECENT = 512
"""Other commands that are stored: those of the last five seconds at a hundred a second."""
MAX_STANDING = 20_000
"""Standing commands that are stored, of all senders: months of a busy desk, some ten megabytes."""


@dataclass(slots=True)
class StoredCommand:
    """A command's datagrams, and when each was last on the air (s)."""

    datagrams: tuple[bytes, ...]
    heard: list[float]


class MessageStore:
    """The bytes of commands, and when each datagram was last on the air."""

    def __init__(self) -> None:
        self._standing: OrderedDict[tuple[StreamId, int], StoredCommand] = OrderedDict()
        self._recent: OrderedDict[tuple[StreamId, int], StoredCommand] = OrderedDict()
        self._news: list[StandingCommand] = []

    def keep(self, stream: StreamId, number: int, standing: bool, datagrams: tuple[bytes, ...], now: float) -> None:
        """Store a command that was heard or sent at `now` (s), in place of the oldest if there are too many."""
        stored, most = (self._standing, MAX_STANDING) if standing else (self._recent, _MAX_RECENT)
        if standing and (stream, number) not in stored:
            self._news.append(StandingCommand(stream, number, datagrams))
        stored[stream, number] = StoredCommand(datagrams, [now] * len(datagrams))
        if len(stored) > most:
            stored.popitem(last=False)

    def news(self) -> tuple[StandingCommand, ...]:
        """The standing commands that were stored since the last call."""
        found = tuple(self._news)
        self._news.clear()
        return found

    def restore(self, standing: Iterable[StandingCommand]) -> None:
        """Restore stored commands, the oldest first, as if none had been on the air for long."""
        for each in standing:
            self.keep(each.stream, each.number, True, each.datagrams, -inf)
        self._news.clear()

    def heard(self, stream: StreamId, number: int, datagram: bytes, now: float) -> bool:
        """Whether this datagram is stored; if so, note that it was heard at `now` (s)."""
        kept = self._find(stream, number)
        if kept is None or datagram not in kept.datagrams:
            return False
        kept.heard[kept.datagrams.index(datagram)] = now
        return True

    def silent_since(self, stream: StreamId, number: int, time: float, parts: Sequence[int] = ()) -> bool:
        """Whether a command is stored of which any of these parts (all, if none is named) has not been on the air since
        `time` (s)."""
        kept = self._find(stream, number)
        return kept is not None and any(kept.heard[part] < time for part in _named(kept, parts))

    def take(
        self, stream: StreamId, number: int, now: float, since: float = inf, parts: Sequence[int] = ()
    ) -> tuple[bytes, ...]:
        """The parts of a command that have not been on the air since `since` (s), and now are; none if it is not
        stored. parts: all, if none is named."""
        kept = self._find(stream, number)
        if kept is None:
            return ()
        found = [part for part in _named(kept, parts) if kept.heard[part] < since]
        for part in found:
            kept.heard[part] = now
        return tuple(kept.datagrams[part] for part in found)

    def standing(self, key: bytes) -> dict[tuple[StreamId, int], tuple[bytes, ...]]:
        """The stored standing commands of a key: their datagrams by stream and number."""
        return {which: kept.datagrams for which, kept in self._standing.items() if which[0][0] == key}

    def _find(self, stream: StreamId, number: int) -> StoredCommand | None:
        return self._standing.get((stream, number)) or self._recent.get((stream, number))


def _named(kept: StoredCommand, parts: Sequence[int]) -> Sequence[int]:
    """Those of the named parts that exist; all, if none is named."""
    there = range(len(kept.datagrams))
    return [part for part in parts if part in there] if parts else there
