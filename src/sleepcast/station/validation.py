"""Who would obey a command by the robots' latest telemetry (the preview), for whom it is, and what may be refused or
asked before it is sent; `prepared` does that.

For the preview only the command's top-level test is evaluated, on a copy of each robot's latest telemetry, and nothing
it could do is done. What the desk cannot know (chance, what a robot's own function would say, news too old) makes a
robot `unknown` with the reason, unless the rest of the test decides without it: in `(AND (> fuel 50%) (PROB 0.5))` an
empty tank is a certain no.

The desk never touches a mind, it only asks. A dictionary of nodes by name will do; minds that answer for many robots at
once (`ManyMinds`) save it a million questions.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Mapping, Sequence
from copy import copy
from functools import cached_property
from typing import Protocol, runtime_checkable

import msgspec
import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.message import FOR, NOT
from sleepcast.channel.message_batch import NameIndex
from sleepcast.columns.telemetry import BulkTelemetry, Key, KnownSymbols, TelemetryTable
from sleepcast.columns.values import Mask, Rows, ValueColumns
from sleepcast.core.errors import MisuseError
from sleepcast.core.records import NamedTuple
from sleepcast.language import Checked, check
from sleepcast.language.evaluate import is_true
from sleepcast.language.explain import Explanation
from sleepcast.language.parts import Part, auction_of, walk
from sleepcast.language.program import Program
from sleepcast.language.rehearsal import ACTION, CHANCE
from sleepcast.language.symbols import Declared
from sleepcast.language.vocabulary import FROZEN, SLEEPING, Variable, Vocabulary
from sleepcast.station.roster import Index, Roster, Seconds

MAX_LISTED = 4_096
"""Names in one message: some forty datagrams; for more robots, use a test."""


class AudienceError(MisuseError):
    """Robots that cannot be addressed by name."""


def robot_names(given: Sequence[str] | None) -> tuple[str, ...] | None:
    """The robots that a caller names; a text is the name of one, not a list of letters. Raises AudienceError for what
    is no name."""
    if given is None:
        return None
    names: tuple[object, ...]
    try:
        names = (given,) if isinstance(given, str | bytes) else tuple(given)
    except TypeError:  # not all that has a way to give its items has any
        names = (given.item() if hasattr(given, "item") else given,)
    for each in names:
        if not isinstance(each, str):
            raise AudienceError(f'{each!r:.80} is no name of a robot: wanted names, such as ["scout1", "scout2"]')
    return tuple(map(str, names))  # NumPy's texts are texts


class Audience(NamedTuple):
    """only: these robots, None for all; but: all except these."""

    only: Sequence[str] | None = None
    but: Sequence[str] | None = None

    @classmethod
    def of(cls, only: Sequence[str] | None = None, but: Sequence[str] | None = None) -> Audience:
        """As a caller names them, see `robot_names`."""
        return cls(robot_names(only), robot_names(but))

    @property
    def named(self) -> bool:
        """Whether it is for robots that are named, so that none is meant by accident."""
        return self.only is not None

    def body(self) -> dict[str, object]:
        """As it stands in a message. Raises AudienceError for more names than fit."""
        body: dict[str, object] = {}
        for key, names in ((FOR, self.only), (NOT, self.but)):
            if names is not None:
                if len(names) > MAX_LISTED:
                    raise AudienceError(f"{len(names)} robots are too many to be named: at most {MAX_LISTED}")
                body[key] = list(names)
        return body

    def places(self, roster: Roster) -> Index | None:
        """The places of those on the roster that are meant, ascending; None for all there are. Raises
        UnknownRobotError."""
        if self.only is None and self.but is None:
            return roster.everybody
        everybody = range(len(roster)) if roster.everybody is None else roster.everybody.tolist()
        listed = everybody if self.only is None else map(roster.place, self.only)
        return np.array(sorted(set(listed) - set(map(roster.place, self.but or ()))), np.intp)


EVERYBODY = Audience()


DEADLINE = 5.0
"""Seconds for which a one-shot command is good unless it gives another time: enough for repairs on a bad radio, too
short for a command to take effect when it has been forgotten."""
MAX_DEADLINE = 3600.0
"""Seconds for which a one-shot command may be good at most; what must hold longer is a rule."""
MAX_DOUBTS = 5
"""Of one text that are shown when it is refused."""


class NotConfirmedError(MisuseError):
    """A command to all robots that was not confirmed."""


class CommandTypeError(MisuseError):
    """A command sent as the wrong type (one-shot or standing), or with an impossible deadline."""


class NobodyHeardError(MisuseError):
    """A command whose robots are to be counted, where none are known."""

    def __init__(self) -> None:
        super().__init__(
            "no robot was heard, so the number that may obey is unknown, and nothing was sent: is a robot up on this "
            "channel, in this fleet, with these keys?"
        )


class CountNeededError(MisuseError):
    """A command whose sender must say how many robots are meant.

    may: how many may obey
    why: the reason for asking
    """

    def __init__(self, may: int, why: str, count: int | None) -> None:
        self.may, self.why = may, why
        said = "say how many are meant" if count is None else f"you gave {count}"
        right = f"Send it with that number if it is right (--count {may})" if may else "Nothing was sent"
        super().__init__(f"{why}: {may or 'nobody'} may obey, {said}. {right}")


class DoubtError(MisuseError):
    """A text that is probably a mistake.

    why: the first doubt, on one line
    shown: the doubts, with carets
    """

    def __init__(self, why: str, shown: str) -> None:
        self.why, self.shown = why, shown
        super().__init__(f"{self.shown}\nNothing was sent: change it, or say that it is meant so (--anyway)")

    @classmethod
    def of(cls, checked: Checked) -> DoubtError:
        """About what the checker doubts."""
        shown = "\n".join(doubt.render(checked.text) for doubt in checked.doubts[:MAX_DOUBTS])
        return cls(checked.doubts[0].message, shown)


class UnknownNameError(DoubtError):
    """A text with names that no robot that has sent telemetry has."""

    def __init__(self, names: Sequence[str], robots: int) -> None:
        why = f"none of the {robots} robots that have sent telemetry has {' or '.join(names)}"
        super().__init__(why, f"warning: {why}")
        self.args = (f"{why}, so nothing was sent. Send it as it is with --anyway",)


class SendPolicy(msgspec.Struct, frozen=True):
    """When a desk asks how many are meant.

    above: more than so many that may obey, None for never
    irreversible: a form that cannot be undone
    strict: whether it refuses what is only doubtful (warnings)
    doubts: whether it asks once more for what is hardly meant (see `Prepared.refuse_doubtful`)
    """

    above: int | None = None
    irreversible: bool = False
    strict: bool = False
    doubts: bool = False


# ---- minds, as the desk asks them


class SlotValues(Protocol):
    """Numbers by slot."""

    def __getitem__(self, slot: int, /) -> float: ...


class Telemetry(Protocol):
    """A robot's telemetry. values: its numbers by slot, SI, NaN unknown. groups: keys of those it is in."""

    @property
    def name(self) -> str: ...

    @property
    def values(self) -> SlotValues: ...

    @property
    def groups(self) -> frozenset[str]: ...

    @property
    def stopped(self) -> bool: ...


