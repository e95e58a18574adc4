"""A command on its way out: read and checked once (`Draft`), then with who would obey it now (`Prepared`); what its
sender still has to say before it goes, and what is refused whoever says so.

Whoever asks a person for a command shows a `Prepared`, and gives the answers to `Station.commit`.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from math import inf

import msgspec
import numpy as np
from numpy.typing import NDArray

from sleepcast.core.ages import duration
from sleepcast.core.records import NamedTuple
from sleepcast.language import Checked
from sleepcast.language.functions import MAX_WAIT
from sleepcast.language.instants import timed
from sleepcast.language.parts import auction_of, irreversible, timed_of, walk
from sleepcast.language.program import Program
from sleepcast.language.reader import read
from sleepcast.language.symbols import Declared
from sleepcast.language.vocabulary import Vocabulary
from sleepcast.station.roster import Index, RobotNames
from sleepcast.station.validation import (
    DEADLINE,
    EVERYBODY,
    MAX_DEADLINE,
    NO,
    UNDECIDED,
    UNKNOWN,
    YES,
    Audience,
    CommandTypeError,
    CountNeededError,
    DoubtError,
    NobodyHeardError,
    NotConfirmedError,
    Preview,
    SendPolicy,
    UnknownNameError,
    chosen,
    is_for_everybody,
)

GOOD_FOR = 1.0
"""Seconds for which who would obey is taken as it was prepared, if nothing has changed since."""


class Terms(msgspec.Struct, frozen=True):
    """How a command is meant.

    standing, deadline: see `Station.send`
    everybody: all robots, as the sender has said
    anyway: the sender insists, so robots' names refuse nothing
    at: the instant at which all obey, s of the desk's clock; None for as soon as they hear it
    undecided: even if its test is unknown on all robots
    strange: even if no robot has a name in it
    """

    standing: bool = False
    deadline: float | None = None
    everybody: bool = False
    audience: Audience = EVERYBODY
    anyway: bool = False
    undecided: bool = False
    strange: bool = False
    at: float | None = None


ONCE = Terms()


class Draft(msgspec.Struct, frozen=True, eq=False):
    """A command that was read and checked, and could be sent to somebody.

    program: of the text
    seconds: for which it is good
    vocabulary: the fleet's names, in whose slots it was checked
    meanings: what robots had learned then under the names in it
    names: changes when other names count than those in which it was checked
    command: the text as its sender wrote it, without the instant at which it is to be obeyed
    """

    checked: Checked
    program: Program
    terms: Terms
    seconds: float
    vocabulary: Vocabulary
    meanings: dict[str, Declared | None]
    names: object = None
    command: str = ""

    @property
    def text(self) -> str:
        return self.command or self.checked.text

    def sent_at(self, now: float) -> str:
        """The text that goes out at `now`, s of the desk's clock. Raises CommandTypeError."""
        return with_instant(self.text, self.terms.at, now)

    def to(self, audience: Audience) -> Draft:
        """The same to some of the robots that its sender was asked about: what names and tests come to on these alone
        is no doubt."""
        return msgspec.structs.replace(
            self, terms=msgspec.structs.replace(self.terms, audience=audience, undecided=True, strange=True)
        )


def with_instant(text: str, at: float | None, now: float) -> str:
    """The text of a command that is sent at `now` and is to be obeyed at an instant, s of the desk's clock, None for as
    soon as it is heard. Raises ReadError, and CommandTypeError for an instant that is over, or too far ahead."""
    if at is None:
        return text
    read(text)  # an error is to tell of what was written, not of what stands around it
    left = round(at - now, 6)
    if not 0.0 < left <= MAX_WAIT:
        when = f"in {duration(left)}" if left > 0.0 else f"{duration(-left)} ago" if left < 0.0 else "now"
        raise CommandTypeError(f"the instant is {when}: wanted one within the next {duration(MAX_WAIT)}")
    return timed(text, left)


class Forecast(NamedTuple):
    """Robots that will obey for certain, that will not, and of which the desk cannot say.

    nameless: how many others are expected that were never heard, whose decision is unknown
    undecided: those that will not obey, as the test has no known value there
    most: how many of them are chosen to obey, None for all
    """

    yes: Sequence[str]
    no: Sequence[str]
    unknown: Sequence[str]
    nameless: int = 0
    undecided: Sequence[str] = ()
    most: int | None = None

    @property
    def may(self) -> int:
        """How many may obey."""
        may = len(self.yes) + len(self.unknown) + self.nameless
        return may if self.most is None else min(may, self.most)


