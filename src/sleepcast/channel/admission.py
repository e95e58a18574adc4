"""The admission: which bytes from outside become messages. Everything else is counted, dropped, and never answered.

Checks go from the cheap to the dear: length and layout, the key, what its owner may say, the deadline, whether this was
heard before - and then the signature, for which each key has a budget, so that nobody can make a robot work by sending
it forgeries. STOP has a larger one of its own, for all keys together: no flood of other messages keeps it out. In a
flood chance decides which are looked at (`RateLimit`), so a STOP, which is repeated often, comes in soon.
"""

from __future__ import annotations

from collections import Counter, OrderedDict, deque
from collections.abc import Iterable
from dataclasses import dataclass, field
from math import inf
from random import Random
from typing import NamedTuple

import msgspec

from sleepcast.channel.clock_sync import ClockOffsets, WrongClocks
from sleepcast.channel.drops import DropCounter, DropReason
from sleepcast.channel.envelope import MAX_CONTENT, EnvelopeError, Part, Piece, look, read_message, read_piece
from sleepcast.channel.keys import MAY, PublicKey, Trust
from sleepcast.channel.message import TO_OPERATOR, Kind, Message, Role
from sleepcast.channel.message_store import StoredWindow
from sleepcast.channel.rate_limit import RateLimit
from sleepcast.core.clock import Clock

WINDOW = 4_096
"""Numbers back from the latest of a sender that are told apart: more than come in the seconds of a deadline."""
WHOLE_WINDOW = (1 << WINDOW) - 1
"""All of them, as bits."""
MAX_SENDERS = 16_384
"""Senders, in each of their epochs, whose numbers are remembered; the one that was silent longest is forgotten."""
MAX_REASSEMBLIES = 64
"""Long messages that wait for their other parts, of all senders together; seven megabytes at most."""
VERIFIED_A_SECOND = 200.0
"""Signatures of one key that a robot looks at in a second, unless another rate is given."""
VERIFIED_IN_ALL = 4_000.0
"""The same of all keys together, but for STOP, at the usual rate: a quarter of a core's time, however many keys' ids
a forger knows."""
VERIFIED_BY_OPERATOR = 4_000.0
"""The same of an operator, who hears a thousand robots with one key answer at once: a quarter of a core's time."""
STOPS_A_SECOND = 5_000.0
"""Signatures of STOPs that a robot looks at in a second, of all keys together, at the usual rate: a third of a core's
time. Of 80,000 in a second it looks at one of sixteen; a real STOP comes a hundred times in its first second."""
STOPS_BY_OPERATOR = 500.0
"""The same of an operator, who only hears of it that others have stopped robots."""
STOPS_AT_ONCE = 0.1
"""Seconds whose STOPs are looked at at once: a flood that begins holds nobody up for longer than a tick."""
SKEW = 2.0
"""Seconds that two clocks may differ, unless another bound is given."""
TO_ROBOTS = frozenset({Kind.COMMAND, Kind.ASK})
"""Kinds that robots are to evaluate."""
ROBOT_KINDS = frozenset(Kind) - TO_OPERATOR
"""Kinds that robots have ears for."""
LASTING = frozenset({Kind.COMMAND, Kind.STOP, Kind.RELEASE})
"""Kinds that do something: that they were heard must not be forgotten, whatever happens to this process."""
COMMANDING = TO_ROBOTS | {Kind.RELEASE}
"""Kinds to which a robot whose clock is wrong answers that it is."""
UNTIMELY_A_SECOND = 8.0
"""Signatures of messages with wrong times that a robot looks at in a second, to answer that its clock is wrong: whoever
plays what he has recorded makes it talk no more than that."""
TIMELY = 60.0
"""Seconds for which a party that was heard in time has a good clock: what comes late meanwhile is old."""
TIMES_A_SECOND = 200.0
"""Signatures that a robot without a clock looks at in a second, of what looks like an answer to its question for the
time: a budget of their own, which nothing that does not name its nonce can spend."""
MAX_TIMELY = 64
"""Parties of which it is known when they were heard in time; the one that was silent longest makes room."""
OLDEST = 3_600.0
"""Seconds after which a message without a deadline is no news any more; what must last is told anew."""


