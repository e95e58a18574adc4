"""A message: what one party of the channel sends to the others, the bounds that every message keeps, and the fields of
its body by their names on the wire.

Expressions travel as text, never as compiled code: robots differ in what they know, and each compiles in its own names.
A message is identified by its sender, the sender's epoch (its lives so far) and its number.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from enum import StrEnum
from functools import cached_property, lru_cache
from math import inf, isnan

import msgspec

from sleepcast.core.errors import MisuseError
from sleepcast.core.records import NamedTuple

MAX_TEXT = 16_384
"""Characters of an expression: what the language reads at most."""
MAX_NAME = 64
"""Characters of a name."""
MAX_NUMBER = 2**63 - 1
"""Epochs and sequence numbers fit a signed 64-bit integer in any language."""


def is_robot_name(name: str) -> bool:
    """Whether robots may be called this: it is short, can be printed, and is one word."""
    return 0 < len(name) <= MAX_NAME and name.isprintable() and " " not in name


_NUMBERS = re.compile(r"(\d+)")


@lru_cache(maxsize=4_096)
def natural_order(name: str) -> tuple[tuple[int, str], ...]:
    """A sort key by which r2 comes before r10; an account sorts the same names several times."""
    parts = _NUMBERS.split(name)
    return tuple([(int(part[:18]) if at % 2 else 0, part) for at, part in enumerate(parts)])


class Kind(StrEnum):
    """What a message is for; the first field that a receiver looks at."""

    COMMAND = "command"
    """Evaluate the text once."""
    ASK = "ask"
    """Evaluate a text without side effects and answer."""
    STOP = "stop"
    """Stop the body and keep it stopped; handled before the language is asked."""
    RELEASE = "release"
    """End STOP."""
    HEARTBEAT = "heartbeat"
    """The operator is there."""
    ANSWER = "answer"
    """The result of a COMMAND or an ASK, in the body."""
    REPORT = "report"
    """Something that a robot sends unasked."""
    DIGEST = "digest"
    """A summary of the commands that a party has."""
    REQUEST = "request"
    """A request for missed commands."""


TO_OPERATOR = frozenset({Kind.ANSWER, Kind.REPORT})
"""Kinds that robots address to the operator; all others are for everybody."""


class Role(StrEnum):
    """What the owner of a key may do. Every role may send STOP."""

    OBSERVER = "observer"
    """Ask only."""
    OPERATOR = "operator"
    """Command."""
    COMMANDER = "commander"
    """Command, store rules, and change whom robots trust."""
    ROBOT = "robot"
    """Answer, report, tell other robots, and resend what others have missed."""


class Predecessors(NamedTuple):
    """The commands before a command.

    after: number of the previous one, 0 for none
    sent, until: when that was issued, and its deadline (s, inf for a standing one)
    rules: number of the previous standing one, 0 for none
    """

    after: int = 0
    sent: float = inf
    until: float = inf
    rules: int = 0

    def written(self) -> dict[str, object]:
        """As fields of a message's body."""
        sent, until = (None if time == inf else time for time in (self.sent, self.until))
        return {"after": self.after, "sent": sent, "until": until, "rules": self.rules}

    @staticmethod
    def of(body: Mapping[str, object], number: int) -> Predecessors:
        """The link of the message with this body and number; a message without one follows nothing."""
        after, rules = body.get("after"), body.get("rules")
        if isinstance(after, int) and isinstance(rules, int) and "until" in body and 0 <= rules <= after < number:
            return Predecessors(after, _time(body.get("sent")), _time(body["until"]), rules)
        return Predecessors()


def _time(time: object) -> float:
    """A time in a body; inf for what is no number, or too large."""
    return float(time) if isinstance(time, float) or (isinstance(time, int) and abs(time) < 1e300) else inf


class MessageError(MisuseError):
    """A message that exceeds a bound."""


