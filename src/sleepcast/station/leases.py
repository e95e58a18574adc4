"""The desk's side of group leases: what to say for one, and what others' wishes mean to a person."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from sleepcast.channel import Message
from sleepcast.channel.message import DO, GROUP, LEASE, MAX_NAME, SECONDS, TO, LeaseAction, Role
from sleepcast.core.ages import duration
from sleepcast.core.errors import MisuseError, printable, slip_of, with_article
from sleepcast.language import Names, ReadError, Symbol, read
from sleepcast.language.symbols import known_groups

if TYPE_CHECKING:
    from sleepcast.channel.keys import Trust

MAX_LEASE = 3_600.0
"""Seconds for which a lease may be had at a time, as robots take it."""


class LeaseError(MisuseError):
    """A lease that no robot could grant."""


def lease_body(action: LeaseAction, group: str, seconds: float, to: str = "") -> dict[str, object]:
    """As it stands in a message. Raises LeaseError."""
    try:
        named = isinstance(read(group), Symbol)
    except ReadError:
        named = False
    if not named or len(group) > MAX_NAME:
        raise LeaseError(f"{group!r:.80} is not a group's name: wanted one word, e.g. bravo")
    if not 0.0 <= seconds <= MAX_LEASE:
        raise LeaseError(
            f"a lease is for 0 s to {duration(MAX_LEASE)}, not {seconds:g} s: renew it if you need it longer"
        )
    if action is LeaseAction.GRANT and not to:
        raise LeaseError(f"say to whom {group} is granted (--to NAME)")
    return {LEASE: {DO: action.value, GROUP: group, SECONDS: seconds, TO: to}}


def validate_holder(name: str, trust: Trust) -> None:
    """Raises LeaseError if by the trusted keys nobody of this name may command robots. Of others nothing is known."""
    roles = {key.role for key in trust.keys if key.owner == name and not key.revoked}
    if roles and not roles & {Role.OPERATOR, Role.COMMANDER}:
        role = min(roles)
        raise LeaseError(
            f"{name} is {with_article(role)}, who commands no robots, so that nobody could "
            "command the group: grant it to an operator"
        )


def doubt_of(group: str, names: Names) -> str:
    """A doubt about the name of a group of which nobody has heard, if it is probably a slip; else "". names: what the
    desk knows that robots have learned."""
    meant = slip_of(group, known_groups(names))
    return printable(f'no robot has told of a group "{group}" (did you mean {meant}?)') if meant else ""


def in_words(body: Mapping[str, object]) -> str:
    """What a message of our own says of a lease: `LEASE take bravo`; "" if it says nothing of any."""
    match body.get(LEASE):
        case {"do": str() as action, "group": str() as group}:
            return f"LEASE {action} {group}"
    return ""


def describe_request(message: Message) -> str:
    """What another operator does about a lease, in words; "" for messages about something else."""
    match message.body.get(LEASE):
        case {"do": str() as action, "group": str() as group}:
            words = {
                LeaseAction.TAKE.value: f"{message.sender} takes {group}",
                LeaseAction.GIVE.value: f"{message.sender} gives {group} back",
                LeaseAction.REQUEST.value: (
                    f"{message.sender} asks for {group}: sleepcast lease grant {group} --to {message.sender}"
                ),
                LeaseAction.GRANT.value: f"{message.sender} grants {group} to somebody else",
                LeaseAction.FORCE.value: f"{message.sender} has taken {group} by force",
            }
            return words.get(action, "")
    return ""
