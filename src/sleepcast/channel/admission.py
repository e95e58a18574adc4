"""Admission: which datagrams become messages. All others are counted, dropped, and never answered.

The cheap checks come first: length and layout, the key, what its owner may send, the deadline, and whether the
message was received before. The signature comes last. Each key has a rate limit for signatures, so that forgeries
cannot exhaust a robot. STOP has a larger one of its own, shared by all keys, so that no flood of other messages
keeps it out. In a flood signatures are checked at random (`RateLimit`); a STOP is repeated often, so one of its
copies is checked soon.
"""

from __future__ import annotations

from collections import OrderedDict, deque
from collections.abc import Callable, Iterable
from math import inf
from random import Random

import msgspec

from sleepcast.channel.clock_sync import ClockOffsets, WrongClocks
from sleepcast.channel.drops import DropCounter, DropReason
from sleepcast.channel.envelope import MAX_CONTENT, EnvelopeError, Fragment, Piece, look, read_message, read_piece
from sleepcast.channel.fair_table import FairTable
from sleepcast.channel.keys import MAY, PublicKey, Trust
from sleepcast.channel.message import TO_OPERATOR, Kind, Message, Role
from sleepcast.channel.name_conflicts import NameConflicts
from sleepcast.channel.sequencer import StoredWindow
from sleepcast.channel.transports.transport import address_of, waited
from sleepcast.core.clock import Clock

WINDOW = 4_096
"""Sequence numbers below a sender's latest that are tracked: more than arrive before a deadline passes."""
_WHOLE_WINDOW = (1 << WINDOW) - 1
"""All of them, as bits."""
_MAX_SENDERS = 16_384
"""Senders, per epoch, whose numbers are remembered; beyond, one of the key that has the most is dropped."""
_MAX_EPOCHS = 64
"""Epochs of one sender among them: whoever invents more loses their own."""
MAX_REASSEMBLIES = 64
"""Long messages that wait for more parts, from all senders together; at most seven megabytes. Beyond, one of the key
that has the most is dropped."""
VERIFIED_A_SECOND = 200.0
"""Signatures of one key that a robot checks in a second, unless another rate is given."""
VERIFIED_IN_ALL = 4_000.0
"""The same for all keys together, without STOPs: a quarter of a core's time, however many key ids a forger knows."""
VERIFIED_BY_OPERATOR = 4_000.0
"""The same for one key of robots at an operator, whom a thousand of them may answer at once: a quarter of a core's
time."""
ANSWERS_TO_OTHERS = 2_000.0
"""Of these, answers to messages of others, for all keys together: who asks much does not keep out what we asked."""
STOPS_A_SECOND = 5_000.0
"""Signatures of STOPs that a robot checks in a second, for all keys together: a third of a core's time. Of 80,000 in a
second it checks one in sixteen; a real STOP is sent a hundred times in its first second."""
STOPS_BY_OPERATOR = 500.0
"""The same for an operator, who only learns from STOPs that others have stopped robots."""
STOPS_AT_ONCE = 0.1
"""Seconds' worth of STOPs that may be checked at once: the start of a flood delays nothing by more than a tick."""
SKEW = 2.0
"""Seconds by which two clocks may differ, unless another bound is given."""
_TO_ROBOTS = frozenset({Kind.COMMAND, Kind.ASK})
"""Kinds that robots evaluate."""
ROBOT_KINDS = frozenset(Kind) - TO_OPERATOR
"""Kinds that robots receive."""
_LASTING = frozenset({Kind.COMMAND, Kind.STOP, Kind.RELEASE})
"""Kinds with lasting effects: a restart must not forget that they were received."""
_COMMANDING = _TO_ROBOTS | {Kind.RELEASE}
"""Kinds that a robot with a wrong clock answers with a notice."""
UNTIMELY_A_SECOND = 8.0
"""Signatures of messages with wrong times that a robot checks in a second, to answer that its clock is wrong. This also
bounds its answers to replayed recordings."""
_TIMELY = 60.0
"""Seconds for which a party with a timely message counts as having a right clock: its late messages are just old."""
TIMES_A_SECOND = 200.0
"""Signatures of possible answers to its time request that a robot without a clock checks in a second. Only messages
that contain its nonce count."""
_TELLS_OTHERS = b"\x64time\x50"
"""What is in a heartbeat that answers another robot's question for the time, and in no other: it is not verified."""
_MAX_TIMELY = 64
"""Operators for which the time of their last timely message is remembered, or that their clocks differ; beyond, the one
that has been silent longest is dropped. Each has one name."""
OLDEST = 3_600.0
"""Seconds after which a message without a deadline is dropped; standing commands are sent again."""


