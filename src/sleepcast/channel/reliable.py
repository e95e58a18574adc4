"""Reliable delivery: every command reaches every party, in order and once, over a radio that loses messages.

It has no socket and no clock: datagrams and the time go in, messages and datagrams come out.

send     a command is sent at once, and a few more times at growing intervals
order    each command names the previous one and the previous standing one, so that gaps show (`sequencer`).
         Commands after a gap wait until it is filled, or until the missing one is too late anyway
repair   a party that misses a command requests it. Any party that has it sends it again, after a random wait, unless
         another one does so first (`repair_timer`). The datagrams are the original sender's, so no repairer needs to
         be trusted (`sequencer.MessageStore`)
rules    all parties store standing commands. Digests report the progress of each party: more and more rarely while
         all agree, at once after a difference (`sequencer.DigestTimer`)

Messages of other kinds are passed on as they come.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from heapq import heappop, heappush
from itertools import count
from math import inf
from random import Random

import msgspec

from sleepcast.channel.admission import Admission, RateLimit, TokenBucket
from sleepcast.channel.baselines import is_base, message_of, missing_of, rebase
from sleepcast.channel.clock_sync import MAX_TRIP, NONCE_BYTES, TimeReply, TimeRequest
from sleepcast.channel.envelope import Fragment, encode
from sleepcast.channel.keys import MAY, KeyChange, KeyPair, KeyRefusal
from sleepcast.channel.message import (
    BASES,
    BID,
    GRANTS,
    KEYS,
    ONLY,
    TIME,
    WHOSE,
    Kind,
    Message,
    Role,
    age_of,
    message_id,
)
from sleepcast.channel.repair_bodies import request, streams_in, wanted_parts
from sleepcast.channel.repair_timer import RepairTimer
from sleepcast.channel.round_trips import RoundTrips
from sleepcast.channel.sequencer import (
    MAX_STREAMS,
    CatchingUp,
    DeliveryState,
    DigestTimer,
    MessageStore,
    ReportedStreams,
    Sequencer,
    Skipped,
    Stream,
    StreamId,
)
from sleepcast.core.clock import MADE
from sleepcast.core.records import NamedTuple

REPEATS = (0.03, 0.09, 0.21, 0.45)
"""Seconds after which a command is sent again, unasked: at 30 % loss two in a thousand receive none of the five."""
_ASK_PARTS_AFTER = 0.21
"""Seconds after which the missing parts of a command are asked for: three repeats later."""
REPEATED = frozenset({Kind.COMMAND, Kind.ASK, Kind.RELEASE})
STOP_EVERY = 0.01
"""Seconds between two copies of a STOP: a hundred a second are a tenth of what a slow radio carries. A robot checks one
in sixteen while 80,000 a second are forged (`admission.STOPS_A_SECOND`), so it needs many, and soon."""
STOP_FOR, STOP_ON = 1.0, 0.1
"""Seconds for which copies of a STOP are sent; and of one that is sent again for silent robots, once the first is older
than `STOP_AT_FIRST`."""
STOP_AT_FIRST = 5.0
"""Seconds after which every robot in reach has received a STOP."""
LIFE = 5.0
"""Seconds for which a command counts, unless its sender says otherwise. Only standing commands have no end."""
REPAIR_RATE = 100_000.0
"""Bytes that a party resends per second, and at once: a tenth of what a slow radio carries, and four of the longest
expressions. Half of that is for others than the key that asks most. Excess requests are ignored; parties that miss more
ask again."""
BATCH = 24
"""Commands resent for one digest or request: the rest follows with the next one."""
KEEP_EVERY = 256
"""Sequence numbers that may be used before they are saved again."""
TIME_REPLIES_A_SECOND = 20.0
"""Replies to time requests in a second: replayed requests cause no more traffic than that."""
MAX_WANTED = 64
"""Numbers in one request."""


class Repair(NamedTuple):
    """Commands that a party misses, to be resent in order.

    time: when, s
    tie: makes equal times comparable
    stream: of the commands
    wanted: their numbers, each with the numbers of its parts if only some are wanted
    silent_since: what was on the air after that (s) is left out
    key: of whoever has requested them
    """

    time: float
    tie: int
    stream: StreamId
    wanted: Sequence[Sequence[int]]
    silent_since: float
    key: str


class Repeat(NamedTuple):
    """A command of our own, to be sent again at a time (s)."""

    time: float
    tie: int
    datagrams: tuple[bytes, ...]


class StopRepeats(NamedTuple):
    """Our latest STOP, of which copies are sent: the next one at `time`, the last one before `until` (s)."""

    time: float = inf
    until: float = inf
    datagrams: tuple[bytes, ...] = ()


class RepairBudget:
    """Bytes that may be resent. Each key may ask for half of them; for more only while more than half is left, so that
    whoever asks without end leaves the rest to the others. Keys are those of who asks; times are s."""

    def __init__(self) -> None:
        self._all = TokenBucket(REPAIR_RATE, REPAIR_RATE, 0.0)
        self._of: dict[str, TokenBucket] = {}
        """Of each key. The number of trusted keys bounds it."""
        self._planned: Counter[str] = Counter()
        """Bytes that are to be resent soon for each key."""

    def plan(self, key: str, size: int, now: float) -> bool:
        """Whether a command of so many bytes may be resent soon for this key. If so, call `confirm` then."""
        if not self._allows(key, now, self._planned[key], self._planned.total()):
            return False
        self._planned[key] += size
        return True

    def confirm(self, key: str, size: int, now: float) -> bool:
        """Whether the command may be resent now: others may have been faster."""
        self._planned[key] -= size
        return self._all.left(now) > 0.0 and self._allows(key, now)

    def spend(self, key: str, size: int) -> None:
        """So many bytes were resent for this key."""
        self._all.spend(size)
        self._of[key].spend(size)

    def _allows(self, key: str, now: float, planned: int = 0, planned_in_all: int = 0) -> bool:
        half = REPAIR_RATE / 2.0
        own = self._of.setdefault(key, TokenBucket(half, half, now))
        return own.left(now) > planned or self._all.left(now) - planned_in_all > half


class ReliableDelivery:
    """One party's delivery.

    name: of its messages
    epoch: higher than in all earlier lives, or the same with `first` higher than every number used in it
    key: signs messages
    admission: checks datagrams
    chance: for random moments
    first: number of the first message
    keep: called before a standing command of ours is sent, and every `KEEP_EVERY` numbers, to save them
    sequencer: the progress of each stream
    overheard: datagrams that were stored already; all others are counted by the admission
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
        admission.own = b"" if admission.robot else message_id(name, epoch, 0)[:-1].encode()
        self.sequencer = Sequencer(chance, admission.skew, admission.no_room)
        self.overheard = 0
        self._key, self._chance = key, chance
        self._store = MessageStore()
        self._repairs = RepairTimer(chance)
        self._digest_timer = DigestTimer(chance)
        self._reported = ReportedStreams(lambda key, _: admission.no_room(bytes.fromhex(key)))
        self._catching_up = CatchingUp(self._reported)
        self._sequence, self._issued, self._keep = first - 1, 0.0, keep
        self._out: list[bytes | TimeReply] = []
        self._later: list[Repair | Repeat] = []
        self._stop_repeats = StopRepeats()
        self._tie = count()
        self._time_request: TimeRequest | None = None
        self._time_replies = RateLimit(TIME_REPLIES_A_SECOND, TIME_REPLIES_A_SECOND, chance, 0.0)
        self.trips = RoundTrips(chance)
        """By which the clocks of those who command us are measured."""
        self._repair_bytes = RepairBudget()
        self._conflicts = admission.conflicts
        if admission.robot:
            self._conflicts.hold({name: epoch})

    # ---- sending

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
        """Compose and queue a message at `now` (s of Unix time), and return it. Raises MessageError if it is too
        long."""
        message = self.compose(kind, now, text=text, deadline=deadline, standing=standing, body=body)
        self.queue(message, now)
        return message

    def compose(
        self,
        kind: Kind,
        now: float,
        *,
        text: str = "",
        deadline: float | None = None,
        standing: bool = False,
        body: dict[str, object] | None = None,
    ) -> Message:
        """Our next message, with its number and, if it is a command, its link. deadline: s of Unix time; None for
        `LIFE` from now, or for no deadline if it is standing. Call `queue` with it before composing another one."""
        until = (inf if standing else now + LIFE) if deadline is None else deadline
        number, fields, issued = self._number(), dict(body or {}), now
        if kind is Kind.COMMAND:
            fields |= self._own().link().written()
            if 0.0 <= self._issued - now <= self.admission.skew:
                issued = self._issued  # if the clock was set back, no command may seem older than the last
            self._issued = issued
        return Message(self.name, self.epoch, number, kind, issued, until, text, standing, fields)

    def queue(self, message: Message, now: float) -> None:
        """Queue a message that was composed; see `posted`. Raises MessageError if it is too long."""
        kind, own = message.kind, self._own()
        datagrams = tuple(encode(message, self.admission.fleet, self._key))
        if kind is Kind.COMMAND:
            if ONLY in message.body:  # before a full store lets go of what still counts
                rebase(own, message, self._store)
            self._store.keep(own.name, message.sequence, message.standing, datagrams, now)
            self.sequencer.deal_with(own, message)
            if message.standing:
                self._tell_progress(now)
            if KEYS in message.body:
                self._change_trust(msgspec.structs.replace(message, role=self.role.value), now)
            if message.standing:  # any other expires before our next life could send it again
                self._keep()
        self._out += datagrams
        if kind in REPEATED:
            for wait in REPEATS:
                if now + wait <= message.deadline:
                    heappush(self._later, Repeat(now + wait, next(self._tie), datagrams))
        if kind is Kind.STOP:
            lasts = STOP_FOR if age_of(message.body) < STOP_AT_FIRST else STOP_ON
            self._stop_repeats = StopRepeats(now + STOP_EVERY, now + lasts, datagrams)
        elif kind is Kind.RELEASE:
            self._stop_repeats = StopRepeats()

    def repeat(self, number: int, now: float) -> None:
        """Send a command of ours once more; parties that have received it ignore it."""
        self._out += self._store.take(self._own().name, number, now)

    def posted(self) -> Iterator[bytes]:
        """The datagrams that were queued since the last call. Send each before the next one is taken: replies to who
        asks for the time are composed as they are taken, so that what is sent before them is no part of the way."""
        out, self._out = self._out, []
        return (datagram for each in out for datagram in ((each,) if isinstance(each, bytes) else self._reply(each)))

    def _reply(self, to: TimeReply) -> list[bytes]:
        """The datagrams of a reply that leaves now."""
        now = self.admission.now()
        message = self.compose(Kind.HEARTBEAT, now, deadline=now + MAX_TRIP, body=to.body(now))
        return encode(message, self.admission.fleet, self._key)

    @property
    def next_number(self) -> int:
        """Sequence number of the next message."""
        return self._sequence + 1

    @property
    def key_id(self) -> bytes:
        """Id of our key."""
        return self._key.id

    @property
    def role(self) -> Role:
        """Role of our key."""
        return self._key.public.role

    def start(self, now: float) -> None:
        """Start listening at `now`. A robot sends a digest, so that others resend what it misses; an operator needs
        nobody's rules, and sends none before its first command."""
        if self.admission.robot:
            self.sequencer.since = now
            self._conflicts.begin(now)
            self._digest_timer.restart(now)

    def is_catching_up(self, now: float) -> bool:
        """Whether a robot misses standing commands of a past in which it did not hear them: see `CatchingUp`."""
        return self._catching_up.lasts(self.sequencer.standing(), now)

    def seek_time(self, set_clock: Callable[[float, str], None]) -> None:
        """Our clock is plainly wrong: ask for the time until an operator answers. set_clock: see `TimeRequest`."""
        self._time_request = TimeRequest(set_clock)

    def _number(self) -> int:
        """Take the next sequence number; copies of our own message that come back are dropped."""
        self._sequence += 1
        self.admission.note(self._key.id, self.name, self.epoch, self._sequence)
        if self._sequence % KEEP_EVERY == 0:
            self._keep()
        return self._sequence

    def _own(self) -> Stream:
        return self.sequencer.stream((self._key.id, self.epoch))

    # ---- receiving

    def turned_away(self) -> list[Message]:
        """See `Admission.turned_away`; to be asked when all that has come has been taken, since what was sent first may
        be old, as after a long start, while the clocks are right."""
        messages = self.admission.turned_away()
        if messages and self._time_request is not None:
            self._time_request.expedite()
        return messages

    def take(self, datagram: bytes, now: float) -> list[Message]:
        """The messages that this datagram makes ready to be handled."""
        part = self.admission.look(datagram)
        if part is None:
            return []
        if self._is_stored(part, datagram, now):
            self.overheard += 1
            return []
        entered = self.admission.admit(part, datagram)
        if entered is None:
            name = part.key, part.epoch  # only commands are stored; their sender repeats them first
            if part.kind is Kind.COMMAND and self.admission.robot and self._missing(name, part.sequence):
                self.sequencer.want_parts(name, part.sequence, part.deadline, now + _ASK_PARTS_AFTER)
            return []
        message = entered.message
        if TIME in message.body and message.kind in (Kind.REPORT, Kind.HEARTBEAT):
            self._deal_with_time(message, self.admission.arrival(datagram), now)
            return []
        if message.kind is Kind.DIGEST:
            self._compare(message, now)
            return []
        if message.kind is Kind.REQUEST:
            self._repair_requested(message, now)
            return [message] if BID in message.body or GRANTS in message.body else []
        if message.kind is Kind.ASK:
            self._conflicts.ask(message, now)
        if message.kind is not Kind.COMMAND or message.role == Role.ROBOT:
            return [message]  # messages between robots are neither ordered nor repaired
        name = part.key, part.epoch
        stream = self.sequencer.find(name) if not self.admission.robot else self.sequencer.stream(name)
        if stream is not None and ONLY in message.body:  # before a full store lets go of what still counts
            rebase(stream, message, self._store)
        counts = stream is None or stream.counts(message.sequence)
        self._store.keep(name, message.sequence, message.standing, entered.datagrams, now, counts)
        if KEYS in message.body:
            self._change_trust(message, now)
        if not self.admission.robot:
            return [message]  # an operator sees others' commands at once, without waiting for missing ones
        assert stream is not None
        return self._noted(self.sequencer.take(stream, message, now), now)

    def _deal_with_time(self, message: Message, arrived: float, now: float) -> None:
        """Handle a time request, or a reply to ours. Such a heartbeat does not count as a sign of the operator."""
        nonce = message.body[TIME]
        if message.kind is Kind.HEARTBEAT:
            request = self._time_request
            behind = None if request is None else request.answer(message, arrived)
            if self.trips.hear(message, arrived):
                self.admission.nonce = b""
            elif request is not None and behind is not None:
                self._time_request = None
                self.admission.forget_clocks()
                self.trips.clear()
                request.set_clock(behind, message.sender)
                self.sequencer.since = now + behind  # do not wait for messages that were dropped until now
                self._conflicts.begin(now + behind)
        elif (
            Kind.HEARTBEAT in MAY[self.role]
            and (isinstance(nonce, bytes) and len(nonce) == NONCE_BYTES)
            and now >= MADE  # we do not reply if our own clock is plainly wrong
            and (self.trips.replies(message, self.name, now) if WHOSE in message.body else self._time_replies.take(now))
        ):
            self._out.append(TimeReply(nonce, arrived))

    def standing_of(self, key: bytes) -> tuple[bytes, ...]:
        """The stored datagrams of the standing commands of a key that still count."""
        kept = self._store.standing(key).items()
        return tuple(
            datagram for (name, number), datagrams in kept if self._stands(name, number) for datagram in datagrams
        )

    def _stands(self, name: StreamId, number: int) -> bool:
        stream = self.sequencer.find(name)
        return stream is None or stream.counts(number)

    @property
    def own_rules(self) -> dict[int, Message | None]:
        """Our standing commands that still count, by number; None for one that is not stored any more."""
        kept, own = self._store.standing(self._key.id), self._own()
        return {
            number: message_of(kept[own.name, number]) if (own.name, number) in kept else None
            for number in own.standing
        }

    def _change_trust(self, message: Message, now: float) -> None:
        """Apply a change of keys at once, even if earlier commands of its sender are missing. One that is refused
        changes nothing; the answer says why."""
        with suppress(KeyRefusal):
            trust = self.admission.trust
            trust.take(KeyChange.of(message))
            for key in {name[0] for name in self.sequencer.names if self._is_revoked(name)}:
                kept = self._store.standing(key).items()
                counting = {which: datagrams for which, datagrams in kept if all(map(trust.vouches, datagrams))}
                self.sequencer.settle(key, counting.keys())
                self._rebase((name, datagrams) for (name, _), datagrams in counting.items())
            self._tell_progress(now)

    def _is_stored(self, part: Fragment, datagram: bytes, now: float) -> bool:
        """Whether this very datagram is stored, so that we need not resend it either. A robot may have stored a command
        that it had no room to keep waiting; that one is received again."""
        name = part.key, part.epoch
        if part.kind is not Kind.COMMAND or not self._store.heard(name, part.sequence, datagram, now):
            return False
        if part.number == 0:
            self._repairs.heard((name, part.sequence), now)
        return not self.admission.robot or self.sequencer.knows(name, part.sequence)

    def _noted(self, messages: list[Message], now: float) -> list[Message]:
        """These messages; if any is standing, our progress is sent to the others."""
        standing = [message for message in messages if message.standing]
        for message in standing:
            self._catching_up.take(message.issued, now)
        if standing:
            self._tell_progress(now)
        return messages

    def _tell_progress(self, now: float) -> None:
        """We have new standing commands: send a digest soon."""
        self._digest_timer.restart(now)

    # ---- state that outlasts the process

    def news(self) -> DeliveryState:
        """What has changed since the last call. Commands that wait for missing ones count as not received, so that they
        are requested again."""
        windows = (each.without(self.sequencer.waiting((each.key, each.epoch))) for each in self.admission.news())
        return DeliveryState(self.sequencer.news(), tuple(windows), self._store.news())

    def restore(self, kept: DeliveryState, since: float) -> None:
        """Restore the state of an earlier process. kept: the latest of all changes; since: when it began to listen, s.
        Standing commands that were not handled yet are left out: they come again; and those of a revoked key, unless
        they are vouched for."""
        self.sequencer.since = since
        rules = {progress.stream: progress.rules for progress in kept.streams}
        handled = [each for each in kept.standing if each.number <= rules.get(each.stream, 0)]
        dealt_with = [each for each in handled if self._counts(each.stream, each.datagrams)]
        numbers: dict[StreamId, list[int]] = {}
        for each in dealt_with:
            numbers.setdefault(each.stream, []).append(each.number)
        self.sequencer.restore(kept.streams, {name: sorted(listed) for name, listed in numbers.items()})
        self._rebase((each.stream, each.datagrams) for each in dealt_with)
        self._store.restore(dealt_with, self._stands)
        self.admission.restore(kept.windows)

    def _rebase(self, stored: Iterable[tuple[StreamId, tuple[bytes, ...]]]) -> None:
        """Take what stored standing commands say of those before them."""
        for name, datagrams in stored:
            stream = self.sequencer.find(name)
            if stream is not None and is_base(datagrams):
                rebase(stream, message_of(datagrams), self._store)

    def _counts(self, stream: StreamId, datagrams: Iterable[bytes]) -> bool:
        """Whether a command counts: its key is not revoked, or it is vouched for."""
        return not self._is_revoked(stream) or all(map(self.admission.trust.vouches, datagrams))

    # ---- repair

    def _compare(self, digest: Message, now: float) -> None:
        """Compare a digest with our own progress: resend what its sender misses, and tell soon what we miss. What it
        names may not exist, so it makes no stream."""
        told = streams_in(digest.body, "have", int)
        theirs = {name: rules for name, rules in told if self._role_of(name) is Role.COMMANDER}  # others have no rules
        ours = self.sequencer.standing()
        self._learn(digest, theirs, now)
        names = ours.keys() | theirs.keys() if self.admission.robot else ours.keys()
        alike, most = True, digest.body.get("most")
        left = max(most, 0) if isinstance(most, int) else BATCH * MAX_STREAMS
        for name in sorted(names):  # all resend the same, so that one does and the others hear it
            they, we, stream = theirs.get(name, 0), ours.get(name, 0), self.sequencer.find(name)
            alike &= they == we
            if they < we and stream is not None:
                missing = missing_of(stream, they, digest.body.get(BASES) is True)[: min(BATCH, left)]
                left -= len(missing)
                self._repair(name, [(number,) for number in missing], digest.key, now)
        if alike:
            self._digest_timer.agree()
        else:
            self._digest_timer.restart(now)

    def _learn(self, digest: Message, theirs: Mapping[StreamId, int], now: float) -> None:
        """Remember what a digest tells: a robot, for how long it has to catch up; an operator, of robots, what they
        have, and of nobody else, since it repeats that."""
        if self.admission.robot:
            theirs = {name: rules for name, rules in theirs.items() if not self._is_revoked(name)}
        elif digest.role != Role.ROBOT:
            return
        self._reported.hear(digest.key, theirs, now, self._is_revoked)  # a revoked key may lose commands

    def _digest(self, now: float) -> dict[str, object]:
        """The body of our digest. An operator repeats what robots tell about others' rules, so that nobody resends them
        to him; what we know ourselves has room first."""
        have = self.sequencer.standing()
        told = {} if self.admission.robot else self._reported.latest(now)
        others = sorted(told.keys() - have.keys())[: MAX_STREAMS - len(have)]
        have |= {name: told[name] for name in others}
        return {"have": [[*name, have[name]] for name in sorted(have)], BASES: True}

    def _missing(self, name: StreamId, number: int) -> tuple[int, ...]:
        """Missing parts of a command that has partly arrived."""
        key = self.admission.trust.find(name[0]) if self._commands(name) else None
        return () if key is None else self.admission.missing(name[0], key.owner, name[1], number)

    def _repair_requested(self, asked: Message, now: float) -> None:
        """Resend what is requested; those of the requested commands that are resent now, we do not request as well."""
        left = MAX_WANTED
        for name, listed in streams_in(asked.body, "want", list):
            numbers = tuple(number for number in listed[: min(left, BATCH)] if isinstance(number, int))
            if self._commands(name) and numbers:
                left -= len(numbers)
                self.sequencer.asked(name, numbers, now)
                self._repair(name, [(number,) for number in numbers], asked.key, now)
        for name, number, parts in wanted_parts(asked.body):
            if self._commands(name):
                if {*parts} >= {*self._missing(name, number)}:
                    self.sequencer.asked(name, (number,), now)
                self._repair(name, [(number, *parts)], asked.key, now)

    def _commands(self, name: StreamId) -> bool:
        """Whether a stream's sender may command."""
        role = self._role_of(name)
        return role is not None and Kind.COMMAND in MAY[role] and role is not Role.ROBOT

    def _role_of(self, name: StreamId) -> Role | None:
        """The role of a stream's sender, None for an unknown one."""
        key = self.admission.trust.find(name[0])
        return None if key is None else key.role

    def _is_revoked(self, name: StreamId) -> bool:
        key = self.admission.trust.find(name[0])
        return key is not None and key.revoked

    def _repair(self, stream: StreamId, asked: Sequence[Sequence[int]], key: str, now: float) -> None:
        """Resend commands of a stream soon, or parts of them. key: of whoever has asked."""
        silent_since = now - self._repairs.pause
        wanted = [
            each
            for each in asked
            if self._store.silent_since(stream, each[0], silent_since, each[1:])
            and self._counts(stream, self._store.datagrams(stream, each[0]))
            and not (len(each) == 1 and self._repairs.is_pending((stream, each[0]), now))
        ]
        due = now + self._repairs.wait()
        wanted = [each for each in wanted if self._repair_bytes.plan(key, self._size(stream, each[0]), now)]
        if wanted:
            heappush(self._later, Repair(due, next(self._tie), stream, wanted, silent_since, key))
            self._repairs.begin([(stream, each[0]) for each in wanted if len(each) == 1], now, due)

    def _size(self, stream: StreamId, number: int) -> int:
        return sum(map(len, self._store.datagrams(stream, number)))

    # ---- time

    def step(self, now: float) -> tuple[Iterator[bytes], list[Message]]:
        """The datagrams to send now, see `posted`, and the messages that need not wait any longer."""
        freed = self._noted(self.sequencer.expire(now), now)
        while self._later and self._later[0].time <= now:
            self._do(heappop(self._later), now)
        if self._stop_repeats.time <= now:
            self._stop_again(now)
        wanted = self.sequencer.wanted(now, MAX_WANTED)
        if wanted:  # missing commands, or missing parts of those that have partly arrived
            missing = [(name, number, self._missing(name, number)) for name, each in wanted.items() for number in each]
            self._send(Kind.REQUEST, request(missing), now)
        if self._time_request is not None and self._time_request.due <= now:
            self._send(Kind.REPORT, self._time_request.question(now), now)
            self.admission.nonce = self._time_request.nonce
        elif self._time_request is None and self.trips.due() <= now and (asks := self.trips.question(now)):
            self._send(Kind.REPORT, asks, now)
            self.admission.nonce = self.trips.nonce
        if self._digest_timer.is_due(now) or self._conflicts.due() <= now:
            self._send(Kind.DIGEST, self._digest(now) | self._conflicts.introduction(now), now)
        return self.posted(), freed

    def due(self) -> float:
        """When to call `step` next, s of Unix time; earlier calls do no harm."""
        later = min(self._later[0].time if self._later else inf, self._stop_repeats.time)
        ask = self.trips.due() if self._time_request is None else self._time_request.due
        digest = min(self._digest_timer.due(), self._conflicts.due())
        return -inf if self._out else min(later, ask, self.sequencer.due(), digest)

    def skipped(self) -> list[Skipped]:
        """The commands that never arrived, since the last call."""
        return self.sequencer.take_skipped()

    def _do(self, job: Repair | Repeat, now: float) -> None:
        if isinstance(job, Repeat):
            self._out += job.datagrams
            return
        for number, *parts in job.wanted:
            if not self._repair_bytes.confirm(job.key, self._size(job.stream, number), now):
                continue
            datagrams = self._store.take(job.stream, number, now, job.silent_since, parts)
            if datagrams:
                self._repairs.sent((job.stream, number))
            self._repair_bytes.spend(job.key, sum(map(len, datagrams)))
            self._out += datagrams

    def _stop_again(self, now: float) -> None:
        """Send the copies of our STOP that are due, including late ones: any of them may be the one that gets
        through."""
        time, until, datagrams = self._stop_repeats
        owed = int((min(now, until) - time) / STOP_EVERY) + 1
        self._out += datagrams * owed
        time += owed * STOP_EVERY
        self._stop_repeats = StopRepeats(time, until, datagrams) if time <= until else StopRepeats()

    def _send(self, kind: Kind, body: dict[str, object], now: float) -> None:
        message = Message(self.name, self.epoch, self._number(), kind, now, now + LIFE, body=body)
        self._out += encode(message, self.admission.fleet, self._key)
