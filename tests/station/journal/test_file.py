"""The journal in a file: nothing that was shown is lost, nothing that is taken away goes unseen, others may read."""

from __future__ import annotations

import json
import os
import sqlite3
import stat
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from math import inf, nan
from pathlib import Path
from threading import Thread

import numpy as np
import pytest

from sleepcast.channel import Kind
from sleepcast.channel.message_batch import NameIndex
from sleepcast.core.clock import ManualClock
from sleepcast.station import JournalEvent, Station
from sleepcast.station.journal.file import (
    INSERT,
    MAX_LISTED,
    ArchiveLimits,
    DeferredJournal,
    NoJournalError,
    SqliteJournal,
    transaction,
)
from sleepcast.station.journal.journal import JournalError, PendingEntry
from sleepcast.station.journal.reader import JournalReader, Query, Verified
from sleepcast.station.roster import RobotNames
from station.fleet import Fleet, vocabulary

TESTS = Path(__file__).resolve().parents[2]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "made for it" / "desk?.db"


@pytest.fixture
def clock() -> ManualClock:
    return ManualClock(1000.0)


@pytest.fixture
def journal(file: Path, clock: ManualClock) -> Iterator[SqliteJournal]:
    with closing(SqliteJournal(file, clock)) as found:
        yield found


def pending(number: int, text: str = "(ST)") -> PendingEntry:
    return PendingEntry(float(number), "desk", JournalEvent.SENT, subject=f"desk-1.{number}", text=text)


def fill(journal: SqliteJournal, first: int, last: int) -> None:
    for number in range(first, last + 1):
        journal.append(pending(number))


def verified(file: Path) -> Verified:
    with JournalReader(file) as reader:
        return reader.verify()


def found(file: Path, query: Query, last: int | None = None) -> list[int]:
    with JournalReader(file) as reader:
        return [written.entry.number for written in reader.search(query, last)]


def tamper(file: Path, *statements: str) -> None:
    """What somebody does who opens the file with a tool for SQLite."""
    with closing(sqlite3.connect(file, isolation_level=None)) as connection:
        connection.execute("DROP TRIGGER IF EXISTS entries_are_kept")
        connection.execute("DROP TRIGGER IF EXISTS entries_stay")
        for statement in statements:
            connection.execute(statement)


def test_entries_come_back_as_they_were_also_to_another_process(journal: SqliteJournal, file: Path) -> None:
    told = {"kind": "command", "deadline": inf, "value": nan, "bytes": b"\x01\xff", "n": np.int64(3), "list": [1, None]}
    names = NameIndex()
    for name in ("r1", "r2", "r3"):
        names.add(name)
    journal.append(
        PendingEntry(2.5, "desk", JournalEvent.SENT, subject="desk-1.1", text='(REPORT "größer" 1)', details=told)
    )
    journal.append(
        PendingEntry(3.5, "r2\udc80", JournalEvent.HEARD, details={"predicted": RobotNames(names, np.array([0, 2]))})
    )
    first, second = journal.entries()
    assert (first.number, first.time, first.who, first.event) == (1, 2.5, "desk", JournalEvent.SENT)
    assert (first.subject, first.text) == ("desk-1.1", '(REPORT "größer" 1)')
    wanted = {"kind": "command", "deadline": None, "value": None, "bytes": "01ff", "n": 3, "list": [1, None]}
    assert first.details == wanted
    assert (second.who, second.details) == (r"r2\udc80", {"predicted": ["r1", "r3"]})
    assert [entry.number for entry in journal.entries(after=1)] == [2]
    with JournalReader(file) as reader:
        written = list(reader.search(Query()))
    assert [each.entry for each in written] == [first, second]
    assert {each.written for each in written} == {1000.0}
    assert stat.S_IMODE(os.stat(file).st_mode) == 0o600


def test_numbers_and_texts_of_any_kind_can_be_written(journal: SqliteJournal) -> None:
    told = {"kind": Kind.ANSWER, "name": np.str_("r1"), "most": 2**63 - 1, "more": -(2**70), "truth": np.bool_(True)}
    journal.append(PendingEntry(0.0, "r1", JournalEvent.HEARD, details=told))
    (heard,) = journal.entries()
    wanted = {"kind": "answer", "name": "r1", "most": 2**63 - 1, "more": str(-(2**70)), "truth": True}
    assert heard.details == wanted


