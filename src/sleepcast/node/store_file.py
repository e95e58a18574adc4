"""The file of a store: its tables, how it is opened, and what happens if it cannot be used.

It is an SQLite file in WAL mode: committed data survive a kill and a power failure. Only one process at a time uses
it; others may read it meanwhile. It is read completely before anything is written: a damaged file is set aside
unchanged, and not used again; one of a newer format, or something else, is refused and left where it is.
"""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from copy import copy
from pathlib import Path

import msgspec

from sleepcast.channel.message import Message
from sleepcast.channel.sequencer import MAX_STANDING, StandingCommand, StoredWindow, StreamId, StreamProgress
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.core.files import lock_file, settle
from sleepcast.core.serial import SerialError, unpack
from sleepcast.mind.state import MindState
from sleepcast.node.integrity import DamageError, Marker, Seal, doubt_about, sum_of

FORMAT = 2
"""Version of the format of stores; files of a newer one are refused. Those of format 1 had no seal."""
APPLICATION = 0x534C5053
"""The application id that marks an SQLite file as a store: `SLPS`."""
PATIENCE = 2.0
"""Seconds to wait for a reader of the file: a robot's mind waits too."""
MAX_MIND = 16 * 1024 * 1024
"""Bytes of what one robot has learned: the largest number of rules and operators, with the longest texts."""
HEAD = 4_096
"""Length of the prefix, in bytes, by which a text is identified."""
EMPTY = "it is empty"
PASSING = frozenset(
    {
        *(sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED, sqlite3.SQLITE_READONLY, sqlite3.SQLITE_IOERR),
        *(sqlite3.SQLITE_FULL, sqlite3.SQLITE_CANTOPEN, sqlite3.SQLITE_PERM, sqlite3.SQLITE_NOMEM),
        *(sqlite3.SQLITE_PROTOCOL, sqlite3.SQLITE_AUTH, sqlite3.SQLITE_INTERRUPT),
    }
)
"""SQLite's errors about disks, locks and permissions, which say nothing about the file's contents."""

SCHEMA = """
CREATE TABLE robots (
    number INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE, since REAL NOT NULL, epoch INTEGER NOT NULL,
    sequence INTEGER NOT NULL, saved REAL NOT NULL, mind BLOB
) STRICT;
CREATE TABLE streams (
    robot INTEGER NOT NULL, key BLOB NOT NULL, epoch INTEGER NOT NULL,
    done INTEGER NOT NULL, sent REAL NOT NULL, until REAL NOT NULL, rules INTEGER NOT NULL,
    PRIMARY KEY (robot, key, epoch)
) STRICT, WITHOUT ROWID;
CREATE TABLE windows (
    robot INTEGER NOT NULL, key BLOB NOT NULL, sender TEXT NOT NULL, epoch INTEGER NOT NULL,
    latest INTEGER NOT NULL, numbers BLOB NOT NULL,
    PRIMARY KEY (robot, key, sender, epoch)
) STRICT, WITHOUT ROWID;
CREATE TABLE standing (
    number INTEGER PRIMARY KEY, key BLOB NOT NULL, epoch INTEGER NOT NULL, sequence INTEGER NOT NULL,
    datagrams BLOB NOT NULL, UNIQUE (key, epoch, sequence)
) STRICT;
CREATE TABLE taken (
    number INTEGER PRIMARY KEY, robot INTEGER NOT NULL, command TEXT NOT NULL, begun INTEGER NOT NULL,
    message BLOB NOT NULL, UNIQUE (robot, command)
) STRICT;
CREATE TABLE evaluations (
    number INTEGER PRIMARY KEY AUTOINCREMENT, robot INTEGER NOT NULL, command TEXT NOT NULL, kind TEXT NOT NULL,
    time REAL NOT NULL, outcome TEXT NOT NULL
) STRICT;
"""
SEAL = """
CREATE TABLE seal (store TEXT NOT NULL, generation INTEGER NOT NULL, doubt TEXT NOT NULL, sum BLOB NOT NULL) STRICT;
CREATE TABLE arrivals (number INTEGER PRIMARY KEY, arrived REAL NOT NULL) STRICT;
CREATE VIEW journal AS
    SELECT evaluations.number, robots.name AS robot, command, kind, arrived, time, outcome
    FROM evaluations JOIN robots ON robots.number = evaluations.robot
    LEFT JOIN arrivals ON arrivals.number = evaluations.number;
"""
"""Missing in stores of format 1, whose view of the journal also had no arrivals."""
MAX_ROWS = 5 * MAX_STANDING
"""Standing commands that are read, the latest: more than are kept, since those that do not count any more give way."""
TABLES = ("robots", "streams", "windows", "standing", "taken", "evaluations", "arrivals")
"""The tables that the seal covers."""
"""robots: in order of arrival, or the operator; since, saved: when it was first here, and when its mind was last
written (s of Unix time); epoch: of the present or the last life; sequence: upper bound of the message numbers that an
operator may have used in it. See `StreamProgress`, `StoredWindow` and `StandingCommand` of the channel. taken: messages
from the channel that are not finished. evaluations: the outcome of each command, STOP and RELEASE, and its time (s of
Unix time); arrivals: when it had arrived, by the evaluation's number. seal: see `integrity`."""


