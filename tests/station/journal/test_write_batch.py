"""A desk whose journal fails: what happened is written later, what has not happened yet is refused, STOP goes out."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from sleepcast.channel import Kind
from sleepcast.station import JournalEvent, MemoryJournal, Station
from sleepcast.station.journal.journal import AGAIN, MAX_KEPT, JournalError, JournalWriter, PendingEntry
from station.fleet import Fleet, vocabulary


class FailingJournal(MemoryJournal):
    """A journal in memory on a disk that can be full. tried: how often it was written to."""

    def __init__(self) -> None:
        super().__init__()
        self.full, self.tried = False, 0

    def append(self, *entries: PendingEntry) -> None:
        self.tried += 1
        if self.full:
            raise JournalError("the disk is full")
        super().append(*entries)

    def texts(self) -> list[str]:
        return [entry.text for entry in self.entries()]


def note(text: str, time: float = 0.0, details: Mapping[str, object] | None = None) -> PendingEntry:
    return PendingEntry(time, "desk", JournalEvent.SENT, "", text, details or {})


def test_what_could_not_be_written_is_written_later_in_its_order() -> None:
    journal = FailingJournal()
    notes = JournalWriter(journal)
    notes.write(note("a"))
    journal.full = True
    for text in "bcd":
        notes.write(note(text, 1.0))
    assert journal.texts() == ["a"]
    assert "the disk is full" in notes.trouble
    assert "wait to be written: 1" in notes.trouble
    assert journal.tried == 2, "a disk that fails is not tried with every entry"
    journal.full = False
    notes.write(note("e", 1.0 + AGAIN))
    assert journal.texts() == ["a", "b", "c", "d", "e"]
    assert notes.trouble == ""


def test_what_must_be_written_first_is_refused() -> None:
    journal = FailingJournal()
    notes = JournalWriter(journal)
    journal.full = True
    with pytest.raises(JournalError, match="full"):
        notes.write_first(note("a"))
    journal.full = False
    notes.write_first(note("b"))
    assert journal.texts() == ["b"]


def test_much_is_written_at_once() -> None:
    journal = FailingJournal()
    notes = JournalWriter(journal)
    with notes.together(0.0):
        for text in "abc":
            notes.write(note(text))
        assert journal.texts() == []
    assert (journal.texts(), journal.tried) == (["a", "b", "c"], 1)
    with notes.together(0.0):
        pass
    assert journal.tried == 1, "nothing to write"


def test_what_does_not_fit_is_lost_and_told() -> None:
    journal = FailingJournal()
    notes = JournalWriter(journal)
    journal.full = True
    for number in range(MAX_KEPT + 3):
        notes.write(note(str(number)))
    assert "the disk is full" in notes.trouble
    journal.full = False
    notes.write(note("last", AGAIN))
    assert journal.texts()[0] == "4"
    assert notes.trouble == "4 entries of the journal were lost"


def test_a_stop_goes_out_and_answers_count_whatever_becomes_of_the_journal() -> None:
    fleet, journal = Fleet(), FailingJournal()
    fleet.station = station = Station(vocabulary(), fleet.minds, fleet.sent.append, fleet.clock, journal=journal)
    fleet.report()
    journal.full = True
    for say in (lambda: station.send("(WHEN (> fuel 50%) (PRINT 1))"), lambda: station.ask("fuel")):
        with pytest.raises(JournalError):
            say()
    assert fleet.sent == []
    assert station.commands() == []
    stop = station.stop()
    assert [message.kind for message in fleet.sent] == [Kind.STOP]
    fleet.deliver()
    assert station.accounting(stop.id).n_matched == 10
    assert "wait to be written" in station.trouble
    journal.full = False
    fleet.clock.advance(AGAIN)
    station.release()
    kinds = [entry.details["kind"] for entry in journal.entries() if entry.event is JournalEvent.SENT]
    assert kinds == ["stop", "release"]
    assert sum(entry.event is JournalEvent.HEARD for entry in journal.entries()) == 10
    assert station.trouble == ""
