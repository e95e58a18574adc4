"""An operator's station, without a page: check, preview, send, stop, and a truthful account of each command."""

import numpy as np  # noqa: F401 - first: deep down in imports of imports, its own take Python twice as long

from sleepcast.station.account import Account
from sleepcast.station.journal.journal import Journal, JournalEntry, JournalEvent, MemoryJournal, Report
from sleepcast.station.roster import UnknownRobotError
from sleepcast.station.sent import (
    FAULT,
    MATCHED,
    NOT_MATCHED,
    SILENT,
    Answer,
    Command,
    NoExplanationError,
    NoSuchCommandError,
    Outcome,
)
from sleepcast.station.station import Station
from sleepcast.station.validation import (
    DEADLINE,
    NO,
    UNKNOWN,
    YES,
    CommandTypeError,
    CountNeededError,
    DoubtError,
    FleetNames,
    ManyMinds,
    Minds,
    NobodyHeardError,
    NotConfirmedError,
    ObservedMind,
    Preview,
    SendPolicy,
    Telemetry,
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
    "Answer",
    "Command",
    "CommandTypeError",
    "CountNeededError",
    "DoubtError",
    "FleetNames",
    "Journal",
    "JournalEntry",
    "JournalEvent",
    "ManyMinds",
    "MemoryJournal",
    "Minds",
    "NoExplanationError",
    "NoSuchCommandError",
    "NobodyHeardError",
    "NotConfirmedError",
    "ObservedMind",
    "Outcome",
    "Preview",
    "Report",
    "SendPolicy",
    "Station",
    "Telemetry",
    "UnknownRobotError",
]
