"""Reading a journal that others may be writing: searching it with its archives, and following its chain."""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator
from contextlib import ExitStack, closing, contextmanager
from dataclasses import replace
from pathlib import Path

from sleepcast.core.records import dataclass
from sleepcast.station.journal.file import (
    FiledEntry,
    Predecessor,
    digest,
    journal_errors,
    open_reading,
    origin_of,
    read_line,
)
from sleepcast.station.journal.journal import JournalError, JournalEvent

MAX_ARCHIVES = 100_000
"""Archives of one journal: more than a folder holds with comfort."""


@dataclass(frozen=True, slots=True)
class Query:
    """Which entries are wanted: those of which all this is true.

    after: numbers above it; since, until: written then, s of Unix time. text: somewhere in the expression or in the
    details, capitals or not. robot: it spoke, or was expected to obey. event, command: of this sort, and about this id.
    """

    after: int = 0
    since: float | None = None
    until: float | None = None
    text: str = ""
    robot: str = ""
    event: JournalEvent | None = None
    command: str = ""

    def from_on(self, after: int) -> Query:
        """The same among the entries with a number above `after`."""
        return replace(self, after=after)

    def where(self) -> tuple[str, list[str | float]]:
        """The condition in SQL, and what its question marks stand for."""
        # The index gives the numbers between which all of them lie. Without the plus signs, or with a bound more,
        # SQLite would go through every entry in the order of their numbers.
        parts: list[tuple[str, list[str | float]]] = []
        if self.since is None:
            parts.append(("number > ?", [self.after]))
        else:
            first = "SELECT coalesce(min(+number), 9e18) FROM entries WHERE written >= ?"
            parts.append((f"number > max(?, ({first}) - 1) AND written >= ?", [self.after, self.since, self.since]))
        if self.until is not None:
            last = "SELECT coalesce(max(+number), 0) FROM entries WHERE written <= ?"
            parts.append((f"number <= ({last}) AND written <= ?", [self.until, self.until]))
        if self.text:
            said = "lower(json_extract(line, '$.text') || ' ' || json_extract(line, '$.details'))"
            parts.append((f"instr({said}, lower(?)) > 0", [self.text]))
        if self.robot:
            expected = "EXISTS (SELECT 1 FROM json_each(line, '$.details.predicted') WHERE value = ?)"
            parts.append((f"(who = ? OR {expected})", [self.robot, self.robot]))
        if self.event is not None:
            parts.append(("event = ?", [self.event.value]))
        if self.command:
            parts.append(("subject = ?", [self.command]))
        return " AND ".join(text for text, _ in parts), [value for _, values in parts for value in values]