class ReplayWindow(msgspec.Struct):
    """The messages received from one sender in one epoch. latest: number of the newest; numbers: those received, as
    bits: bit i is message `latest - i`."""

    latest: int
    numbers: int = 0

    def knows(self, sequence: int) -> bool:
        """Whether this message was received before, or is too old to tell."""
        back = self.latest - sequence
        return back >= WINDOW or (back >= 0 and bool(self.numbers >> back & 1))

    def note(self, sequence: int) -> None:
        """Mark this message as received."""
        ahead = sequence - self.latest
        if ahead > 0:
            self.latest = sequence
            self.numbers = (self.numbers << min(ahead, WINDOW) | 1) & _WHOLE_WINDOW
        elif ahead > -WINDOW:
            self.numbers |= 1 << -ahead


class ReplayWindows:
    """What was received from each sender in each epoch. lost: called with the id of a key when what was known of one of
    its senders gives way, and may be received again.

    A sender may have `_MAX_EPOCHS`, all together `_MAX_SENDERS`; nobody can push out what is known of another key.
    """

    def __init__(self, lost: Callable[[bytes], object]) -> None:
        self._lost = lost
        self._windows = FairTable[tuple[bytes, str, int], ReplayWindow, bytes](_MAX_SENDERS, lost=self._forget)
        self._epochs: dict[tuple[bytes, str], dict[int, None]] = {}
        """The epochs of each sender, the one heard longest ago first."""

    def __len__(self) -> int:
        return len(self._windows)

    def get(self, which: tuple[bytes, str, int]) -> ReplayWindow | None:
        """Of one sender in one epoch; None if nothing was received."""
        return self._windows.get(which)

    def use(self, which: tuple[bytes, str, int]) -> None:
        """A sender of which there is a window has just been heard."""
        key, sender, epoch = which
        self._windows.use(which)
        epochs = self._epochs[key, sender]
        if len(epochs) > 1:
            epochs[epoch] = epochs.pop(epoch)

    def put(self, which: tuple[bytes, str, int], window: ReplayWindow) -> None:
        """Store a window: its sender has just been heard."""
        key, sender, epoch = which
        self._windows.put(key, which, window)
        epochs = self._epochs.setdefault((key, sender), {})
        epochs.pop(epoch, None)
        epochs[epoch] = None
        if len(epochs) > _MAX_EPOCHS:
            oldest = key, sender, next(iter(epochs))
            self._windows.pop(oldest)
            self._forget(key, oldest)

    def clear(self) -> None:
        """Forget everything."""
        self._windows.clear()
        self._epochs.clear()

    def _forget(self, key: bytes, which: tuple[bytes, str, int]) -> None:
        _, sender, epoch = which
        epochs = self._epochs[key, sender]
        del epochs[epoch]
        if not epochs:
            del self._epochs[key, sender]
        self._lost(key)


class Admitted(msgspec.Struct, frozen=True, gc=False):
    """A verified message, and the datagrams that it came in."""

    message: Message
    datagrams: tuple[bytes, ...]


class Reassembly(msgspec.Struct):
    """A long message, some of whose parts have arrived."""

    parts: int
    pieces: dict[int, tuple[bytes, bytes]] = msgspec.field(default_factory=dict)
    """By part number: the content, and the datagram."""


