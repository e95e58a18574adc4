"""Whether a store is whole, and the latest one: a robot whose STOP may have been forgotten stands until RELEASE.

    seal      a row in the store, renewed by every transaction: which store it is, how many transactions it has seen,
              and a sum over all rows of all tables. A bit that is not as it was written gives another sum
    marker    a small file beside the store that says which store it was, and how far it had come. An old copy of a
              store is whole, but behind its marker; a store that is gone has left its marker behind

But for a newborn one, the store is always written first, so a kill at any moment leaves it level with its marker or
ahead of it. The marker follows at each start, at each STOP and RELEASE, and else now and then. Who cannot write a STOP
down takes the marker away, for which a full disk has room. Only a robot without store and marker is new.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from hashlib import blake2b
from pathlib import Path
from secrets import token_hex

import msgspec

from sleepcast.core.files import replace_file

SUM_BYTES = 8
"""Bytes of the sum of a row: damage that leaves it as it was comes about once in 10^19 times."""
MAX_MARKER = 4_096
"""Bytes of a marker that are read; it has less than two hundred."""
ID_BYTES = 8
NEWBORN = 1
"""The generation of a store that was made and never used: no marker is missed yet."""

Value = int | float | str | bytes | None


class DamageError(Exception):
    """A store or marker that is not as it was written, and how."""


def row_sum(*row: Value) -> int:
    """Of a row, its table first. Sums of rows are united by exclusive or, so the order does not matter."""
    return int.from_bytes(blake2b(msgspec.msgpack.encode(row), digest_size=SUM_BYTES).digest(), "big")


def sum_of(connection: sqlite3.Connection, tables: Sequence[str]) -> int:
    """Of all rows of these tables."""
    found = 0
    for table in tables:
        for row in connection.execute(f"SELECT * FROM {table}"):
            found ^= row_sum(table, *row)
    return found


@dataclass(slots=True)
class Seal:
    """See the module. doubt: why a robot of which this store knows nothing yet stands all the same: what it was told
    before may be lost. rows: the sum of all rows."""

    store: str = field(default_factory=lambda: token_hex(ID_BYTES))
    generation: int = 0
    doubt: str = ""
    rows: int = 0

    def _own_sum(self) -> bytes:
        return row_sum("seal", self.store, self.generation, self.doubt, self.rows).to_bytes(SUM_BYTES, "big")

    @classmethod
    def read(cls, connection: sqlite3.Connection, tables: Sequence[str]) -> Seal:
        """That of a store whose tables are as they were written. Raises DamageError."""
        rows = sum_of(connection, tables)
        try:
            ((store, generation, doubt, own_sum),) = connection.execute(
                "SELECT store, generation, doubt, sum FROM seal"
            )
        except ValueError:
            raise DamageError("its seal is missing") from None
        found = cls(store, generation, doubt, rows)
        if own_sum != found._own_sum():
            raise DamageError("its rows are not those that were written")
        return found

    def watch(self, connection: sqlite3.Connection, tables: Sequence[str]) -> None:
        """Take notice of every row of these tables that this connection writes or removes."""
        connection.create_function("toggle", -1, self._toggle)
        connection.execute("PRAGMA recursive_triggers = ON")  # else REPLACE removes rows without a word
        for table in tables:
            columns = [row[1] for row in connection.execute(f"PRAGMA table_info({table})")]
            gone, come = (
                f"SELECT toggle('{table}', {', '.join(f'{which}.{column}' for column in columns)});"
                for which in ("old", "new")
            )
            for change, does in (("INSERT", come), ("DELETE", gone), ("UPDATE", gone + come)):
                connection.execute(
                    f"CREATE TEMP TRIGGER {table}_{change} AFTER {change} ON main.{table} BEGIN {does} END"
                )

    def _toggle(self, *row: Value) -> None:
        self.rows ^= row_sum(*row)

    def write(self, to: sqlite3.Connection) -> None:
        """The last thing in every transaction."""
        self.generation += 1
        to.execute("DELETE FROM seal")
        to.execute("INSERT INTO seal VALUES (?, ?, ?, ?)", (self.store, self.generation, self.doubt, self._own_sum()))


class StoreMark(msgspec.Struct, frozen=True):
    """What a marker says: format, store and generation as the store had them, and a sum over these."""

    format: int
    store: str
    generation: int
    sum: int

    def own_sum(self) -> int:
        return row_sum("marker", self.format, self.store, self.generation)


class Marker:
    """The marker of a store."""

    def __init__(self, store: Path, version: int) -> None:
        self.file, self._version = store.with_name(f"{store.name}.marker"), version

    def read(self) -> StoreMark | None:
        """What it says; None if there is none. Raises DamageError for one that cannot be read."""
        try:
            with self.file.open("rb") as opened:
                found = msgspec.json.decode(opened.read(MAX_MARKER), type=StoreMark)
        except (FileNotFoundError, NotADirectoryError):
            return None
        except (OSError, msgspec.MsgspecError, ValueError) as error:
            raise DamageError(str(error)) from None
        if found.sum != found.own_sum():
            raise DamageError("it is not as it was written")
        return found

    def write(self, seal: Seal) -> None:
        """The store has come so far. Raises OSError."""
        mark = StoreMark(self._version, seal.store, seal.generation, 0)
        replace_file(self.file, msgspec.json.encode(msgspec.structs.replace(mark, sum=mark.own_sum())), private=True)

    def withdraw(self) -> None:
        """Let the next start be in doubt. Raises OSError."""
        with suppress(FileNotFoundError, NotADirectoryError):
            self.file.unlink()


def doubt_about(seal: Seal | None, mark: StoreMark | None) -> str:
    """What is wrong with a store that is whole, but may not be the latest of its robots; "" if it is. seal: None in one
    of an older format."""
    if seal is None:
        return "is of an older format"
    if mark is None:
        return "has lost its marker" if seal.generation > NEWBORN else ""
    if mark.store != seal.store:
        return "is not the one it had"
    return "is an old copy" if seal.generation < mark.generation else ""
