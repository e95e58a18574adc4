"""An operator's station, without a page: check, preview, send, stop, and a truthful account of each command."""

from sleepcast.station.account import (
    FAULT,
    MATCHED,
    NOT_MATCHED,
    SILENT,
    Account,
    Answer,
    Command,
    NoSuchCommandError,
    Outcome,
)
from sleepcast.station.journal.journal import Entry, Event, Journal, MemoryJournal, Report
from sleepcast.station.preview import NO, UNKNOWN, YES, FleetNames, ManyMinds, Mind, Minds, Preview, Telemetry
from sleepcast.station.roster import UnknownRobotError
from sleepcast.station.station import NoExplanationError, Station
from sleepcast.station.validation import (
    DEADLINE,
    AddressError,
    CommandTypeError,
    CountNeededError,
    DoubtError,
    NobodyHeardError,
    SendPolicy,
)

__all__ = [
    "DEADLINE",
    "FAULT",
    "MATCHED",
    "NO",
    "NOT_MATCHED",
    "SILENT",
    "UNKNOWN",
    "YES",
    "Account",
    "AddressError",
    "Answer",
    "Command",
    "CommandTypeError",
    "CountNeededError",
    "DoubtError",
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
    "NobodyHeardError",
    "Outcome",
    "Preview",
    "Report",
    "SendPolicy",
    "Station",
    "Telemetry",
    "UnknownRobotError",
]
