"""What became of each command: how many robots matched, did not match, could not tell, met a fault, or were not heard.

Silence is never taken for consent: a robot that was on the roster when the command went out and has not spoken
is silent, with the time at which it was last heard.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import cached_property
from math import inf, nan
from typing import TYPE_CHECKING

import msgspec
import numpy as np
from numpy.typing import NDArray

from sleepcast.channel import Kind
from sleepcast.channel.message import NOT_STORED, natural_order
from sleepcast.core.ages import ago
from sleepcast.core.angles import mean_direction, quantile
from sleepcast.core.errors import SleepcastError, and_more, printable
from sleepcast.core.units import value_in_words
from sleepcast.language import Checked
from sleepcast.station.rest import RestAccount
from sleepcast.station.roster import Index, Seconds, of_robots
from sleepcast.station.sent import (
    FAULT,
    HELD_BY_STOP,
    MATCHED,
    NOT_MATCHED,
    OUTCOMES,
    SILENT,
    TEST_UNKNOWN,
    WAITS,
    Answer,
    Answers,
    Command,
    Outcome,
    nameless,
    silent,
)

if TYPE_CHECKING:
    from sleepcast.mind.auction import AuctionStatus

COUNTED = ("matched", "held", "not_matched", "unknown", "fault", "silent")
"""What an account counts, as its attributes; held is among matched."""
SHOWN = 5
"""Silent robots named in a sentence; more are counted."""
SORTED = 1_000
"""Of which those are chosen, in the order in which people look for names."""
BINS = 10
"""Bars of a histogram of what was answered."""


class ValueSummary(msgspec.Struct, frozen=True):
    """So many values, the least, their mean, and the greatest of them. Of angles see `core.angles`; NaN where they have
    no mean direction."""

    count: int
    least: float
    mean: float
    greatest: float


class Histogram(msgspec.Struct, frozen=True):
    """How many values lie in each of `BINS` bars of equal width from `low` to `high`, the last one with its end."""

    low: float
    high: float
    counts: tuple[int, ...]


class Account(msgspec.Struct, frozen=True, eq=False, dict=True):
    """What became of one command, names in the order of the roster. For a STOP, matched means that the robot says it is
    stopped, and `rest` tells who of them is at rest; for a RELEASE, that it is not stopped any more; for a question,
    that it has answered. held: those among the matched that were to move, and did not, because STOP holds them.
    unknown: their test was neither true nor false. not_stored: those that a restart may make forget what they
    answered, wherever else they are counted. waiting: those that have the command and wait for its instant; what they
    answer after that takes the place of this.

    codes: by place, as in `Answers.codes`
    addressed: so many of them, from the first on, count as silent
    heard: when each was last heard (s of the desk's clock, -inf: never)
    only, size, conflicts: see `Command`
    auction: how that of a command stands which chooses among robots
    instant: when robots that wait are to obey, s of the desk's clock; None for a command that waits for nothing
    bound: by how many s a robot may have missed the instant at most, by what they answered; NaN while none has
    unit, angles: of what was asked for: in which people read it, and whether it is an angle
    """

    command: str
    text: str
    now: float
    codes: NDArray[np.uint8]
    addressed: int
    heard: Seconds
    answers: Answers
    only: Index | None = None
    size: int = 0
    rest: RestAccount | None = None
    conflicts: Mapping[str, str] = {}
    auction: AuctionStatus | None = None
    unit: str = ""
    angles: bool = False
    instant: float | None = None
    bound: float = nan

    @cached_property
    def counts(self) -> list[int]:
        """How many robots there are of each code."""
        counts: list[int] = np.bincount(self.codes, minlength=len(OUTCOMES) + 1).tolist()
        return counts

    @property
    def n_matched(self) -> int:
        return self.counts[MATCHED] + self.counts[HELD_BY_STOP]

    @property
    def n_held(self) -> int:
        return self.counts[HELD_BY_STOP]

    @property
    def n_not_matched(self) -> int:
        return self.counts[NOT_MATCHED]

    @property
    def n_unknown(self) -> int:
        return self.counts[TEST_UNKNOWN]

    @property
    def n_waiting(self) -> int:
        return self.counts[WAITS]

    @property
    def n_fault(self) -> int:
        return self.counts[FAULT]

    @property
    def asked(self) -> int:
        """How many robots of the roster it was for."""
        return self.addressed if self.only is None else len(self.only)

    @cached_property
    def _silent(self) -> NDArray[np.bool_]:
        return silent(self.codes, self.addressed, self.only)

    @cached_property
    def n_silent(self) -> int:
        """How many of those for whom it was have not answered, named or not."""
        return int(np.count_nonzero(self._silent)) + self.n_nameless

    @cached_property
    def n_nameless(self) -> int:
        """How many silent robots have unknown names."""
        return nameless(self.size, self.codes, self.addressed, self.only)

    @property
    def total(self) -> int:
        """How many robots it tells of."""
        return len(self.codes) - self.counts[SILENT] + self.n_silent

    @property
    def scope(self) -> str:
        """Among whom silence was counted: `of 100 robots`, or, where nobody has said how many there are, `of 64 robots
        heard so far`."""
        return of_robots(self.total, self.size > 0)

    @cached_property
    def matched(self) -> tuple[str, ...]:
        return self._named(MATCHED, HELD_BY_STOP)

    @cached_property
    def held(self) -> tuple[str, ...]:
        return self._named(HELD_BY_STOP)

    @cached_property
    def not_matched(self) -> tuple[str, ...]:
        return self._named(NOT_MATCHED)

    @cached_property
    def unknown(self) -> tuple[str, ...]:
        return self._named(TEST_UNKNOWN)

    @cached_property
    def waiting(self) -> tuple[str, ...]:
        """The robots that wait for the instant of the command."""
        return self._named(WAITS)

    @cached_property
    def fault(self) -> tuple[str, ...]:
        return self._named(FAULT)

    @cached_property
    def not_stored(self) -> tuple[str, ...]:
        """The robots that have done what they answered, but could not store it: a restart may forget it."""
        return tuple(self.answers.names[place] for place in np.flatnonzero(self.answers.not_stored).tolist())

    @property
    def n_not_stored(self) -> int:
        return len(self.not_stored)

    @cached_property
    def flawed(self) -> dict[str, str]:
        """What went wrong on robots that count as matched, besides that: a body that did not rest, for instance."""
        obeyed = np.isin(self.codes, (MATCHED, HELD_BY_STOP)) & self.answers.faulted[: len(self.codes)]
        faults = {
            self.answers.names[place]: self.answers.fault(place) or "" for place in np.flatnonzero(obeyed).tolist()
        }
        return {name: fault for name, fault in faults.items() if fault != NOT_STORED}

    @cached_property
    def silent(self) -> tuple[str, ...]:
        return tuple(self.answers.names[place] for place in np.flatnonzero(self._silent).tolist())

    @property
    def last_heard(self) -> dict[str, float | None]:
        """Of each silent robot, the s of the desk's clock at which it last said anything, None if it never did."""
        return {name: self.heard_at(name) for name in self.silent}

    @property
    def faults(self) -> dict[str, str]:
        """The error of each robot with a fault."""
        return {name: self.answers[name].fault or "" for name in self.fault}

    @cached_property
    def values(self) -> ValueSummary | None:
        """The values in the answers, SI; None if there was none."""
        known = self.answers.known
        if not len(known):
            return None
        if self.angles:
            return ValueSummary(len(known), quantile(known, 0.0), mean_direction(known), quantile(known, 1.0))
        return ValueSummary(len(known), float(known.min()), float(known.mean()), float(known.max()))

    @cached_property
    def histogram(self) -> Histogram | None:
        """The spread of the values, None if there was none."""
        known = self.answers.known
        if not len(known):
            return None
        low, high = float(known.min()), float(known.max())
        width = high / 2.0 - low / 2.0  # halves, so that a spread as wide as all numbers is still a number
        places = (known / 2.0 - low / 2.0) / width if width > 0.0 else np.zeros(len(known))
        bars = np.minimum((places * BINS).astype(np.intp), BINS - 1)
        return Histogram(low, high, tuple(np.bincount(bars, minlength=BINS).tolist()))

    def first_silent(self, most: int) -> list[str]:
        """The first silent robots, at most this many."""
        places = np.flatnonzero(self._silent)[:most]
        return [self.answers.names[place] for place in places.tolist()]

    def heard_at(self, name: str) -> float | None:
        """When a robot was last heard, None for never."""
        place = self.answers.names.index_of(name)
        heard = -inf if place is None or place >= len(self.heard) else float(self.heard[place])
        return heard if heard > -inf else None

    def _named(self, *codes: int) -> tuple[str, ...]:
        return tuple(self.answers.names[place] for place in np.flatnonzero(np.isin(self.codes, codes)).tolist())

    @property
    def complete(self) -> bool:
        """Whether every robot has been heard from."""
        return not self.n_silent

    @property
    def stands(self) -> bool:
        """Of a STOP: whether every robot has accepted it, and none of them says that it still moves."""
        return self.complete and not (self.rest and self.rest.n_stopping)

    def sentence(self) -> str:
        """The account for a person: `matched 29, did not match 970, fault 0, silent 1 of 1,000 robots: r12 (last heard
        8 s ago)`; with those that STOP holds, and those whose test was unknown, where there are any."""
        held = f" (held by STOP: {self.n_held})" if self.n_held else ""
        unknown = f", unknown {self.n_unknown}" if self.n_unknown else ""
        waiting = f", waiting {self.n_waiting}" if self.n_waiting else ""
        lost = f", not stored {self.n_not_stored}" if self.n_not_stored else ""
        others = f"{unknown}{waiting}{lost}, fault {self.n_fault}"
        counts = f"matched {self.n_matched}{held}, did not match {self.n_not_matched}{others}"
        chosen = "" if self.auction is None else f"; {printable(self.auction.sentence())}"
        return f"{counts}, {self.silence()}{chosen}"

    def silence(self, most: int = SHOWN) -> str:
        """How many said nothing, among whom, and who: `silent 1 of 1,000 robots: r12 (last heard 8 s ago)`."""
        if self.complete:
            return "silent 0" if self.size else f"silent 0 {self.scope}"
        return f"silent {self.n_silent} {self.scope}: {self.missing(most)}"

    def missing(self, most: int) -> str:
        """The silent robots: at most this many by name, in the order in which people look for them, each with when it
        was last heard."""
        named = sorted(self.first_silent(SORTED), key=natural_order)[:most]
        shown = [f"{name} ({self.ago(name)})" for name in named]
        more = self.n_silent - self.n_nameless - len(named)
        shown += and_more(more)
        shown += [f"{'and ' if shown else ''}{self.n_nameless} that were never heard"] if self.n_nameless else []
        return printable(", ".join(shown))

    def to_dict(self) -> dict[str, object]:
        """The counts, as the command line prints them."""
        counts = {"text": self.text} | {sort: getattr(self, f"n_{sort}") for sort in COUNTED}
        counts |= {"waiting": self.n_waiting} if self.n_waiting else {}
        counts |= {} if self.auction is None else {"auction": self.auction.to_dict()}
        return counts if self.rest is None else counts | rest_counts(self.rest)

    def ago(self, name: str) -> str:
        """When a robot was last heard, in words; of a name with several robots, that one of them is missing."""
        if name in self.conflicts:
            return "several robots have this name, and not all have answered"
        heard = self.heard_at(name)
        return "never heard" if heard is None else f"last heard {ago(self.now - heard)}"


def account(command: Command, now: float, heard: Seconds, check: Callable[[str], Checked] | None = None) -> Account:
    """The account of `command` at `now`.

    heard: when each robot was last heard (-inf: never), by place
    check: of the desk, for what a question asks for
    """
    answers = command.answers
    codes = answers.codes.copy()
    rest = command.resting if command.kind is Kind.STOP else None
    auction = None if command.auctioneer is None else command.auctioneer.status()
    about = command.only, command.size, rest, dict(command.conflicts), auction
    asked = _asked(command, check)
    quantity = ("", False) if asked is None else (asked.unit, asked.is_angle)
    place = command.id, command.text, now, codes, command.addressed, heard.copy(), answers
    return Account(*place, *about, *quantity, command.instant, command.answers.bound)


def _asked(command: Command, check: Callable[[str], Checked] | None) -> Checked | None:
    """What a question asks for; None for a command, and for a look at robots, which has no text."""
    try:
        return check(command.text) if check is not None and command.kind is Kind.ASK else None
    except SleepcastError:
        return None


def rest_counts(rest: RestAccount) -> dict[str, object]:
    """How many have accepted a STOP and are at rest, still move, or do not tell."""
    return {"at_rest": rest.n_at_rest, "stopping": rest.n_stopping, "accepted": rest.n_accepted}


def answer_in_words(answer: Answer | None, unit: str) -> str:
    """What one robot answered to a question, as people read it; "" for nothing yet. unit: of the question's value."""
    if answer is None:
        return ""
    if answer.outcome is Outcome.FAULT:
        return "fault"
    return "unknown" if answer.value is None else value_in_words(answer.value, unit)


def values_in_words(command: Command, account: Account) -> str:
    """The answer to a question as people read it; "" for none."""
    if command.kind != "ask":
        return ""
    summary = account.values
    return "no value yet" if summary is None else f"{summary.count:,} values: {spread_in_words(summary, account.unit)}"


def spread_in_words(summary: ValueSummary, unit: str) -> str:
    """`min 4.2 %, mean 50.1 %, max 97.3 %`."""
    least, mean, greatest = (value_in_words(each, unit) for each in (summary.least, summary.mean, summary.greatest))
    return f"min {least}, mean {mean}, max {greatest}"
