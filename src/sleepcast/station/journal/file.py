"""The file of a journal: its layout, how its entries are chained, and how it is opened, extended and rotated.

A journal is an SQLite file. Each entry is one line of JSON, kept as it was written, and its hash:

    hash = SHA-256(the hash before it, as 32 bytes, then the line in UTF-8)

so an entry that is changed, removed or put between others breaks the chain there. What is searched for is taken out of
the line by SQLite itself, so that nothing can say something else than the line. The first hash of all is 32 zeros; a
file that goes on after an archive begins with the last hash of that.
"""

from __future__ import annotations

import hashlib
import json
import os
import sqlite3
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from functools import partial
from math import inf, isfinite
from pathlib import Path
from threading import RLock

import msgspec
import numpy as np

from sleepcast.core.clock import Clock
from sleepcast.core.errors import SleepcastError
from sleepcast.core.files import settle
from sleepcast.station.journal.journal import JournalEntry, JournalError, JournalEvent, PendingEntry
from sleepcast.station.roster import RobotNames

FORMAT = 1
"""The version of the format of journals; a file of a newer one is refused."""
APPLICATION = 0x534C504A
"""What marks an SQLite file as a journal: `SLPJ`."""
FIRST = bytes(32)
"""The hash before the first entry of all."""
PATIENCE = 10.0
"""Seconds to wait for another writer: it writes for milliseconds, and some seconds when it begins another file."""
LOOK = 0.001
"""Seconds between two checks whether another writer has finished: about as long as one entry takes."""
MAX_LISTED = 100_000
"""Names in one list of robots: some megabytes a command; of a longer list, its length and the first names are
stored."""
MAX_BYTES = 64 * 1024 * 1024
"""Bytes of one value in the file: an entry with the longest lists has less."""
MAX_DEPTH = 16
"""Lists within each other in details: four times what a message may have."""
MAX_INTEGER = 2**63 - 1
"""The largest integer that is written as a number; a larger one is a text."""

SCHEMA = """
CREATE TABLE entries (
    number INTEGER PRIMARY KEY AUTOINCREMENT,
    line TEXT NOT NULL,
    hash BLOB NOT NULL,
    written REAL GENERATED ALWAYS AS (json_extract(line, '$.written')) VIRTUAL,
    who TEXT GENERATED ALWAYS AS (json_extract(line, '$.who')) VIRTUAL,
    event TEXT GENERATED ALWAYS AS (json_extract(line, '$.event')) VIRTUAL,
    subject TEXT GENERATED ALWAYS AS (json_extract(line, '$.subject')) VIRTUAL
) STRICT;
CREATE INDEX by_written ON entries (written);
CREATE INDEX by_subject ON entries (subject);
CREATE TABLE about (key TEXT PRIMARY KEY, value TEXT NOT NULL) STRICT;
CREATE TRIGGER entries_stay BEFORE UPDATE ON entries BEGIN SELECT RAISE(ABORT, 'a journal only grows'); END;
"""
KEPT = "CREATE TRIGGER entries_are_kept BEFORE DELETE ON entries BEGIN SELECT RAISE(ABORT, 'a journal only grows'); END"
"""Against accidents; deliberate changes are found by the chain."""
INSERT = "INSERT INTO entries (number, line, hash) VALUES (?, ?, ?)"


class NoJournalError(JournalError):
    """There is no file, or it is no journal, or one of a newer format."""

    exit_status = 2


class FiledEntry(msgspec.Struct, frozen=True):
    """An entry as it lies in a file. written: when, s of Unix time; `entry.time` is that of the desk's clock, which may
    be a simulation's. line, hash: see the module."""

    entry: JournalEntry
    written: float
    line: str
    hash: bytes


class Predecessor(msgspec.Struct, frozen=True):
    """What came before a file: the archive's name, the number of its last entry, and that one's hash."""

    archive: str = ""
    number: int = 0
    hash: bytes = FIRST


def digest(before: bytes, line: str) -> bytes:
    """The hash of an entry; see the module."""
    return hashlib.sha256(before + line.encode()).digest()


