"""The sequencer puts commands in order: which can be handled, which wait for earlier ones, and which are missing.

Each command names in its `Predecessors` the previous command with its deadline, and the previous standing command. So a
receiver detects a gap at the next command that it receives. It waits for a missing standing command without limit;
for any other only until its deadline, and not at all if it joined after that one was sent.
"""

from __future__ import annotations

from bisect import bisect_right
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence, Set
from math import exp, inf, log1p, log2
from random import Random

import msgspec

from sleepcast.channel.fair_table import FairTable
from sleepcast.channel.message import Message, Predecessors
from sleepcast.core.backoff import Backoff
from sleepcast.core.records import NamedTuple

MAX_STREAMS = 64
"""Streams (senders of commands, per epoch) that are kept in order; beyond, one of the key that has the most is dropped,
those without rules before others."""
MAX_WAITING = 1_024
"""Waiting commands of one stream; beyond, the latest ones are dropped, and requested again later."""
_MAX_MISSING = 64
"""Missing commands of one stream that are requested at a time; the rest follows."""
_MAX_PUT_OFF = 4
"""Requests of others that put off ours: whoever asks without end keeps nobody else from asking."""
_MAX_SKIPPED = 1_024
"""Skipped commands that are remembered: the latest."""
_ASK_AFTER = (0.02, 0.08)
"""Seconds before a missing command is requested, at random between these: its sender also repeats it on its own."""
ASK_AGAIN, _ASK_SELDOM = 0.15, 2.0
"""Seconds after which it is requested again: at first, and at most; doubled each time."""
SLACK = 0.25
"""Seconds after a deadline during which a command may still be on its way."""


class Skipped(NamedTuple):
    """A command that never arrived, and is now too late. key: id of its sender's key."""

    key: bytes
    epoch: int
    sequence: int


class MissingCommand(msgspec.Struct):
    """A missing command.

    due: time of the next request, s
    until: when it is too late, s
    pauses: until the next requests
    put_off: how often others' requests have put off ours
    """

    due: float
    until: float = inf
    pauses: Backoff = msgspec.field(default_factory=lambda: Backoff(ASK_AGAIN, _ASK_SELDOM))
    put_off: int = 0


class Stream(msgspec.Struct):
    """The commands of one sender in one epoch.

    done: number of the latest that was handled, or skipped
    sent, until: when that was issued, and its deadline, s
    standing: numbers of the handled standing ones that count
    waiting: commands that came too early, by number
    wanted: missing ones
    base: number of the latest standing command that says which before it still count (`only`); 0 for none
    over: numbers of handled ones that do not count any more; we resend them only to parties that know nothing of this
    """

    name: StreamId
    done: int = 0
    sent: float = inf
    until: float = inf
    standing: list[int] = msgspec.field(default_factory=list)
    waiting: dict[int, Message] = msgspec.field(default_factory=dict)
    wanted: dict[int, MissingCommand] = msgspec.field(default_factory=dict)
    base: int = 0
    only: tuple[int, ...] = ()
    over: list[int] = msgspec.field(default_factory=list)

    def rebase(self, base: int, only: Sequence[int]) -> None:
        """A standing command says which before it still count. Of several, the latest decides."""
        if base <= self.base:
            return
        self.base, self.only = base, tuple(only)
        numbers = sorted((*self.standing, *self.over))
        self.standing = [number for number in numbers if self.counts(number)]
        self.over = [number for number in numbers if not self.counts(number)]
        one_shot = {number for number, message in self.waiting.items() if not message.standing}
        for table in (self.waiting, self.wanted):
            for number in [number for number in table if not self.counts(number) and number not in one_shot]:
                del table[number]

    def counts(self, number: int) -> bool:
        """Whether a standing command still counts."""
        index = bisect_right(self.only, number)
        return number >= self.base or (index > 0 and self.only[index - 1] == number)

    def after_rules(self, link: Predecessors) -> int:
        """The number of the standing command for which one with this link waits: the latest that still counts."""
        if link.rules >= self.base:
            return link.rules
        index = bisect_right(self.only, link.rules)
        return self.only[index - 1] if index else 0

    @property
    def rules(self) -> int:
        """Number of the latest standing command that was handled, 0 for none."""
        return self.standing[-1] if self.standing else 0

    def link(self) -> Predecessors:
        """The link of the next command."""
        return Predecessors(self.done, self.sent, self.until, self.rules)

    def deal_with(self, message: Message) -> None:
        """Record that the next command is handled."""
        self.done, self.sent, self.until = message.sequence, message.issued, message.deadline
        self.waiting.pop(message.sequence, None)
        self.wanted.pop(message.sequence, None)
        if message.standing:
            self.standing.append(message.sequence)


