"""Clock differences: their size, which clocks are wrong, and how a robot without a real-time clock gets the time.

`ClockOffsets` are measured by heartbeats: for one sent at t by its sender's clock and received at T by ours, T - t
is the clocks' difference plus the transmission time. The minimum of several is the difference plus the shortest
transmission time, which is small on a radio.

`WrongClocks` differ from ours by more than is allowed. Callers record only signed messages that are not replays.

`TimeRequest` is for a robot whose clock starts in 1970. It asks with a nonce, and an operator signs nonce and time
(Cristian, *Probabilistic clock synchronization*, 1989). The nonce was never used before, so no recording answers it;
the round trip was short, so the answer was not held back: the error is at most half the round trip.
"""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Callable, Sequence
from math import inf
from os import urandom

from sleepcast.channel.fair_table import FairTable
from sleepcast.channel.message import TIME, WAITED, Message
from sleepcast.core.ages import duration
from sleepcast.core.backoff import Backoff
from sleepcast.core.clock import MADE
from sleepcast.core.errors import listed
from sleepcast.core.records import NamedTuple

ENOUGH, LATEST = 3, 16
"""Heartbeats needed to measure an offset, and the number of latest ones used: those of some five seconds."""
FRESH = 600.0
"""Seconds for which an offset is used without new heartbeats: clocks drift by milliseconds meanwhile."""
LEAST = 0.05
"""Least offset that matters, s: less may be transmission time, and synchronized clocks differ by less."""
MAX_OFFSETS = 64
"""Senders with known offsets; beyond, the one that has been silent longest is dropped. Only operators send heartbeats,
and each has one name."""


class ClockBound(NamedTuple):
    """What is known of another party's clock. ahead: s by which our clock is ahead of it; bound: by how many s that may
    be wrong at most."""

    ahead: float
    bound: float


class ClockOffsets:
    """Clock offsets of the senders of heartbeats, by name. bound: s, the largest offset: an attacker who delays
    heartbeats cannot move deadlines farther."""

    def __init__(self, bound: float) -> None:
        self._bound = bound
        self._took: OrderedDict[str, deque[tuple[float, float]]] = OrderedDict()

    def note(self, sender: str, issued: float, now: float) -> None:
        """Record a heartbeat: its time of issue by the sender's clock, and of arrival by ours, s."""
        took = self._took.setdefault(sender, deque(maxlen=LATEST))
        took.append((now, now - issued))
        self._took.move_to_end(sender)
        if len(self._took) > MAX_OFFSETS:
            self._took.popitem(last=False)

    def of(self, sender: str, now: float) -> float:
        """Seconds by which our clock is ahead of this sender's; 0 if that is unknown, or too small to matter."""
        took = self._took.get(sender)
        if took is None or len(took) < ENOUGH or now - took[-1][0] > FRESH:
            return 0.0
        offset = max(-self._bound, min(self._bound, *(each for _, each in took)))
        return offset if abs(offset) >= LEAST else 0.0

    def all(self, now: float) -> dict[str, float]:
        """All offsets that are not 0."""
        offsets = {sender: self.of(sender, now) for sender in self._took}
        return {sender: offset for sender, offset in offsets.items() if offset}


_MAX_CLOCKS = 1_000_000
"""Parties whose clocks are tracked: as many as a roster takes. Beyond, one of the key that has the most is dropped."""
_ALIKE = 4.0
"""Seconds by which clocks may differ and still count as equally wrong: each may be wrong by the allowed skew."""
SHOWN = 5
"""Names listed in a sentence; more are counted."""


