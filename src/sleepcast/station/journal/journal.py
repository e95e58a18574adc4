"""The journal: everything that the desk sent, heard and decided, in order, so that a session can be read again.

`Journal` is what the desk needs of one; `MemoryJournal` keeps the latest entries in this process.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from sleepcast.core.errors import SleepcastError

MAX_ENTRIES = 200_000
"""Entries that a journal in memory keeps: the answers of 1,000 robots to 200 commands; the oldest go first."""


class JournalError(SleepcastError):
    """A journal that cannot be written or read."""


class Event(StrEnum):
    """What an entry tells of."""

    SENT = "sent"
    """The desk sent a message; details: kind, standing, deadline, digest, predicted (names)."""
    REFUSED = "refused"
    """The desk did not send; details: reason."""
    HEARD = "heard"
    """A robot spoke; details: kind and what it said. Many answered at once: how many robots, and how many of them with
    which outcome."""
    REPEATED = "repeated"
    """The desk sent a message again; details: silent (how many robots were not accounted for)."""
    ACCOUNTED = "accounted"
    """The desk goes after a command no longer; details: n_matched, n_not_matched, n_fault, n_silent, silent (names)."""


@dataclass(frozen=True, slots=True)
class Entry:
    """One line of the journal. number: from 1, without gaps. time: s of the desk's clock. who: the operator's desk or
    the robot. subject: the id of the command it is about, "" if none. text: the expression. details: plain values."""

    number: int
    time: float
    who: str
    event: Event
    subject: str
    text: str
    details: Mapping[str, object]


@dataclass(frozen=True, slots=True)
class Report:
    """Something that a robot said unasked. heard: s of the desk's clock. body: what its message carried."""

    robot: str
    heard: float
    body: dict[str, object]


class Journal(Protocol):
    """Where the desk writes; it only ever appends. Whatever keeps a journal raises JournalError where it cannot."""

    def append(
        self, time: float, who: str, event: Event, *, subject: str = "", text: str = "", details: Mapping[str, object]
    ) -> None:
        """Write one entry; its number is the next one."""

    def together(self) -> AbstractContextManager[None]:
        """Entries that are written within this are kept at once when it ends, so that many cost what one does."""

    def entries(self, after: int = 0) -> Iterable[Entry]:
        """The entries with a number above `after`, oldest first."""

    @property
    def dropped(self) -> int:
        """How many of the oldest entries are not kept any more."""


class MemoryJournal:
    """The latest `MAX_ENTRIES` entries, gone when the program ends."""

    def __init__(self, size: int = MAX_ENTRIES) -> None:
        self._entries: deque[Entry] = deque(maxlen=size)
        self._written = 0

    def append(
        self, time: float, who: str, event: Event, *, subject: str = "", text: str = "", details: Mapping[str, object]
    ) -> None:
        """Write one entry; its number is the next one."""
        self._written += 1
        self._entries.append(Entry(self._written, time, who, event, subject, text, details))

    def together(self) -> AbstractContextManager[None]:
        """Nothing: memory keeps at once."""
        return nullcontext()

    def entries(self, after: int = 0) -> list[Entry]:
        """The kept entries with a number above `after`, oldest first."""
        return [entry for entry in self._entries if entry.number > after]

    @property
    def dropped(self) -> int:
        """How many of the oldest entries are not kept any more."""
        return self._written - len(self._entries)

    def fill(self, entries: Iterable[Entry], dropped: int) -> None:
        """Have just these entries, after so many that are not kept any more."""
        self._entries.clear()
        self._entries.extend(entries)
        self._written = dropped + len(self._entries)