class Message(msgspec.Struct, frozen=True, dict=True):
    """One message. Raises MessageError past a bound.

    sender, epoch, sequence: who sends it, in which life, and its number
    kind: what it is for
    issued: when it was sent, s of the swarm's clock
    deadline: after which nobody acts on it any more, s of that clock, inf for never
    text: the expression
    standing: whether it must reach everybody in the end, also robots that join later
    body: further fields as plain data, by name (see below)
    role: of the key that signed it, as the receiver knows it; "" where nobody signs
    heard: when it reached its receiver, s of that clock, None if unknown
    ahead: s by which its sender's clock is ahead of the receiver's, 0 if by no more than is allowed; a message with
        another value only shows that its sender is there
    key: id of the key that signed it, in hexadecimal digits; "" where nobody signs
    late: whether it only came late: its sender's clock is right, whatever `ahead` says
    """

    sender: str
    epoch: int
    sequence: int
    kind: Kind
    issued: float
    deadline: float = inf
    text: str = ""
    standing: bool = False
    body: dict[str, object] = {}
    role: str = ""
    heard: float | None = None
    ahead: float = 0.0
    key: str = ""
    late: bool = False

    def __post_init__(self) -> None:
        if not (0 < len(self.sender) <= MAX_NAME and self.sender.isprintable()):  # it will stand on terminals
            raise MessageError(
                f"a sender's name has 1 to {MAX_NAME} characters, not {len(self.sender)}, and none that cannot be "
                f"printed: {self.sender!r:.80}"
            )
        if len(self.text) > MAX_TEXT:
            raise MessageError(f"a message's text has at most {MAX_TEXT} characters, this one has {len(self.text)}")
        if not (0 <= self.epoch <= MAX_NUMBER and 0 <= self.sequence <= MAX_NUMBER):
            raise MessageError(f"epoch {self.epoch} and sequence {self.sequence} must lie in 0..{MAX_NUMBER}")
        if isnan(self.issued) or isnan(self.deadline):
            raise MessageError(f"a message needs times, not issued {self.issued} with deadline {self.deadline}")

    @cached_property
    def id(self) -> str:
        """The message's identifier: `desk-3.17` is message 17 of the third life of `desk`."""
        return message_id(self.sender, self.epoch, self.sequence)

    @cached_property
    def link(self) -> Predecessors:
        """The commands before it, if it is a command."""
        return Predecessors.of(self.body, self.sequence)


def message_id(sender: str, epoch: int, sequence: int) -> str:
    """See `Message.id`."""
    return f"{sender}-{epoch}.{sequence}"


# ---- fields of a message's body besides the text, by their names on the wire


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
"""In a RELEASE: the STOPs of others, and of its sender's other lives, that it ends; see `mind.authority`."""
STOPS = "stops"
"""In telemetry: the STOPs that hold a robot, each with the seconds since it came."""
ONLY = "only"
"""In a standing command: the numbers of the standing commands before it in its stream that still count, ascending;
nothing depends on any other of them any more."""
BASES = "bases"
"""In a digest: whether its sender knows what `ONLY` means."""
MATCHED = "matched"
"""In an ASK: robots are to say whether they would obey; in their answers: whether they would."""
UNKNOWN = "unknown"
"""In an answer with the outcome `not matched`, and in one to an ASK with `matched`: the test was unknown."""
HELD = "held"
"""In an answer with the outcome `matched`: the body was asked to move, and STOP holds it still."""
NOT_STORED = "not stored"
"""At the end of an answer's fault: it was done, but could not be written, so a restart may forget it."""
WAITING = "waiting"
"""In an answer with the outcome `not matched`: the command waits for its instant, and a second answer says what came
of it."""
REFINED = {UNKNOWN: "not matched", HELD: "matched", WAITING: "not matched"}
"""Outcomes that are sent as one that every receiver knows, and a field that has their own name."""
MOTION = "motion"
"""In an answer to a STOP, and in telemetry: how the stopped body moves: m/s, and m until it is at rest; null for
unknown."""
RULE = "rule"
"""In a REPORT: the name of the rule that a robot has deactivated because of its faults."""
TIME = "time"
"""In a REPORT: the nonce of a robot's time request; in a HEARTBEAT: the same nonce, in reply."""
WHOSE = "whose"
"""In a REPORT with a nonce: the one party that is to answer with its time; without it whoever can."""
WAITED = "waited"
"""In a HEARTBEAT with a nonce: s from the arrival of the question to the time of issue, 0 if it is missing."""
TOOK = "took"
"""In a REPORT: whose time a robot has taken. The report's value is by how many s its clock was behind."""
TELEMETRY = "told"
"""What a robot tells about itself, in the answer to an inspection."""
HOPS = "hops"
"""In what a robot tells other robots: hops that it may still go, this one included."""
DRIVER = "driver"
"""In what a robot tells other robots: the operator who drives it, if one does."""
MISSED = "missed"
"""Ids of commands that never reached a robot in time."""
OTHERS = "others"
"""In an answer: other robots that have its sender's name, each by its epoch, with the seconds since it was heard."""
NAMES = "names"
"""In a DIGEST: the robots for which it speaks, with their epochs (`name_conflicts`)."""
BID, GRANTS = "bid", "grants"
"""In a REQUEST, which is for minds then: what a robot says of its bid, and a caller of its auction (`mind.auction`)."""
AUCTION = "auction"
"""In a command that a robot tells and that chooses among robots: the number of its poll, which stays the same however
often it is told."""
OUTBID = "outbid"
"""In an answer to a command that chooses among robots: who was chosen in the place of this one."""
BOUND = "bound"
"""In an answer: by how many s the robot may have missed the instant of the command at most."""
INTRODUCE = "introduce"
"""In an ASK: the robots addressed are to send a DIGEST with their names."""


