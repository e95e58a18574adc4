"""The delivery: how commands reach everybody over a radio that loses some of everything.

It knows no socket and no clock: datagrams and the time go in, messages and datagrams come out.

    out      a command is sent at once and a few times more, further and further apart
    order    each command names the one before it and the standing one before it, so that a gap is seen (`order`). What
             follows a gap waits until it is filled, or until what is missing would come too late anyway
    repair   who misses a command asks for it, and whoever has it sends it again, after a moment of chance in which he
             listens whether somebody else does. The bytes are its sender's own, so nobody has to be believed (`shelf`)
    rules    standing commands are kept by everybody. How far each party has come is told in digests by Trickle
             (RFC 6206): more and more seldom while all agree, at once when somebody does not (`trickle`)

Kinds that are no commands go through as they come.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from heapq import heappop, heappush
from itertools import count
from math import inf
from random import Random
from typing import NamedTuple, TypeVar

import msgspec

from sleepcast.channel.admission import Admission
from sleepcast.channel.clock_sync import MAX_TRIP, NONCE_BYTES, TimeRequest
from sleepcast.channel.digest_timer import DigestTimer, mostly_late
from sleepcast.channel.envelope import MAX_PARTS, Part, encode
from sleepcast.channel.keys import MAY, KeyChange, KeyPair, KeyRefusal
from sleepcast.channel.message import Kind, Message, Role
from sleepcast.channel.message_store import DeliveryState, MessageStore, StreamId
from sleepcast.channel.payload import KEYS, TIME, age_of
from sleepcast.channel.rate_limit import RateLimit, TokenBucket
from sleepcast.channel.sequencer import MAX_STREAMS, Sequencer, Skipped, Stream
from sleepcast.core.clock import MADE

REPEATS = (0.03, 0.09, 0.21, 0.45)
"""Seconds after which a command is sent again, unasked: at 30 % loss two of a thousand hear none of the five."""
ASK_PARTS_AFTER = 0.21
"""Seconds after which the missing parts of a command are asked for, of which others have come: three repeats later."""
REPEATED = frozenset({Kind.COMMAND, Kind.ASK, Kind.RELEASE})
STOP_EVERY = 0.01
"""Seconds between two copies of a STOP: of 15 hundred bytes a hundred are a tenth of what a slow radio carries. A robot
looks at one of sixteen where 80,000 are forged in a second (`door.STOPS_A_SECOND`): it needs many, and soon."""
STOP_FOR, STOP_ON = 1.0, 0.1
"""Seconds for which copies of a STOP are sent; and of one that is sent again for those who were not heard, once the
first is so old that all who can hear have heard it."""
STOP_AT_FIRST = 5.0
"""Seconds until then."""
LIFE = 5.0
"""Seconds for which a command counts, unless its sender says otherwise: all that is no rule has an end."""
REPAIR_WITHIN = 0.06
"""Seconds within which, by chance, a party sends what another one misses, unless somebody else does."""
REPAIR_PAUSE = 0.2
"""Seconds for which what was heard is not sent again."""
REPAIR_RATE = 100_000.0
"""Bytes that a party sends in a second of what others miss, and at once: a tenth of what a slow radio carries, and four
of the longest expressions. Whoever asks without end gets no more; who misses more asks again."""
BATCH = 24
"""Commands sent for one digest or request: the rest follows with the next one."""
KEEP_EVERY = 256
"""Numbers of ours that may be used before whoever keeps them is told."""
TIME_REPLIES_A_SECOND = 20.0
"""Answers in a second, at most, to those who ask for the time: whoever plays old questions makes nobody talk more."""
MAX_WANTED = 64
"""Numbers in one request."""


class Repair(NamedTuple):
    """Commands that somebody misses are to be sent at a time (s), in their order. tie: makes equal times comparable.
    wanted: numbers, each with those of the parts that are meant if not all are."""

    time: float
    tie: int
    stream: Stream
    wanted: Sequence[Sequence[int]]


class Repeat(NamedTuple):
    """A command of our own is to be sent again."""

    time: float
    tie: int
    datagrams: tuple[bytes, ...]


class StopRepeats(NamedTuple):
    """Our latest STOP, of which copies are sent: the next at a time, the last before another (s)."""

    time: float = inf
    until: float = inf
    datagrams: tuple[bytes, ...] = ()


class ReliableDelivery:
    """One party's mailbox. name, epoch: of what it says, the epoch higher than in all its lives before, or the same and
    the first number higher than all in that (`first`); key: signs it; admission: what comes in goes through it; chance:
    for its moments. keep: called before a command of ours that stands leaves, and every `KEEP_EVERY` numbers, for
    whoever keeps them.

    order: whose commands have come how far. overheard: datagrams of which we need not know more; all others are
    counted at the door.
    """

    def __init__(
        self,
        name: str,
        epoch: int,
        key: KeyPair,
        admission: Admission,
        chance: Random,
        *,
        first: int = 1,
        keep: Callable[[], None] = lambda: None,
    ) -> None:
        self.name, self.epoch, self.admission = name, epoch, admission
        self.sequencer = Sequencer(chance, admission.skew)
        self.overheard = 0
        self._key, self._chance = key, chance
        self._store = MessageStore()
        self._digest_timer = DigestTimer(chance)
        self._told: dict[StreamId, int] = {}
        """How far others' rules have come, as an operator hears from the robots."""
        self._sequence, self._issued, self._keep = first - 1, 0.0, keep
        self._out: list[bytes] = []
        self._later: list[Repair | Repeat] = []
        self._stop_repeats = StopRepeats()
        self._tie = count()
        self._time_request: TimeRequest | None = None
        self._time_replies = RateLimit(TIME_REPLIES_A_SECOND, TIME_REPLIES_A_SECOND, chance, 0.0)
        self._repair_bytes = TokenBucket(REPAIR_RATE, REPAIR_RATE, 0.0)

    # ---- what we say

    def post(
        self,
        kind: Kind,
        now: float,
        *,
        text: str = "",
        deadline: float | None = None,
        standing: bool = False,
        body: dict[str, object] | None = None,
    ) -> Message:
        """Say something at `now` (s of Unix time); gives the message as others hear it. deadline: s of Unix time, None
        for `LIFE` from now, or for none where it stands. Raises MessageError for what is too long."""
        until = (inf if standing else now + LIFE) if deadline is None else deadline
        number = self._number()
        own, said = self._own(), dict(body or {})
        issued = now
        if kind is Kind.COMMAND:
            said |= own.link().written()
            if 0.0 <= self._issued - now <= self.admission.skew:
                issued = self._issued  # a clock that was set back a little lets no command seem older than the last
            self._issued = issued
        message = Message(self.name, self.epoch, number, kind, issued, until, text, standing, said)
        datagrams = tuple(encode(message, self.admission.fleet, self._key))
        if kind is Kind.COMMAND:
            self._store.keep(own.name, message.sequence, standing, datagrams, now)
            self.sequencer.deal_with(own, message)
            if standing:
                self._tell_progress(now)
            if KEYS in said:
                self._change_trust(msgspec.structs.replace(message, role=self.role.value), now)
            if standing:  # one that does not is over before our next life could send it again
                self._keep()
        self._out += datagrams
        if kind in REPEATED:
            for wait in REPEATS:
                if now + wait <= until:
                    heappush(self._later, Repeat(now + wait, next(self._tie), datagrams))
        if kind is Kind.STOP:
            lasts = STOP_FOR if age_of(said) < STOP_AT_FIRST else STOP_ON
            self._stop_repeats = StopRepeats(now + STOP_EVERY, now + lasts, datagrams)
        elif kind is Kind.RELEASE:
            self._stop_repeats = StopRepeats()
        return message

    def repeat(self, number: int, now: float) -> None:
        """Send a command of ours once more, by its number: who has heard it takes no notice."""
        self._out += self._store.take(self._own().name, number, now)

    def posted(self) -> list[bytes]:
        """What has been said and not been sent yet."""
        out, self._out = self._out, []
        return out

    @property
    def next_number(self) -> int:
        """Of what is posted next."""
        return self._sequence + 1

    @property
    def key_id(self) -> bytes:
        """Of our key."""
        return self._key.id

    @property
    def role(self) -> Role:
        """Of our key."""
        return self._key.public.role

    def start(self, now: float) -> None:
        """Tell the others how far we have come, so that they tell us what we have missed. An operator needs nobody's
        rules, and keeps quiet until he has sent some."""
        if self.admission.robot:
            self.sequencer.since = now
            self._digest_timer.restart(now)

    def seek_time(self, set_clock: Callable[[float, str], None]) -> None:
        """Our clock is plainly wrong: ask for the time until an operator tells it. set_clock: see `TimeRequest`."""
        self._time_request = TimeRequest(set_clock)

    def _number(self) -> int:
        """The next number is ours: whatever comes back of it from the air, by an echo or by malice, is no news."""
        self._sequence += 1
        self.admission.note(self._key.id, self.name, self.epoch, self._sequence)
        if self._sequence % KEEP_EVERY == 0:
            self._keep()
        return self._sequence

    def _own(self) -> Stream:
        return self.sequencer.stream((self._key.id, self.epoch))

    # ---- what others say

    def take(self, datagram: bytes, now: float) -> list[Message]:
        """The messages that can be dealt with now that this datagram has come."""
        part = self.admission.look(datagram)
        if part is None:
            return []
        if self._is_stored(part, datagram, now):
            self.overheard += 1
            return []
        entered = self.admission.admit(part, datagram)
        if entered is None:
            name = part.key, part.epoch  # nobody keeps anything but commands; their sender repeats them himself first
            if part.kind is Kind.COMMAND and self.admission.robot and self._missing(name, part.sequence):
                self.sequencer.want_parts(name, part.sequence, part.deadline, now + ASK_PARTS_AFTER)
            turned_away = self.admission.turned_away()
            if turned_away and self._time_request is not None:
                self._time_request.hurry()
            return turned_away
        message = entered.message
        if TIME in message.body and message.kind in (Kind.REPORT, Kind.HEARTBEAT):
            self._deal_with_time(message, now)
            return []
        if message.kind is Kind.DIGEST:
            self._compare(message, now)
            return []
        if message.kind is Kind.REQUEST:
            self._repair_requested(message, now)
            return []
        if message.kind is not Kind.COMMAND or message.role == Role.ROBOT:
            return [message]  # what robots tell each other has no order, and nobody mends it
        name = part.key, part.epoch
        self._store.keep(name, message.sequence, message.standing, entered.datagrams, now)
        if KEYS in message.body:
            self._change_trust(message, now)
        if not self.admission.robot:
            return [message]  # an operator sees what others send, and waits for nothing of it
        stream = self.sequencer.stream(name)
        return self._noted(self.sequencer.take(stream, message, now), now)

    def _deal_with_time(self, message: Message, now: float) -> None:
        """Somebody asks for the time, or tells it; it is no heartbeat that keeps anybody going."""
        nonce = message.body[TIME]
        if message.kind is Kind.HEARTBEAT:
            request = self._time_request
            behind = None if request is None else request.answer(message, now)
            if request is not None and behind is not None:
                self._time_request = None
                self.admission.forget_clocks()
                request.set_clock(behind, message.sender)
                self.sequencer.since = now + behind  # what was turned away until now is waited for no more
        elif (
            Kind.HEARTBEAT in MAY[self.role]
            and (isinstance(nonce, bytes) and len(nonce) == NONCE_BYTES)
            and now >= MADE  # whose own clock is plainly wrong tells nobody
            and self._time_replies.take(now)
        ):
            self.post(Kind.HEARTBEAT, now, deadline=now + MAX_TRIP, body={TIME: nonce})

    def standing_of(self, key: bytes) -> tuple[bytes, ...]:
        """The datagrams of the standing commands of the key with this id, as far as they have come to us."""
        return tuple(datagram for datagrams in self._store.standing(key).values() for datagram in datagrams)

    def _change_trust(self, message: Message, now: float) -> None:
        """Whom to trust counts at once, whatever else of its sender is still missing. What cannot be taken changes
        nothing; whoever answers says why."""
        with suppress(KeyRefusal):
            trust = self.admission.trust
            trust.take(KeyChange.of(message))
            for key in {name[0] for name in self.sequencer.names if self._is_revoked(name)}:
                kept = self._store.standing(key).items()
                self.sequencer.settle(key, {which for which, datagrams in kept if all(map(trust.vouches, datagrams))})
            self._tell_progress(now)

    def _is_stored(self, part: Part, datagram: bytes, now: float) -> bool:
        """Whether these very bytes are on our shelf: then we need not send them either. What there was no room for to
        wait is there as well, and comes anew."""
        name = part.key, part.epoch
        return (
            part.kind is Kind.COMMAND
            and self._store.heard(name, part.sequence, datagram, now)
            and (not self.admission.robot or self.sequencer.knows(name, part.sequence))
        )

    def _noted(self, found: list[Message], now: float) -> list[Message]:
        """These messages, of which those that stand are news to be told."""
        for message in found:
            if message.standing:
                self._tell_progress(now)
                break
        return found

    def _tell_progress(self, now: float) -> None:
        """We have come further."""
        self._digest_timer.restart(now)

    # ---- what outlasts us

    def news(self) -> DeliveryState:
        """What has changed since this was asked last, and is to outlast us. What waits for something before it counts
        as not heard: it is asked for again."""
        windows = (each.without(self.sequencer.waiting((each.key, each.epoch))) for each in self.admission.news())
        return DeliveryState(self.sequencer.news(), tuple(windows), self._store.news())

    def restore(self, kept: DeliveryState, since: float) -> None:
        """Go on where a mailbox had come to whose news these are, the latest of each, and that had begun to listen at
        `since` (s). What stands beyond what was dealt with is left out: it comes again."""
        self.sequencer.since = since
        rules = {progress.stream: progress.rules for progress in kept.streams}
        dealt_with = [each for each in kept.standing if each.number <= rules.get(each.stream, 0)]
        numbers: dict[StreamId, list[int]] = {}
        for each in dealt_with:
            numbers.setdefault(each.stream, []).append(each.number)
        self.sequencer.restore(kept.streams, {name: sorted(found) for name, found in numbers.items()})
        self._store.restore(dealt_with)
        self.admission.restore(kept.windows)

    # ---- repair

    def _compare(self, digest: Message, now: float) -> None:
        """Somebody tells how far he has come: mend what he misses, and tell what we miss."""
        theirs = {name: rules for name, rules in streams_in(digest.body, "have", int) if self._commands(name)}
        names = set(self.sequencer.standing())
        if self.admission.robot:
            names |= theirs.keys()
        else:  # an operator has an eye on what he has sent himself
            for name in theirs.keys() - names:
                before = 0 if self._is_revoked(name) else self._told.pop(name, 0)  # of a revoked key, some may go
                self._told[name] = max(theirs[name], before)
                if len(self._told) > MAX_STREAMS:
                    del self._told[next(iter(self._told))]
        alike = True
        for name in names:
            stream = self.sequencer.stream(name)
            they, we = theirs.get(name, 0), stream.rules
            alike &= they == we
            if they < we:
                self._repair(stream, [(number,) for number in stream.standing if number > they][:BATCH], now)
        if alike:
            self._digest_timer.agree()
        else:
            self._digest_timer.restart(now)

    def _digest(self) -> dict[str, object]:
        """How far we have come. An operator repeats what robots tell of others' rules, so that nobody sends him any."""
        have = self._told | self.sequencer.standing()
        return {"have": [[*name, have[name]] for name in sorted(have)[-MAX_STREAMS:]]}

    def _missing(self, name: StreamId, number: int) -> tuple[int, ...]:
        """Parts that are missing of a command of which some have come."""
        key = self.admission.trust.find(name[0]) if self._commands(name) else None
        return () if key is None else self.admission.missing(name[0], key.owner, name[1], number)

    def _request(self, wanted: Mapping[StreamId, Sequence[int]], now: float) -> None:
        """Ask for what is missing: whole commands, or parts of those of which some have come."""
        missing = [
            (name, number, self._missing(name, number)) for name, numbers in wanted.items() for number in numbers
        ]
        self._say(Kind.REQUEST, request(missing), now)

    def _repair_requested(self, asked: Message, now: float) -> None:
        for name, listed in streams_in(asked.body, "want", list):
            numbers = tuple(number for number in listed[:MAX_WANTED] if isinstance(number, int))
            if self._commands(name):
                self.sequencer.asked(name, numbers, now)
                self._repair(self.sequencer.stream(name), [(number,) for number in numbers[:BATCH]], now)
        for name, number, parts in wanted_parts(asked.body):
            if self._commands(name):
                if {*parts} >= {*self._missing(name, number)}:
                    self.sequencer.asked(name, (number,), now)
                self._repair(self.sequencer.stream(name), [(number, *parts)], now)

    def _commands(self, name: StreamId) -> bool:
        """Whether a stream is of somebody whose commands count."""
        key = self.admission.trust.find(name[0])
        return key is not None and Kind.COMMAND in MAY[key.role] and key.role is not Role.ROBOT

    def _is_revoked(self, name: StreamId) -> bool:
        key = self.admission.trust.find(name[0])
        return key is not None and key.revoked

    def _repair(self, stream: Stream, asked: Sequence[Sequence[int]], now: float) -> None:
        wanted = [
            each for each in asked if self._store.silent_since(stream.name, each[0], now - REPAIR_PAUSE, each[1:])
        ]
        if wanted:
            wait = mostly_late(self._chance) * REPAIR_WITHIN
            heappush(self._later, Repair(now + wait, next(self._tie), stream, wanted))

    # ---- time

    def step(self, now: float) -> tuple[list[bytes], list[Message]]:
        """What is to be sent now, and the messages that no longer wait for one that would come too late."""
        found = self._noted(self.sequencer.expire(now), now)
        while self._later and self._later[0].time <= now:
            self._do(heappop(self._later), now)
        if self._stop_repeats.time <= now:
            self._stop_again(now)
        wanted = self.sequencer.wanted(now, MAX_WANTED)
        if wanted:
            self._request(wanted, now)
        if self._time_request is not None and self._time_request.due <= now:
            self._say(Kind.REPORT, self._time_request.question(now), now)
            self.admission.nonce = self._time_request.nonce
        if self._digest_timer.is_due(now):
            self._say(Kind.DIGEST, self._digest(), now)
        return self.posted(), found

    def due(self) -> float:
        """When `step` has something to do next, s of Unix time; it may be called earlier."""
        later = min(self._later[0].time if self._later else inf, self._stop_repeats.time)
        ask = inf if self._time_request is None else self._time_request.due
        return -inf if self._out else min(later, ask, self.sequencer.due(), self._digest_timer.due())

    def skipped(self) -> list[Skipped]:
        """The commands that never came, since this was asked last."""
        return self.sequencer.take_skipped()

    def _do(self, job: Repair | Repeat, now: float) -> None:
        if isinstance(job, Repeat):
            self._out += job.datagrams
            return
        for number, *parts in job.wanted:
            if self._repair_bytes.left(now) <= 0.0:
                return
            found = self._store.take(job.stream.name, number, now, now - REPAIR_PAUSE, parts)
            self._repair_bytes.spend(sum(map(len, found)))
            self._out += found

    def _stop_again(self, now: float) -> None:
        """Send what copies of our STOP are due: whoever is late sends those that he owes, as each may be the one that
        is heard."""
        time, until, datagrams = self._stop_repeats
        owed = int((min(now, until) - time) / STOP_EVERY) + 1
        self._out += datagrams * owed
        time += owed * STOP_EVERY
        self._stop_repeats = StopRepeats(time, until, datagrams) if time <= until else StopRepeats()

    def _say(self, kind: Kind, body: dict[str, object], now: float) -> None:
        message = Message(self.name, self.epoch, self._number(), kind, now, now + LIFE, body=body)
        self._out += encode(message, self.admission.fleet, self._key)


