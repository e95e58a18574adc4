"""What is checked before a command is sent: for whom it is, of which type it is, and how many are meant to obey."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf
from typing import NamedTuple

import numpy as np

from sleepcast.channel.message import FOR, NOT
from sleepcast.core.errors import MisuseError
from sleepcast.language import Checked
from sleepcast.language.parts import irreversible, walk
from sleepcast.language.program import Program
from sleepcast.station.preview import is_for_everybody
from sleepcast.station.roster import Index, Roster

MAX_LISTED = 4_096
"""Names in one message: some forty datagrams; for more robots, use a test."""


class AudienceError(MisuseError):
    """Robots that cannot be addressed by name."""


class Audience(NamedTuple):
    """only: these robots, None for all; but: all except these."""

    only: Sequence[str] | None = None
    but: Sequence[str] | None = None

    @property
    def named(self) -> bool:
        """Whether it is for robots that are named, so that none is meant by accident."""
        return self.only is not None

    def body(self) -> dict[str, object]:
        """As it stands in a message. Raises AudienceError for more names than fit."""
        found: dict[str, object] = {}
        for key, names in ((FOR, self.only), (NOT, self.but)):
            if names is not None:
                if len(names) > MAX_LISTED:
                    raise AudienceError(f"{len(names)} robots are too many to be named: at most {MAX_LISTED}")
                found[key] = list(names)
        return found

    def places(self, roster: Roster) -> Index | None:
        """The places of those on the roster that are meant, ascending; None for all. Raises UnknownRobotError."""
        if self.only is None and self.but is None:
            return None
        listed = range(len(roster)) if self.only is None else map(roster.place, self.only)
        return np.array(sorted(set(listed) - set(map(roster.place, self.but or ()))), np.intp)


EVERYBODY = Audience()


DEADLINE = 5.0
"""Seconds for which a one-shot command is good unless it gives another time: enough for repairs on a bad radio, too
short for a command to take effect when it has been forgotten."""
MAX_DEADLINE = 3600.0
"""Seconds for which a one-shot command may be good at most; what must hold longer is a rule."""
MOST_DOUBTS = 5
"""Of one text that are shown when it is refused."""


class AddressError(MisuseError):
    """A command to all robots that was not confirmed."""


class CommandTypeError(MisuseError):
    """A command sent as the wrong sort (one-shot or standing), or with an impossible deadline."""


class NobodyHeardError(MisuseError):
    """A command whose robots are to be counted, where none are known."""

    def __init__(self) -> None:
        super().__init__(
            "no robot was heard, so the number that may obey is unknown, and nothing was sent: is a robot up on this "
            "channel, in this fleet, with these keys?"
        )


class CountNeededError(MisuseError):
    """A command whose sender must say how many robots are meant. may: how many may obey; why: the reason for asking."""

    def __init__(self, may: int, why: str, count: int | None) -> None:
        self.may, self.why = may, why
        said = "say how many are meant" if count is None else f"{count} was said"
        right = f"Send it with that number if it is right (--count {may})" if may else "Nothing was sent"
        super().__init__(f"{why}: {may or 'nobody'} may obey, {said}. {right}")


class UnknownNameError(MisuseError):
    """A text with names that no robot that has sent telemetry has. why: the same in a sentence."""

    def __init__(self, names: Sequence[str], robots: int) -> None:
        self.why = f"none of the {robots} robots that have sent telemetry has {' or '.join(names)}"
        super().__init__(f"{self.why}, so nothing was sent. Send it as it is with --anyway")


class DoubtError(MisuseError):
    """A text that is hardly meant as it stands. why: the first doubt, on one line; shown: the doubts, with carets."""

    def __init__(self, checked: Checked) -> None:
        self.why = checked.doubts[0].message
        self.shown = "\n".join(doubt.render(checked.text) for doubt in checked.doubts[:MOST_DOUBTS])
        super().__init__(f"{self.shown}\nNothing was sent: change it, or say that it is meant so (--anyway)")


@dataclass(frozen=True, slots=True)
class SendPolicy:
    """When a desk asks how many are meant. above: more than so many that may obey, None for never; irreversible: a form
    that cannot be undone. strict: whether it refuses what is only doubtful (warnings); known: how many robots have sent
    all their names, where it refuses other names, 0 where it does not. doubts: whether it asks once more for what is
    hardly meant (see `Checked.doubts`)."""

    above: int | None = None
    irreversible: bool = False
    strict: bool = False
    known: int = 0
    doubts: bool = False


@dataclass(frozen=True, slots=True)
class Draft:
    """A command before it is sent: see `Station.send`."""

    text: str
    standing: bool = False
    deadline: float | None = None
    everybody: bool = False
    count: int | None = None
    audience: Audience = EVERYBODY
    confirmed: bool = False


class Forecast(NamedTuple):
    """Robots that will obey for certain, that will not, and of which the desk cannot say. nameless: how many others
    are expected that were never heard, whose decision is unknown."""

    yes: Sequence[str]
    no: Sequence[str]
    unknown: Sequence[str]
    nameless: int = 0

    @property
    def may(self) -> int:
        """How many may obey."""
        return len(self.yes) + len(self.unknown) + self.nameless


class Validated(NamedTuple):
    """What a command says besides its text. seconds: for which it is good; expected: the places of those who will obey
    for certain; places: of those for whom it is, None for all."""

    standing: bool
    seconds: float
    expected: Index
    places: Index | None
    body: dict[str, object]


def validate_address(program: Program, everybody: bool, roster: int) -> None:
    """A command to all robots must be confirmed. Raises AddressError."""
    if everybody or not is_for_everybody(program):
        return
    which = "has no test" if program.test is None else "has a test that is always true"
    raise AddressError(
        f"this command {which}, so every robot that hears it would obey ({roster} on the roster): confirm that "
        "you mean all robots (--all), or put a test before it, as in (WHEN (IN bravo) ...)"
    )


def validate_count(program: Program, may: int, roster: int, count: int | None, caution: SendPolicy) -> None:
    """A command to many robots, or one that cannot be undone, needs their number. may: robots that might obey, of a
    roster of so many. Raises CountNeededError, also for a number that was said and is not the right one, and
    NobodyHeardError where there is nobody to be counted."""
    form = irreversible(program.root) if caution.irreversible else ""
    many = caution.above is not None and may > caution.above
    if not roster and (form or count is not None):
        raise NobodyHeardError
    if count == may or (count is None and not many and not (form and may)):
        return
    if form:
        raise CountNeededError(may, f"{form} cannot be undone", count)
    why = f"this is for more than {caution.above} robots" if many else "the desk counts otherwise"
    raise CountNeededError(may, why, count)


def validate_type(program: Program, standing: bool, deadline: float | None) -> float:
    """The seconds for which a command is good. Raises SortError."""
    if not standing:
        seconds = DEADLINE if deadline is None else deadline
        if not 0.0 < seconds <= MAX_DEADLINE:
            raise CommandTypeError(
                f"a deadline lies more than 0 and at most {MAX_DEADLINE:g} s ahead, not {seconds:g} s"
            )
        return seconds
    if deadline is not None:
        raise CommandTypeError("a standing command has no deadline: it is sent until every robot has it")
    joins = any(part.op == "act" and part.name == "join" for part in walk(program.root))
    if joins and program.test is not None:
        raise CommandTypeError(
            "a command with a test and a JOIN cannot be standing, because which robots match changes with time: "
            "send it as a one-shot command"
        )
    return inf
