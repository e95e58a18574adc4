"""How far the clock of another party is behind ours, with a bound that holds: by round trips.

A robot asks for the time with a nonce, and the party that it names answers with its own (Cristian, *Probabilistic clock
synchronization*, 1989), and with how long it has held the question. What is left of the round trip is the two ways; so
our clock is ahead by what lies in their middle, and that is wrong by half of them at most, however unequal they are.
Questions and answers count from their arrival at the computer, not from when a busy process reads them. Since then both
clocks have drifted apart by no more than `DRIFT`. Of the latest trips the one with the least bound counts.

Robots ask only while they have to know: while a command of that party waits for an instant.
"""

from __future__ import annotations

from collections import deque
from math import inf
from os import urandom
from random import Random

from sleepcast.channel.admission import RateLimit
from sleepcast.channel.clock_sync import MAX_TRIP, NONCE_BYTES, ClockBound, on_the_way
from sleepcast.channel.message import TIME, WHOSE, Message
from sleepcast.core.backoff import Backoff
from sleepcast.core.records import NamedTuple

TRIPS = 8
"""Round trips that are remembered of a party: in a handful the way there and back is often as short as it gets."""
DRIFT = 1e-4
"""By how much two clocks drift apart, as a share: quartzes are good for half of that."""
SOON, SELDOM = 0.3, 16.0
"""Seconds from one question to the next while trips are missing, and at most where nobody answers: then the pause
doubles each time."""
REFRESH = 30.0
"""Seconds from one question to the next once there are enough: clocks drift by three milliseconds meanwhile."""
REPLIES_A_SECOND = 100.0
"""Replies in a second to robots that ask for our time alone: they do so as long as what we have sent waits in them."""
MAX_ASKED = 16
"""Parties that are asked; beyond, the one that is needed least long is not asked any more."""


class Trip(NamedTuple):
    """A round trip: when it ended, s of our clock, how far that was ahead, and half of how long it took, s."""

    ended: float
    ahead: float
    half: float

    def bound(self, now: float) -> float:
        return self.half + DRIFT * abs(now - self.ended)


class AskedClock:
    """The trips to one party. until: when they are not needed any more; due: when to ask next, s of our clock."""

    def __init__(self, until: float, due: float) -> None:
        self.until, self.due = until, due
        self.trips = deque[Trip](maxlen=TRIPS)
        self.pauses = Backoff(SOON, SELDOM)

    def took(self, trip: Trip) -> None:
        self.trips.append(trip)
        self.pauses.reset()
        self.due = min(self.due, trip.ended + SOON) if len(self.trips) < TRIPS else trip.ended + REFRESH


class RoundTrips:
    """See the module. Times are s of our clock. nonce: of the open question, b"" for none."""

    def __init__(self, chance: Random) -> None:
        self._chance = chance
        self._clocks: dict[str, AskedClock] = {}
        self.nonce = b""
        self._asked, self._whom = -inf, ""
        self._replies = RateLimit(REPLIES_A_SECOND, REPLIES_A_SECOND, chance, 0.0)

    def want(self, party: str, until: float, now: float) -> None:
        """Find out about this party's clock, and keep to it until then. The first questions of robots that hear the
        same command are spread."""
        known = self._clocks.setdefault(party, AskedClock(until, now + self._chance.uniform(0.0, SOON)))
        known.until = max(known.until, until)
        if len(self._clocks) > MAX_ASKED:
            del self._clocks[min(self._clocks, key=lambda each: self._clocks[each].until)]

    def of(self, party: str, now: float) -> ClockBound | None:
        """What is known of its clock; None if nothing is."""
        known = self._clocks.get(party)
        if known is None or not known.trips:
            return None
        best = min(known.trips, key=lambda trip: trip.bound(now))
        return ClockBound(best.ahead, best.bound(now))

    def due(self) -> float:
        """When to ask next; inf for never."""
        return min((each.due for each in self._clocks.values() if each.due <= each.until), default=inf)

    def question(self, now: float) -> dict[str, object]:
        """The body of a new question, to whoever is due; answers to older ones are ignored from now on."""
        self._clocks = {party: each for party, each in self._clocks.items() if now <= each.until}
        whom = min(self._clocks, key=lambda each: self._clocks[each].due, default="")
        if not whom:
            return {}
        known = self._clocks[whom]
        known.due = now + self._chance.uniform(1.0, 1.5) * max(known.pauses.take(), self._usual(known))
        self.nonce, self._asked, self._whom = urandom(NONCE_BYTES), now, whom
        return {TIME: self.nonce, WHOSE: whom}

    def hear(self, message: Message, now: float) -> bool:
        """Take in an answer; whether it is the one to our open question."""
        trip = now - self._asked
        known = self._clocks.get(message.sender)
        answers = bool(self.nonce) and message.body.get(TIME) == self.nonce and message.sender == self._whom
        if known is None or not answers or not 0.0 <= trip <= MAX_TRIP:
            return False
        half = on_the_way(message, trip) / 2.0
        known.took(Trip(now, now - half - message.issued, half))
        self.nonce = b""
        return True

    def replies(self, question: Message, name: str, now: float) -> bool:
        """Whether the party of this name, which may tell the time, replies to another's question."""
        return question.body.get(WHOSE) == name and self._replies.take(now)

    def clear(self) -> None:
        """Our clock has been set: what was measured says nothing any more."""
        for each in self._clocks.values():
            each.trips.clear()

    @staticmethod
    def _usual(known: AskedClock) -> float:
        """The pause while all goes well, s: twice as long as the trips, which are to end before the next one begins."""
        if len(known.trips) == TRIPS:
            return REFRESH
        return 4.0 * min((trip.half for trip in known.trips), default=0.0)
