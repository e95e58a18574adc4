"""Leases: robots of a group obey one operator only, for a while."""

from __future__ import annotations

from typing import Annotated, Literal, Protocol

import msgspec
from msgspec import Meta

from sleepcast.console.feature import NO_ROBOTS, answers
from sleepcast.console.incoming import PageMessage, Serial
from sleepcast.console.outgoing import Sent

Action = Literal["take", "give", "request", "grant", "force"]


class ChangeLease(PageMessage, tag="lease"):
    """Ask robots that a group (by its name) obeys one operator only, for so many seconds.

    action: what is to become of the lease
    to: the operator for a grant
    """

    serial: Serial
    action: Action = msgspec.field(name="deed")
    group: Annotated[str, Meta(min_length=1, max_length=64)]
    seconds: Annotated[float, Meta(ge=1.0, le=3_600.0)] = 60.0
    to: Annotated[str, Meta(max_length=64)] = ""


class LeaseSource(Protocol):
    """Robots that several operators command."""

    def lease(self, asked: ChangeLease) -> Sent:
        """Ask robots about the lease of a group. Raises SleepcastError."""


@answers(lacking="Leases are for robots on the air, which several operators command.", recording=NO_ROBOTS)
def lease(source: LeaseSource, asked: ChangeLease) -> Sent:
    """Ask robots about a lease."""
    return source.lease(asked)