def line_of(entry: JournalEntry, written: float) -> str:
    """An entry as a line of JSON: bytes in hexadecimal, `null` for what is unknown or never comes, and an integer of
    more than 64 bits as text."""
    details: dict[str, object] = {}
    for key, value in entry.details.items():
        if type(value) is RobotNames and len(value) > MAX_LISTED:
            details[f"n_{key}"], value = len(value), value[:MAX_LISTED]
        details[key] = _plain(value)
    fields = {
        "number": entry.number,
        "written": written,
        "time": entry.time,
        "who": _text(entry.who),
        "event": entry.event,
        "subject": _text(entry.subject),
        "text": _text(entry.text),
        "details": details,
    }
    return msgspec.json.encode(fields).decode()


def read_line(line: str, hash: bytes) -> FiledEntry:
    """The entry in a line. Raises JournalError for one that is no entry."""
    try:
        match json.loads(line):
            case {
                "number": int() as number,
                "written": float() | int() as written,
                "time": float() | int() as time,
                "who": str() as who,
                "event": str() as event,
                "subject": str() as subject,
                "text": str() as text,
                "details": dict() as details,
            }:
                entry = JournalEntry(number, float(time), who, JournalEvent(event), subject, text, details)
                return FiledEntry(entry, float(written), line, hash)
    except (ValueError, RecursionError):
        pass
    raise JournalError(f"this is not a journal entry: {line[:80]!r}")


def _plain(value: object, depth: int = 0) -> object:
    """What `line_of` can write for a value, of exactly these types."""
    if type(value) is str:  # as most are, and there are many entries
        return _text(value)
    if value is None or type(value) is float:  # what is no finite number is written as `null`
        return value
    match value:
        case bool():
            return value
        case str():
            return _text(str(value))
        case int() if abs(value) <= MAX_INTEGER:
            return value
        case np.generic():
            return _plain(value.item(), depth)
        case float():
            return value if isfinite(value) else None
        case bytes():
            return value.hex()
        case Mapping() if depth < MAX_DEPTH:
            return {_text(str(key)): _plain(each, depth + 1) for key, each in value.items()}
        case Iterable() if depth < MAX_DEPTH:
            return [_plain(each, depth + 1) for each in value]
    return _text(str(value))


def _text(text: str) -> str:
    """Text that UTF-8 can say."""
    return text if text.isascii() else text.encode(errors="backslashreplace").decode()


# ---- files


def open_writing(file: Path) -> sqlite3.Connection:
    """A journal to write to; it is made if there is none yet, readable by its owner only. Raises JournalError."""
    with journal_errors(file):
        file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with suppress(FileExistsError):  # to open one that is there, and to close it again, would undo SQLite's locks
            os.close(os.open(file, os.O_RDWR | os.O_CREAT | os.O_EXCL, 0o600))
        connection = _connection(file, "rw")
        try:
            if not _is_journal(connection, file):
                prepare(connection, file)
                settle(file.parent)
            connection.execute("PRAGMA synchronous = FULL")
        except BaseException:
            connection.close()
            raise
    return connection


def open_reading(file: Path) -> sqlite3.Connection:
    """A journal to read, while others may write to it. Raises NoJournalError."""
    if not file.is_file():
        raise NoJournalError(f"no journal {file}: commands on the air create it, or choose another with --journal")
    with journal_errors(file):
        connection = _connection(file, "ro")
        try:
            if not _is_journal(connection, file):
                raise NoJournalError(f"{file} is empty: nothing was ever written to this journal")
        except BaseException:
            connection.close()
            raise
    return connection


def prepare(
    connection: sqlite3.Connection, file: Path, origin: Predecessor | None = None, *, live: bool = True
) -> None:
    """Make an empty file a journal that goes on after `origin`. live: it is to be read while it is written."""
    if live:
        _patiently(connection, "PRAGMA journal_mode = WAL")
    with transaction(connection):
        if _is_journal(connection, file):  # somebody else was faster
            return
        for statement in SCHEMA.strip().split(";\n"):
            connection.execute(statement)
        connection.execute(KEPT)
        if origin is not None:
            set_origin(connection, origin)
        connection.execute(f"PRAGMA application_id = {APPLICATION}")
        connection.execute(f"PRAGMA user_version = {FORMAT}")


