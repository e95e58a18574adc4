"""The journal in memory: numbered without gaps, bounded, and honest about what it no longer has."""

from __future__ import annotations

from sleepcast.station import JournalEvent, MemoryJournal
from sleepcast.station.journal.journal import PendingEntry


def test_entries_come_back_in_order_from_any_number_on() -> None:
    journal = MemoryJournal()
    for i in range(5):
        journal.append(
            PendingEntry(float(i), "desk", JournalEvent.SENT, subject=f"desk-1.{i}", text="(MARK)", details={"i": i})
        )
    assert [entry.number for entry in journal.entries()] == [1, 2, 3, 4, 5]
    assert [entry.details["i"] for entry in journal.entries(after=3)] == [3, 4]
    assert journal.entries(after=5) == []
    assert journal.dropped == 0


def test_a_full_journal_forgets_the_oldest_and_says_how_many() -> None:
    journal = MemoryJournal(size=3)
    for i in range(10):
        journal.append(PendingEntry(float(i), "s1", JournalEvent.HEARD))
    assert [entry.number for entry in journal.entries()] == [8, 9, 10]
    assert journal.dropped == 7


def test_a_journal_of_long_entries_forgets_the_oldest_sooner() -> None:
    journal = MemoryJournal(most=50_000)
    for i in range(100):
        journal.append(
            PendingEntry(float(i), "s1", JournalEvent.HEARD, text="x" * 4_000, details={"names": ["r1"] * 10})
        )
    kept = [entry.number for entry in journal.entries()]
    assert kept == list(range(100 - len(kept) + 1, 101))
    assert 8 <= len(kept) <= 12
    assert journal.dropped == 100 - len(kept)