class Sequencer:
    """The streams of all senders of commands.

    chance: for the times of requests
    skew: largest clock difference, s
    lost: called with the id of a key of which a stream is dropped
    since: when we began to listen, s; earlier commands are not for us, unless they are standing
    """

    def __init__(
        self, chance: Random, skew: float, lost: Callable[[bytes, StreamId], object] = lambda *_: None
    ) -> None:
        self.since = -inf
        self._chance, self._skew = chance, skew
        self._streams = FairTable[StreamId, Stream, bytes](
            MAX_STREAMS, lasting=lambda stream: bool(stream.standing), lost=lost
        )
        self._skipped: deque[Skipped] = deque(maxlen=_MAX_SKIPPED)
        self._changed: set[StreamId] = set()

    def stream(self, name: StreamId) -> Stream:
        """The stream of a command that was verified, created if it is the first."""
        stream = self._streams.get(name) or Stream(name)
        self._streams.put(name[0], name, stream)
        return stream

    def find(self, name: StreamId) -> Stream | None:
        """The stream with this id, if a command of it was received: what others only tell makes no stream."""
        return self._streams.get(name)

    def knows(self, name: StreamId, number: int) -> bool:
        """Whether a command has arrived, and waits or was handled."""
        stream = self._streams.get(name)
        return stream is not None and (number <= stream.done or number in stream.waiting)

    def waiting(self, name: StreamId) -> set[int]:
        """Numbers of a stream's commands that came too early."""
        stream = self._streams.get(name)
        return set() if stream is None else set(stream.waiting)

    def deal_with(self, stream: Stream, message: Message) -> None:
        """Record that the next command of a stream is handled."""
        stream.deal_with(message)
        self._changed.add(stream.name)

    def news(self) -> tuple[StreamProgress, ...]:
        """The progress of the streams that have advanced since the last call."""
        moved = (self._streams.get(name) for name in self._changed)
        progress = tuple(
            StreamProgress(stream.name, stream.done, stream.sent, stream.until, stream.rules)
            for stream in moved
            if stream is not None
        )
        self._changed.clear()
        return progress

    def restore(self, streams: Iterable[StreamProgress], standing: Mapping[StreamId, Sequence[int]]) -> None:
        """Restore streams. standing: numbers of each one's standing commands, ascending."""
        for progress in streams:
            stream = self.stream(progress.stream)
            stream.done, stream.sent, stream.until = progress.done, progress.sent, progress.until
            stream.standing = [number for number in standing.get(stream.name, ()) if number <= progress.rules]

    def standing(self) -> dict[StreamId, int]:
        """Number of the latest standing command of each stream that has any."""
        return {stream.name: stream.rules for stream in self._streams.values() if stream.standing}

    def take(self, stream: Stream, message: Message, now: float) -> list[Message]:
        """The commands that can be handled now that this one has arrived, in order."""
        if message.sequence <= stream.done or (message.standing and not stream.counts(message.sequence)):
            return []
        stream.waiting[message.sequence] = message
        stream.wanted.pop(message.sequence, None)
        if len(stream.waiting) > MAX_WAITING:
            del stream.waiting[max(stream.waiting)]
        return self._advance(stream, now)

    @property
    def names(self) -> tuple[StreamId, ...]:
        """The ids of all streams."""
        return tuple(self._streams)

    def settle(self, key: bytes, counting: Set[tuple[StreamId, int]]) -> None:
        """A key was revoked: of its commands only these still count. Others that wait, are wanted or were standing are
        dropped; their effects remain. What does not count says nothing of others either (`Stream.rebase`)."""
        for stream in self._streams.values():
            if stream.name[0] == key:
                numbers = {number for name, number in counting if name == stream.name}
                if stream.base not in numbers:
                    stream.base, stream.only = 0, ()
                handled = sorted(number for number in numbers if number <= stream.done)
                stream.standing = [number for number in handled if stream.counts(number)]
                stream.over = [number for number in handled if not stream.counts(number)]
                stream.waiting = {number: each for number, each in stream.waiting.items() if number in numbers}
                stream.wanted.clear()
                self._changed.add(stream.name)

    def expire(self, now: float) -> list[Message]:
        """Commands that need not wait any longer, because the missing ones before them are now too late."""
        return [
            message for stream in self._streams.values() if stream.waiting for message in self._advance(stream, now)
        ]

    def wanted(self, now: float, most: int) -> dict[StreamId, list[int]]:
        """The missing commands to ask for at `now`, at most `most`."""
        numbers: dict[StreamId, list[int]] = {}
        for stream in self._streams.values():
            for number, want in list(stream.wanted.items()):
                if want.until < now:
                    del stream.wanted[number]
                elif want.due <= now and most > 0:
                    numbers.setdefault(stream.name, []).append(number)
                    want.due = now + want.pauses.take() * (1.0 + mostly_late(self._chance)) / 2.0
                    want.put_off = 0
                    most -= 1
        return numbers

    def want_parts(self, name: StreamId, number: int, until: float, due: float) -> None:
        """Parts of a command have arrived: request the others from `due` to `until`, s."""
        stream = self.stream(name)
        if number > stream.done and number not in stream.wanted and len(stream.wanted) < _MAX_MISSING:
            stream.wanted[number] = MissingCommand(due + _ASK_AFTER[1] * mostly_late(self._chance), until=until + SLACK)

    def asked(self, name: StreamId, numbers: Sequence[int], now: float) -> None:
        """Another party has requested these commands, so we wait a while, but not for ever."""
        stream = self._streams.get(name)
        wanted = {} if stream is None else stream.wanted
        for number in wanted.keys() & set(numbers):
            want = wanted[number]
            if want.put_off < _MAX_PUT_OFF:
                want.due, want.put_off = max(want.due, now + want.pauses.pause), want.put_off + 1

    def due(self) -> float:
        """When to request something next, or to stop waiting for it, s."""
        due = inf
        for stream in self._streams.values():
            if stream.wanted:
                due = min(due, *(want.due for want in stream.wanted.values()))
            if stream.waiting:
                link = stream.waiting[min(stream.waiting)].link
                if stream.after_rules(link) <= stream.rules:  # it waits for rules without limit
                    due = min(due, link.until + SLACK)
        return due

    def take_skipped(self) -> list[Skipped]:
        """The commands that were skipped since the last call."""
        skipped = list(self._skipped)
        self._skipped.clear()
        return skipped

    def _advance(self, stream: Stream, now: float) -> list[Message]:
        ready = []
        while stream.waiting:
            message = stream.waiting[min(stream.waiting)]
            if not self._is_next(stream, message, now):
                break
            self.deal_with(stream, message)
            if message.standing or message.issued >= self.since - self._skew:  # it is for us, whichever clock is wrong
                ready.append(message)
        return ready

    def _is_next(self, stream: Stream, message: Message, now: float) -> bool:
        """Whether the earliest waiting command can be handled; if one before it is missing, that one is wanted."""
        link = message.link
        rules = stream.after_rules(link)
        if rules > stream.rules:
            self._want(stream, rules, now)
            return False
        if link.after > max(stream.done, link.rules) and link.sent >= self.since:  # a standing one was dealt with above
            if now <= link.until + SLACK:
                self._want(stream, link.after, now)
                return False
            stream.wanted.pop(link.after, None)
            self._skipped.append(Skipped(*stream.name, link.after))
        return True

    def _want(self, stream: Stream, number: int, now: float) -> None:
        if number not in stream.wanted and len(stream.wanted) < _MAX_MISSING:
            soonest, latest = _ASK_AFTER
            stream.wanted[number] = MissingCommand(now + soonest + (latest - soonest) * mostly_late(self._chance))


