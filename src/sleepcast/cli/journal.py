"""`sleepcast journal`: what was sent, heard and decided, to be searched, followed, exported and checked."""

from __future__ import annotations

import csv
import io
import json
import re
import time
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING

import click

from sleepcast.api.connection import FLEET, journal_of
from sleepcast.cli.air import journal_option
from sleepcast.cli.options import MomentType
from sleepcast.cli.streams import announce, complain, put
from sleepcast.core.errors import MisuseError, SleepcastError, printable

if TYPE_CHECKING:
    from sleepcast.station.journal.file import FiledEntry
    from sleepcast.station.journal.reader import JournalReader, Query

LAST = 20
"""Entries that are shown unless more are asked for."""
MAX_SHOWN = 1_000_000
"""Entries that can be shown: what memory holds with ease; `export` has no end."""
PAUSE = 0.25
"""Seconds between two looks at a journal that is followed."""
COLUMNS = ("number", "written", "time", "who", "event", "subject", "text", "details", "hash")
"""Columns of an exported table."""
NEVER = "never"
HASH = re.compile("[0-9a-fA-F]{64}")


@click.group("journal", invoke_without_command=True)
@click.pass_context
def journal(context: click.Context) -> int:
    """Every command on the air is written into its fleet's journal, with its outcome. A journal is only appended to,
    and each entry holds a hash of those before it. Without a subcommand, this shows the last entries.

    \b
    Examples:
      sleepcast journal
      sleepcast journal search --robot r7 --since 10min
      sleepcast journal search --follow
      sleepcast journal export --csv > session.csv
      sleepcast journal verify
    """
    if context.invoked_subcommand is None:
        status: int = context.invoke(search)
        return status
    return 0


def _place(command: Callable[..., int]) -> Callable[..., int]:
    """The options that say which journal; the command gets its `file`."""

    @click.option("--fleet", default=FLEET, show_default=True, help="The fleet of the journal.")
    @journal_option
    @wraps(command)
    def placed(fleet: str, journal: Path | None, **others: object) -> int:
        return command(file=journal or journal_of(fleet), **others)

    return placed


def _query(command: Callable[..., int]) -> Callable[..., int]:
    """The options that say which entries; the command gets a `query`."""

    @click.argument("text", default="")
    @click.option("--robot", metavar="NAME", default="", help="What it reported, and what it was expected to obey.")
    @click.option("--event", metavar="SORT", default="", help="Entries of one type, e.g. sent, heard or refused.")
    @click.option("--command", "command_", metavar="ID", default="", help="All about one command.")
    @click.option(
        "--since", metavar="WHEN", type=MomentType(), help="Entries since 10min (ago), 14:30 or 2026-11-21T14:30."
    )
    @click.option("--until", metavar="WHEN", type=MomentType(), help="Entries until then.")
    @wraps(command)
    def chosen(
        text: str, robot: str, event: str, command_: str, since: float | None, until: float | None, **others: object
    ) -> int:
        from sleepcast.station.journal.journal import JournalEvent
        from sleepcast.station.journal.reader import Query

        types = [each.value for each in JournalEvent]
        if event and event not in types:
            raise MisuseError(f"--event {event}: entries tell of {', '.join(types)}")
        type_ = JournalEvent(event) if event else None
        return command(query=Query(0, since, until, text, robot, type_, command_), **others)

    return chosen


@journal.command("search", short_help="Show entries.")
@_query
@click.option(
    "--last", metavar="N", type=click.IntRange(1, MAX_SHOWN), default=LAST, show_default=True, help="At most."
)
@click.option("--follow", is_flag=True, help="Keep printing new entries until Ctrl-C.")
@click.option("--json", "as_json", is_flag=True, help="One JSON object a line.")
@_place
def search(file: Path, query: Query, last: int = LAST, follow: bool = False, as_json: bool = False) -> int:
    """Show the last entries, or those with TEXT in their expression or in what robots said.

    \b
    Examples:
      sleepcast journal search 'division by zero'
      sleepcast journal search --event sent --since 2026-11-21 --last 100
      sleepcast journal search --command desk-1795298400000.7 --json
    """
    from sleepcast.station.journal.reader import JournalReader

    show = _as_json if as_json else _as_line
    with JournalReader(file) as reader:
        _tell_lost(reader)
        end = reader.last
        for written in reader.search(query, last):
            announce(show(written))
    while follow:
        time.sleep(PAUSE)
        with JournalReader(file, end) as reader:
            for written in reader.search(query.from_on(end)):
                announce(show(written))
            end = reader.last
    return 0


@journal.command("export", short_help="Print all entries, for other programs.")
@_query
@click.option("--csv", "as_table", is_flag=True, help="A table with commas instead of one JSON object a line.")
@_place
def export(file: Path, query: Query, as_table: bool) -> int:
    """Print entries on standard output, oldest first: one JSON object a line, or a table.

    \b
    Examples:
      sleepcast journal export > session.jsonl
      sleepcast journal export --csv --since 08:00 > today.csv
    """
    from sleepcast.station.journal.reader import JournalReader

    with JournalReader(file) as reader:
        _tell_lost(reader)
        entries = reader.search(query)
        for line in _rows(entries) if as_table else map(_as_json, entries):
            put(line)
    return 0