def test_more_entries_than_one_page_come_back(journal: SqliteJournal, file: Path) -> None:
    journal.append(*map(pending, range(1, 1235)))
    assert [entry.number for entry in journal.entries()] == list(range(1, 1235))
    assert found(file, Query()) == list(range(1, 1235))


def test_a_list_of_very_many_robots_is_cut_and_says_so(journal: SqliteJournal) -> None:
    names = NameIndex()
    for number in range(MAX_LISTED + 5):
        names.add(f"r{number + 1}")
    journal.append(
        PendingEntry(
            0.0, "desk", JournalEvent.SENT, details={"predicted": RobotNames(names, np.arange(MAX_LISTED + 5))}
        )
    )
    (entry,) = journal.entries()
    predicted = entry.details["predicted"]
    assert isinstance(predicted, list)
    assert (len(predicted), predicted[-1]) == (MAX_LISTED, f"r{MAX_LISTED}")
    assert entry.details["n_predicted"] == MAX_LISTED + 5


def test_a_desk_writes_it(journal: SqliteJournal, file: Path) -> None:
    fleet = Fleet()
    station = Station(vocabulary(), fleet.minds, fleet.sent.append, fleet.clock, journal=journal)
    station.send("(ST)", everybody=True)
    with pytest.raises(Exception, match="confirm that"):
        station.send("(ST)")
    assert [entry.event for entry in journal.entries()] == [JournalEvent.SENT, JournalEvent.REFUSED]
    assert found(file, Query(event=JournalEvent.REFUSED)) == [2]


def test_nothing_that_was_shown_is_lost_whenever_its_writer_is_killed(tmp_path: Path) -> None:
    rounds = 20
    file = tmp_path / "journal.db"
    command = [sys.executable, "-m", "station.killed_writers", str(file), str(rounds), "7"]
    done = subprocess.run(command, cwd=TESTS, capture_output=True, text=True, timeout=120, check=False)
    assert done.returncode == 0, done.stderr
    shown = json.loads(done.stdout)
    assert len(shown) > rounds, "writers were killed before they had written anything"
    result = verified(file)
    assert not result.broken
    with JournalReader(file) as reader:
        texts = [written.entry.text for written in reader.search(Query())]
        assert len(reader.files) > 1, "nobody began another file"
    assert len(texts) == len(set(texts)) == result.count
    assert set(shown) <= set(texts)
    for each in texts:  # what was written together is there as a whole
        if each.endswith(".0") and each.count(".") == 2:
            assert {f"{each[:-1]}1", f"{each[:-1]}2"} <= set(texts)
    with closing(SqliteJournal(file, ManualClock())) as journal:
        journal.append(PendingEntry(0.0, "desk", JournalEvent.SENT))
    assert verified(file).last == result.last + 1


def test_writers_at_the_same_time_make_one_chain(file: Path) -> None:
    def write(name: str) -> None:
        with closing(SqliteJournal(file, ManualClock())) as journal:
            for _ in range(50):
                journal.append(PendingEntry(0.0, name, JournalEvent.SENT))

    writers = [Thread(target=write, args=(name,)) for name in ("anna", "bert", "carl")]
    for each in writers:
        each.start()
    for each in writers:
        each.join()
    result = verified(file)
    assert (result.count, result.broken) == (150, "")
    assert len(found(file, Query(robot="bert"))) == 50


def test_it_is_read_while_it_is_written(journal: SqliteJournal, file: Path) -> None:
    fill(journal, 1, 3)
    with JournalReader(file) as reader:
        fill(journal, 4, 5)
        assert [written.entry.number for written in reader.search(Query())] == [1, 2, 3]
        with transaction(journal._connection):
            journal._connection.executemany(INSERT, journal._chained([pending(6)]))
            assert found(file, Query(after=3)) == [4, 5]
    assert found(file, Query(after=3)) == [4, 5, 6]


def test_of_many_entries_all_are_written_or_none(journal: SqliteJournal, file: Path) -> None:
    """A full disk has SQLite take back the whole transaction, not the one entry."""
    fill(journal, 1, 1)
    pages = journal._connection.execute("PRAGMA page_count").fetchone()[0]
    journal._connection.execute(f"PRAGMA max_page_count = {pages + 2}")
    with pytest.raises(JournalError, match="full"):
        journal.append(*(pending(number, "x" * 1_000) for number in range(2, 22)))
    journal._connection.execute("PRAGMA max_page_count = 100000")
    fill(journal, 2, 2)
    assert [each.number for each in journal.entries()] == [1, 2]
    assert not verified(file).broken