class ObservedMind(Telemetry, KnownSymbols, Protocol):
    """One robot's mind, as far as the desk is concerned."""

    def heard(self) -> Iterable[str]:
        """Every learned name as written."""

    def why(self, command: str | None = None) -> Explanation:
        """How the robot evaluated a command (by its id; None: the last one)."""


Minds = Mapping[str, ObservedMind]
"""The minds of a fleet by the robots' names."""


@runtime_checkable
class NamesOfAll(Protocol):
    """Minds of which one can ask at once what any of them has learned."""

    def declared(self, key: str) -> Declared | None:
        """What any robot has learned under this key, or None."""

    def heard(self) -> Iterable[str]:
        """Every name that any robot has learned, as written."""


@runtime_checkable
class ManyMinds(NamesOfAll, Protocol):
    """Minds, in the order of the roster, that answer for many robots at once."""

    @property
    def names(self) -> Iterable[str]: ...

    @property
    def telemetry(self) -> BulkTelemetry: ...


class FleetNames:
    """The names that a fleet knows: its vocabulary, and what any of its minds has learned (a `Names` for the checker).

    Slots of new user variables are given out in a copy of the vocabulary: checking a text, keystroke by keystroke,
    leaves nothing behind in the robots' own tables.
    """

    def __init__(self, vocabulary: Vocabulary, minds: Minds) -> None:
        self.vocabulary = copy(vocabulary)
        self.vocabulary.user_slots = dict(vocabulary.user_slots)
        self._minds, self._of_all = minds, minds if isinstance(minds, NamesOfAll) else None

    def declared(self, key: str) -> Declared | None:
        """What the first mind that knows `key` has learned under it, or None."""
        if self._of_all is not None:
            return self._of_all.declared(key)
        for mind in self._minds.values():
            declared = mind.declared(key)
            if declared is not None:
                return declared
        return None

    def heard(self) -> Iterable[str]:
        """Every name that some mind has learned, each once."""
        if self._of_all is not None:
            return self._of_all.heard()
        return {name: None for mind in self._minds.values() for name in mind.heard()}

    def check(self, text: str) -> Checked:
        """See `lint.check`; what was checked in the same names, for other robots of the same `anew` vocabulary, is not
        checked again. Raises ReadError."""
        known, key = self.vocabulary.common(_Checks), (text, tuple(self.vocabulary.user_slots))
        if known is None:
            return check(text, self)
        asked, checked = known.get(key, (None, None))
        if asked is None or checked is None or not asked.like(self):
            asked = _AnsweredNames(self)
            checked = check(text, asked)
            asked.forget_whom()
            if len(known) >= MAX_CHECKED:
                known.clear()
            known[key] = asked, checked
        return checked