@contextmanager
def transaction(connection: sqlite3.Connection, patience: float = PATIENCE) -> Iterator[None]:
    """One transaction, alone. patience: s to wait for other writers."""
    _patiently(connection, "BEGIN IMMEDIATE", patience)
    try:
        yield
        connection.execute("COMMIT")
    except BaseException:
        if connection.in_transaction:
            connection.execute("ROLLBACK")
        raise


def _patiently(connection: sqlite3.Connection, statement: str, patience: float = PATIENCE) -> None:
    """Do this once nobody else writes. SQLite looks more and more seldom, so that one who writes without a pause would
    keep us out, and for some statements not even twice; so we look often ourselves."""
    until = time.monotonic() + patience
    connection.execute("PRAGMA busy_timeout = 0")
    try:
        while True:
            try:
                connection.execute(statement)
                return
            except sqlite3.OperationalError as error:
                if error.sqlite_errorcode & 0xFF != sqlite3.SQLITE_BUSY or time.monotonic() > until:
                    raise
            time.sleep(LOOK)
    finally:
        connection.execute(f"PRAGMA busy_timeout = {PATIENCE * 1000.0:.0f}")


@contextmanager
def journal_errors(file: Path) -> Iterator[None]:
    """What goes wrong with a file, as a sentence."""
    try:
        yield
    except SleepcastError:
        raise
    except (sqlite3.Error, OSError) as error:
        said = (error.strerror or str(error)) if isinstance(error, OSError) else str(error)
        raise JournalError(f"the journal {file}: {said}") from None


def get_attribute(connection: sqlite3.Connection, key: str) -> str:
    """What kind of file it is by its own entry, "" for none."""
    row = connection.execute("SELECT value FROM about WHERE key = ?", (key,)).fetchone()
    return str(row[0]) if row else ""


def set_attribute(connection: sqlite3.Connection, key: str, value: str) -> None:
    """Let a file say this of itself."""
    connection.execute("INSERT OR REPLACE INTO about VALUES (?, ?)", (key, value))


def origin_of(connection: sqlite3.Connection) -> Predecessor:
    """What came before a file. Raises JournalError."""
    archive = get_attribute(connection, "archive")
    if not archive:
        return Predecessor()
    try:
        return Predecessor(
            Path(archive).name,
            int(get_attribute(connection, "number")),
            bytes.fromhex(get_attribute(connection, "hash")),
        )
    except ValueError:
        raise JournalError(f"it does not say where {archive} ended, which came before it") from None


def set_origin(connection: sqlite3.Connection, origin: Predecessor) -> None:
    """Let a file begin after `origin`."""
    for key, value in (("archive", origin.archive), ("number", str(origin.number)), ("hash", origin.hash.hex())):
        set_attribute(connection, key, value)


def _connection(file: Path, mode: str) -> sqlite3.Connection:
    where = f"{file.absolute().as_uri()}?mode={mode}"
    # Its users lock it for themselves.
    connection = sqlite3.connect(where, timeout=PATIENCE, isolation_level=None, check_same_thread=False, uri=True)
    connection.setlimit(sqlite3.SQLITE_LIMIT_LENGTH, MAX_BYTES)
    return connection


def _is_journal(connection: sqlite3.Connection, file: Path) -> bool:
    """Whether it is one; False for an empty file. Raises NoJournalError for anything else."""
    with _at_one_moment(connection):
        application = connection.execute("PRAGMA application_id").fetchone()[0]
        version = connection.execute("PRAGMA user_version").fetchone()[0]
        used = connection.execute("SELECT EXISTS (SELECT 1 FROM sqlite_schema)").fetchone()[0]
    if application == APPLICATION:
        if version > FORMAT:
            raise NoJournalError(
                f"{file} has format {version}, which is newer than this sleepcast, which reads format {FORMAT}: "
                "update sleepcast"
            )
        if not _is_as_made(connection):
            raise JournalError(
                f"the journal {file}: its tables are not those of a journal, so what it says is not what was written, "
                "and what is written may be lost: choose another with --journal"
            )
        return True
    if application or version or used:
        raise NoJournalError(f"{file} is an SQLite file, but not a journal: choose another with --journal")
    return False