def test_nobody_waits_longer_than_he_has_patience(journal: SqliteJournal, file: Path) -> None:
    other = SqliteJournal(file, ManualClock(), patience=0.01)
    with closing(other), transaction(journal._connection), pytest.raises(JournalError, match="locked"):
        fill(other, 1, 1)


@pytest.mark.parametrize(
    ("query", "numbers"),
    [
        (Query(), [1, 2, 3, 4, 5]),
        (Query(after=3), [4, 5]),
        (Query(text="vm 0.1"), [1]),
        (Query(text="ZERO"), [4]),
        (Query(text="100%"), []),
        (Query(robot="r2"), [1, 3]),
        (Query(event=JournalEvent.HEARD), [2, 3, 4]),
        (Query(command="desk-1.1"), [1, 2, 3]),
        (Query(since=1002.0, until=1003.0), [3, 4]),
        (Query(event=JournalEvent.HEARD, robot="r1", text="zero"), [4]),
        (Query(robot="' OR 1=1 --"), []),
    ],
)
def test_it_is_searched(
    journal: SqliteJournal, file: Path, clock: ManualClock, query: Query, numbers: list[int]
) -> None:
    names = NameIndex()
    for name in ("r1", "r2"):
        names.add(name)
    predicted = {"predicted": RobotNames(names, np.array([1]))}
    said = {"outcome": "fault", "fault": "division by zero"}
    journal.append(
        PendingEntry(0.0, "desk", JournalEvent.SENT, subject="desk-1.1", text="(VM 0.1 0.1)", details=predicted)
    )
    journal.append(PendingEntry(0.0, "r1", JournalEvent.HEARD, subject="desk-1.1", details={"outcome": "not matched"}))
    clock.advance(2.0)
    journal.append(PendingEntry(0.0, "r2", JournalEvent.HEARD, subject="desk-1.1", details={"outcome": "matched"}))
    clock.advance(1.0)
    journal.append(PendingEntry(0.0, "r1", JournalEvent.HEARD, subject="desk-1.2", details=said))
    clock.advance(1.0)
    journal.append(PendingEntry(0.0, "desk", JournalEvent.REFUSED, text="(ST"))
    assert found(file, query) == numbers
    assert found(file, query, last=2) == numbers[-2:]


@pytest.mark.parametrize(
    ("statements", "broken", "good"),
    [
        (["DELETE FROM entries WHERE number = 3"], "entry 3 is missing", 2),
        (["DELETE FROM entries WHERE number BETWEEN 2 AND 4"], "entries 2 to 4 are missing", 1),
        (["DELETE FROM entries WHERE number = 1"], "entry 1 is missing", 0),
        (["DELETE FROM entries WHERE number > 3"], "entries 4 to 5 are missing at its end", 3),
        (["UPDATE entries SET line = replace(line, '(ST)', '(GO)') WHERE number = 4"], "entry 4 was changed", 3),
        (
            ["DELETE FROM entries WHERE number = 2", "UPDATE entries SET number = number - 1 WHERE number > 2"],
            "entry 2 was changed",
            1,
        ),
        (["UPDATE entries SET hash = zeroblob(32) WHERE number = 5"], "entry 5 was changed", 4),
    ],
)
def test_what_was_changed_or_taken_away_is_named(
    journal: SqliteJournal, file: Path, statements: list[str], broken: str, good: int
) -> None:
    fill(journal, 1, 5)
    assert not verified(file).broken
    tamper(file, *statements)
    result = verified(file)
    assert broken in result.broken
    assert result.count == good


def test_an_end_that_was_cut_off_stays_seen_after_more_was_written(journal: SqliteJournal, file: Path) -> None:
    fill(journal, 1, 5)
    tamper(file, "DELETE FROM entries WHERE number > 3")
    journal.append(PendingEntry(0.0, "desk", JournalEvent.SENT))
    assert "entries 4 to 5 are missing" in verified(file).broken