class StoreError(MisuseError):
    """The store cannot be used; the text says why."""


class InUseError(StoreError):
    """Another process uses the store."""


class Taken(msgspec.Struct):
    """A message that was taken and is not finished; begun: how often its evaluation had begun."""

    message: Message
    begun: int


class Remembered(msgspec.Struct):
    """What a file holds about one robot. mind: None if it has never learned anything."""

    number: int
    since: float
    epoch: int = 0
    sequence: int = 0
    saved: float = 0.0
    mind: MindState | None = None
    streams: list[StreamProgress] = msgspec.field(default_factory=list)
    windows: list[StoredWindow] = msgspec.field(default_factory=list)
    taken: list[Taken] = msgspec.field(default_factory=list)


class Content(msgspec.Struct):
    """The contents of a file: each robot by its name, and the standing commands, oldest first."""

    robots: dict[str, Remembered] = msgspec.field(default_factory=dict)
    standing: list[StandingCommand] = msgspec.field(default_factory=list)


class Examined(msgspec.Struct):
    """The result of examining a store.

    content, seal: of an undamaged file; a store of format 1 has no seal.
    doubt: the problem, as the end of a sentence about the store, "" if there is none.
    damage: the same in detail.
    """

    content: Content | None = None
    seal: Seal | None = None
    doubt: str = ""
    damage: str = ""


def examine(file: Path) -> Examined:
    """Read a store and judge whether it can be trusted; changes nothing. Raises StoreError if it is not a store or of a
    newer format, and OSError and sqlite3.Error if it cannot be read now."""
    marker = Marker(file, FORMAT)
    mark, lost = None, False
    try:
        mark = marker.read()
    except DamageError:
        lost = True
    if not os.path.lexists(file):
        return Examined(doubt="is gone" if mark or lost else "")
    try:
        content, seal = _load(file)
    except DamageError as error:
        damage = str(error)
    except StoreError as error:
        if not lost and (mark is None or mark.format > FORMAT):
            raise
        damage = str(error)  # its marker shows that it was a store of ours
    else:
        return Examined(content, seal, "has a damaged marker" if lost else doubt_about(seal, mark))
    return Examined(None, None, "was empty" if damage == EMPTY else "was damaged", damage)


