"""What of a mailbox outlasts its process: how far each stream has come, what was heard, and the rules' bytes.

A mailbox gives its news; all of them together, the latest of each, are what it can be made again from.
"""

from __future__ import annotations

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