@pytest.mark.parametrize(
    "statements",
    [
        ["CREATE TRIGGER swallow BEFORE INSERT ON entries BEGIN SELECT RAISE(IGNORE); END"],
        ["CREATE TRIGGER change AFTER INSERT ON entries BEGIN DELETE FROM about; END"],
        ["ALTER TABLE entries RENAME TO old", "CREATE VIEW entries AS SELECT * FROM old WHERE who != 'desk'"],
        [
            "ALTER TABLE entries RENAME TO old",
            "CREATE VIEW entries AS WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i FROM n) SELECT i number FROM n",
        ],
        ["ALTER TABLE entries DROP COLUMN event", "ALTER TABLE entries ADD COLUMN event TEXT AS ('refused')"],
    ],
)
def test_a_file_that_says_something_else_than_its_lines_is_refused(
    journal: SqliteJournal, file: Path, statements: list[str]
) -> None:
    """A trigger that swallows what is written, a view that leaves something out or never ends, a column that lies."""
    fill(journal, 1, 3)
    journal.close()
    tamper(file, *statements)
    for use in (lambda: SqliteJournal(file, ManualClock()), lambda: verified(file), lambda: found(file, Query())):
        with pytest.raises(JournalError, match="its tables are not those of a journal"):
            use()


def test_what_somebody_adds_for_himself_is_nobodys_harm(journal: SqliteJournal, file: Path) -> None:
    fill(journal, 1, 3)
    tamper(file, "CREATE INDEX mine ON entries (event)", "CREATE TABLE notes (x)", "CREATE VIEW sent AS SELECT 1")
    with closing(SqliteJournal(file, ManualClock())) as again:
        fill(again, 4, 5)
    assert (verified(file).count, verified(file).broken) == (5, "")


class TickingClock(ManualClock):
    """A second passes each time somebody looks at it."""

    def now(self) -> float:
        self.advance(1.0)
        return super().now()


def test_a_moment_is_found_without_reading_everything(file: Path) -> None:
    with closing(SqliteJournal(file, TickingClock(1000.0))) as journal:
        journal.append(*map(pending, range(1, 401)))
    steps: list[int] = []
    for since, until, numbers in ((1398.0, None, [398, 399, 400]), (None, 1003.0, [1, 2, 3]), (5000.0, None, [])):
        with JournalReader(file) as reader:
            reader._live.set_progress_handler(lambda: steps.append(1) or 0, 100)
            query = Query(0, since, until, "(ST)")
            assert [each.entry.number for each in reader.search(query, 20)] == numbers
            assert [each.entry.number for each in reader.search(query)] == numbers
    assert len(steps) < 3 * 400 * 10 / 100, "a hundred of SQLite's steps each"


def test_a_tool_cannot_change_it_by_accident(journal: SqliteJournal, file: Path) -> None:
    fill(journal, 1, 2)
    with closing(sqlite3.connect(file)) as connection:
        for statement in ("DELETE FROM entries", "UPDATE entries SET line = '{}' WHERE number = 1"):
            with pytest.raises(sqlite3.IntegrityError, match="only grows"):
                connection.execute(statement)


# ---- archives


def test_it_goes_on_in_its_own_name_and_the_chain_holds(journal: SqliteJournal, file: Path) -> None:
    assert journal.rotate() is None, "nothing to move"
    fill(journal, 1, 3)
    archive = journal.rotate()
    assert archive == file.with_name("desk?.1-3.db")
    assert (list(journal.entries()), journal.dropped) == ([], 3)
    fill(journal, 4, 5)
    second = journal.rotate()
    fill(journal, 6, 6)
    assert second == file.with_name("desk?.4-5.db")
    with JournalReader(file) as reader:
        assert reader.files == [archive, second, file]
        assert (reader.first, reader.lost) == (1, "")
        assert [written.entry.number for written in reader.search(Query())] == [1, 2, 3, 4, 5, 6]
        assert [written.entry.number for written in reader.search(Query(), last=2)] == [5, 6]
    assert (verified(file).count, verified(file).broken) == (6, "")
    assert found(archive, Query()) == [1, 2, 3], "an archive can be read by itself"
    assert found(second, Query()) == [1, 2, 3, 4, 5]
    assert not [path for path in file.parent.iterdir() if path.suffix == ".new"]


def test_archives_that_nobody_wants_stay_closed(journal: SqliteJournal, file: Path) -> None:
    for number in range(1, 7, 2):
        fill(journal, number, number + 1)
        journal.rotate()
    for after, files in ((0, 4), (1, 4), (2, 3), (5, 2), (6, 1)):
        with JournalReader(file, after) as reader:
            assert len(reader.files) == files
            numbers = [written.entry.number for written in reader.search(Query(after=after))]
            assert (numbers, reader.last) == (list(range(after + 1, 7)), 6)


