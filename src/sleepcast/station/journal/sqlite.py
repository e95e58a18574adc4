"""The journal as a file that only grows: an entry that `append` has taken is on the disk, whatever happens next.

Any number of processes may write to one journal and read it: SQLite's lock puts their entries into one order and one
chain. `rotate` moves what there is into an archive beside it, `NAME.FIRST-LAST.db`, and goes on under the old name:

    1. under the lock, the entries are copied into a new file, which is brought to the disk and gets its name
    2. in one transaction they leave the journal, which from then on says which archive came before it

A process that is killed in between leaves a copy too many, and nothing is lost.
"""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterator, Mapping
from contextlib import AbstractContextManager, closing, contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from math import inf
from pathlib import Path
from threading import RLock

from sleepcast.core.clock import Clock
from sleepcast.core.files import settle
from sleepcast.station.journal.file import (
    KEPT,
    PATIENCE,
    Origin,
    digest,
    get_attribute,
    journal_errors,
    line_of,
    open_writing,
    origin_of,
    prepare,
    read_line,
    set_attribute,
    set_origin,
    transaction,
)
from sleepcast.station.journal.journal import Entry, Event, JournalError

PAGE = 500
"""Entries that are read in one go, so that a reader keeps nobody waiting."""


@dataclass(frozen=True, slots=True)
class Limits:
    """When a journal is full and moves into an archive. size: bytes of its file; age: s since its first entry was
    written; whichever comes first."""

    size: float = inf
    age: float = inf


