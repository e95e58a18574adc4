"""The shelf: the bytes of commands, kept for those who missed them, and when each was last heard on the air."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import inf

from sleepcast.channel.delivery_state import StandingCommand, StreamId

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
    """See the module."""

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