def _is_as_made(connection: sqlite3.Connection) -> bool:
    """Whether a file has the tables of a journal. A view in their place could say anything, a trigger could swallow
    what is written. Those against accidents may be missing, and indexes be added: the chain needs neither."""
    with closing(sqlite3.connect(":memory:")) as model:
        model.executescript(f"{SCHEMA}{KEPT};")
        ours, here = _shape(model), _shape(connection)
    tables = {each for each in ours if each[0] == "table"}
    return tables <= here <= ours


def _shape(connection: sqlite3.Connection) -> set[tuple[str, ...]]:
    """The tables of a journal, and the views and triggers that go by their names."""
    query = "SELECT type, name, tbl_name, sql FROM sqlite_schema WHERE type != 'index' AND tbl_name IN (?, ?)"
    return set(connection.execute(query, ("entries", "about")))


@contextmanager
def _at_one_moment(connection: sqlite3.Connection) -> Iterator[None]:
    """All that is read within this is as it was at one moment: somebody else may be making the file a journal."""
    if connection.in_transaction:
        yield
        return
    connection.execute("BEGIN")
    try:
        yield
    finally:
        connection.execute("ROLLBACK")


# ---- writing: an entry that `append` has taken is on the disk, whatever happens next


PAGE = 500
"""Entries that are read in one go, so that a reader blocks no writer for long."""


class ArchiveLimits(msgspec.Struct, frozen=True):
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

    def close(self) -> None:
        """Be done with the file."""
        with self._lock:
            self._connection.close()

    def append(self, *entries: PendingEntry) -> None:
        """Write entries; their numbers are the next ones. They are on the disk when this returns: many cost what one
        does. None is if this raises JournalError. Others cannot write meanwhile, so they must not be too many."""
        with self._lock:
            if self._is_full():
                self._move(only_if_full=True)
            with journal_errors(self.file), transaction(self._connection, self._patience):
                self._connection.executemany(INSERT, self._chained(entries))

    def _chained(self, entries: Iterable[PendingEntry]) -> Iterator[tuple[int, str, bytes]]:
        """The rows of the next entries. Nobody else writes meanwhile."""
        latest, before = self._head()
        for number, entry in enumerate(entries, latest + 1):
            line = line_of(JournalEntry(number, *entry), self._clock.now())
            before = digest(before, line)
            yield number, line, before

    def entries(self, after: int = 0) -> Iterator[JournalEntry]:
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
    def limits(self) -> ArchiveLimits:
        """When it moves into an archive automatically; every writer does so."""
        with self._lock, journal_errors(self.file):
            size, age = get_attribute(self._connection, "most_bytes"), get_attribute(self._connection, "most_seconds")
        return ArchiveLimits(float(size or inf), float(age or inf))

    @limits.setter
    def limits(self, limits: ArchiveLimits) -> None:
        with self._lock, journal_errors(self.file), transaction(self._connection):
            set_attribute(self._connection, "most_bytes", repr(limits.size))
            set_attribute(self._connection, "most_seconds", repr(limits.age))

    def rotate(self) -> Path | None:
        """Move all entries into an archive, and return it; None if there were no entries."""
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
            set_origin(self._connection, Predecessor(archive.name, last, hash))
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
                    copy.executemany(INSERT, rows)
            os.replace(beside, archive)
            settle(archive.parent)
        except BaseException:
            beside.unlink(missing_ok=True)
            raise

    def _is_full(self) -> bool:
        limits = self.limits
        if limits == ArchiveLimits():
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

    def append(self, *entries: PendingEntry) -> None:
        """As `SqliteJournal`."""
        self._journal.append(*entries)

    def entries(self, after: int = 0) -> Iterator[JournalEntry]:
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
