"""What a desk knows when it is kept: its account, its roster, its journal and where it was in its numbers.

Robots are named by their places on the roster: those of the minds come first, then others that were heard.
"""

from __future__ import annotations

from math import inf, nan

import msgspec

from sleepcast.channel import Message
from sleepcast.core.serial import Array
from sleepcast.mind.auction import Auctioneer
from sleepcast.station.journal.journal import JournalEvent


class CommandAnswersState(msgspec.Struct, array_like=True):
    """The first answer of each robot; see `Answers`."""

    outcome: Array
    heard: Array
    value: Array
    fault: Array | None
    faults: tuple[str, ...]
    waiting_since: Array | None = None
    bound: float = nan


class RestStatesState(msgspec.Struct, array_like=True):
    """See `RestStates`."""

    told: Array
    speed: Array
    distance: Array


class CommandState(msgspec.Struct, array_like=True):
    """See `Command`. names: of the robots that were asked or have answered, by place, where others may be there now."""

    message: Message
    addressed: int
    expected: Array
    last_sent: float
    answers: CommandAnswersState
    only: Array | None = None
    rest: RestStatesState | None = None
    auctioneer: Auctioneer | None = None
    names: dict[int, str] | None = None


class EntryState(msgspec.Struct, array_like=True):
    """An entry of the journal without its number. robots: details that are robots, by their places."""

    time: float
    who: str
    event: JournalEvent
    subject: str
    text: str
    details: dict[str, object]
    robots: dict[str, Array] = {}


class JournalState(msgspec.Struct):
    """The stored entries, and how many were dropped before them."""

    dropped: int
    entries: list[EntryState]


class ReportState(msgspec.Struct, array_like=True):
    """See `Report`."""

    robot: str
    heard: float
    body: dict[str, object]


class RosterState(msgspec.Struct):
    """others: names on the roster that are none of the minds'. heard, told (`reported`): see `Roster`."""

    others: list[str]
    heard: Array
    told: Array


class AccountState(msgspec.Struct):
    """Who sends, what was sent and what was heard.

    latch: the last STOP or RELEASE
    holding: see `Station.hold`
    beat: when the last heartbeat was sent, s
    """

    operator: str
    epoch: int
    sequence: int
    commands: list[CommandState]
    latch: CommandState | None
    reports: list[ReportState]
    holding: bool = False
    beat: float = -inf


class StationState(msgspec.Struct):
    """Everything."""

    account: AccountState
    roster: RosterState
    journal: JournalState
