"""The desk's journal as a parcel and back; the desk, its roster and its account keep themselves."""

from __future__ import annotations

import numpy as np

from sleepcast.channel.message_batch import NameIndex, ascending
from sleepcast.core.serial import Array, SerialError
from sleepcast.station.journal.journal import MAX_ENTRIES, Journal, JournalEntry, MemoryJournal
from sleepcast.station.roster import RobotNames
from sleepcast.station.serialized import EntryState, JournalState


def dump_journal(journal: Journal) -> JournalState:
    """Every entry of a journal in memory; one in a file is not part of a snapshot."""
    if not isinstance(journal, MemoryJournal):
        return JournalState(0, [])
    return JournalState(journal.dropped, [_entry_parcel(entry) for entry in journal.entries()])


def restore_journal(journal: MemoryJournal, state: JournalState, names: NameIndex) -> None:
    """Hold the stored entries. Raises SerialError."""
    if state.dropped < 0 or len(state.entries) > MAX_ENTRIES:
        raise SerialError(f"a journal of {len(state.entries)} entries after {state.dropped}")
    entries = enumerate(state.entries, state.dropped + 1)
    journal.fill([_entry(number, entry, names) for number, entry in entries], state.dropped)


def _entry_parcel(entry: JournalEntry) -> EntryState:
    robots = {key: value for key, value in entry.details.items() if isinstance(value, RobotNames)}
    details = {key: value for key, value in entry.details.items() if key not in robots}
    for key in [key for key, some in robots.items() if not some.names.lasting]:
        details[key] = list(robots.pop(key))
    places = {key: Array.of(some.places.astype(np.int32)) for key, some in robots.items()}
    return EntryState(entry.time, entry.who, entry.event, entry.subject, entry.text, details, places)


def _entry(number: int, state: EntryState, names: NameIndex) -> JournalEntry:
    robots = {key: RobotNames(names, ascending(places, len(names))) for key, places in state.robots.items()}
    details = state.details | robots
    return JournalEntry(number, state.time, state.who, state.event, state.subject, state.text, details)