class Admission:
    """One party's admission.

    trust: the keys it trusts
    fleet: whose messages it accepts
    robot: whether it is a robot, which ignores messages for the operator, or an operator, who ignores what robots tell
        each other
    clock: Unix time, s
    rate: signatures of one key that are checked in a second; the limit for STOPs is scaled in proportion
    skew: largest accepted clock difference, s; None is the default of this and of `rate`
    chance: random source for floods
    offsets: measured differences between our clock and those of senders of heartbeats
    clocks: those that differ by more than is allowed
    conflicts: names that several robots have
    drops: dropped datagrams
    counts: the same by reason
    taken: accepted datagrams
    passed: messages
    """

    def __init__(
        self,
        trust: Trust,
        fleet: str,
        clock: Clock,
        *,
        robot: bool,
        rate: float | None = None,
        skew: float | None = None,
        chance: Random | None = None,
    ) -> None:
        self.trust, self.fleet, self.robot = trust, fleet, robot
        self.drops = DropCounter(clock)
        self.counts = self.drops.counts
        self.taken = self.passed = 0
        usual = VERIFIED_A_SECOND if robot else VERIFIED_BY_OPERATOR
        self._clock, self._rate, self._chance = clock, usual if rate is None else rate, chance or Random()
        self.skew = SKEW if skew is None else skew
        self.offsets, self.clocks = ClockOffsets(self.skew), WrongClocks(_MAX_TIMELY)
        self._heard = ReplayWindows(self.no_room)
        self.conflicts = NameConflicts(self._chance, self.skew)
        self._changed: set[tuple[bytes, str, int]] = set()
        stops = (STOPS_A_SECOND if robot else STOPS_BY_OPERATOR) * self._rate / usual
        self._stops = RateLimit(stops, STOPS_AT_ONCE * stops, self._chance, clock.now())
        self._budgets: dict[bytes, RateLimit] = {}
        in_all = VERIFIED_IN_ALL * self._rate / usual
        self._in_all = RateLimit(in_all, in_all, self._chance, clock.now())
        self._of_others = VERIFIED_A_SECOND * self._rate / usual
        to_others = ANSWERS_TO_OTHERS * self._rate / usual
        self._to_others = RateLimit(to_others, to_others, self._chance, clock.now())
        self.own = b""
        """How the ids of our own messages begin, b"" if we expect no answers."""
        self._open = FairTable[tuple[bytes, str, int, int], Reassembly, bytes](MAX_REASSEMBLIES, lost=self.no_room)
        self._timeless = frozenset({Kind.STOP}) if robot else TO_OPERATOR | {Kind.STOP}
        """Kinds that are accepted whatever their times say: in doubt a robot stops, and a robot's message is judged by
        the message that it answers."""
        self._untimely_budget = RateLimit(UNTIMELY_A_SECOND, UNTIMELY_A_SECOND, self._chance, clock.now())
        self._times = RateLimit(TIMES_A_SECOND, TIMES_A_SECOND, self._chance, clock.now())
        self.nonce = b""
        """Nonce of the open `TimeRequest`, b"" for none."""
        self._turned_away: deque[Message] = deque(maxlen=MAX_REASSEMBLIES)
        self._timely: OrderedDict[str, float] = OrderedDict()
        """When each party that may command us last sent a timely message."""

    def enter(self, datagram: bytes) -> Admitted | None:
        """The message that this datagram is or completes; None if it is dropped, or if other parts are still
        missing."""
        part = self.look(datagram)
        return None if part is None else self.admit(part, datagram)

    def look(self, datagram: bytes) -> Fragment | None:
        """The unverified fields of a datagram; None if it is dropped."""
        try:
            return look(datagram)
        except EnvelopeError:
            self.drops.add(DropReason.MALFORMED)
            return None

    def admit(self, part: Fragment, datagram: bytes) -> Admitted | None:
        """The rest of `enter`, after `look`."""
        try:
            key, now = self.trust.find(part.key), self._clock.now()
            reason = self._objection(part, key, datagram, now)
            if reason is not None or key is None:
                self.drops.add(reason or DropReason.UNKNOWN_KEY, part.key)
                return None
            piece = read_piece(part)
            reason = self._second_objection(key, part, piece)
            if reason is not None:
                self.drops.add(reason, part.key)
                return None
            entered = self._completed(part, piece, datagram, key, now)
        except EnvelopeError:
            self.drops.add(DropReason.MALFORMED, part.key)
            return None
        self.taken += 1
        if entered is not None:
            self.passed += 1
        return entered

    def now(self) -> float:
        """By our clock, s."""
        return self._clock.now()

    def arrival(self, datagram: bytes) -> float:
        """When it reached this computer, by our clock, s; rather too late than too early, however busy we are."""
        since = waited(datagram)
        return self._clock.now() - since

    def warnings(self, clock: Clock) -> list[str]:
        """Sentences about what is wrong, besides what is dropped: operators' clocks, and names of ours that others
        have. clock: Unix time, s."""
        return [*self.clocks.of_operators(), *self.conflicts.of_own(clock.now())]

    def news(self) -> list[StoredWindow]:
        """The replay windows that have changed since the last call."""
        changed = ((which, self._heard.get(which)) for which in self._changed)
        windows = [StoredWindow(*which, each.latest, each.numbers) for which, each in changed if each is not None]
        self._changed.clear()
        return windows

    def restore(self, windows: Iterable[StoredWindow]) -> None:
        """Restore replay windows."""
        for window in windows:
            heard = ReplayWindow(window.latest, window.numbers & _WHOLE_WINDOW)
            self._heard.put((window.key, window.sender, window.epoch), heard)

    def no_room(self, key: bytes, *_: object) -> None:
        """Something that was kept of this key has given way to more of the same: count it, so that somebody is told."""
        self.drops.add(DropReason.NO_ROOM, key)

    def _objection(self, part: Fragment, key: PublicKey | None, datagram: bytes, now: float) -> DropReason | None:
        """Why the part is dropped, judged without its content."""
        if key is None:
            return DropReason.UNKNOWN_KEY
        if key.revoked and not (part.standing and self.trust.vouches(datagram)):
            return DropReason.REVOKED
        if part.kind not in MAY[key.role] or (part.standing and key.role is not Role.COMMANDER):
            return DropReason.NOT_ALLOWED
        if part.kind in TO_OPERATOR if self.robot else part.kind in _TO_ROBOTS and key.role is Role.ROBOT:
            return DropReason.NOT_FOR_US
        tells_time = bool(self.nonce) and self._tells_time(part)
        untimely = None if part.kind in self._timeless or tells_time else self._untimely(part, now)
        if untimely is not None and not self._may_tell_why(part, key):
            return untimely
        if not key.owner.endswith("*") and self._knows(part, key.owner):
            return DropReason.REPEATED
        if self.robot and not tells_time and part.kind is Kind.HEARTBEAT and _TELLS_OTHERS in part.payload:
            return DropReason.NOT_FOR_US
        budget = self._times if tells_time else self._untimely_budget if untimely is not None else None
        if not (self._has_time(part, key, now) if budget is None else budget.take(now)):
            return untimely or DropReason.TOO_MANY
        if not key.signed(part.signed, part.signature):
            return DropReason.FORGED
        if untimely is not None:
            self._turn_away(key, part, now)
        return untimely

    def _may_tell_why(self, part: Fragment, key: PublicKey) -> bool:
        """Whether its sender is told that its time is wrong, or ours."""
        return self.robot and part.kind in _COMMANDING and key.role is not Role.ROBOT and part.parts == 1

    def _tells_time(self, part: Fragment) -> bool:
        """Whether this may answer our open time request; its own times are not checked then, as our clock is wrong."""
        return part.kind is Kind.HEARTBEAT and part.parts == 1 and self.nonce in part.payload

    def _untimely(self, part: Fragment, now: float) -> DropReason | None:
        late = now - self.skew
        if late > part.deadline or (late > part.issued + OLDEST and not part.standing):
            return DropReason.LATE
        return DropReason.EARLY if part.issued > now + self.skew else None

    def _turn_away(self, key: PublicKey, part: Fragment, now: float) -> None:
        """Drop a message of a sender who may command us, but remember it for a notice: one of the clocks is wrong, or
        it is late."""
        piece = read_piece(part)
        if self._second_objection(key, part, piece) is not None:
            return
        ahead = part.issued - now
        message = read_message(part, piece.sender, piece.content, str(key.role), ahead)
        self.note(part.key, piece.sender, part.epoch, part.sequence)
        self._compare_clocks(piece.sender, ahead, now)
        self._turned_away.append(message)

    def _compare_clocks(self, sender: str, ahead: float, now: float) -> None:
        """Record the time of a message from a sender who may command us. ahead: s it is ahead of our clock, 0 if
        timely."""
        if not ahead:
            self._timely[sender] = now
            self._timely.move_to_end(sender)
            if len(self._timely) > _MAX_TIMELY:
                self._timely.popitem(last=False)
        if not ahead or now - self._timely.get(sender, -inf) > _TIMELY:
            self.clocks.note(sender, ahead)

    def forget_clocks(self) -> None:
        """Our clock has been set: forget how others differ from it, and end the time request."""
        self.nonce = b""
        self.offsets = ClockOffsets(self.skew)
        self.clocks.clear()
        self._timely.clear()

    def turned_away(self) -> list[Message]:
        """Messages of senders who may command us that were dropped because of their times, since the last call. An old
        one is just late if something timely of its sender has come, before or after it."""
        right, messages = self._clock.now() - _TIMELY, list(self._turned_away)
        self._turned_away.clear()
        return [
            msgspec.structs.replace(
                message, late=message.ahead < 0.0 and self._timely.get(message.sender, -inf) >= right
            )
            for message in messages
        ]

    def _second_objection(self, key: PublicKey, part: Fragment, piece: Piece) -> DropReason | None:
        if piece.fleet != self.fleet:
            return DropReason.OTHER_FLEET
        if not key.is_of(piece.sender):
            return DropReason.NOT_ALLOWED
        return DropReason.REPEATED if self._knows(part, piece.sender) else None

    def _knows(self, part: Fragment, sender: str) -> bool:
        heard = self._heard.get((part.key, sender, part.epoch))
        # A standing command counts however old it is; the sequencer knows which ones we have.
        if heard is not None and heard.knows(part.sequence) and not part.standing:
            return True
        if part.parts == 1:
            return False
        waiting = self._open.get((part.key, sender, part.epoch, part.sequence))
        return waiting is not None and part.number in waiting.pieces

    def _has_time(self, part: Fragment, key: PublicKey, now: float) -> bool:
        """Whether one more signature may be checked. An operator has no limit for all keys together, and one for
        answers to others; what is no robot's it hears at the pace of robots."""
        if part.kind is Kind.STOP:
            return self._stops.take(now)
        to_others = self.own and part.kind is Kind.ANSWER and part.parts == 1 and self.own not in part.payload
        if to_others and not self._to_others.take(now):
            return False
        budget = self._budgets.get(part.key)
        if budget is None:
            rate = self._rate if self.robot or key.role is Role.ROBOT else self._of_others
            budget = self._budgets[part.key] = RateLimit(rate, rate, self._chance, now)
        return budget.take(now) and (not self.robot or self._in_all.take(now))

    def missing(self, key: bytes, sender: str, epoch: int, sequence: int) -> tuple[int, ...]:
        """Numbers of the missing parts of a message of which some have arrived; none if none has."""
        waiting = self._open.get((key, sender, epoch, sequence))
        return () if waiting is None else tuple(part for part in range(waiting.parts) if part not in waiting.pieces)

    def _completed(self, part: Fragment, piece: Piece, datagram: bytes, key: PublicKey, now: float) -> Admitted | None:
        """The message, if this was its last missing part."""
        content, datagrams = piece.content, (bytes(datagram),)
        if part.parts > 1:
            which = part.key, piece.sender, part.epoch, part.sequence
            waiting = self._open.get(which) or Reassembly(part.parts)
            if part.parts != waiting.parts:
                raise EnvelopeError("a message whose parts disagree on how many there are")
            waiting.pieces[part.number] = content, bytes(datagram)
            if len(waiting.pieces) < part.parts:
                if which not in self._open:  # the oldest gives way, not the one of which parts came last
                    self._open.put(part.key, which, waiting)
                return None
            self._open.pop(which)
            contents, datagrams = zip(*(waiting.pieces[number] for number in range(part.parts)), strict=True)
            content = b"".join(contents)
            if len(content) > MAX_CONTENT:
                raise EnvelopeError("a message whose parts are too long together")
        ahead = part.issued - now if self._untimely(part, now) is not None else 0.0
        message = read_message(part, piece.sender, content, str(key.role), ahead)
        if key.role is Role.ROBOT and not ahead:
            self.conflicts.hear(message, now, address_of(datagram), key.is_of)
        if self.robot and key.role is not Role.ROBOT and (ahead or abs(part.issued - now) <= self.skew):
            self._compare_clocks(piece.sender, ahead, now)
        if part.kind is Kind.HEARTBEAT:
            self.offsets.note(piece.sender, part.issued, now)
        if not part.standing:
            self.note(part.key, piece.sender, part.epoch, part.sequence, lasting=part.kind in _LASTING)
        return Admitted(message, datagrams)

    def note(self, key: bytes, sender: str, epoch: int, sequence: int, *, lasting: bool = False) -> None:
        """Mark this message as received, or as our own: a repeat is dropped. lasting: whether a restart must not forget
        it."""
        which = key, sender, epoch
        heard = self._heard.get(which)
        if heard is None:
            self._heard.put(which, ReplayWindow(sequence, 1))
        else:
            heard.note(sequence)
            self._heard.use(which)
        if lasting:
            self._changed.add(which)


