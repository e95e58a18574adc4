"""The file of a store: its tables, how it is opened, and what is done about one that cannot be used.

It is an SQLite file in WAL mode, and what was committed outlives a kill and a loss of power. One process at a time uses
it; others may read it meanwhile. A file that is damaged is set aside and not used again; one of a newer format, or one
that is something else, is refused and left as it is.
"""

from __future__ import annotations

import os
import sqlite3
from collections.abc import Iterator
from contextlib import closing, contextmanager
from dataclasses import dataclass, field
from pathlib import Path

import msgspec

from sleepcast.channel.kept import Progress, Standing, Window
from sleepcast.channel.message import Message
from sleepcast.channel.shelf import MAX_STANDING
from sleepcast.errors import MisuseError, SleepcastError

FORMAT = 1
"""The version of the format of stores; a file of a newer one is refused."""
APPLICATION = 0x534C5053
"""What marks an SQLite file as a store: `SLPS`."""
PATIENCE = 2.0
"""Seconds to wait for somebody who reads: a robot's mind waits with it."""

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
CREATE VIEW journal AS
    SELECT evaluations.number, robots.name AS robot, command, kind, time, outcome
    FROM evaluations JOIN robots ON robots.number = evaluations.robot
"""
"""robots: in the order in which they came, or the operator; since, saved: when it was first here, and when its mind was
last written (s of Unix time); epoch: of the present life, or the last one; sequence: up to where an operator's numbers
in it may have been used. See `Progress`, `Window` and `Standing` of the channel. taken: what was taken from the channel
and not finished. evaluations: what became of each command, STOP and RELEASE, and when (s of Unix time)."""


class StoreError(MisuseError):
    """A store that cannot be used, and why."""


class InUseError(StoreError):
    """A store that another process uses."""


@dataclass(slots=True)
class Taken:
    """A message that was taken and not finished; begun: how often its evaluation had begun."""

    message: Message
    begun: int


@dataclass(slots=True)
class Remembered:
    """What a file says of one robot. mind: a packed `MindParcel`, None if it never learned anything."""

    number: int
    since: float
    epoch: int = 0
    sequence: int = 0
    saved: float = 0.0
    mind: bytes | None = None
    streams: list[Progress] = field(default_factory=list)
    windows: list[Window] = field(default_factory=list)
    taken: list[Taken] = field(default_factory=list)


@dataclass(slots=True)
class Content:
    """What a file says: of each robot by its name, and the standing commands, the oldest first."""

    robots: dict[str, Remembered] = field(default_factory=dict)
    standing: list[Standing] = field(default_factory=list)


def open_file(file: Path) -> sqlite3.Connection:
    """The store in a file, made if there is none. Raises StoreError, sqlite3.Error and OSError."""
    file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    os.close(os.open(file, os.O_RDWR | os.O_CREAT, 0o600))
    connection = sqlite3.connect(file, timeout=PATIENCE, isolation_level=None)
    try:
        if not _is_store(connection, file):
            connection.execute("PRAGMA journal_mode = WAL")
            with transaction(connection):
                for statement in SCHEMA.split(";\n"):
                    connection.execute(statement)
                connection.execute(f"PRAGMA application_id = {APPLICATION}")
                connection.execute(f"PRAGMA user_version = {FORMAT}")
        connection.execute("PRAGMA synchronous = FULL")
    except BaseException:
        connection.close()
        raise
    return connection


def _is_store(connection: sqlite3.Connection, file: Path) -> bool:
    """Whether it is one; False for an empty file. Raises StoreError for anything else."""
    application = connection.execute("PRAGMA application_id").fetchone()[0]
    version = connection.execute("PRAGMA user_version").fetchone()[0]
    if application == APPLICATION:
        if version > FORMAT:
            raise StoreError(
                f"{file} is a store of format {version}, and this sleepcast reads {FORMAT}: take a newer one, or "
                "another file"
            )
        return True
    with closing(connection.execute("SELECT 1 FROM sqlite_schema LIMIT 1")) as any_table:
        if application or version or any_table.fetchone() is not None:
            raise StoreError(f"{file} is an SQLite file, but no store of a robot: name another one")
    return False


def lock(file: Path) -> int | None:
    """Keep other processes from using this store until the descriptor is closed or this process ends; None where that
    cannot be asked for. Raises StoreError if another one has it, OSError if nothing can be written there."""
    try:
        import fcntl
    except ImportError:
        return None
    file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    descriptor = os.open(file.with_name(f"{file.name}.lock"), os.O_RDWR | os.O_CREAT, 0o600)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(descriptor)
        raise InUseError(
            f"{file} is in use: does a robot of this name run already? Name another with --store, or take none with "
            "--no-store"
        ) from None
    except OSError:  # this file system knows no locks
        os.close(descriptor)
        return None
    return descriptor


def refuse_text(file: Path) -> None:
    """Raises StoreError for a file that is a text: somebody has named the wrong one, and it is left as it is."""
    with file.open("rb") as opened:
        data = opened.read(4_096)
    if data.isascii() and b"\0" not in data:
        raise StoreError(f"{file} is a text and no store of a robot: name another one")


def set_aside(file: Path, now: float) -> Path:
    """Give a file that cannot be used another name, with what SQLite keeps beside it; gives that. Raises OSError."""
    for attempt in range(100):
        aside = file.with_name(f"{file.name}.broken-{now:.0f}" + (f"-{attempt}" if attempt else ""))
        if not aside.exists():
            break
    for ending in ("", "-wal", "-shm"):
        part = file.with_name(file.name + ending)
        if part.exists():
            os.replace(part, aside.with_name(aside.name + ending))
    return aside


def read_all(connection: sqlite3.Connection) -> Content:
    """Everything that a file says, but for what has been evaluated. Raises sqlite3.DatabaseError for a damaged one."""
    found = Content()
    by_number: dict[int, Remembered] = {}
    for number, name, *rest in connection.execute("SELECT * FROM robots"):
        found.robots[name] = by_number[number] = Remembered(number, *rest)
    try:
        for robot, key, epoch, *rest in connection.execute("SELECT * FROM streams"):
            by_number[robot].streams.append(Progress((key, epoch), *rest))
        for robot, key, sender, epoch, latest, numbers in connection.execute("SELECT * FROM windows"):
            by_number[robot].windows.append(Window(key, sender, epoch, latest, int.from_bytes(numbers, "big")))
        for robot, begun, message in connection.execute("SELECT robot, begun, message FROM taken ORDER BY number"):
            by_number[robot].taken.append(Taken(msgspec.msgpack.decode(message, type=Message), begun))
        query = "SELECT key, epoch, sequence, datagrams FROM standing ORDER BY number"
        for key, epoch, sequence, datagrams in connection.execute(query):
            parts = msgspec.msgpack.decode(datagrams, type=tuple[bytes, ...])
            found.standing.append(Standing((key, epoch), sequence, parts))
    except (msgspec.DecodeError, ValueError, RecursionError, SleepcastError) as error:
        raise sqlite3.DatabaseError(f"what is in it cannot be read: {error}") from None
    except KeyError as error:
        raise sqlite3.DatabaseError(f"it speaks of a robot {error} that is not there") from None
    del found.standing[:-MAX_STANDING]
    return found


def read_only(file: Path) -> Content:
    """What a file says that nobody may write to; nothing if it cannot be read either. Raises StoreError for what is no
    store."""
    for how in ("mode=ro", "mode=ro&immutable=1"):  # the second where not even a lock can be written
        try:
            with closing(sqlite3.connect(f"{file.absolute().as_uri()}?{how}", uri=True)) as connection:
                if _is_store(connection, file):
                    return read_all(connection)
        except sqlite3.Error:
            continue
    return Content()


@contextmanager
def transaction(connection: sqlite3.Connection) -> Iterator[None]:
    """All or nothing."""
    connection.execute("BEGIN IMMEDIATE")
    try:
        yield
        connection.execute("COMMIT")
    except BaseException:
        if connection.in_transaction:
            connection.execute("ROLLBACK")
        raise