def _load(file: Path) -> tuple[Content, Seal | None]:
    """The contents of an undamaged file. Raises as `examine` does, and DamageError."""
    if not file.is_file():
        raise StoreError(f"{file} is no file: name another one")
    with file.open("rb") as opened:
        head = opened.read(HEAD)
    if not head:
        raise DamageError(EMPTY)
    if head.isascii() and b"\0" not in head:
        raise StoreError(f"{file} is a text and no store of a robot: name another one")
    failure = sqlite3.Error()
    for how in ("mode=ro", "mode=ro&immutable=1"):  # the second works where not even a lock can be written
        try:
            with closing(sqlite3.connect(f"{file.absolute().as_uri()}?{how}", uri=True)) as connection:
                return _checked(connection, file)
        except sqlite3.Error as error:
            if getattr(error, "sqlite_errorcode", sqlite3.SQLITE_CORRUPT) & 0xFF not in PASSING:
                raise DamageError(str(error)) from None
            failure = error
    raise failure


def _checked(connection: sqlite3.Connection, file: Path) -> tuple[Content, Seal | None]:
    application = connection.execute("PRAGMA application_id").fetchone()[0]
    version = connection.execute("PRAGMA user_version").fetchone()[0]
    if application != APPLICATION:
        raise StoreError(f"{file} is an SQLite file, but no store of a robot: name another one")
    if version > FORMAT:
        raise StoreError(
            f"{file} is a store of format {version}, and this sleepcast reads {FORMAT}: take a newer one, or another "
            "file"
        )
    (verdict,) = connection.execute("PRAGMA integrity_check(1)").fetchone()
    if verdict != "ok":
        raise DamageError(verdict)
    if version < FORMAT:
        return read_all(connection), None
    with closing(sqlite3.connect(":memory:")) as model:
        model.executescript(SCHEMA + SEAL)
        if _shape(connection) != _shape(model):
            raise DamageError("its tables are not those of a store")
    numbered = connection.execute("SELECT max(number) FROM evaluations").fetchone()
    if numbered != (connection.execute("SELECT seq FROM sqlite_sequence").fetchone() or (None,)):
        raise DamageError("its entries are numbered in another way than they were")
    seal = Seal.read(connection, TABLES)
    return read_all(connection), seal


def _shape(connection: sqlite3.Connection) -> set[tuple[str, ...]]:
    return set(connection.execute("SELECT type, name, tbl_name, sql FROM sqlite_schema"))


def create(file: Path, doubt: str) -> Seal:
    """Create an unused store, atomically, even if the process ends here. doubt: see `Seal`. Raises sqlite3.Error and
    OSError."""
    temporary = file.with_name(f".{file.name}.new")
    for part in _parts(temporary):
        part.unlink(missing_ok=True)
    os.close(os.open(temporary, os.O_RDWR | os.O_CREAT, 0o600))
    with closing(sqlite3.connect(temporary, isolation_level=None)) as connection:
        connection.execute("PRAGMA journal_mode = WAL")
        connection.executescript(SCHEMA + SEAL)
        connection.execute(f"PRAGMA application_id = {APPLICATION}")
        connection.execute(f"PRAGMA user_version = {FORMAT}")
        seal = Seal(doubt=doubt)
        seal.write(connection)
    os.replace(temporary, file)
    settle(file.parent)
    return seal


def connect(file: Path, seal: Seal | None) -> tuple[sqlite3.Connection, Seal]:
    """Open a store, already read, for writing. seal: None for one of format 1, which gets one. Raises sqlite3.Error."""
    # Several stores of one process are written at a time, by whichever thread is free; one store by one at a time.
    connection = sqlite3.connect(file, timeout=PATIENCE, isolation_level=None, check_same_thread=False)
    try:
        connection.execute("PRAGMA synchronous = FULL")
        if seal is None:
            seal = Seal(rows=sum_of(connection, [table for table in TABLES if table != "arrivals"]))
            with transaction(connection, seal):
                connection.execute("DROP VIEW IF EXISTS journal")
                for statement in SEAL.strip().split(";\n"):
                    connection.execute(statement)
                connection.execute(f"PRAGMA user_version = {FORMAT}")
        seal.watch(connection, TABLES)
        connection.execute("BEGIN IMMEDIATE")  # fails now if the file is not writable
        connection.execute("ROLLBACK")
    except BaseException:
        connection.close()
        raise
    return connection, seal