class JournalReader:
    """A journal with its archives, as it was when this was entered; it must be left soon, as a reader keeps a journal
    from being tidied.

    after: nobody wants entries up to this number, so archives that hold no others are left closed. lost: the archive
    that came before the first entry and is not there any more, "" if all of them are.
    """

    def __init__(self, file: Path, after: int = 0) -> None:
        self.file = file
        self._after = after
        self.lost = ""
        self._parts: list[tuple[Path, Predecessor]] = []
        self._stack = ExitStack()

    def __enter__(self) -> JournalReader:
        """Raises JournalError."""
        with ExitStack() as stack:
            self._live = stack.enter_context(closing(open_reading(self.file)))
            with journal_errors(self.file):
                self._live.execute("BEGIN")
            file, origin = self.file, self._origin(self.file)
            self._parts = [(file, origin)]
            while origin.number > self._after and len(self._parts) < MAX_ARCHIVES:
                file = self.file.with_name(origin.archive)
                if not file.is_file():
                    self.lost = origin.archive
                    break
                before, origin = origin, self._origin(file)
                self._parts.append((file, origin))
                if origin.number >= before.number:  # it names one that came later, perhaps itself
                    break
            self._parts.reverse()
            self._stack = stack.pop_all()
        return self

    def __exit__(self, *_: object) -> None:
        self._stack.close()

    def _origin(self, file: Path) -> Predecessor:
        with self._reading(file) as connection:
            return origin_of(connection)

    @contextmanager
    def _reading(self, file: Path) -> Iterator[sqlite3.Connection]:
        """A file that is read for a while: the journal as it was, or an archive, which does not change any more."""
        with ExitStack() as stack:
            connection = self._live
            if file != self.file:
                connection = stack.enter_context(closing(open_reading(file)))
            with journal_errors(file):
                yield connection

    @property
    def first(self) -> int:
        """The number of the first entry that is there, or will be."""
        return self._parts[0][1].number + 1

    @property
    def last(self) -> int:
        """The number of the last entry, 0 for none."""
        origin = self._parts[-1][1]
        with journal_errors(self.file):
            last = self._live.execute("SELECT max(number) FROM entries").fetchone()[0]
        return origin.number if last is None else int(last)

    @property
    def files(self) -> list[Path]:
        """The archives, the oldest first, and the journal."""
        return [file for file, _ in self._parts]

    def search(self, query: Query, last: int | None = None) -> Iterator[FiledEntry]:
        """The matching entries, oldest first. last: only this number of the latest ones."""
        where, values = query.where()
        if last is None:
            for file, _ in self._parts:
                with self._reading(file) as connection:
                    rows = connection.execute(f"SELECT line, hash FROM entries WHERE {where} ORDER BY number", values)
                    yield from (read_line(line, hash) for line, hash in rows)
            return
        entries: list[FiledEntry] = []
        for file, _ in reversed(self._parts):
            if len(entries) == last:
                break
            with self._reading(file) as connection:
                rows = connection.execute(
                    f"SELECT line, hash FROM entries WHERE {where} ORDER BY number DESC LIMIT ?",
                    [*values, last - len(entries)],
                )
                entries += [read_line(line, hash) for line, hash in rows]
        yield from reversed(entries)

    def verify(self) -> Verified:
        """Go through the whole chain."""
        so_far = Verified(0, self._parts[0][1].number, self._parts[0][1].hash, "")
        for file, origin in self._parts:
            if (origin.number, origin.hash) != (so_far.last, so_far.hash):
                return replace(
                    so_far,
                    broken=f"{file} goes on after entry {origin.number} of an archive that ends otherwise, at "
                    f"{so_far.last}: one of them is not what it was",
                )
            try:
                with self._reading(file) as connection:
                    so_far = _followed(connection, so_far)
            except JournalError as error:
                return replace(so_far, broken=f"what comes after entry {so_far.last} cannot be read: {error}")
            if so_far.broken:
                return replace(so_far, broken=f"{file}: {so_far.broken}")
        return so_far

    def hashes(self) -> Iterator[bytes]:
        """The hash of each entry."""
        for file, _ in self._parts:
            with self._reading(file) as connection:
                yield from (row[0] for row in connection.execute("SELECT hash FROM entries ORDER BY number"))


@dataclass(frozen=True, slots=True)
class Verified:
    """The result of checking the chain: how many entries are good, and the number and hash of the last of them. broken:
    what is wrong with the next one, "" if nothing."""

    count: int
    last: int
    hash: bytes
    broken: str


def _followed(connection: sqlite3.Connection, so_far: Verified) -> Verified:
    """The chain through one file."""
    count, number, hash = so_far.count, so_far.last, so_far.hash
    for row in connection.execute("SELECT number, line, hash FROM entries ORDER BY number"):
        wrong = _wrong(row, number, hash)
        if wrong:
            return Verified(count, number, hash, wrong)
        number, hash, count = row[0], row[2], count + 1
    given = connection.execute("SELECT seq FROM sqlite_sequence WHERE name = 'entries'").fetchone()
    cut = given is not None and given[0] > number
    return Verified(count, number, hash, f"{_missing(number + 1, given[0])} at its end" if cut else "")


def _wrong(row: tuple[int, str, bytes], number: int, hash: bytes) -> str:
    """What is wrong with an entry that follows that number and hash."""
    if row[0] != number + 1:
        return _missing(number + 1, row[0] - 1)
    if digest(hash, row[1]) != row[2]:
        return f"entry {row[0]} was changed: its hash does not match"
    try:
        said = read_line(row[1], row[2]).entry.number
    except JournalError as error:
        return f"entry {row[0]}: {error}"
    return "" if said == row[0] else f"entry {row[0]} was entry {said} when it was written"


def _missing(first: int, last: int) -> str:
    return f"entry {first} is missing" if first == last else f"entries {first} to {last} are missing"
