"""`sleepcast journal`: searching, following, exporting, verifying and moving what a desk has written."""

from __future__ import annotations

import csv
import io
import json
import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, redirect_stderr, redirect_stdout
from datetime import UTC, datetime
from pathlib import Path

import pytest

from channel.test_udp import free_port
from cli.calling import Called, called_warm
from cli.test_swarm import account, at_rest, swarm
from processes import live_in
from sleepcast.api.connection import journal_of, open_journal
from sleepcast.cli import main
from sleepcast.core.clock import ManualClock
from sleepcast.station import JournalEvent
from sleepcast.station.journal.file import SqliteJournal
from sleepcast.station.journal.journal import PendingEntry

WRITTEN = 1_795_298_400.0
"""2026-11-21 22:00 UTC."""


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "journal.db"


@pytest.fixture
def journal(file: Path) -> Iterator[SqliteJournal]:
    """A command, who answered, and a refusal."""
    clock = ManualClock(WRITTEN)
    with closing(SqliteJournal(file, clock)) as found:
        sent = {"kind": "command", "standing": False, "predicted": ["r1", "r2"]}
        found.append(
            PendingEntry(
                0.0, "desk", JournalEvent.SENT, subject="desk-1.1", text="(WHEN (> x 1)\n  (ST))", details=sent
            )
        )
        clock.advance(0.5)
        found.append(
            PendingEntry(
                0.5, "r1", JournalEvent.HEARD, subject="desk-1.1", details={"outcome": "matched", "value": 0.25}
            )
        )
        fault = {"outcome": "fault", "fault": "division by zero"}
        found.append(PendingEntry(0.5, "r2", JournalEvent.HEARD, subject="desk-1.1", details=fault))
        clock.advance(60.0)
        found.append(
            PendingEntry(60.5, "r2", JournalEvent.HEARD, details={"kind": "report", "label": "here", "values": [1.0]})
        )
        found.append(
            PendingEntry(60.5, "desk", JournalEvent.REFUSED, text="(ST)", details={"reason": "everybody\nsecond line"})
        )
        yield found


def said_here(*arguments: str) -> Called:
    """What `sleepcast ARGUMENTS` says, in this process."""
    out, err = io.StringIO(), io.StringIO()
    with redirect_stdout(out), redirect_stderr(err):
        status = main(arguments)
    return Called(status, out.getvalue(), err.getvalue())


def journal_says(file: Path, *arguments: str) -> Called:
    return said_here("journal", *arguments, "--journal", str(file))


def test_a_person_reads_one_line_for_each_entry(journal: SqliteJournal, file: Path) -> None:
    told = journal_says(file, "search")
    assert (told.status, told.err) == (0, "")
    lines = told.out.splitlines()
    assert len(lines) == 5
    assert "desk-1.1: (WHEN (> x 1) (ST))  [2 expected: r1, r2]" in lines[0]
    assert "desk-1.1: matched 0.25" in lines[1]
    assert "desk-1.1: fault: division by zero" in lines[2]
    assert "here" in lines[3]
    assert lines[4].endswith("(ST) (everybody)")


@pytest.mark.parametrize(
    ("arguments", "numbers"),
    [
        (["division"], [3]),
        (["--robot", "r2"], [1, 3, 4]),
        (["--event", "heard", "--last", "1"], [4]),
        (["--command", "desk-1.1"], [1, 2, 3]),
        (["--until", datetime.fromtimestamp(WRITTEN + 10, UTC).isoformat()], [1, 2, 3]),
        (["--since", datetime.fromtimestamp(WRITTEN + 10, UTC).isoformat()], [4, 5]),
        (["--since", "1s", "--event", "sent"], []),
    ],
)
def test_scripts_find_what_they_look_for(
    journal: SqliteJournal, file: Path, arguments: list[str], numbers: list[int]
) -> None:
    told = journal_says(file, "search", *arguments, "--json")
    assert [json.loads(line)["number"] for line in told.out.splitlines()] == numbers