class _AnsweredNames:
    """These names, and what they were asked: whoever asks others the same knows whether all would come out as here."""

    def __init__(self, names: FleetNames) -> None:
        self.vocabulary, self._names = names.vocabulary, names
        self._declared: dict[str, Declared | None] = {}
        self._heard: list[str] | None = None

    def declared(self, key: str) -> Declared | None:
        """See `FleetNames`."""
        if key not in self._declared:
            self._declared[key] = self._names.declared(key)
        return self._declared[key]

    def heard(self) -> Iterable[str]:
        """See `FleetNames`."""
        if self._heard is None:
            self._heard = list(self._names.heard())
        return self._heard

    def forget_whom(self) -> None:
        """Keep what was said, not who said it."""
        del self._names

    def like(self, names: FleetNames) -> bool:
        """Whether others would have said the same."""
        heard = self._heard is None or self._heard == list(names.heard())
        return heard and all(names.declared(key) == known for key, known in self._declared.items())


class _Checks(dict[tuple[str, tuple[str, ...]], tuple[_AnsweredNames, Checked]]):
    """What was checked, by the text and by the user variables that had slots."""


MAX_CHECKED = 256
"""Of these, at most."""


# ---- who would obey


TEST_UNKNOWN = "its test has no known value there, so it would not obey"
NEVER_HEARD = "it has sent no telemetry yet"
STALE = "its last news is too old"
COMMANDED = "it was commanded since its last news"
COST_UNKNOWN = "its cost has no known value there, so it would not bid"


NO, YES, UNKNOWN, UNDECIDED, NOBODY = range(5)