class Prepared(msgspec.Struct, frozen=True, eq=False, dict=True):
    """A command with who would obey it, before its sender has answered what is asked of him.

    preview: of all robots
    codes: of those whom it is for, see `Preview`
    places: theirs, None for all
    nameless: how many it is for that were never heard
    unknown: names in it that no robot has, of so many robots that have told all of theirs (`informed`)
    at: when it was foreseen, s of the desk's clock
    state: of the desk then
    """

    draft: Draft
    preview: Preview
    codes: NDArray[np.uint8]
    places: Index | None
    nameless: int
    unknown: tuple[str, ...]
    informed: int
    at: float
    state: object

    @cached_property
    def forecast(self) -> Forecast:
        """Who would obey, of those whom it is for."""
        yes, no, unknown, undecided = (self._named(code) for code in (YES, NO, UNKNOWN, UNDECIDED))
        wanted, bidders = self.preview.wanted, len(yes) + len(unknown) + self.nameless
        most = None if wanted is None else chosen(wanted, bidders)
        return Forecast(yes, no, unknown, self.nameless, undecided, most)

    def _named(self, code: int) -> RobotNames:
        return RobotNames(self.preview.names, self._places(code))

    def _places(self, code: int) -> Index:
        places = np.flatnonzero(self.codes == code)
        return places if self.places is None else self.places[places]

    @property
    def expected(self) -> Index:
        """The places of those who will obey for certain."""
        return self._places(YES)

    @property
    def may(self) -> int:
        """How many may obey: the number that its sender may have to say."""
        may = int(np.count_nonzero((self.codes == YES) | (self.codes == UNKNOWN))) + self.nameless
        most = self.preview.most
        return may if most is None else min(may, most)

    def despite_names(self) -> Prepared:
        """The same, whose sender insists on names that no robot has."""
        terms = msgspec.structs.replace(self.draft.terms, strange=True, undecided=True)
        draft = msgspec.structs.replace(self.draft, terms=terms)
        return msgspec.structs.replace(self, draft=draft, unknown=())

    def refuse_doubtful(self) -> None:
        """Raises DoubtError for what is hardly meant: first what the names and the text say, then that a test without a
        known value on all robots lets nobody obey."""
        if self.unknown:
            raise UnknownNameError(self.unknown, self.informed)
        if self.draft.checked.doubts:
            raise DoubtError.of(self.draft.checked)
        if not self.draft.terms.undecided:
            _refuse_unknown_test(self.draft.program, self.codes)


def _refuse_unknown_test(program: Program, codes: NDArray[np.uint8]) -> None:
    """A test without a known value on all robots that the command is for is hardly meant. codes: of them in a preview.
    Raises DoubtError."""
    test = program.test
    if test is None or not len(codes) or not (codes == UNDECIDED).all():
        return
    unknown = (part for part in walk(test.root) if part.op in ("absent", "missing"))
    names = list(dict.fromkeys(part.name for part in unknown))
    because = f", because no robot has {' or '.join(names)}" if names else ""
    robots = "the robot" if len(codes) == 1 else f"all {len(codes):,} robots"
    why = f"the test has no known value on {robots}{because}: nobody would obey"
    raise DoubtError(why, f"warning: {why}")


def validate_address(program: Program, everybody: bool, roster: int) -> None:
    """A command to all robots must be confirmed. Raises NotConfirmedError."""
    if everybody or not is_for_everybody(program):
        return
    which = "has no test" if program.test is None else "has a test that is always true"
    raise NotConfirmedError(
        f"this command {which}, so every robot that hears it would obey ({roster} on the roster): confirm that "
        "you mean all robots (--all), or put a test before it, as in (WHEN (IN bravo) ...)"
    )


def validate_count(program: Program, may: int, roster: int, count: int | None, policy: SendPolicy) -> None:
    """A command to many robots, or one that cannot be undone, needs their number; so does one with a function that the
    desk does not know, since some robot may have it. may: robots that might obey, of a roster of so many. Raises
    CountNeededError, also for a number that was said and is not the right one, and NobodyHeardError where there is
    nobody to be counted."""
    why = _for_good(program) if policy.irreversible else ""
    many = policy.above is not None and may > policy.above
    if not roster and (why or count is not None):
        raise NobodyHeardError
    if count == may or (count is None and not many and not (why and may)):
        return
    if not why:
        why = f"this is for more than {policy.above} robots" if many else "the count does not match"
    raise CountNeededError(may, why, count)


def _for_good(program: Program) -> str:
    """Why a command can or may not be undone, "" if it can."""
    if form := irreversible(program.root):
        return f"{form} cannot be undone"
    strange = next((part.name for part in walk(program.root) if part.op == "missing"), "")
    return f"no robot has told of a function {strange}, which perhaps cannot be undone" if strange else ""


def validate_type(program: Program, standing: bool, deadline: float | None) -> float:
    """The seconds for which a command is good. Raises CommandTypeError."""
    if not standing:
        seconds = _usual_deadline(program) if deadline is None else deadline
        if not 0.0 < seconds <= MAX_DEADLINE:
            raise CommandTypeError(
                f"a deadline lies more than 0 and at most {duration(MAX_DEADLINE)} ahead, not {seconds:g} s"
            )
        return seconds
    if (auction := auction_of(program.root)) is not None:
        raise CommandTypeError(f"{auction.name} cannot be standing: who is chosen is a matter of the moment")
    if timed_of(program.root) is not None:
        raise CommandTypeError("AFTER-ISSUE cannot be standing: whoever comes later has missed the instant")
    if deadline is not None:
        raise CommandTypeError("a standing command has no deadline: it is sent until every robot has it")
    joins = any(part.op == "act" and part.name == "join" for part in walk(program.root))
    if joins and program.test is not None:
        raise CommandTypeError(
            "a command with a test and a JOIN cannot be standing, because which robots match changes with time: "
            "send it as a one-shot command"
        )
    return inf


def _usual_deadline(program: Program) -> float:
    """The seconds for which a one-shot command is good unless it is said."""
    auction = auction_of(program.root)
    if auction is None:
        return DEADLINE
    from sleepcast.mind.auction import good_for  # few commands choose among robots

    return good_for(auction)