# ---- when to send digests: the Trickle algorithm (RFC 6206), rare while all agree, soon after a difference


SOONEST, LATEST = 0.4, 60.0
"""Seconds of the shortest interval, while there is news, and of the longest."""
ENOUGH = 2
"""Equal digests of others in an interval after which ours is omitted."""
CROWD, SOONEST_SLOW = 8, 6.4
"""Equal digests in an interval, of which most came too late to keep others from being sent: more than these, and the
shortest interval grows, up to so many seconds."""
_SHRINK = 0.9
"""Factor of the shortest interval after one with fewer."""
STEEPNESS = 10.0
"""How rarely `mostly_late` draws small numbers: enough for some ten thousand parties."""


def mostly_late(chance: Random, steepness: float = STEEPNESS) -> float:
    """A random back-off from [0, 1], exponentially biased towards late: of a thousand parties one or two are early, and
    the others hear them and stay silent. No party needs to know their number (Nonnenmacher and Biersack, Scalable
    feedback for large groups, IEEE/ACM Transactions on Networking 7, 1999). steepness: 1 + ln n suits n parties."""
    return log1p(chance.random() * (exp(steepness) - 1.0)) / steepness


class DigestTimer:
    """One party's timer. chance: for the moment within each interval. It is idle until the first restart.

    soonest: the shortest interval, s. Within it all but the first few are to stay silent; but on a slow network they
    hear those too late, and a thousand may send before. So it grows with the number of equal digests that come, as the
    waits of repairs do (`repair_timer`), and becomes shorter again when few come."""

    def __init__(self, chance: Random) -> None:
        self._chance, self.soonest = chance, SOONEST
        self._interval, self._ends, self._speaks, self._alike = SOONEST, inf, inf, 0

    def restart(self, now: float) -> None:
        """A party's digest differs: begin the shortest interval, unless it is running."""
        if self._ends == inf or self._interval > self.soonest:
            self._begin(now, self.soonest)

    def agree(self) -> None:
        """A party has sent a digest equal to ours."""
        self._alike += 1

    def is_due(self, now: float) -> bool:
        """Whether to send a digest now; to be called from `due` on."""
        speak = self._speaks <= now and self._alike < ENOUGH
        if self._speaks <= now:
            self._speaks = inf
        if self._ends <= now:
            if self._alike > CROWD:
                self.soonest = min(max(self.soonest, self._interval * log2(self._alike)), SOONEST_SLOW)
            else:
                self.soonest = max(_SHRINK * self.soonest, SOONEST)
            self._begin(now, min(max(2.0 * self._interval, self.soonest), LATEST))
        return speak

    def due(self) -> float:
        """When to call `is_due` next, s."""
        return min(self._speaks, self._ends)

    def _begin(self, now: float, interval: float) -> None:
        self._interval, self._ends, self._alike = interval, now + interval, 0
        self._speaks = now + interval * (1.0 + mostly_late(self._chance)) / 2.0


