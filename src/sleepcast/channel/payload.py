"""What the bodies of commands and questions may say besides their text, by its name on the air."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from math import inf

from sleepcast.channel.message import Role

WITHIN = "within"
"""Seconds over which answers are to be spread."""
FOR, NOT = "for", "not"
"""Names of the robots that are addressed, and of those that are not; all others do not even answer."""
AGAIN = "again"
"""Of a question without a text: the command of which those that are addressed, by `for` or by `not`, shall say their
answer once more."""
LOOK, OF = "look", "of"
"""What a robot is to tell of itself, and of which command or description."""
LEASE = "lease"
"""Who is to control a group, and for how long: a map with these four."""
DO, GROUP, SECONDS, TO = "do", "group", "seconds", "to"
"""What is to be done with the lease (see `LeaseAction`), of which group, for how long, and who is to have it."""
KEYS = "keys"
"""Whom to trust, and whom not any more."""
FIRST, AGE = "first", "age"
"""The id of the message that this one repeats for those who were not heard, and the seconds since that was sent."""
ENDS = "ends"
"""In a RELEASE: the STOPs of others, and of other lives of its sender, that it ends; see `latch`."""
STOPS = "stops"
"""With telemetry: the STOPs that hold a robot, each with the seconds since it came."""
MATCHED = "matched"
"""In a question: robots are to say whether they would obey it; in their answers: whether they would."""
TIME = "time"
"""In a REPORT: a nonce with which a robot without a clock asks for the time; in a HEARTBEAT: that nonce, answered."""
TOOK = "took"
"""In a REPORT: whose time a robot has taken; its value, by how many s its clock was behind."""
TOLD = "told"
"""What a robot tells of itself, in the answer to a look."""
HOPS = "hops"
"""In what a robot tells others: how far it may go, this hop included."""
MISSED = "missed"
"""Ids of commands that a robot was to hear and that never came in time."""


class LeaseAction(StrEnum):
    """What can be done with the lease of a group."""

    TAKE = "take"
    """Have it, if nobody else does, or have it longer."""
    GIVE = "give"
    """Have it no more."""
    REQUEST = "request"
    """Have it if nobody else does; who does hears of the wish."""
    GRANT = "grant"
    """Let somebody else have it."""
    FORCE = "force"
    """Have it whoever else does; for commanders."""


class Inspection(StrEnum):
    """What a robot can be asked to tell of itself."""

    TELEMETRY = "telemetry"
    """Its numbers, its groups, whether it is stopped."""
    VOCABULARY = "vocabulary"
    """The names of its type."""
    MIND = "mind"
    """What it has learned: groups, operators, rules."""
    WHY = "why"
    """How it evaluated a command, or what a rule would do now."""


def hops_left(body: Mapping[str, object], role: str, most: int) -> int:
    """How far what a robot tells because of a message may go: `most`, or one hop less than what another robot has told
    it. role: of the message's sender."""
    hops = body.get(HOPS)
    if isinstance(hops, int) and not isinstance(hops, bool):
        return min(max(hops, 1), most) - 1
    return 0 if role == Role.ROBOT or HOPS in body else most


def is_addressed(body: Mapping[str, object], name: str) -> bool:
    """Whether a message is for the robot of this name. One that says for whom, and says it wrongly, is for nobody."""
    only, others = body.get(FOR), body.get(NOT, [])
    if not isinstance(others, list) or name in others:
        return False
    return FOR not in body or (isinstance(only, list) and name in only)


def age_of(body: Mapping[str, object]) -> float:
    """Seconds since a message was first sent; inf where it does not say what can be meant."""
    age = body.get(AGE, 0.0)
    return float(age) if isinstance(age, float | int) and age >= 0.0 else inf
