"""The payload: fields of a message's body besides the text, by their names on the wire."""

from __future__ import annotations

from collections.abc import Mapping
from enum import StrEnum
from math import inf

from sleepcast.channel.message import Role

WITHIN = "within"
"""Seconds over which answers are to be spread."""
FOR, NOT = "for", "not"
"""Names of the addressed robots, or of those that are not addressed; robots that are not addressed do not answer."""
AGAIN = "again"
"""In an ASK without a text: the command whose answer the robots addressed by `for` or `not` are to send again."""
LOOK, OF = "look", "of"
"""What a robot is to tell about itself (`Inspection`), and about which command or description."""
LEASE = "lease"
"""A change of a group's lease: a map with the next four fields."""
DO, GROUP, SECONDS, TO = "do", "group", "seconds", "to"
"""The action (see `LeaseAction`), the group, the seconds, and who is to have the lease."""
KEYS = "keys"
"""Keys to trust and to revoke (`keys.KeyChange`)."""
FIRST, AGE = "first", "age"
"""The id of the message that this one repeats for robots that were not heard, and the seconds since it was sent."""
ENDS = "ends"
"""In a RELEASE: the STOPs of others, and of its sender's other lives, that it ends; see `stop_latch`."""
STOPS = "stops"
"""In telemetry: the STOPs that hold a robot, each with the seconds since it came."""
MATCHED = "matched"
"""In an ASK: robots are to say whether they would obey; in their answers: whether they would."""
TIME = "time"
"""In a REPORT: the nonce of a robot's time request; in a HEARTBEAT: the same nonce, in reply."""
TOOK = "took"
"""In a REPORT: whose time a robot has taken. The report's value is by how many s its clock was behind."""
TELEMETRY = "told"
"""What a robot tells about itself, in the answer to an inspection."""
HOPS = "hops"
"""In what a robot tells other robots: hops that it may still go, this one included."""
MISSED = "missed"
"""Ids of commands that never reached a robot in time."""


class LeaseAction(StrEnum):
    """What an operator can do with the lease of a group."""

    TAKE = "take"
    """Take it if it is free, or extend one's own."""
    GIVE = "give"
    """Give it up."""
    REQUEST = "request"
    """Take it if it is free; otherwise its holder hears of the request."""
    GRANT = "grant"
    """Hand it to somebody else."""
    FORCE = "force"
    """Take it from its holder; for commanders."""


class Inspection(StrEnum):
    """What a robot can be asked to tell about itself."""

    TELEMETRY = "telemetry"
    """Its variables, its groups, whether it is stopped."""
    VOCABULARY = "vocabulary"
    """The names that its type knows."""
    MIND = "mind"
    """What it has learned: groups, operators, rules."""
    WHY = "why"
    """How it evaluated a command, or what a rule would do now."""


def hops_left(body: Mapping[str, object], role: str, most: int) -> int:
    """Hops that something told because of a message may go: `most`, or one less than the message had left if it came
    from a robot. role: of the message's sender."""
    hops = body.get(HOPS)
    if isinstance(hops, int) and not isinstance(hops, bool):
        return min(max(hops, 1), most) - 1
    return 0 if role == Role.ROBOT or HOPS in body else most


def is_addressed(body: Mapping[str, object], name: str) -> bool:
    """Whether a message is for the robot of this name. A message with malformed addressing is for nobody."""
    only, others = body.get(FOR), body.get(NOT, [])
    if not isinstance(others, list) or name in others:
        return False
    return FOR not in body or (isinstance(only, list) and name in only)


def age_of(body: Mapping[str, object]) -> float:
    """Seconds since a message was first sent; inf if the field is malformed."""
    age = body.get(AGE, 0.0)
    return float(age) if isinstance(age, float | int) and age >= 0.0 else inf