class Preview(msgspec.Struct, frozen=True, eq=False, dict=True):
    """Who would obey: certainly (`yes`), certainly not (`no`), and of whom the desk cannot say (`unknown`), those among
    them whose test is itself unknown.

    codes: NO, YES, UNKNOWN or, where the test is unknown, UNDECIDED of each robot by its place, uint8; NOBODY at a
        place without one
    reason: why a robot is unknown, uint8, which of `listed` from 1
    names: of the robots, by place
    everybody: the command has no test, or one that is true whatever the robot
    oldest: the age in s of the oldest news that a yes or no rests on (0 if none does)
    nameless: how many robots there are besides that were never heard, all of them unknown
    wanted: how many are chosen of those who would bid, at least and at most; None for a command that chooses nobody
    """

    codes: NDArray[np.uint8]
    reason: NDArray[np.uint8]
    listed: tuple[str, ...]
    names: NameIndex
    everybody: bool
    oldest: float
    nameless: int = 0
    wanted: tuple[int, int] | None = None

    @property
    def most(self) -> int | None:
        """How many may obey of those who would bid, None for a command that chooses nobody."""
        bidders = int(np.count_nonzero(np.isin(self.codes, (YES, UNKNOWN)))) + self.nameless
        return None if self.wanted is None else chosen(self.wanted, bidders)

    def without(self, robots: Index, why: str) -> Preview:
        """The same, but for the robots at these places, of which the desk cannot say for another reason."""
        codes, reason = self.codes.copy(), self.reason.copy()
        codes[robots], reason[robots] = UNKNOWN, len(self.listed) + 1
        return msgspec.structs.replace(self, codes=codes, reason=reason, listed=(*self.listed, why))

    def count(self, code: int) -> int:
        """How many robots there are of this code."""
        if code == UNKNOWN:
            return int(np.count_nonzero(self._open)) + self.nameless
        return int(np.count_nonzero(self.codes == code))

    @property
    def _open(self) -> NDArray[np.bool_]:
        """Of which robots the desk cannot say."""
        return np.isin(self.codes, (UNKNOWN, UNDECIDED))

    @cached_property
    def yes(self) -> tuple[str, ...]:
        """The robots that would obey."""
        return self._named(YES)

    @cached_property
    def no(self) -> tuple[str, ...]:
        """The robots that would not."""
        return self._named(NO)

    @cached_property
    def unknown(self) -> Mapping[str, str]:
        """The robots of which the desk cannot say, each with the reason."""
        places = np.flatnonzero(self._open).tolist()
        return {self.names[place]: self.listed[self.reason[place] - 1] for place in places}

    @property
    def reasons(self) -> dict[str, int]:
        """Why robots are unknown, and how many for each reason, the most frequent first."""
        counts = np.bincount(self.reason[self._open], minlength=len(self.listed) + 1)[1:].tolist()
        reasons = Counter({reason: count for reason, count in zip(self.listed, counts, strict=True) if count})
        if self.nameless:
            reasons[NEVER_HEARD] += self.nameless
        return dict(reasons.most_common())

    def _named(self, code: int) -> tuple[str, ...]:
        return tuple(self.names[place] for place in np.flatnonzero(self.codes == code).tolist())


def preview(
    program: Program, roster: Roster, table: TelemetryTable, now: float, stale_after: float, since: Seconds
) -> Preview:
    """Who would obey `program`.

    table: telemetry by place on the roster, which decides nothing where it is older than `stale_after` s at `now`, or
        from before the robot was last commanded
    since: when that was, by place
    """
    count = len(since)
    times = roster.reported[:count].copy()
    recent, current = now - times <= stale_after, times >= since
    fresh = recent & current
    codes, reason = np.full(count, UNKNOWN, np.uint8), np.where(np.isfinite(times), np.uint8(2), np.uint8(1))
    reason[recent & ~current] = 3
    listed, oldest = [NEVER_HEARD, STALE, COMMANDED], now
    obstacle, test = _obstacle(program), program.test
    if test is None:
        codes[fresh] = YES
    elif obstacle:
        reason[fresh] = len(listed) + 1
        listed.append(obstacle)
    else:
        robots = np.flatnonzero(fresh)
        values, why, reasons = table.values(test, robots, now, times)
        known = why == 0
        undecided = known & np.isnan(values)
        codes[robots] = np.where(known, np.where(undecided, UNDECIDED, is_true(values)), UNKNOWN)
        listed.append(TEST_UNKNOWN)
        reason[robots] = np.where(undecided, np.uint8(len(listed)), why + np.uint8(len(listed)))
        listed += reasons
        oldest = float(np.min(times[robots][known], initial=now))
    auction, everybody = auction_of(program.root), is_for_everybody(program)
    if auction is not None:
        _look_at_bids(program, table, codes, reason, listed, (now, times))
    if roster.everybody is not None:
        nobody = np.ones(count, np.bool_)
        nobody[roster.everybody] = False
        codes[nobody] = NOBODY
    wanted = None if auction is None else (auction.least, auction.most)
    return Preview(codes, reason, tuple(listed), roster.names, everybody, now - oldest, roster.nameless, wanted)


def chosen(wanted: tuple[int, int], bidders: int) -> int:
    """How many may obey a command that chooses so many, at least and at most, if so many may bid."""
    least, most = wanted
    return min(most, bidders) if bidders >= least else 0


def chosen_in_words(most: int) -> str:
    """The same for people."""
    return f"{most} at most will obey" if most else "too few for any to obey"


