"""Integrity of a store: whether it is undamaged and the latest one. A robot that may have lost a STOP stays stopped
until RELEASE.

seal      a row in the store, renewed by every transaction: the store's identity, its number of transactions, and a
          checksum over all rows of all tables. Any changed bit changes the checksum
marker    a small file beside the store with the store's identity and progress. An old copy of a store is undamaged,
          but behind its marker; a store that is lost has left its marker behind

Except for a new one, the store is always written first, so after a kill at any moment it is level with its marker or
ahead of it. The marker is updated at each start, at each STOP and RELEASE, and from time to time. If a STOP cannot
be written, the marker is removed, which works even on a full disk. Only a robot without store and marker counts as
new.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Sequence
from contextlib import suppress
from hashlib import blake2b
from pathlib import Path
from secrets import token_hex

import msgspec

from sleepcast.core.files import replace_file

SUM_BYTES = 8
"""Bytes of a row's checksum: damage goes undetected about once in 10^19 cases."""
MAX_MARKER = 4_096
"""Bytes read of a marker; real ones have fewer than two hundred."""
ID_BYTES = 8
NEWBORN = 1
"""The generation of a store that was created but never used: it needs no marker yet."""

Value = int | float | str | bytes | None


class DamageError(Exception):
    """A store or marker is damaged; the text says how."""


def row_sum(*row: Value) -> int:
    """Checksum of a row, beginning with its table's name. Checksums are combined by exclusive or, so their order does
    not matter."""
    return int.from_bytes(blake2b(msgspec.msgpack.encode(row), digest_size=SUM_BYTES).digest(), "big")


def sum_of(connection: sqlite3.Connection, tables: Sequence[str]) -> int:
    """Combined checksum of all rows of these tables."""
    combined = 0
    for table in tables:
        for row in connection.execute(f"SELECT * FROM {table}"):
            combined ^= row_sum(table, *row)
    return combined


class Seal(msgspec.Struct):
    """See the module. doubt: why robots that are not in this store yet start stopped: an earlier STOP may be lost.
    rows: the checksum of all rows."""

    store: str = msgspec.field(default_factory=lambda: token_hex(ID_BYTES))
    generation: int = 0
    doubt: str = ""
    rows: int = 0

    def _own_sum(self) -> bytes:
        return row_sum("seal", self.store, self.generation, self.doubt, self.rows).to_bytes(SUM_BYTES, "big")

    @classmethod
    def read(cls, connection: sqlite3.Connection, tables: Sequence[str]) -> Seal:
        """The seal of a store whose tables are undamaged. Raises DamageError."""
        rows = sum_of(connection, tables)
        try:
            ((store, generation, doubt, own_sum),) = connection.execute(
                "SELECT store, generation, doubt, sum FROM seal"
            )
        except ValueError:
            raise DamageError("its seal is missing") from None
        seal = cls(store, generation, doubt, rows)
        if own_sum != seal._own_sum():
            raise DamageError("its rows are not those that were written")
        return seal

    def watch(self, connection: sqlite3.Connection, tables: Sequence[str]) -> None:
        """Track every row of these tables that this connection writes or removes."""
        connection.create_function("toggle", -1, self._toggle)
        connection.execute("PRAGMA recursive_triggers = ON")  # otherwise REPLACE removes rows without firing triggers
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
        """Write the seal, as the last step of every transaction."""
        self.generation += 1
        to.execute("DELETE FROM seal")
        to.execute("INSERT INTO seal VALUES (?, ?, ?, ?)", (self.store, self.generation, self.doubt, self._own_sum()))


class StoreMark(msgspec.Struct, frozen=True):
    """The contents of a marker: the store's format, identity and generation, and a checksum over them."""

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
        """The contents; None if there is no marker. Raises DamageError if it cannot be read."""
        try:
            with self.file.open("rb") as opened:
                mark = msgspec.json.decode(opened.read(MAX_MARKER), type=StoreMark)
        except (FileNotFoundError, NotADirectoryError):
            return None
        except (OSError, msgspec.MsgspecError, ValueError) as error:
            raise DamageError(str(error)) from None
        if mark.sum != mark.own_sum():
            raise DamageError("it is not as it was written")
        return mark

    def write(self, seal: Seal) -> None:
        """Record the store's progress. Raises OSError."""
        mark = StoreMark(self._version, seal.store, seal.generation, 0)
        replace_file(self.file, msgspec.json.encode(msgspec.structs.replace(mark, sum=mark.own_sum())), private=True)

    def withdraw(self) -> None:
        """Remove the marker, so that the next start is in doubt. Raises OSError."""
        with suppress(FileNotFoundError, NotADirectoryError):
            self.file.unlink()


def doubt_about(seal: Seal | None, mark: StoreMark | None) -> str:
    """Why an undamaged store may not be the latest of its robots; "" if it is. seal: None for a store of an older
    format."""
    if seal is None:
        return "is of an older format"
    if mark is None:
        return "has lost its marker" if seal.generation > NEWBORN else ""
    if mark.store != seal.store:
        return "is not the one it had"
    return "is an old copy" if seal.generation < mark.generation else ""