def test_what_is_exported_is_what_was_written(journal: SqliteJournal, file: Path) -> None:
    journal.rotate()
    lines = [json.loads(line) for line in journal_says(file, "export").out.splitlines()]
    assert [line["number"] for line in lines] == [1, 2, 3, 4, 5]
    assert lines[0]["text"] == "(WHEN (> x 1)\n  (ST))"
    assert lines[1]["details"] == {"outcome": "matched", "value": 0.25}
    table = list(csv.DictReader(io.StringIO(journal_says(file, "export", "--csv").out)))
    assert [row["hash"] for row in table] == [line["hash"] for line in lines]
    assert (table[0]["text"], table[0]["written"]) == ("(WHEN (> x 1)\n  (ST))", "2026-11-21T22:00:00.000000+00:00")


def test_a_chain_is_verified_and_what_breaks_it_is_named(journal: SqliteJournal, file: Path) -> None:
    good = journal_says(file, "verify", "--json")
    found = json.loads(good.out)
    assert (good.status, found["entries"], found["last"], found["broken"]) == (0, 5, 5, None)
    assert journal_says(file, "verify", "--head", found["head"]).status == 0
    unknown = journal_says(file, "verify", "--head", "00" * 32)
    assert (unknown.status, "no entry has the hash" in unknown.err) == (1, True)
    with closing(sqlite3.connect(file)) as connection, connection:
        connection.execute("DROP TRIGGER entries_are_kept")
        connection.execute("DELETE FROM entries WHERE number = 3")
    broken = journal_says(file, "verify")
    assert (broken.status, broken.out) == (1, "")
    assert "entry 3 is missing; the 2 entries before it are as they were written" in broken.err


def test_it_is_followed(journal: SqliteJournal, file: Path) -> None:
    command = [
        sys.executable,
        "-m",
        "sleepcast",
        "journal",
        "search",
        "--follow",
        "--last",
        "1",
        "--journal",
        str(file),
    ]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        try:
            assert process.stdout is not None
            assert "(ST)" in process.stdout.readline()
            journal.append(PendingEntry(61.0, "desk", JournalEvent.SENT, text="(GO 1)", details={"kind": "command"}))
            journal.rotate()
            journal.append(PendingEntry(62.0, "desk", JournalEvent.SENT, text="(GO 2)", details={"kind": "command"}))
            assert "(GO 1)" in process.stdout.readline()
            assert "(GO 2)" in process.stdout.readline()
        finally:
            process.kill()


def test_it_moves_into_an_archive_when_told(journal: SqliteJournal, file: Path) -> None:
    assert "journal.1-5.db" in journal_says(file, "rotate").out
    assert "nothing to move" in journal_says(file, "rotate").out
    assert journal_says(file, "rotate", "--at", "1MB,24h").status == 0
    assert (journal.limits.size, journal.limits.age) == (1e6, 86_400.0)
    assert journal_says(file, "rotate", "--at", "never").status == 0
    assert journal.limits.size == float("inf")
    assert journal_says(file, "rotate", "--at", "soon").status == 2
    (archive,) = file.parent.glob("journal.1-5.db")
    archive.unlink()
    told = journal_says(file, "search")
    assert (told.status, told.out) == (0, "")
    assert "entries before 6 were moved into journal.1-5.db, which is not there any more" in told.err
    assert json.loads(journal_says(file, "verify", "--json").out)["lost_archive"] == "journal.1-5.db"


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (["search", "--event", "shouted"], "entries tell of sent"),
        (["search", "--since", "yesterday"], "wanted 10min, 14:30"),
        (["search"], "no journal"),
        (["verify"], "no journal"),
        (["verify", "--head", "zz"], "64 hexadecimal digits"),
        (["rotate"], "no journal"),
    ],
)
def test_misuse_is_a_sentence(tmp_path: Path, arguments: list[str], complaint: str) -> None:
    refused = journal_says(tmp_path / "none.db", *arguments)
    assert (refused.status, refused.out) == (2, "")
    assert complaint in refused.err
    assert "Traceback" not in refused.err