# ---- stored commands for parties that have missed them, and the state of reliable delivery that outlasts its process:
# delivery reports changes as `DeliveryState`s; together they restore it

StreamId = tuple[bytes, int]
"""Identifies a stream of commands: the id of the sender's key, and the epoch."""


class StreamProgress(NamedTuple):
    """The progress of a stream.

    done: number of the latest handled command
    sent, until: its time of issue and deadline, s of Unix time, inf for a standing one
    rules: number of the latest standing one
    """

    stream: StreamId
    done: int
    sent: float
    until: float
    rules: int


class StoredWindow(NamedTuple):
    """The messages received from one sender in one epoch. key: its id; numbers: bit i is message `latest - i`."""

    key: bytes
    sender: str
    epoch: int
    latest: int
    numbers: int

    def without(self, numbers: set[int]) -> StoredWindow:
        """The same without these messages."""
        most = self.numbers.bit_length()
        gone = sum(1 << self.latest - number for number in numbers if 0 <= self.latest - number < most)
        return self._replace(numbers=self.numbers & ~gone)


class StandingCommand(NamedTuple):
    """A standing command and its datagrams."""

    stream: StreamId
    number: int
    datagrams: tuple[bytes, ...]


class DeliveryState(NamedTuple):
    """What has changed since the last call."""

    streams: tuple[StreamProgress, ...] = ()
    windows: tuple[StoredWindow, ...] = ()
    standing: tuple[StandingCommand, ...] = ()