class WrongClocks:
    """How far each party's clock is ahead of ours, s; 0 if it is right. most: parties that are remembered."""

    def __init__(self, most: int = _MAX_CLOCKS) -> None:
        self._ahead = FairTable[str, float, object](most)
        self._took = FairTable[str, tuple[str, float], object](most)

    def note(self, name: str, ahead: float, key: object = "") -> None:
        """The clock of this party is `ahead` s ahead, 0 if it is right. key: that signed what shows it."""
        if self._ahead.get(name) != ahead:  # nearly always it is as right as before
            self._ahead.put(key, name, ahead)

    def note_took(self, name: str, whose: str, behind: float, key: object = "") -> None:
        """This robot's clock was `behind` s behind, and has been set to the time of `whose`. key: as in `note`."""
        self._took.put(key, name, (whose, behind))
        self.note(name, 0.0, key)

    def clear(self) -> None:
        """Forget everything."""
        self._ahead.clear()
        self._took.clear()

    def ahead(self, name: str) -> float:
        """How far its clock is ahead, s; 0 if unknown."""
        return self._ahead.get(name) or 0.0

    @property
    def wrong(self) -> dict[str, float]:
        """The clocks that are wrong: s ahead, by name."""
        return {name: ahead for name, ahead in self._ahead.items() if ahead}

    def of_robots(self, life: float) -> list[str]:
        """Sentences for an operator about robots' clocks. life: s for which commands count."""
        sentences, wrong = [], sorted(self.wrong.items(), key=lambda each: each[1])
        if len(wrong) > 1:
            middle = wrong[len(wrong) // 2][1]
            alike = [name for name, ahead in wrong if abs(ahead - middle) <= _ALIKE]
            if 2 * len(alike) > max(2, len(self._ahead)):  # one wrong clock here is more likely than so many elsewhere
                rest = "they obey nothing but your STOP; set it, and start sleepcast again"
                sentences.append(
                    f"your clock is {differs(-middle)} {'of ' if middle < 0 else ''}{len(alike)} robots: {rest}"
                )
                wrong = [(name, ahead) for name, ahead in wrong if name not in alike]
        while wrong:
            first = wrong[0][1]
            names = [name for name, ahead in wrong if ahead - first <= _ALIKE]
            whose = "its clock is" if len(names) == 1 else "their clocks are"
            only = "" if 0.0 < first <= life else "; it obeys STOP only" if len(names) == 1 else "; they obey STOP only"
            sentences.append(f"{listed(names, SHOWN)}: {whose} {differs(first)}{only}")
            wrong = wrong[len(names) :]
        whose_time: dict[tuple[str, str], list[str]] = {}
        for name, (whose, behind) in self._took.items():
            whose_time.setdefault((whose, differs(-behind)), []).append(name)
        return sentences + [took(names, *which) for which, names in whose_time.items()]

    def of_operators(self) -> list[str]:
        """Sentences of a robot about its clock, compared with those of the operators."""
        return [
            f"our clock is {differs(-ahead)} {'of ' if ahead < 0 else ''}that of {name}: nothing but STOP is obeyed"
            for name, ahead in self.wrong.items()
        ]


def differs(ahead: float) -> str:
    """A clock's error for a person: `1 h ahead`."""
    return f"{duration(round(abs(ahead)))} {'ahead' if ahead > 0.0 else 'behind'}"


def took(names: Sequence[str], whose: str, differs: str) -> str:
    """A sentence: these robots have set their clocks to the time of `whose`. differs: how wrong they were."""
    theirs, clocks = ("its", "its clock was") if len(names) == 1 else ("their", "their clocks were")
    return f"{listed(names, SHOWN)} took {theirs} time from {whose}: {clocks} {differs}"


NONCE_BYTES = 16
"""Bytes of a nonce: it cannot be guessed, and is never repeated by chance."""
MAX_TRIP = 1.0
"""Longest round trip, s. So the error is at most half a second, a quarter of the allowed skew."""


def on_the_way(reply: Message, trip: float) -> float:
    """How long question and reply have been on their ways, of the `trip` s from one to the other: without what the
    question has waited for its reply, as far as the replying party tells that."""
    waited = reply.body.get(WAITED)
    return trip - waited if isinstance(waited, float) and 0.0 <= waited <= trip else trip


class TimeReply(NamedTuple):
    """A reply to a question for the time. nonce: of the question; arrived: when that came, s of our clock."""

    nonce: bytes
    arrived: float

    def body(self, now: float) -> dict[str, object]:
        """Its body if it leaves now, s of our clock."""
        return {TIME: self.nonce, WAITED: max(0.0, now - self.arrived)}


SOONEST, SLOWEST = 2.0, 16.0
"""Seconds between two requests at first, and at most: the pause doubles while there is no answer. It is longer than
`MAX_TRIP`, so a timely answer is always to the open request."""
HURRIED_PAUSE = 0.25
"""Seconds between two requests while an operator commands us, who may leave after our answer."""


class TimeRequest:
    """A robot's request for the time, repeated until it is answered.

    set_clock: called with the seconds by which our clock is behind, and with the name of the operator who says so
    nonce: of the open request
    due: time of the next request, s of our clock
    """

    def __init__(self, set_clock: Callable[[float, str], None]) -> None:
        self.set_clock = set_clock
        self.nonce, self.due = b"", -inf
        self._asked, self._pauses = -inf, Backoff(SOONEST, SLOWEST)

    def question(self, now: float) -> dict[str, object]:
        """The body of a new request; answers to older ones are ignored from now on."""
        self.nonce = urandom(NONCE_BYTES)
        self._asked, self.due = now, now + self._pauses.take()
        return {TIME: self.nonce}

    def expedite(self) -> None:
        """An operator who commands us is present: ask as soon as allowed."""
        self.due = min(self.due, self._asked + HURRIED_PAUSE)

    def answer(self, message: Message, now: float) -> float | None:
        """Seconds by which our clock is behind according to this answer; None for an answer that cannot be trusted."""
        trip = now - self._asked
        if message.body.get(TIME) != self.nonce or not 0.0 <= trip <= MAX_TRIP or message.issued < MADE:
            return None
        return message.issued + on_the_way(message, trip) / 2.0 - now
