"""The operator's desk, without a page: check, preview, send, stop, and a truthful account of what became of it."""

from sleepcast.station.accounting import Accounting, Answer, Command, Outcome
from sleepcast.station.desk import (
    DEADLINE,
    AddressError,
    NoExplanationError,
    NoSuchCommandError,
    Report,
    SortError,
    Station,
)
from sleepcast.station.journal import Entry, Event, Journal, MemoryJournal
from sleepcast.station.minds import FleetNames, Mind, Minds, Telemetry
from sleepcast.station.preview import Preview
from sleepcast.station.roster import Row, UnknownRobotError

__all__ = [
    "DEADLINE",
    "Accounting",
    "AddressError",
    "Answer",
    "Command",
    "Entry",
    "Event",
    "FleetNames",
    "Journal",
    "MemoryJournal",
    "Mind",
    "Minds",
    "NoExplanationError",
    "NoSuchCommandError",
    "Outcome",
    "Preview",
    "Report",
    "Row",
    "SortError",
    "Station",
    "Telemetry",
    "UnknownRobotError",
]