@pytest.mark.parametrize("fleet", ["sleepcast", "../../up", "a/b", "\N{GRINNING FACE}" * 64, "CON"])
def test_every_fleet_has_a_file_of_its_own(fleet: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    with closing(open_journal(None, fleet)) as journal:
        assert list(journal.entries()) == []
        assert [path.parent for path in tmp_path.rglob("*.db")] == [tmp_path / "sleepcast" / "journals"]
    assert journal_of(fleet) != journal_of(fleet + "x")
    assert journal_of(fleet).is_file()
    assert said_here("journal", "--journal", "x").status == 2, "the options belong to what is done"


def test_a_run_is_written_when_asked(tmp_path: Path) -> None:
    file = tmp_path / "run.db"
    run = said_here("run", "bravo", "--robots", "20", "--seconds", "20", "--quiet", "--journal", str(file))
    assert run.status == 0, run.err
    lines = [json.loads(line) for line in journal_says(file, "export").out.splitlines()]
    assert {line["event"] for line in lines} >= {"sent", "heard"}
    assert all(line["time"] <= 20.0 for line in lines), "simulated time"
    assert journal_says(file, "verify").status == 0
    refused = said_here("run", "bravo", "--seconds", "2", "--journal", str(tmp_path))
    assert (refused.status, "the journal" in refused.err) == (1, True)


def test_commands_on_the_air_are_written_by_whoever_sends_them(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    live_in(tmp_path, monkeypatch)
    channel = f"udp://239.255.83.78:{free_port()}?interface=lo"
    with swarm(2, channel, *at_rest(tmp_path)):
        sent = account(channel, "send", "(WHEN (> id 1) (DRIVE 1 0))")
        stopped = account(channel, "stop", "--journal", str(tmp_path / "stops.db"))
        refused = called_warm("send", "(DRIVE 1 0)", "--channel", channel)
        (tmp_path / "damaged.db").write_text("no journal at all", encoding="utf-8")
        damaged = "--journal", str(tmp_path / "damaged.db"), "--channel", channel
        unwritten = called_warm("send", "(WHEN (> id 1) (DRIVE 1 0))", *damaged)
        still = called_warm("stop", *damaged)
    assert refused.status == 2
    assert (unwritten.status, unwritten.out) == (1, "")
    assert "file is not a database" in unwritten.err
    assert (still.status, "stopped 2: r1, r2" in still.out) == (0, True), "nothing keeps a STOP back"
    assert "wait to be written" in still.err
    entries = [json.loads(line) for line in said_here("journal", "export").out.splitlines()]
    assert entries[-1]["event"] == "refused"
    entries = [entry for entry in entries if entry["subject"] == sent["id"]]
    entries = [entry for entry in entries if entry["event"] != "repeated"]  # for who is late, on a busy machine
    assert [entry["event"] for entry in entries] == ["sent", "heard", "heard", "accounted"]
    assert {entry["who"]: entry["details"]["outcome"] for entry in entries[1:3]} == {
        "r1": "not matched",
        "r2": "matched",
    }
    assert said_here("journal", "verify").status == 0
    stops = [json.loads(line) for line in journal_says(tmp_path / "stops.db", "export").out.splitlines()]
    assert {(entry["event"], entry["subject"]) for entry in stops} >= {
        ("sent", stopped["id"]),
        ("heard", stopped["id"]),
    }


def test_the_word_alone_shows_the_last_entries(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path))
    with closing(open_journal(None, "sleepcast")) as journal:
        journal.append(PendingEntry(0.0, "desk", JournalEvent.SENT, text="(ST)", details={"kind": "command"}))
    assert "(ST)" in said_here("journal").out