@journal.command("verify", short_help="Check that no entry was changed or removed.")
@click.option("--head", metavar="HASH", help="A hash noted earlier, which must be in the journal.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object.")
@_place
def verify(file: Path, head: str | None, as_json: bool) -> int:
    """Follow the chain of hashes through the journal and its archives, and name the first entry that does not fit.

    The chain shows whether an entry was changed or removed. If somebody rewrites all later entries as well, only a hash
    that was noted elsewhere before reveals it: give it with --head.

    \b
    Examples:
      sleepcast journal verify
      sleepcast journal verify --head 5f0e...
    """
    from sleepcast.station.journal.reader import JournalReader

    if head is not None and not HASH.fullmatch(head):
        raise MisuseError(f"a head has 64 hexadecimal digits, as verify prints it, not {head[:80]!r}")
    with JournalReader(file) as reader:
        _tell_lost(reader)
        chain = reader.verify()
        broken = chain.broken
        if not broken and head is not None and not any(hash.hex() == head.lower() for hash in reader.hashes()):
            broken = f"no entry has the hash {head}: what it stood for was changed or taken away"
        first, files, lost = reader.first, len(reader.files), reader.lost
    if as_json:
        summary = {"entries": chain.count, "first": first, "last": chain.last, "files": files, "head": chain.hash.hex()}
        put(json.dumps(summary | {"lost_archive": lost or None, "broken": broken or None}))
    elif broken:
        raise BrokenChainError(f"{broken}; the {chain.count} entries before it are as they were written")
    else:
        which = f", {first} to {chain.last}" if chain.count else ""
        put(f"{chain.count} entries{which} in {files} file{'s' if files > 1 else ''}: no entry was changed or removed")
        put(f"head {chain.hash.hex()}")
    return 1 if broken else 0


@journal.command("rotate", short_help="Move the journal into an archive.")
@click.option("--at", metavar="WHEN", help=f"From now on, do so automatically: 100MB, 24h, 100MB,24h, or {NEVER}.")
@_place
def rotate(file: Path, at: str | None) -> int:
    """Move all entries into an archive beside the journal, which goes on with the next number; searching, exporting and
    verifying go through the archives as well.

    \b
    Examples:
      sleepcast journal rotate
      sleepcast journal rotate --at 100MB,24h
    """
    from contextlib import closing

    from sleepcast.core.clock import UnixClock
    from sleepcast.station.journal.file import ArchiveLimits, SqliteJournal, open_reading

    open_reading(file).close()  # there must be one
    with closing(SqliteJournal(file, UnixClock())) as opened:
        if at is None:
            archive = opened.rotate()
            put(f"moved into {archive}" if archive else "there is nothing to move")
        elif at == NEVER:
            opened.limits = ArchiveLimits()
            put(f"{file} moves into an archive only when you say so")
        else:
            from sleepcast.simulator.recording.recorder import read_rotation

            rotation = read_rotation(at)
            opened.limits = ArchiveLimits(rotation.size, rotation.age)
            put(f"{file} moves into an archive at {at}")
    return 0


class BrokenChainError(SleepcastError):
    """A journal that is not what was written."""


def _tell_lost(reader: JournalReader) -> None:
    if reader.lost:
        complain(f"entries before {reader.first} were moved into {reader.lost}, which is not there any more")


# ---- how entries are printed


def _as_json(written: FiledEntry) -> str:
    """The line as it was written, with its hash."""
    return f'{written.line[:-1]},"hash":"{written.hash.hex()}"}}'


def _rows(entries: Iterator[FiledEntry]) -> Iterator[str]:
    yield ",".join(COLUMNS)
    for written in entries:
        entry, cells = written.entry, io.StringIO()
        when = datetime.fromtimestamp(written.written, UTC).isoformat(timespec="microseconds")
        details = json.dumps(entry.details, ensure_ascii=False)
        rest = (entry.who, entry.event, entry.subject, entry.text, details, written.hash.hex())
        csv.writer(cells, lineterminator="\n").writerow((entry.number, when, entry.time, *rest))
        yield cells.getvalue().removesuffix("\n")


def _as_line(written: FiledEntry) -> str:
    """One line for a person, in local time."""
    from sleepcast.cli.describe import entry_text

    entry = written.entry
    when = datetime.fromtimestamp(written.written).astimezone().strftime("%Y-%m-%d %H:%M:%S.%f")[:-3]
    line = f"{entry.number:>6}  {when}  {entry.who:<12}  {entry.event:<9}  {entry_text(entry)}"
    return printable(" ".join(line.split("\n"))).rstrip()
