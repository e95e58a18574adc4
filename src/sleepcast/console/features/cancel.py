"""Discarding what waits for an instant, before it has come."""

from __future__ import annotations

from typing import Protocol

from sleepcast.console.feature import answers, only_now
from sleepcast.console.incoming import Operator, PageMessage, Serial
from sleepcast.console.outgoing import Sent
from sleepcast.station import Station
from sleepcast.station.prepared import Terms

CANCEL = "(CANCEL)"
"""What robots are sent: whatever of the same sender waits on them is discarded."""


class Cancel(PageMessage):
    """Discard all commands of an operator that wait. by: see `Send`."""

    serial: Serial
    by: Operator = ""


class CancelSource(Protocol):
    """Who can send."""

    def desk_of(self, operator: str) -> Station:
        """The desk of an operator. Raises MisuseError for one who has none here."""


@answers(then=only_now)
def cancel(source: CancelSource, asked: Cancel) -> Sent:
    """Discard what waits on all robots, without asking how many they are: there is no time for that, and it only keeps
    them from doing something."""
    desk = source.desk_of(asked.by)
    prepared = desk.prepare(CANCEL, Terms(everybody=True, anyway=True))
    return Sent(asked.serial, desk.commit(prepared, count=prepared.may, confirmed=True).id)