# ---- the bodies of digests and requests
#
# have     a digest's list of streams, each with the number of its latest standing command
# want     a request's list of streams, each with the numbers of missing commands
# parts    a request's list of commands of which some parts have come, each with the numbers of the others

MAX_ASKED = 24
"""Commands of which parts are looked at in one request."""

Value = TypeVar("Value")


def streams_in(body: dict[str, object], what: str, kind: type[Value]) -> list[tuple[StreamId, Value]]:
    """Streams, each with a value, as digests and requests have them; what is no such thing is left out."""
    found = []
    listed = body.get(what)
    for each in listed[:MAX_STREAMS] if isinstance(listed, list) else ():
        match each:
            case [bytes() as key, int() as epoch, value] if isinstance(value, kind):
                found.append(((key, epoch), value))
    return found


def wanted_parts(body: dict[str, object]) -> list[tuple[StreamId, int, list[int]]]:
    """Parts that are wanted of commands; what is no such thing is left out."""
    found = []
    listed = body.get("parts")
    for each in listed[:MAX_ASKED] if isinstance(listed, list) else ():
        match each:
            case [bytes() as key, int() as epoch, int() as number, list() as said]:
                numbers = [part for part in said[:MAX_PARTS] if isinstance(part, int)]
                found += [((key, epoch), number, numbers)] if numbers else []
    return found


def request(missing: Iterable[tuple[StreamId, int, Sequence[int]]]) -> dict[str, object]:
    """A body that asks for these commands, or for those of their parts that are named."""
    whole: dict[StreamId, list[int]] = {}
    some: list[object] = []
    for name, number, parts in missing:
        if parts:
            some.append([*name, number, [*parts]])
        else:
            whole.setdefault(name, []).append(number)
    want: list[object] = [[*name, numbers] for name, numbers in whole.items()]
    return {what: listed for what, listed in (("want", want), ("parts", some)) if listed}