@dataclass(slots=True)
class ReplayWindow:
    """What was heard of one sender in one epoch. latest: number of its newest message; numbers: those up to it that
    were heard, as bits: bit i is `latest - i`."""

    latest: int
    numbers: int = 0

    def knows(self, sequence: int) -> bool:
        """Whether this message was heard, or is too old to tell."""
        back = self.latest - sequence
        return back >= WINDOW or (back >= 0 and bool(self.numbers >> back & 1))

    def note(self, sequence: int) -> None:
        """This message has been heard."""
        ahead = sequence - self.latest
        if ahead > 0:
            self.latest = sequence
            self.numbers = (self.numbers << min(ahead, WINDOW) | 1) & WHOLE_WINDOW
        elif ahead > -WINDOW:
            self.numbers |= 1 << -ahead


class Admitted(NamedTuple):
    """A message that came in, and the bytes that it was: nobody but its sender could have made them."""

    message: Message
    datagrams: tuple[bytes, ...]


@dataclass(slots=True)
class Reassembly:
    """A long message in so many parts, of which these pieces have come."""

    parts: int
    pieces: dict[int, tuple[bytes, bytes]] = field(default_factory=dict)
    """What each says, and the bytes that it was."""


class Admission:
    """One party's door. trust: whom it believes; fleet: whose messages it hears; robot: whether it is a robot's, which
    has no ear for what others tell the operator, or an operator's, who has none for what robots tell each other.
    clock: Unix time, s. rate: signatures of one key that are looked at in a second, and in proportion to what is usual
    those of STOPs; skew: s that others' clocks may be wrong; None for what is usual. chance: decides in a flood.

    skews: how much the clocks of those that send heartbeats differ from ours; clocks: whose differ by more than is
    allowed. drops: datagrams that went no further,
    counts: by reason; taken: those that did; passed: messages that came in whole.
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
        self.offsets, self.clocks = ClockOffsets(self.skew), WrongClocks()
        self._heard: OrderedDict[tuple[bytes, str, int], ReplayWindow] = OrderedDict()
        self._changed: set[tuple[bytes, str, int]] = set()
        stops = (STOPS_A_SECOND if robot else STOPS_BY_OPERATOR) * self._rate / usual
        self._stops = RateLimit(stops, STOPS_AT_ONCE * stops, self._chance, clock.now())
        self._budgets: dict[bytes, RateLimit] = {}
        in_all = VERIFIED_IN_ALL * self._rate / usual
        self._in_all = RateLimit(in_all, in_all, self._chance, clock.now())
        self._open: OrderedDict[tuple[bytes, str, int, int], Reassembly] = OrderedDict()
        self._timeless = frozenset({Kind.STOP}) if robot else TO_OPERATOR | {Kind.STOP}
        """Kinds that come in whatever their times say: in doubt a robot stands, and what robots say is judged by what
        it answers."""
        self._untimely_budget = RateLimit(UNTIMELY_A_SECOND, UNTIMELY_A_SECOND, self._chance, clock.now())
        self._times = RateLimit(TIMES_A_SECOND, TIMES_A_SECOND, self._chance, clock.now())
        self.nonce = b""
        """Of the question for the time that is open (`Sync`), b"" for none."""
        self._turned_away: deque[Message] = deque(maxlen=MAX_REASSEMBLIES)
        self._timely: OrderedDict[str, float] = OrderedDict()
        """When those who may command us were last heard in time."""

    def enter(self, datagram: bytes) -> Admitted | None:
        """The message that these bytes are, or complete; None if they are dropped, or part of a message that others
        are still missing of."""
        part = self.look(datagram)
        return None if part is None else self.admit(part, datagram)

    def look(self, datagram: bytes) -> Part | None:
        """What can be read of these bytes without believing them; None if they are dropped."""
        try:
            return look(datagram)
        except EnvelopeError:
            self.drops.add(DropReason.MALFORMED)
            return None

    def admit(self, part: Part, datagram: bytes) -> Admitted | None:
        """The rest of `enter`, for what `look` made of the bytes."""
        try:
            key = self.trust.find(part.key)
            reason = self._objection(part, key, datagram)
            if reason is not None or key is None:
                self.drops.add(reason or DropReason.UNKNOWN_KEY, part.key)
                return None
            piece = read_piece(part)
            reason = self._second_objection(key, part, piece)
            if reason is not None:
                self.drops.add(reason, part.key)
                return None
            entered = self._completed(part, piece, datagram, key.role)
        except EnvelopeError:
            self.drops.add(DropReason.MALFORMED, part.key)
            return None
        self.taken += 1
        if entered is not None:
            self.passed += 1
        return entered

    def news(self) -> list[StoredWindow]:
        """What was heard of those senders who have had something done since this was asked last."""
        found = [StoredWindow(*which, *self._both(which)) for which in self._changed if which in self._heard]
        self._changed.clear()
        return found

    def restore(self, windows: Iterable[StoredWindow]) -> None:
        """Know again what was heard."""
        for window in windows:
            heard = ReplayWindow(window.latest, window.numbers & WHOLE_WINDOW)
            self._heard[window.key, window.sender, window.epoch] = heard

    def _both(self, which: tuple[bytes, str, int]) -> tuple[int, int]:
        heard = self._heard[which]
        return heard.latest, heard.numbers

    def _objection(self, part: Part, key: PublicKey | None, datagram: bytes) -> DropReason | None:
        """Why the part is dropped, as far as can be said without reading what it says."""
        if key is None:
            return DropReason.UNKNOWN_KEY
        if key.revoked and not (part.standing and self.trust.vouches(datagram)):
            return DropReason.REVOKED
        if part.kind not in MAY[key.role] or (part.standing and key.role is not Role.COMMANDER):
            return DropReason.NOT_ALLOWED
        if part.kind in TO_OPERATOR if self.robot else part.kind in TO_ROBOTS and key.role is Role.ROBOT:
            return DropReason.NOT_FOR_US
        now = self._clock.now()
        tells_time = self._tells_time(part)
        untimely = None if part.kind in self._timeless or tells_time else self._untimely(part, now)
        tells = self.robot and part.kind in COMMANDING and key.role is not Role.ROBOT and part.parts == 1
        if untimely is not None and not tells:
            return untimely
        if not key.owner.endswith("*") and self._knows(part, key.owner):
            return DropReason.REPEATED
        budget = self._times if tells_time else self._untimely_budget if untimely is not None else None
        if not (self._has_time(part, now) if budget is None else budget.take(now)):
            return untimely or DropReason.TOO_MANY
        if not key.signed(part.signed, part.signature):
            return DropReason.FORGED
        if untimely is not None:
            self._turn_away(key, part, now)
        return untimely

    def _tells_time(self, part: Part) -> bool:
        """Whether this may answer our question for the time: whoever has no clock cannot judge its times."""
        return bool(self.nonce) and part.kind is Kind.HEARTBEAT and part.parts == 1 and self.nonce in part.payload

    def _untimely(self, part: Part, now: float) -> DropReason | None:
        late = now - self.skew
        if late > part.deadline or (late > part.issued + OLDEST and not part.standing):
            return DropReason.LATE
        return DropReason.EARLY if part.issued > now + self.skew else None

    def _turn_away(self, key: PublicKey, part: Part, now: float) -> None:
        """Either our clock is wrong or that of somebody who commands us, or this comes late: he is to know."""
        piece = read_piece(part)
        if self._second_objection(key, part, piece) is not None:
            return
        message = read_message(part, piece.sender, piece.content, key.role.value)
        self.note(part.key, piece.sender, part.epoch, part.sequence)
        self._compare_clocks(piece.sender, part.issued - now, now)
        self._turned_away.append(msgspec.structs.replace(message, ahead=part.issued - now))

    def _compare_clocks(self, sender: str, ahead: float, now: float) -> None:
        """Somebody who may command us said something whose time is so far ahead of ours, 0 for one in time."""
        if not ahead:
            self._timely[sender] = now
            self._timely.move_to_end(sender)
            if len(self._timely) > MAX_TIMELY:
                self._timely.popitem(last=False)
        if not ahead or now - self._timely.get(sender, -inf) > TIMELY:
            self.clocks.note(sender, ahead)

    def forget_clocks(self) -> None:
        """Our clock has been set: by how much others differ from it is not known any more, and nobody is asked."""
        self.nonce = b""
        self.offsets = ClockOffsets(self.skew)
        self.clocks.clear()
        self._timely.clear()

    def turned_away(self) -> list[Message]:
        """Messages of those who may command us that were dropped because of their times, since this was asked last."""
        found = list(self._turned_away)
        self._turned_away.clear()
        return found

    def _second_objection(self, key: PublicKey, part: Part, piece: Piece) -> DropReason | None:
        if piece.fleet != self.fleet:
            return DropReason.OTHER_FLEET
        if not key.is_of(piece.sender):
            return DropReason.NOT_ALLOWED
        return DropReason.REPEATED if self._knows(part, piece.sender) else None

    def _knows(self, part: Part, sender: str) -> bool:
        heard = self._heard.get((part.key, sender, part.epoch))
        # What stands counts however old it is; whoever keeps the rules knows which ones he has.
        if heard is not None and heard.knows(part.sequence) and not part.standing:
            return True
        if part.parts == 1:
            return False
        waiting = self._open.get((part.key, sender, part.epoch, part.sequence))
        return waiting is not None and part.number in waiting.pieces

    def _has_time(self, part: Part, now: float) -> bool:
        """Whether one more signature may be looked at. An operator hears as many robots' keys as there are."""
        if part.kind is Kind.STOP:
            return self._stops.take(now)
        found = self._budgets.get(part.key)
        if found is None:
            found = self._budgets[part.key] = RateLimit(self._rate, self._rate, self._chance, now)
        return found.take(now) and (not self.robot or self._in_all.take(now))

    def missing(self, key: bytes, sender: str, epoch: int, sequence: int) -> tuple[int, ...]:
        """Numbers of the parts that are missing of a message of which some have come; none if none has."""
        waiting = self._open.get((key, sender, epoch, sequence))
        return () if waiting is None else tuple(part for part in range(waiting.parts) if part not in waiting.pieces)

    def _completed(self, part: Part, piece: Piece, datagram: bytes, role: Role) -> Admitted | None:
        """The message, if this part was the last one of it that was missing."""
        content, datagrams = piece.content, (datagram,)
        if part.parts > 1:
            which = part.key, piece.sender, part.epoch, part.sequence
            waiting = self._open.setdefault(which, Reassembly(part.parts))
            if part.parts != waiting.parts:
                raise EnvelopeError("a message whose parts do not agree on how many they are")
            waiting.pieces[part.number] = content, datagram
            if len(waiting.pieces) < part.parts:
                if len(self._open) > MAX_REASSEMBLIES:
                    self._make_room()
                return None
            del self._open[which]
            contents, datagrams = zip(*(waiting.pieces[number] for number in range(part.parts)), strict=True)
            content = b"".join(contents)
            if len(content) > MAX_CONTENT:
                raise EnvelopeError("a message that says more than fits into one")
        message = read_message(part, piece.sender, content, role.value)
        now = self._clock.now()
        if self._untimely(part, now) is not None:
            message = msgspec.structs.replace(message, ahead=part.issued - now)
        if self.robot and role is not Role.ROBOT and (message.ahead or abs(part.issued - now) <= self.skew):
            self._compare_clocks(piece.sender, message.ahead, now)
        if part.kind is Kind.HEARTBEAT:
            self.offsets.note(piece.sender, part.issued, now)
        if not part.standing:
            self.note(part.key, piece.sender, part.epoch, part.sequence, lasting=part.kind in LASTING)
        return Admitted(message, datagrams)

    def _make_room(self) -> None:
        """The oldest one goes of the long messages that wait, of the key that has most of them: whoever begins many
        pushes out his own."""
        waiting = Counter(key for key, *_ in self._open)
        most = max(waiting.values())
        del self._open[next(which for which in self._open if waiting[which[0]] == most)]

    def note(self, key: bytes, sender: str, epoch: int, sequence: int, *, lasting: bool = False) -> None:
        """This message is no news any more, whoever sends it again; so is what we have said ourselves. lasting: whether
        that must be known over a restart."""
        which = key, sender, epoch
        heard = self._heard.get(which)
        if heard is None:
            heard = self._heard[which] = ReplayWindow(sequence)
        heard.note(sequence)
        if lasting:
            self._changed.add(which)
        self._heard.move_to_end(which)
        if len(self._heard) > MAX_SENDERS:
            self._heard.popitem(last=False)