_MAX_RECENT = 512
"""Other commands that are stored: those of the last five seconds at a hundred a second. Beyond, one of the key that has
the most gives way, as among the standing ones."""
MAX_STANDING = 20_000
"""Standing commands that are stored, of all senders: months of a busy desk, some ten megabytes."""


class StoredCommand(msgspec.Struct):
    """A command's datagrams, and when each was last on the air (s)."""

    datagrams: tuple[bytes, ...]
    heard: list[float]


class MessageStore:
    """The bytes of commands, and when each datagram was last on the air."""

    def __init__(self) -> None:
        self._standing = FairTable[tuple[StreamId, int], StoredCommand, bytes](MAX_STANDING)
        self._over: dict[tuple[StreamId, int], None] = {}
        """Standing ones that do not count any more (`Stream.rebase`): they give way first, a key's own before all."""
        self._recent = FairTable[tuple[StreamId, int], StoredCommand, bytes](_MAX_RECENT)
        self._news: list[StandingCommand] = []

    def keep(
        self,
        stream: StreamId,
        number: int,
        standing: bool,
        datagrams: tuple[bytes, ...],
        now: float,
        counts: bool = True,
    ) -> None:
        """Store a command that was received or sent at `now` (s). counts: whether it still does, if it is standing."""
        stored = self._standing if standing else self._recent
        if standing and (stream, number) not in stored:
            self._news.append(StandingCommand(stream, number, datagrams))
            self._make_room(stream[0])
        if standing and not counts:
            self._over[stream, number] = None
        stored.put(stream[0], (stream, number), StoredCommand(datagrams, [now] * len(datagrams)))

    def rebase(self, stream: Stream) -> None:
        """What does not count any more in a stream gives way first."""
        over = {which: None for which in self._over if which[0] != stream.name}
        named = (which for which in self._standing if which[0] == stream.name)
        self._over = over | {which: None for which in named if not stream.counts(which[1])}

    def _make_room(self, key: bytes) -> None:
        while self._over and len(self._standing) >= MAX_STANDING:
            gone = next((which for which in self._over if which[0][0] == key), next(iter(self._over)))
            del self._over[gone]
            self._standing.pop(gone)

    def news(self) -> tuple[StandingCommand, ...]:
        """The standing commands that were stored since the last call."""
        commands = tuple(self._news)
        self._news.clear()
        return commands

    def restore(self, standing: Iterable[StandingCommand], counts: Callable[[StreamId, int], bool]) -> None:
        """Restore stored commands, oldest first; all count as not on the air for long. counts: which still do."""
        for each in standing:
            self.keep(each.stream, each.number, True, each.datagrams, -inf, counts(each.stream, each.number))
        self._news.clear()

    def heard(self, stream: StreamId, number: int, datagram: bytes, now: float) -> bool:
        """Whether this datagram is stored; if so, record that it was heard at `now` (s)."""
        stored = self._find(stream, number)
        if stored is None or datagram not in stored.datagrams:
            return False
        stored.heard[stored.datagrams.index(datagram)] = now
        return True

    def silent_since(self, stream: StreamId, number: int, time: float, parts: Sequence[int] = ()) -> bool:
        """Whether a stored command has any of these parts (all, if none is named) that has not been on the air since
        `time` (s)."""
        stored = self._find(stream, number)
        return stored is not None and any(stored.heard[part] < time for part in _named(stored, parts))

    def datagrams(self, stream: StreamId, number: int) -> tuple[bytes, ...]:
        """The datagrams of a stored command; none if it is not stored."""
        stored = self._find(stream, number)
        return () if stored is None else stored.datagrams

    def take(
        self, stream: StreamId, number: int, now: float, since: float = inf, parts: Sequence[int] = ()
    ) -> tuple[bytes, ...]:
        """The parts of a command that have not been on the air since `since` (s), and are marked as on the air now;
        empty if it is not stored. parts: all, if none is named."""
        stored = self._find(stream, number)
        if stored is None:
            return ()
        silent = [part for part in _named(stored, parts) if stored.heard[part] < since]
        for part in silent:
            stored.heard[part] = now
        return tuple(stored.datagrams[part] for part in silent)

    def standing(self, key: bytes) -> dict[tuple[StreamId, int], tuple[bytes, ...]]:
        """The stored standing commands of a key: their datagrams by stream and number."""
        return {which: kept.datagrams for which, kept in self._standing.items() if which[0][0] == key}

    def _find(self, stream: StreamId, number: int) -> StoredCommand | None:
        return self._standing.get((stream, number)) or self._recent.get((stream, number))


