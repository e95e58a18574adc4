"""What became of commands: their accounts, what each robot did with one, and what robots answered to a question."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Annotated, Protocol

from msgspec import Meta

from sleepcast.console.feature import answers
from sleepcast.console.incoming import Id, PageMessage, Serial
from sleepcast.console.outgoing import Answered, Commands, DeskMessage

MAX_REPLIES = 64
"""Robots whose answers are asked for at one time: about as many as have their names on a map."""


class GetCommands(PageMessage, tag="commands"):
    """The account of every command, at once."""

    serial: Serial


class Outcomes(PageMessage):
    """What became of a command on each robot."""

    serial: Serial
    command: Id


class Replies(PageMessage):
    """What each of these robots (by their indices) answered to a question."""

    serial: Serial
    command: Id
    robots: Annotated[list[Annotated[int, Meta(ge=0, le=10_000_000)]], Meta(max_length=MAX_REPLIES)]


class Replied(DeskMessage):
    """What each robot answered to a question, with its unit, in the order in which they were asked for; "" for who is
    silent."""

    serial: int
    texts: list[str]


class AccountSource(Protocol):
    """A desk that knows what became of commands."""

    def commands(self, serial: int | None = None, time: float = inf) -> Commands:
        """The account of every command as it was at a time, s of the page's time."""


class AnswerSource(Protocol):
    """A desk that knows it robot by robot. time: s of the page's time."""

    def outcomes(self, command: str, time: float = inf) -> bytes:
        """What had become of a command on each robot, a byte each. Raises SleepcastError."""

    def replies(self, command: str, robots: Sequence[int], time: float = inf) -> list[str]:
        """What these robots had answered to a question. Raises MisuseError for what is no question, and for a robot
        that there is not."""


@answers(then=lambda source, asked, then: source.commands(asked.serial, then.time))
def commands(source: AccountSource, asked: GetCommands) -> Commands:
    """The account of every command."""
    return source.commands(asked.serial)


@answers(
    then=lambda source, asked, then: Answered(asked.serial, source.outcomes(asked.command, then.time)),
    recording="A recording stores how many robots obeyed a command, not which ones.",
)
def outcomes(source: AnswerSource, asked: Outcomes) -> Answered:
    """What became of a command on each robot."""
    return Answered(asked.serial, source.outcomes(asked.command))


@answers(
    then=lambda source, asked, then: Replied(asked.serial, source.replies(asked.command, asked.robots, then.time)),
    recording="A recording stores the least, the mean and the greatest answer, not those of each robot.",
)
def replies(source: AnswerSource, asked: Replies) -> Replied:
    """What robots answered to a question."""
    return Replied(asked.serial, source.replies(asked.command, asked.robots))