# ---- rate limits: a token bucket, and a fair one that decides at random in a flood


SPAN = 0.05
"""Seconds over which requests are counted, to know their rate."""


class TokenBucket:
    """Tokens that may be spent: `rate` a second, and at most `most` at once. now: s."""

    def __init__(self, rate: float, most: float, now: float) -> None:
        self._rate, self._most = rate, most
        self._left, self._since = most, now

    def left(self, now: float) -> float:
        """Tokens left at `now`; below 0 if more were spent than there were."""
        self._left = min(self._most, self._left + max(0.0, now - self._since) * self._rate)
        self._since = now
        return self._left

    def spend(self, count: float) -> None:
        """Spend `count` tokens."""
        self._left -= count


class RateLimit:
    """Lets through `rate` requests per second, and at most `most` at once.

    While tokens last, requests are served in order. When the rest would not last, they are served at random, with
    the probability that the rate allows: a sender's share of all requests decides, not its place in the queue, so a
    flood of forgeries cannot spend the tokens of others.
    """

    def __init__(self, rate: float, most: float, chance: Random, now: float) -> None:
        self._bucket = TokenBucket(rate, most, now)
        self._rate, self._chance = rate, chance
        self._asked, self._asked_since, self._share = 0, now, 1.0

    def take(self, now: float) -> bool:
        """Whether one more request is served."""
        left, passed = self._bucket.left(now), now - self._asked_since
        if not 0.0 <= passed < SPAN:
            self._share = passed * self._rate / self._asked if self._asked and passed > 0.0 else 1.0
            self._asked, self._asked_since = 0, now
        self._asked += 1
        if left < 1.0 or (left < 2.0 * SPAN * self._rate and self._chance.random() >= self._share):
            return False
        self._bucket.spend(1.0)
        return True
