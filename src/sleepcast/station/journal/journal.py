"""The journal: everything that the desk sent, heard and decided, in order, so that a session can be read again.

`Journal` is what the desk needs of one; `MemoryJournal` keeps the latest entries in this process.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sized
from contextlib import contextmanager
from enum import StrEnum
from types import MappingProxyType
from typing import Protocol

import msgspec

from sleepcast.core.errors import SleepcastError
from sleepcast.core.records import NamedTuple

MAX_ENTRIES = 200_000
"""Entries that a journal in memory keeps: the answers of 1,000 robots to 200 commands; the oldest go first."""
MAX_BYTES = 100_000_000
"""Bytes that they may take together, about; the oldest go first."""
ENTRY, DETAIL = 600, 60
"""Bytes of an entry besides its texts, and of a detail besides its content."""


class JournalError(SleepcastError):
    """A journal that cannot be written or read."""


class JournalEvent(StrEnum):
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
    """The desk goes after a command no longer; details: n_matched, n_held, n_not_matched, n_unknown, n_fault, n_silent,
    silent (names); n_not_stored if there are any."""


CONFLICT = "conflict"
"""The kind, in the details of HEARD, of an entry whose text says which robots have one name."""


class PendingEntry(NamedTuple):
    """What is to become an entry of the journal, without its number; see `JournalEntry`."""

    time: float
    who: str
    event: JournalEvent
    subject: str = ""
    text: str = ""
    details: Mapping[str, object] = MappingProxyType({})


class JournalEntry(msgspec.Struct, frozen=True):
    """One line of the journal. number: from 1, without gaps. time: s of the desk's clock. who: the operator's desk or
    the robot. subject: the id of the command it is about, "" if none. text: the expression. details: plain values."""

    number: int
    time: float
    who: str
    event: JournalEvent
    subject: str
    text: str
    details: Mapping[str, object]


class Report(msgspec.Struct, frozen=True):
    """Something that a robot said unasked. heard: s of the desk's clock. body: what its message carried."""

    robot: str
    heard: float
    body: dict[str, object]


class Journal(Protocol):
    """Where the desk writes; it only ever appends. Whatever keeps a journal raises JournalError where it cannot."""

    def append(self, *entries: PendingEntry) -> None:
        """Write entries, together or none of them, so that many cost as much as one; their numbers are the next
        ones."""

    def entries(self, after: int = 0) -> Iterable[JournalEntry]:
        """The entries with a number above `after`, oldest first."""

    @property
    def dropped(self) -> int:
        """How many of the oldest entries have been dropped."""


def size_of(entry: JournalEntry) -> int:
    """Bytes that an entry takes, about."""
    sized = (8 * len(value) for value in entry.details.values() if isinstance(value, Sized))
    return ENTRY + len(entry.text) + DETAIL * len(entry.details) + sum(sized)


class MemoryJournal:
    """The latest `MAX_ENTRIES` entries, or fewer if these take more than `MAX_BYTES`, gone when the program ends."""

    def __init__(self, size: int = MAX_ENTRIES, most: int = MAX_BYTES) -> None:
        self._entries: dict[int, JournalEntry] = {}
        self._size, self._most = size, most
        self._written = self._bytes = 0

    def append(self, *entries: PendingEntry) -> None:
        """Write entries; their numbers are the next ones."""
        for entry in entries:
            self._written += 1
            self._take(JournalEntry(self._written, *entry))

    def _take(self, entry: JournalEntry) -> None:
        """Hold one more, and let go of the oldest that are too many."""
        self._entries[entry.number] = entry
        self._bytes += size_of(entry)
        while len(self._entries) > self._size or (self._bytes > self._most and len(self._entries) > 1):
            self._bytes -= size_of(self._entries.pop(self.dropped + 1))

    def entries(self, after: int = 0) -> list[JournalEntry]:
        """The stored entries with a number above `after`, oldest first."""
        return [entry for entry in self._entries.values() if entry.number > after]

    @property
    def dropped(self) -> int:
        """How many of the oldest entries have been dropped."""
        return self._written - len(self._entries)

    def fill(self, entries: Iterable[JournalEntry], dropped: int) -> None:
        """Hold these entries, after this number of dropped ones."""
        self._entries.clear()
        self._written, self._bytes = dropped, 0
        for entry in entries:
            self._written += 1
            self._take(entry)


# How a desk writes its journal: at once, and where that cannot be, as soon as it can.

MAX_KEPT = 100_000
"""Entries that wait for the journal: the answers of 1,000 robots to 100 commands; beyond, the oldest are lost."""
AGAIN = 1.0
"""Seconds after which the journal is tried again; a desk that has robots to stop does not wait for a disk."""


class JournalWriter:
    """See the module. trouble: what is wrong with the journal, for a person; "" while nothing is. It is not safe for
    several threads at once."""

    def __init__(self, journal: Journal) -> None:
        self.journal = journal
        self.trouble = ""
        self._kept: list[PendingEntry] = []
        self._lost = 0
        self._next = 0.0
        self._gathering = False

    def write(self, note: PendingEntry) -> None:
        """Write something down that has happened."""
        if len(self._kept) == MAX_KEPT:
            self._lost += 1
            del self._kept[0]
        self._kept.append(note)
        if not self._gathering and (not self.trouble or note.time >= self._next):
            self._put_down(note.time)

    def write_first(self, note: PendingEntry) -> None:
        """Write something down before it happens. Raises JournalError, and then it must not happen."""
        self._kept.append(note)
        error = self._put_down(note.time)
        if error is not None:
            self._kept.pop()
            raise error

    @contextmanager
    def together(self, now: float) -> Iterator[None]:
        """What is written down within this is written at its end, at `now` (s): much costs what little does."""
        self._gathering = True
        try:
            yield
        finally:
            self._gathering = False
            if self._kept and (not self.trouble or now >= self._next):
                self._put_down(now)

    def _put_down(self, now: float) -> JournalError | None:
        """Write everything that waits into the journal, and return the errors."""
        try:
            self.journal.append(*self._kept)
        except JournalError as error:
            self._next = now + AGAIN
            lost = f", and {self._lost} are lost" if self._lost else ""
            self.trouble = f"{error} (entries that wait to be written: {len(self._kept)}{lost})"
            return error
        self._kept.clear()
        self.trouble = f"{self._lost} entries of the journal were lost" if self._lost else ""
        return None
