"""The operator's desk, without a page: check, preview, send, stop, and a truthful account of what became of it."""

from sleepcast.station.accounting import (
    FAULT,
    MATCHED,
    NOT_MATCHED,
    SILENT,
    Accounting,
    Answer,
    Command,
    Outcome,
)
from sleepcast.station.desk import (
    DEADLINE,
    AddressError,
    NoExplanationError,
    NoSuchCommandError,
    SortError,
    Station,
)
from sleepcast.station.journal import Entry, Event, Journal, MemoryJournal, Report
from sleepcast.station.minds import FleetNames, ManyMinds, Mind, Minds, Telemetry
from sleepcast.station.preview import NO, UNKNOWN, YES, Preview
from sleepcast.station.roster import UnknownRobotError

__all__ = [
    "DEADLINE",
    "FAULT",
    "MATCHED",
    "NO",
    "NOT_MATCHED",
    "SILENT",
    "UNKNOWN",
    "YES",
    "Accounting",
    "AddressError",
    "Answer",
    "Command",
    "Entry",
    "Event",
    "FleetNames",
    "Journal",
    "ManyMinds",
    "MemoryJournal",
    "Mind",
    "Minds",
    "NoExplanationError",
    "NoSuchCommandError",
    "Outcome",
    "Preview",
    "Report",
    "SortError",
    "Station",
    "Telemetry",
    "UnknownRobotError",
]
