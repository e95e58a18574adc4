"""The desks of several operators at one place: whose desk is meant, and what all of them have sent."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import Protocol, TypeVar

from sleepcast.channel.message import Message
from sleepcast.core.errors import MisuseError, did_you_mean


class HoldsMessage(Protocol):
    """What a desk keeps account of a message by."""

    @property
    def message(self) -> Message: ...


Kept = TypeVar("Kept", bound=HoldsMessage)
KeptHere = TypeVar("KeptHere", bound=HoldsMessage, covariant=True)
Seat = TypeVar("Seat")


class SendsCommands(Protocol[KeptHere]):
    """A desk, as far as it has sent something."""

    def commands(self) -> Sequence[KeptHere]:
        """What it has sent, oldest first."""


def desk_of(operator: str, operators: Collection[str], desks: Sequence[Seat]) -> Seat:
    """The desk of an operator. Raises MisuseError where nobody of this name sits at one.

    operator: by name, "" for the first
    operators: all who are named, the first one first
    desks: theirs in this order; one where nobody is named
    """
    by = operator or next(iter(operators), "")
    if by and by not in operators:
        known = f"wanted one of {', '.join(operators)}" if operators else "nobody is named in this run"
        raise MisuseError(f"no operator {by}{did_you_mean(by, operators)}: {known}")
    place = [*operators].index(by) if by else 0
    if place >= len(desks):
        raise MisuseError(f"nobody sits at the desk of {by or 'the operator'}")
    return desks[place]


def sent_by(desks: Sequence[SendsCommands[Kept]]) -> list[Kept]:
    """What these desks have sent, oldest first."""
    if len(desks) == 1:
        return [*desks[0].commands()]
    return sorted((each for desk in desks for each in desk.commands()), key=lambda each: each.message.issued)