class LeaseAction(StrEnum):
    """What an operator can do with the lease of a group."""

    TAKE = "take"
    """Take it if it is free, or extend one's own."""
    GIVE = "give"
    """Give it up."""
    REQUEST = "request"
    """Take it if it is free; otherwise its holder hears of the request."""
    GRANT = "grant"
    """Transfer it to another operator."""
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


def relay_body(hops: int, driver: str = "", auction: int | None = None) -> dict[str, object]:
    """The body of what a robot tells others. driver: who drives it, "" for nobody; auction: see `AUCTION`."""
    body: dict[str, object] = {HOPS: hops}
    body |= {DRIVER: driver} if driver else {}
    return body if auction is None else body | {AUCTION: auction}


def answer_body(command: str, outcome: str, value: float, fault: str) -> dict[str, object]:
    """The body of an answer. value: NaN for unknown; fault: "" for none."""
    refined_of = REFINED.get(outcome)
    body: dict[str, object] = {"command": command, "outcome": refined_of or outcome}
    body |= {"value": None if isnan(value) else value, "fault": fault or None}
    return body if refined_of is None else body | {outcome: True}


def outcome_of(body: Mapping[str, object]) -> object:
    """The outcome in an answer's body, whatever its sender has put there."""
    outcome = body.get("outcome")
    for refined, known in REFINED.items():
        if outcome == known and body.get(refined) is True:
            return refined
    return outcome


def not_stored(message: Message) -> Message:
    """The same message; but an answer that claims something which a restart must not forget says that it may."""
    body = message.body
    if message.kind is not Kind.ANSWER or body.get("outcome") not in _CLAIMS:
        return message
    fault = f"{body['fault']}; {NOT_STORED}" if body.get("fault") else NOT_STORED
    return msgspec.structs.replace(message, body={**body, "fault": fault})


def lasts(fault: str) -> bool:
    """Whether an answer with this fault, "" for none, does not say that a restart may forget what it claims."""
    return not fault.endswith(NOT_STORED)


_CLAIMS = frozenset({"stopped", "released", "matched", "not matched"})
"""Outcomes that a robot stores before it answers; the others claim nothing that must last."""


def hops_left(body: Mapping[str, object], role: str, most: int) -> int:
    """Hops that something told because of a message may go: `most`, or one less than the message had left if it came
    from a robot. role: of the message's sender."""
    hops = body.get(HOPS)
    if isinstance(hops, int) and not isinstance(hops, bool):
        return min(max(hops, 1), most) - 1
    return 0 if role == Role.ROBOT or HOPS in body else most


def is_addressed(body: Mapping[str, object], name: str) -> bool:
    """Whether a message addresses the robot of this name. A message with malformed addressing addresses no robot."""
    only, others = body.get(FOR), body.get(NOT, [])
    if not isinstance(others, list) or name in others:
        return False
    return FOR not in body or (isinstance(only, list) and name in only)


def age_of(body: Mapping[str, object]) -> float:
    """Seconds since a message was first sent; inf if the field is malformed."""
    age = body.get(AGE, 0.0)
    return float(age) if isinstance(age, float | int) and age >= 0.0 else inf