def _look_at_bids(
    program: Program,
    table: TelemetryTable,
    codes: NDArray[np.uint8],
    reason: NDArray[np.uint8],
    listed: list[str],
    at: tuple[float, Seconds],
) -> None:
    """Of those whose test is true, let none bid that is held still, and none whose cost is unknown. at: the time, and
    when each robot told of itself, s."""
    robots = np.flatnonzero(codes == YES)
    columns, rows = table.latest(), Rows.of(robots)
    held = table.stopped(robots)
    for slot in (SLEEPING, FROZEN):
        held |= columns.column(slot, rows) > 0.0
    codes[robots[held]] = NO
    if (cost := program.bid_cost) is None:
        return
    robots = robots[~held]
    values, why, reasons = table.values(cost, robots, *at)
    unknown, unsure = (why == 0) & np.isnan(values), why > 0
    if CHANCE in reasons:  # whatever it is, it will be known
        unsure &= why != reasons.index(CHANCE) + 1
    codes[robots[unknown]], codes[robots[unsure]] = UNDECIDED, UNKNOWN
    listed.append(COST_UNKNOWN)
    reason[robots[unknown]], reason[robots[unsure]] = len(listed), why[unsure] + np.uint8(len(listed))
    listed += reasons


_DEEDS = frozenset({"set_user", "write", "defvar", "store", "act"})
_PERHAPS_DEEDS = _DEEDS | {"host", "call", "fetch"}


def _obstacle(program: Program) -> str:
    """Why the test is unknown on every robot, or an empty text."""
    test = program.test
    if test is None:
        return ""
    if any(part.op in _DEEDS for part in walk(test.root)):
        return ACTION
    for part in walk(program.root):
        if part.form is test.form:
            break
        if part.op in _PERHAPS_DEEDS:
            return "it does something before its test"
    return ""


_STRICT = frozenset({"const", "var", "linked", "absent", "pure", "and", "or", "local", "let", "progn"})
"""Parts whose value can only become unknown, never another, when what they read becomes unknown."""


_TESTS = frozenset({"or", "known", "in", "prob"})
"""Special forms that are no more than tests."""


def is_predicate_only(program: Program) -> bool:
    """Whether this is a test and nothing else. Sent as it is, all robots would evaluate it and do nothing; a desk that
    is asked about it asks for which robots it holds."""
    root = program.root
    if program.test is not None or program.acts:
        return False
    return root.op in _TESTS or (root.op == "pure" and root.function.rule in ("compare", "truth"))


def is_for_everybody(program: Program) -> bool:
    """Whether every robot that hears the command would obey: it has no test, or one that is true of nothing known,
    or one that the declared ranges of its variables make always true."""
    if auction_of(program.root) is not None:
        return False
    test = program.test
    return test is None or _always(test.root) or _true_of_nothing_known(test)


def _true_of_nothing_known(test: Program) -> bool:
    if any(part.op not in _STRICT for part in walk(test.root)):
        return False
    values, reason, _ = _NothingTold().values(test, np.zeros(1, np.intp))
    return bool(reason[0] == 0 and is_true(values[0]))


class _NothingTold(TelemetryTable):
    """The telemetry of one robot that knows nothing of itself."""

    def latest(self) -> ValueColumns:
        return ValueColumns(1, ())

    def divide(self, rows: Rows, key: Callable[[KnownSymbols], Key]) -> list[tuple[Key, Rows, Mask | None]]:
        """There is nobody to be asked."""
        return []


_MIRRORED = {"<": ">", "<=": ">=", ">": "<", ">=": "<="}


def _always(part: Part) -> bool:
    """Whether declared ranges alone make `part` true on every robot that knows its variables."""
    if part.op in ("and", "or"):
        holds = map(_always, part.parts)
        return all(holds) if part.op == "and" else any(holds)
    if part.op == "const":
        return part.number < 0.0 or part.number > 0.0
    if part.op != "pure" or part.name not in _MIRRORED or len(part.parts) != 2:
        return False
    (left, right), name = part.parts, part.name
    if left.op == "const":
        left, right, name = right, left, _MIRRORED[name]
    if right.op != "const" or not isinstance(left.data, Variable):
        return False
    low, high, limit = left.data.quantity.low, left.data.quantity.high, right.number
    return {"<": high < limit, "<=": high <= limit, ">": low > limit, ">=": low >= limit}[name]