def lock(file: Path) -> int | None:
    """Keep other processes from using this store until the descriptor is closed or this process ends; None if the
    platform has no locks. Raises StoreError if another process has it, OSError if the folder is not writable."""
    file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    try:
        return lock_file(file.with_name(f"{file.name}.lock"))
    except BlockingIOError:
        raise InUseError(
            f"{file} is in use: does a robot of this name run already? Name another with --store, or take none with "
            "--no-store"
        ) from None


def set_aside(file: Path, now: float) -> Path | None:
    """Rename an unusable file, with SQLite's files beside it; returns the new path, None if there was nothing. Raises
    OSError."""
    for attempt in range(100):
        aside = file.with_name(f"{file.name}.broken-{now:.0f}" + (f"-{attempt}" if attempt else ""))
        if not any(os.path.lexists(part) for part in _parts(aside)):
            break
    moved = False
    for part, to in zip(_parts(file), _parts(aside), strict=True):
        if os.path.lexists(part):
            os.replace(part, to)
            moved = True
    return aside if moved else None


def _parts(file: Path) -> list[Path]:
    """A store with SQLite's files beside it; the store last, because without it the others do not count as a store."""
    return [file.with_name(file.name + ending) for ending in ("-wal", "-shm", "")]


def read_all(connection: sqlite3.Connection) -> Content:
    """The contents of a file, except for past evaluations. Raises sqlite3.DatabaseError if it is damaged."""
    content = Content()
    by_number: dict[int, Remembered] = {}
    try:
        for number, name, *rest, mind in connection.execute("SELECT * FROM robots"):
            content.robots[name] = by_number[number] = Remembered(number, *rest)
            if mind is not None:
                by_number[number].mind = unpack(MindState, mind, MAX_MIND, f"what {name} has learned")
        for robot, key, epoch, *rest in connection.execute("SELECT * FROM streams"):
            by_number[robot].streams.append(StreamProgress((key, epoch), *rest))
        for robot, key, sender, epoch, latest, numbers in connection.execute("SELECT * FROM windows"):
            by_number[robot].windows.append(StoredWindow(key, sender, epoch, latest, int.from_bytes(numbers, "big")))
        for robot, begun, message in connection.execute("SELECT robot, begun, message FROM taken ORDER BY number"):
            by_number[robot].taken.append(Taken(msgspec.msgpack.decode(message, type=Message), begun))
        query = "SELECT key, epoch, sequence, datagrams FROM standing ORDER BY number"
        for key, epoch, sequence, datagrams in connection.execute(query):
            parts = msgspec.msgpack.decode(datagrams, type=tuple[bytes, ...])
            content.standing.append(StandingCommand((key, epoch), sequence, parts))
    except (msgspec.DecodeError, SerialError, ValueError, RecursionError, SleepcastError) as error:
        raise sqlite3.DatabaseError(f"what is in it cannot be read: {error}") from None
    except KeyError as error:
        raise sqlite3.DatabaseError(f"it speaks of a robot {error} that is not there") from None
    del content.standing[:-MAX_ROWS]  # which of them still count, their receiver knows: the oldest may
    return content


@contextmanager
def transaction(connection: sqlite3.Connection, seal: Seal) -> Iterator[None]:
    """A transaction that ends with the seal."""
    before = copy(seal)
    connection.execute("BEGIN IMMEDIATE")
    try:
        yield
        seal.write(connection)
        connection.execute("COMMIT")
    except BaseException:
        seal.generation, seal.rows = before.generation, before.rows
        if connection.in_transaction:
            connection.execute("ROLLBACK")
        raise


# ---- changes that wait to be written into a store, all in one transaction, the latest of each

MAX_EVALUATIONS = 1_000_000
"""Evaluations that are remembered for all robots of a file: some eighty megabytes."""

Evaluated = tuple[int, str, str, float, str, float | None]
"""A robot's number, a command's id and kind, the time (s of Unix time), the outcome, and the time of its arrival."""