def test_an_archive_that_is_gone_or_another_one_is_told(journal: SqliteJournal, file: Path) -> None:
    fill(journal, 1, 3)
    archive = journal.rotate()
    assert archive is not None
    fill(journal, 4, 5)
    kept = archive.read_bytes()
    tamper(archive, "DELETE FROM entries WHERE number = 3")
    assert "entry 3 is missing at its end" in verified(file).broken
    tamper(archive, "DELETE FROM sqlite_sequence")
    assert "ends otherwise, at 2" in verified(file).broken
    archive.unlink()
    with JournalReader(file) as reader:
        assert (reader.first, reader.lost) == (4, archive.name)
        assert reader.verify().count == 2
    archive.write_bytes(kept)
    assert verified(file).count == 5


@pytest.mark.parametrize("limits", [ArchiveLimits(size=150_000.0), ArchiveLimits(age=60.0)])
def test_it_moves_by_itself_when_asked(
    journal: SqliteJournal, file: Path, clock: ManualClock, limits: ArchiveLimits
) -> None:
    journal.limits = limits
    with closing(SqliteJournal(file, clock)) as other:  # it is the journal's wish, not one writer's
        assert other.limits == limits
        for number in range(40):
            clock.advance(5.0)
            other.append(PendingEntry(0.0, "desk", JournalEvent.SENT, text=f"({number}{' ' * 10_000})"))
    with JournalReader(file) as reader:
        archives = reader.files[:-1]
    assert 2 <= len(archives) <= 5
    assert all(archive.stat().st_size < 250_000 for archive in archives)
    assert (verified(file).count, verified(file).broken) == (40, "")
    journal.limits = ArchiveLimits()
    fill(journal, 1, 50)
    with JournalReader(file) as reader:
        assert reader.files[:-1] == archives


# ---- files that are no journals


def test_a_file_that_comes_late_is_written_then(tmp_path: Path) -> None:
    file = tmp_path / "journal.db"
    file.mkdir()
    with closing(DeferredJournal(file, ManualClock())) as journal:
        with pytest.raises(JournalError):
            journal.append(pending(1))
        file.rmdir()
        journal.append(PendingEntry(0.0, "desk", JournalEvent.SENT, text="(ST)"))
        assert [entry.text for entry in journal.entries()] == ["(ST)"]
        assert journal.dropped == 0
    assert found(file, Query()) == [1]


def test_a_newer_format_is_refused(journal: SqliteJournal, file: Path) -> None:
    tamper(file, "PRAGMA user_version = 2")
    for use in (lambda: SqliteJournal(file, ManualClock()), lambda: JournalReader(file).__enter__()):
        with pytest.raises(NoJournalError, match=r"has format 2, which is newer than .* update sleepcast"):
            use()


def test_what_is_no_journal_is_left_alone(tmp_path: Path) -> None:
    text = tmp_path / "notes.txt"
    text.write_text("not a journal at all, but long enough to be looked at" * 20, encoding="utf-8")
    other = tmp_path / "other.db"
    with closing(sqlite3.connect(other)) as connection:
        connection.execute("CREATE TABLE mine (x)")
    for file in (text, other):
        before = file.read_bytes()
        with pytest.raises(JournalError):
            SqliteJournal(file, ManualClock())
        assert file.read_bytes() == before
    with pytest.raises(NoJournalError, match="no journal"):
        JournalReader(tmp_path / "none.db").__enter__()
    with pytest.raises(JournalError, match="the journal"):
        SqliteJournal(tmp_path, ManualClock())


def test_a_damaged_file_is_told_in_a_sentence(journal: SqliteJournal, file: Path) -> None:
    journal.append(*map(pending, range(1, 301)))
    journal.close()
    data = bytearray(file.read_bytes())
    middle = data.find(b'"number":200')
    data[middle - 2_000 : middle + 2_000] = b"\x55" * 4_000
    file.write_bytes(bytes(data))
    result = verified(file)
    assert result.count < 300
    assert "cannot be read" in result.broken or "is not what was written" in result.broken


def test_a_full_disk_is_told_in_a_sentence(journal: SqliteJournal, file: Path) -> None:
    fill(journal, 1, 2)
    journal._connection.execute("PRAGMA max_page_count = 20")

    def write_on() -> None:
        for _ in range(100):
            journal.append(PendingEntry(0.0, "desk", JournalEvent.SENT, text="x" * 10_000))

    with pytest.raises(JournalError, match="full"):
        write_on()
    assert verified(file).broken == ""
