"""Dropped datagrams, counted by reason and by the key that they name, and notices about them for a person.

Counting takes one clock reading and one addition, because it is done for each datagram of a flood. Notices tell what
is going on now, by the rates of the last second or two. What is normal on every channel (a repeated message, or one
for others) is only counted.
"""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping
from enum import StrEnum
from typing import Protocol

from sleepcast.core.clock import Clock
from sleepcast.core.records import NamedTuple

WINDOW = 1.0
"""Seconds over which rates are measured: long enough for a steady number, short enough to be current."""
_FIRST = 0.25
"""Seconds after which the current window gives a rate: one datagram is no flood."""
MAX_STRANGERS = 64
"""Unknown keys that are counted separately, so that invented keys take no memory. The number of known ones is
bounded."""
_MAX_NOTICES = 4
"""Notices at once: those with the highest rates."""
AGAIN = 60.0
"""Period, s, after which a `NoticeLog` repeats an ongoing notice."""
_WORSE = 10.0
"""A rate this many times the one last reported is reported at once."""
_MANY_REPEATED = 500.0
"""Repeated messages of one key per second that indicate an attack: a STOP is repeated a hundred times in its first
second."""
_MANY_LATE = 5.0
"""Late messages of one key per second that are worth a notice: repaired ones are occasionally late."""
LEAST = 0.5
"""The same for all other reasons: rare cases in the past are over."""


class DropReason(StrEnum):
    """Why a datagram was dropped."""

    MALFORMED = "malformed"
    UNKNOWN_KEY = "unknown key"
    REVOKED = "revoked key"
    NOT_FOR_US = "not for us"
    NOT_ALLOWED = "not allowed"
    LATE = "late"
    EARLY = "from the future"
    REPEATED = "repeated"
    TOO_MANY = "too many"
    FORGED = "forged"
    OTHER_FLEET = "other fleet"
    NO_ROOM = "no room"
    """Not the datagram, but what was kept of an earlier one of the same key."""
    HELD_BACK = "held back"


class Owned(Protocol):
    """A key with an owner."""

    @property
    def owner(self) -> str: ...


class Owners(Protocol):
    """Finds the owner of a key (`Trust`)."""

    def find(self, key: bytes) -> Owned | None: ...


class Notice(NamedTuple):
    """What is going on.

    key: id of the key that the datagrams name, b"" for none
    reason: why most of them were dropped
    rate: datagrams a second
    text: a sentence without a full stop
    """

    key: bytes
    reason: DropReason
    rate: float
    text: str


class DropCounter:
    """Counts dropped datagrams. counts: all so far, by reason; by_key: by key id and reason, together with what found
    no room; the id is b"" if no key is named, or there are too many unknown ones."""

    def __init__(self, clock: Clock) -> None:
        self.counts: Counter[DropReason] = Counter()
        self.by_key: Counter[tuple[bytes, DropReason]] = Counter()
        self._clock = clock
        self._strangers: set[bytes] = set()
        self._window: Counter[tuple[bytes, DropReason]] = Counter()
        self._since = clock.now()
        self._rates: dict[tuple[bytes, DropReason], float] = {}
        """In the window before this one."""

    def add(self, reason: DropReason, key: bytes = b"", count: int = 1) -> None:
        """Count dropped datagrams, or things that found no room. key: id of the key that they name."""
        self._turn()
        if reason is DropReason.UNKNOWN_KEY and key not in self._strangers:
            if len(self._strangers) < MAX_STRANGERS:
                self._strangers.add(key)
            else:
                key = b""
        if reason is not DropReason.NO_ROOM:
            self.counts[reason] += count
        self.by_key[key, reason] += count
        self._window[key, reason] += count

    def rates(self) -> Mapping[tuple[bytes, DropReason], float]:
        """Datagrams dropped in a second recently, by key id and reason."""
        self._turn()
        passed = max(self._clock.now() - self._since, _FIRST)
        rates = dict(self._rates)
        for which, count in self._window.items():
            rates[which] = max(rates.get(which, 0.0), count / passed)
        return rates

    def notices(self, owners: Owners) -> list[Notice]:
        """What a person should know, highest rate first. owners: of the keys."""
        by_key: defaultdict[bytes, dict[DropReason, float]] = defaultdict(dict)
        for (key, reason), rate in self.rates().items():
            by_key[key][reason] = rate
        notices = [notice for key, rates in by_key.items() for notice in _noticed(key, rates, owners)]
        return sorted(notices, key=lambda notice: -notice.rate)[:_MAX_NOTICES]

    def _turn(self) -> None:
        """Begin another window if this one is over."""
        passed = self._clock.now() - self._since
        if not 0.0 <= passed < WINDOW:
            length = max(passed, WINDOW)  # if the clock was set back, the true length is unknown
            self._rates = {which: count / length for which, count in self._window.items()}
            self._window.clear()
            self._since += passed


