"""How a desk writes its journal: at once, and where that cannot be, as soon as it can.

A journal may fail: the disk is full, or another program keeps the file to itself. What happened has happened all the
same, so its entries are kept here, in their order, and written later; the desk says so. Only what has not happened yet
can be refused: a command whose entry cannot be written is not sent.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import NamedTuple

from sleepcast.station.journal.journal import Event, Journal, JournalError

MAX_KEPT = 100_000
"""Entries that wait for the journal: the answers of 1,000 robots to 100 commands; beyond, the oldest are lost."""
AGAIN = 1.0
"""Seconds after which the journal is tried again; a desk that has robots to stop does not wait for a disk."""


class PendingEntry(NamedTuple):
    """An entry without its number; see `Entry`."""

    time: float
    who: str
    event: Event
    subject: str
    text: str
    details: Mapping[str, object]


class WriteBatch:
    """See the module. trouble: what is wrong with the journal, for a person; "" while nothing is. It is not safe for
    several threads at once."""

    def __init__(self, journal: Journal) -> None:
        self.journal = journal
        self.trouble = ""
        self._kept: deque[PendingEntry] = deque(maxlen=MAX_KEPT)
        self._lost = 0
        self._next = 0.0
        self._gathering = False

    def write(self, note: PendingEntry) -> None:
        """Write something down that has happened."""
        self._lost += len(self._kept) == MAX_KEPT
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
        """Bring all that is kept into the journal; gives what went wrong."""
        try:
            with self.journal.together():
                for note in self._kept:
                    self.journal.append(
                        note.time, note.who, note.event, subject=note.subject, text=note.text, details=note.details
                    )
        except JournalError as error:
            self._next = now + AGAIN
            lost = f", and {self._lost} are lost" if self._lost else ""
            self.trouble = f"{error} (entries that wait to be written: {len(self._kept)}{lost})"
            return error
        self._kept.clear()
        self.trouble = f"{self._lost} entries of the journal were lost" if self._lost else ""
        return None