def _named(stored: StoredCommand, parts: Sequence[int]) -> Sequence[int]:
    """Those of the named parts that exist; all, if none is named."""
    existing = range(len(stored.datagrams))
    return [part for part in parts if part in existing] if parts else existing


# ---- what digests tell of streams: heard from others, and never verified. Only a command that was received makes a
# stream. Anybody whose key may send a digest can name streams that do not exist, so what digests say is kept apart:
# each key that tells has a room of its own, in which it replaces only what it told itself, and what it does not repeat
# is forgotten


MAX_REPORTED = 4_096
"""Streams that are remembered as others tell of them: `MAX_STREAMS` of each of 64 keys, half a megabyte."""
REPORTED_FOR = 600.0
"""Seconds for which it is remembered that somebody told of a command: digests come every minute at least."""


class LatestStanding(NamedTuple):
    """The number of a stream's latest standing command, and when it was last told, s."""

    number: int
    time: float


class ReportedStreams:
    """The latest standing command of each stream, as others tell. lost: called with the key of a teller that has told
    of more streams than are remembered of one key."""

    def __init__(self, lost: Callable[..., object] = lambda *_: None) -> None:
        self._reported = FairTable[tuple[str, StreamId], LatestStanding, str](MAX_REPORTED, each=MAX_STREAMS, lost=lost)

    def hear(self, teller: str, told: Mapping[StreamId, int], now: float, falling: Callable[[StreamId], bool]) -> None:
        """A digest that was signed with this key, at `now`, s. falling: of which streams a smaller number counts."""
        for name, number in told.items():
            before = self._reported.get((teller, name))
            if before is None or number >= before.number or falling(name) or now - before.time > REPORTED_FOR:
                self._reported.put(teller, (teller, name), LatestStanding(number, now))

    def latest(self, now: float) -> dict[StreamId, int]:
        """The highest number that is told of each stream."""
        for which in [which for which, told in self._reported.items() if now - told.time > REPORTED_FOR]:
            self._reported.pop(which)
        numbers: dict[StreamId, int] = {}
        for (_, name), told in self._reported.items():
            numbers[name] = max(told.number, numbers.get(name, 0))
        return numbers


# ---- whether a robot catches up: it was off or out of reach, and takes standing commands that are old. Each was right
# in its time, and one that is still to come may have replaced it. So the robot rests until it has all of them


OLD = 60.0
"""Seconds after its issue from which a standing command is old. Whoever was out of reach for less need not rest, and
interrupt what it does: commands of one minute hardly contradict each other."""
QUIET = 2.0
"""Seconds after the latest old command for which there may be more of which nobody has told yet: the digests of others
come sooner, unless several are lost."""
PATIENCE = 30.0
"""Seconds after the latest old command for which a robot waits for others that it has been told of. Whoever told of
them may be gone, or may have lied."""


class CatchingUp:
    """One receiver's judgement. told: what others tell. Times are s of Unix time."""

    def __init__(self, told: ReportedStreams) -> None:
        self._reported, self._latest = told, -inf

    def take(self, issued: float, now: float) -> None:
        """A standing command, issued at that time, is taken at `now`."""
        if now - issued > OLD:
            self._latest = now

    def lasts(self, have: Mapping[StreamId, int], now: float) -> bool:
        """Whether it lasts at `now`. have: the latest standing command of each stream that was taken here."""
        since = now - self._latest
        if since >= PATIENCE:
            return False
        return since < QUIET or any(number > have.get(name, 0) for name, number in self._reported.latest(now).items())
