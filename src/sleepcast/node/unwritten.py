"""What waits to be written into a store: all of it in one transaction, the latest of each."""

from __future__ import annotations

import sqlite3
from dataclasses import dataclass, field, fields

import msgspec

from sleepcast.channel.delivery_state import StoredWindow, StreamId, StreamProgress
from sleepcast.channel.message import Message
from sleepcast.node.store_file import Remembered

MAX_EVALUATIONS = 1_000_000
"""Evaluations that are remembered, of all robots of a file: some eighty megabytes."""

Evaluated = tuple[int, str, str, float, str, float | None]
"""A robot's number, a command's id and kind, when (s of Unix time), the outcome, and when it had come."""


@dataclass(slots=True)
class Unwritten:
    """What waits, mostly by the number of the robot; the fields are those of the tables. taken: messages and how
    often they were begun; finished: of those that were written as taken. minds: when, and packed. lives: names, and
    what is known of their lives."""

    streams: dict[tuple[int, StreamId], StreamProgress] = field(default_factory=dict)
    windows: dict[tuple[int, bytes, str, int], StoredWindow] = field(default_factory=dict)
    standing: dict[tuple[StreamId, int], tuple[bytes, ...]] = field(default_factory=dict)
    taken: dict[tuple[int, str], tuple[Message, int]] = field(default_factory=dict)
    finished: set[tuple[int, str]] = field(default_factory=set)
    evaluated: list[Evaluated] = field(default_factory=list)
    minds: dict[int, tuple[float, bytes]] = field(default_factory=dict)
    lives: dict[int, tuple[str, Remembered]] = field(default_factory=dict)

    def __bool__(self) -> bool:
        return any(getattr(self, each.name) for each in fields(self))

    def write(self, to: sqlite3.Connection) -> None:
        """Write everything, within a transaction of the caller's. Raises sqlite3.Error."""
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
            ((*which, each.latest, _bytes(each.numbers)) for which, each in self.windows.items()),
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
            ((*which, begun, msgspec.msgpack.encode(said)) for which, (said, begun) in self.taken.items()),
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


def _bytes(number: int) -> bytes:
    return number.to_bytes((number.bit_length() + 7) // 8, "big")
