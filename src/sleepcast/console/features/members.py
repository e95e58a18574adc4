"""Who is in a group, for the map."""

from __future__ import annotations

from typing import Annotated, Protocol

from msgspec import Meta

from sleepcast.console.feature import answers, run_again
from sleepcast.console.incoming import PageMessage, Serial
from sleepcast.console.outgoing import DeskMessage


class Members(PageMessage):
    """Who is in a group, by its code in a frame."""

    serial: Serial
    group: Annotated[int, Meta(ge=1, le=255)]


class Joined(DeskMessage):
    """Who is in a group: a byte for each robot, 1 for its members."""

    serial: int
    members: bytes


class MemberSource(Protocol):
    """Robots in groups."""

    def members(self, group: int) -> bytes:
        """Who is in the group with this code: 1 each."""


@answers(then=run_again)
def members(source: MemberSource, asked: Members) -> Joined:
    """Who is in a group."""
    return Joined(asked.serial, source.members(asked.group))