class SqliteJournal:
    """A `Journal` in a file; see the module. clock: Unix time, s, of when entries are written. patience: s to
    wait while somebody else writes.

    It may be used by any thread. All its methods raise JournalError when the file cannot be written or read.
    """

    def __init__(self, file: Path, clock: Clock, patience: float = PATIENCE) -> None:
        self.file = file
        self._patience = patience
        self._clock, self._lock = clock, RLock()
        self._connection = open_writing(file)
        self._together = False

    def close(self) -> None:
        """Be done with the file."""
        with self._lock:
            self._connection.close()

    def append(
        self, time: float, who: str, event: Event, *, subject: str = "", text: str = "", details: Mapping[str, object]
    ) -> None:
        """Write one entry; its number is the next one. It is on the disk when this returns, or, within `together`,
        when that ends."""
        with self.together():
            number, before = self._head()
            entry = Entry(number + 1, time, who, event, subject, text, details)
            line = line_of(entry, self._clock.now())
            with journal_errors(self.file):
                self._connection.execute(
                    "INSERT INTO entries (number, line, hash) VALUES (?, ?, ?)",
                    (entry.number, line, digest(before, line)),
                )

    @contextmanager
    def together(self) -> Iterator[None]:
        """Entries that are written within this come to the disk at once, when it ends: many cost what one does. None
        does if that raises anything. Others cannot write meanwhile, so it must be short."""
        with self._lock:
            if self._together:
                yield
                return
            if self._is_full():
                self._move(only_if_full=True)
            with journal_errors(self.file), transaction(self._connection, self._patience):
                self._together = True
                try:
                    yield
                finally:
                    self._together = False

    def entries(self, after: int = 0) -> Iterator[Entry]:
        """The entries in this file with a number above `after`, oldest first."""
        rows: list[tuple[int, str, bytes]] = [(after, "", b"")]
        while rows:
            with self._lock, journal_errors(self.file):
                rows = self._connection.execute(
                    "SELECT number, line, hash FROM entries WHERE number > ? ORDER BY number LIMIT ?",
                    (rows[-1][0], PAGE),
                ).fetchall()
            yield from (read_line(line, hash).entry for _, line, hash in rows)

    @property
    def dropped(self) -> int:
        """How many of the oldest entries lie in archives."""
        with self._lock, journal_errors(self.file):
            return origin_of(self._connection).number

    # ---- another file

    @property
    def limits(self) -> Limits:
        """When it moves into an archive by itself; every writer keeps to it."""
        with self._lock, journal_errors(self.file):
            size, age = get_attribute(self._connection, "most_bytes"), get_attribute(self._connection, "most_seconds")
        return Limits(float(size or inf), float(age or inf))

    @limits.setter
    def limits(self, limits: Limits) -> None:
        with self._lock, journal_errors(self.file), transaction(self._connection):
            set_attribute(self._connection, "most_bytes", repr(limits.size))
            set_attribute(self._connection, "most_seconds", repr(limits.age))

    def rotate(self) -> Path | None:
        """Move all entries into an archive; gives it, or None if there were none."""
        with self._lock:
            return self._move()

    def _move(self, *, only_if_full: bool = False) -> Path | None:
        with journal_errors(self.file), transaction(self._connection):
            first = self._connection.execute("SELECT min(number) FROM entries").fetchone()[0]
            if first is None or (only_if_full and not self._is_full()):  # another writer may have been faster
                return None
            last, hash = self._head()
            archive = self.file.with_name(f"{self.file.stem}.{first}-{last}{self.file.suffix}")
            self._copy_to(archive)
            self._connection.execute("DROP TRIGGER entries_are_kept")
            self._connection.execute("DELETE FROM entries")
            self._connection.execute(KEPT)
            set_origin(self._connection, Origin(archive.name, last, hash))
        return archive

    def _copy_to(self, archive: Path) -> None:
        beside = archive.with_name(f".{archive.name}.{os.getpid()}.new")
        beside.unlink(missing_ok=True)  # of a process that was killed and had our number
        try:
            os.close(os.open(beside, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600))
            with closing(sqlite3.connect(beside, isolation_level=None)) as copy:
                prepare(copy, beside, origin_of(self._connection), live=False)
                with transaction(copy):
                    rows = self._connection.execute("SELECT number, line, hash FROM entries ORDER BY number")
                    copy.executemany("INSERT INTO entries (number, line, hash) VALUES (?, ?, ?)", rows)
            os.replace(beside, archive)
            settle(archive.parent)
        except BaseException:
            beside.unlink(missing_ok=True)
            raise

    def _is_full(self) -> bool:
        limits = self.limits
        if limits == Limits():
            return False
        with journal_errors(self.file):
            begun = self._connection.execute("SELECT min(written) FROM entries").fetchone()[0]
            if begun is None:
                return False
            pages, free, size = (
                self._connection.execute(f"PRAGMA {what}").fetchone()[0]
                for what in ("page_count", "freelist_count", "page_size")
            )
        return bool((pages - free) * size >= limits.size or self._clock.now() - begun >= limits.age)

    def _head(self) -> tuple[int, bytes]:
        """The number and the hash of the last entry."""
        with journal_errors(self.file):
            # The highest number that was ever given: a last entry that was taken away leaves a gap.
            number = self._connection.execute("SELECT seq FROM sqlite_sequence WHERE name = 'entries'").fetchone()
            last = self._connection.execute("SELECT hash FROM entries ORDER BY number DESC LIMIT 1").fetchone()
            origin = origin_of(self._connection)
        return max(number[0] if number else 0, origin.number), bytes(last[0]) if last else origin.hash


class DeferredJournal:
    """A journal in a file that may not be opened yet: it is tried whenever somebody writes, so that a desk whose file
    is damaged or out of reach can stop robots all the same, and says what is wrong. All methods raise JournalError."""

    def __init__(self, file: Path, clock: Clock, patience: float = PATIENCE) -> None:
        self._open = partial(SqliteJournal, file, clock, patience)
        self._opened: SqliteJournal | None = None
        with suppress(JournalError):  # said when something is to be written
            self._opened = self._open()

    @property
    def _journal(self) -> SqliteJournal:
        if self._opened is None:
            self._opened = self._open()
        return self._opened

    def append(
        self, time: float, who: str, event: Event, *, subject: str = "", text: str = "", details: Mapping[str, object]
    ) -> None:
        """As `SqliteJournal`."""
        self._journal.append(time, who, event, subject=subject, text=text, details=details)

    def together(self) -> AbstractContextManager[None]:
        """As `SqliteJournal`."""
        return self._journal.together()

    def entries(self, after: int = 0) -> Iterator[Entry]:
        """As `SqliteJournal`."""
        return self._journal.entries(after)

    @property
    def dropped(self) -> int:
        """As `SqliteJournal`."""
        return self._journal.dropped

    def close(self) -> None:
        """Be done with the file."""
        if self._opened is not None:
            self._opened.close()
