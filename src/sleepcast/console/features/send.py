"""Broadcasting a text: to be done once, as a standing command, a question, or in stages."""

from __future__ import annotations

from typing import Annotated, Literal, Protocol

import msgspec
from msgspec import Meta

from sleepcast.console.feature import answers, only_now
from sleepcast.console.incoming import Operator, PageMessage, Serial, Text
from sleepcast.console.outgoing import Sent

SendKind = Literal["once", "standing", "ask", "stages"]


class Send(PageMessage):
    """Broadcast a text.

    everybody: the sender has said that all robots are meant
    kind: to be done once and soon; without a deadline; a question, to which each robot answers with the value; or in
        stages: to one robot, to a tenth, to all
    count: how many robots may obey
    confirmed: it is meant as it stands, whatever is doubted
    by: the operator who sends it, "" for the first
    """

    serial: Serial
    text: Text
    everybody: bool = False
    kind: SendKind = msgspec.field(default="once", name="sort")
    count: Annotated[int, Meta(ge=0, le=10_000_000)] | None = None
    confirmed: bool = False
    by: Operator = ""


class Halt(PageMessage):
    """Send no further stage of what goes out in stages."""


class SendSource(Protocol):
    """Who can send."""

    def send(self, asked: Send) -> Sent:
        """Broadcast a text. Raises SleepcastError, where the station asks for confirmation, too."""

    def halt(self) -> None:
        """Send no further stage."""


@answers(then=only_now)
def send(source: SendSource, asked: Send) -> Sent:
    """Broadcast a text."""
    return source.send(asked)


@answers()
def halt(source: SendSource, asked: Halt) -> None:
    """Send no further stage."""
    source.halt()