def _noticed(key: bytes, rates: Mapping[DropReason, float], owners: Owners) -> Iterator[Notice]:
    """The notices about one key."""
    known, short = owners.find(key), key.hex()[:4]
    name = f"key {short} ({known.owner})" if known else f"key {short}" if key else "many keys"
    forged, unread = rates.get(DropReason.FORGED, 0.0), rates.get(DropReason.TOO_MANY, 0.0)
    if forged:  # datagrams that were not checked came with them
        text = f"somebody sends {_much(forged + unread, 'forged')} a second under {name}"
        yield Notice(key, DropReason.FORGED, forged + unread, text)
    elif unread:
        text = f"{_much(unread)} a second under {name} are more than can be checked, and are dropped"
        yield Notice(key, DropReason.TOO_MANY, unread, text)
    for reason, (least, text) in _SENTENCES.items():
        rate = rates.get(reason, 0.0)
        if rate >= least:
            yield Notice(key, reason, rate, text.format(much=_much(rate), name=name))


_SENTENCES: Mapping[DropReason, tuple[float, str]] = {
    DropReason.UNKNOWN_KEY: (LEAST, "{much} a second come under {name}, not trusted here"),
    DropReason.REVOKED: (LEAST, "{much} a second come under {name}, which is revoked"),
    DropReason.NOT_ALLOWED: (LEAST, "{much} a second come under {name}, whose role may not send them"),
    DropReason.OTHER_FLEET: (LEAST, "{much} a second under {name} are for another fleet"),
    DropReason.REPEATED: (_MANY_REPEATED, "somebody sends {much} a second of {name} again that were heard before"),
    DropReason.LATE: (_MANY_LATE, "{much} a second of {name} come too late, by our clock"),
    DropReason.EARLY: (LEAST, "{much} a second of {name} come from the future, by our clock"),
    DropReason.NO_ROOM: (LEAST, "{much} a second of {name} are more than there is room for: its oldest are forgotten"),
    DropReason.HELD_BACK: (
        LEAST,
        "{much} a second of {name} ask for more than is answered at a time, and are held back",
    ),
    DropReason.MALFORMED: (LEAST, "{much} a second come that sleepcast cannot read"),
}
"""The rate (a second) from which each reason is reported, and the sentence."""


def _much(rate: float, what: str = "") -> str:
    """A number of messages, rounded to two digits."""
    digits = len(str(round(rate))) - 2
    count = max(1, round(rate, -digits) if digits > 0 else round(rate))
    return " ".join(filter(None, (f"{count:,.0f}", what, "message" if count == 1 else "messages")))


class NoticeLog:
    """Notices for a log: each when it begins, when its rate has grown by `_WORSE`, and every `AGAIN` s while it goes
    on. others: gives further sentences."""

    def __init__(
        self, drops: DropCounter, owners: Owners, clock: Clock, others: Callable[[], Iterable[str]] = tuple
    ) -> None:
        self._drops, self._owners, self._clock, self._others = drops, owners, clock, others
        self._reported: dict[tuple[bytes, DropReason], tuple[float, float]] = {}
        """When each was reported, and its rate then."""
        self._said: dict[str, float] = {}
        """When each of the other sentences was reported."""

    def lines(self) -> list[str]:
        """Lines that are due."""
        now, lines = self._clock.now(), []
        self._reported = {which: last for which, last in self._reported.items() if 0.0 <= now - last[0] < AGAIN}
        for key, reason, rate, text in self._drops.notices(self._owners):
            _, last = self._reported.get((key, reason), (now, 0.0))
            if rate >= _WORSE * last:
                self._reported[key, reason] = now, rate
                lines.append(text)
        self._said = {text: at for text, at in self._said.items() if 0.0 <= now - at < AGAIN}
        for text in self._others():
            if text not in self._said:
                self._said[text] = now
                lines.append(text)
        return lines