class WriteBatch(msgspec.Struct):
    """Changes waiting to be written, mostly by the robot's number; the fields are those of the tables.

    taken: messages and how often they were begun.
    finished: those of them that are finished.
    minds: time and packed state.
    lives: names, and what is known of their lives.
    """

    streams: dict[tuple[int, StreamId], StreamProgress] = msgspec.field(default_factory=dict)
    windows: dict[tuple[int, bytes, str, int], StoredWindow] = msgspec.field(default_factory=dict)
    standing: dict[tuple[StreamId, int], tuple[bytes, ...]] = msgspec.field(default_factory=dict)
    taken: dict[tuple[int, str], tuple[Message, int]] = msgspec.field(default_factory=dict)
    finished: set[tuple[int, str]] = msgspec.field(default_factory=set)
    evaluated: list[Evaluated] = msgspec.field(default_factory=list)
    minds: dict[int, tuple[float, bytes]] = msgspec.field(default_factory=dict)
    lives: dict[int, tuple[str, Remembered]] = msgspec.field(default_factory=dict)

    def __bool__(self) -> bool:
        return any(getattr(self, each) for each in self.__struct_fields__)

    def write(self, to: sqlite3.Connection) -> None:
        """Write everything, within a transaction of the caller. Raises sqlite3.Error."""
        to.executemany(
            "INSERT INTO robots VALUES (?, ?, ?, ?, ?, 0.0, NULL) "
            "ON CONFLICT (number) DO UPDATE SET epoch = excluded.epoch, sequence = excluded.sequence",
            ((number, name, each.since, each.epoch, each.sequence) for number, (name, each) in self.lives.items()),
        )
        to.executemany(
            "INSERT OR REPLACE INTO streams VALUES (?, ?, ?, ?, ?, ?, ?)",
            (
                (robot, *name, each.done, each.sent, each.until, each.rules)
                for (robot, name), each in self.streams.items()
            ),
        )
        to.executemany(
            "INSERT OR REPLACE INTO windows VALUES (?, ?, ?, ?, ?, ?)",
            (
                (*which, each.latest, each.numbers.to_bytes((each.numbers.bit_length() + 7) // 8, "big"))
                for which, each in self.windows.items()
            ),
        )
        to.executemany(
            "INSERT OR IGNORE INTO standing (key, epoch, sequence, datagrams) VALUES (?, ?, ?, ?)",
            ((*name, number, msgspec.msgpack.encode(data)) for (name, number), data in self.standing.items()),
        )
        self._write_taken(to)
        to.executemany(
            "UPDATE robots SET saved = ?, mind = ? WHERE number = ?",
            ((saved, mind, number) for number, (saved, mind) in self.minds.items()),
        )
        self._write_evaluated(to)

    def _write_taken(self, to: sqlite3.Connection) -> None:
        to.executemany(
            "INSERT INTO taken (robot, command, begun, message) VALUES (?, ?, ?, ?) "
            "ON CONFLICT (robot, command) DO UPDATE SET begun = excluded.begun",
            ((*which, begun, msgspec.msgpack.encode(message)) for which, (message, begun) in self.taken.items()),
        )
        to.executemany("DELETE FROM taken WHERE robot = ? AND command = ?", self.finished)

    def _write_evaluated(self, to: sqlite3.Connection) -> None:
        for *entry, arrived in self.evaluated:
            row = to.execute(
                "INSERT INTO evaluations (robot, command, kind, time, outcome) VALUES (?, ?, ?, ?, ?)", entry
            )
            if arrived is not None:
                to.execute("INSERT INTO arrivals VALUES (?, ?)", (row.lastrowid, arrived))
        if self.evaluated:
            (last,) = to.execute("SELECT max(number) FROM evaluations").fetchone()
            for table in ("evaluations", "arrivals"):
                to.execute(f"DELETE FROM {table} WHERE number <= ?", (last - MAX_EVALUATIONS,))
