"""Authority: who may command this robot, by the role of the sender's key and by the leases of groups; how long a driven
robot continues unattended; and which STOPs hold it.

The channel verifies keys. A refusal here is an answer, so that the sender gets the reason. Commands of the robot's
own host, and those typed at it, come without a role and are not refused.

A lease says which operator alone may command the robots of a group. Every robot stores the leases of all groups that
it hears of, because it may join them. A lease ends unless its holder renews it, so a desk that is gone blocks nobody
for longer than that.

A robot is *driven* from the moment a person's one-time command moves its body until one of its own rules or a
standing command moves it. Its operator must be heard all the time, or the body comes to rest (the dead man's
switch). A robot on a mission of its own is not driven and needs no operator. What a driven robot tells others names
its operator, and those that it moves are driven by that operator, too.

What robots tell each other may be limited by the robot's own host: `Tells`.

The STOP latch records which STOPs hold a robot, and which have ended. Sequence numbers decide that, not clocks. A
STOP is identified by its mark: its sender, the sender's epoch, and its number; a STOP that is sent again keeps its
first mark. A RELEASE ends the STOPs that its sender sent before it in the same epoch, and those of others that it
names. So a late STOP changes nothing if a RELEASE has ended it, and a late RELEASE ends no STOP that its sender did
not know. Any other STOP stops the robot: in doubt it stays stopped.

What changes is a value (`Latch`, `Driving`, `Leases`), and what decides is a function of values. So a node has one of
each, and a fleet has each of them once for all robots that have equal ones.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from enum import StrEnum
from math import inf
from weakref import WeakKeyDictionary

import msgspec

from sleepcast.channel.clock_sync import differs
from sleepcast.channel.message import (
    AUCTION,
    DO,
    DRIVER,
    ENDS,
    FIRST,
    GROUP,
    HOPS,
    LEASE,
    MAX_NAME,
    MAX_NUMBER,
    NOT_STORED,
    SECONDS,
    TO,
    Kind,
    LeaseAction,
    Message,
    Role,
    age_of,
    message_id,
)
from sleepcast.core.ages import duration
from sleepcast.core.errors import MisuseError, decimal_comma
from sleepcast.core.quantities import QuantityError, in_si
from sleepcast.core.records import NamedTuple
from sleepcast.core.units import TIME
from sleepcast.language.functions import DEADLY, PRIORITY
from sleepcast.language.parts import auction_of, label_of, ranked, rules, timed_of, walk
from sleepcast.language.program import Program
from sleepcast.language.reader import List
from sleepcast.language.reader import walk as walk_forms

MAX_LEASE = 3_600.0
"""Longest duration of a lease, s."""
MAX_LEASES = 1_024
"""Groups whose leases are stored: as many as a robot can be in. Beyond, the operator who took most of them loses one,
the first to end."""


class Lease(msgspec.Struct, frozen=True):
    """The holder of a lease, and its end (s of the mind's time). by: who took it, and has perhaps granted it on."""

    holder: str
    until: float
    by: str


class LeaseRequest(msgspec.Struct, frozen=True):
    """A message's request about a lease. seconds: its duration; to: the new holder, for a grant."""

    action: LeaseAction
    group: str
    seconds: float
    to: str

    @staticmethod
    def of(body: object) -> LeaseRequest | None:
        """The request in a message's body; None if it is malformed."""
        if not isinstance(body, Mapping):
            return None
        action, group, seconds, to = body.get(DO), body.get(GROUP), body.get(SECONDS, 0.0), body.get(TO, "")
        if action not in tuple(LeaseAction) or not isinstance(group, str) or not 0 < len(group) <= MAX_NAME:
            return None
        if not isinstance(seconds, float | int) or not 0.0 <= seconds <= MAX_LEASE or not isinstance(to, str):
            return None
        return LeaseRequest(LeaseAction(str(action)), group, float(seconds), to[:MAX_NAME])


class Leases:
    """The leases known to one robot."""

    def __init__(self, held: Mapping[str, Lease] | None = None) -> None:
        self._held: dict[str, Lease] = dict(held or {})

    @property
    def held(self) -> tuple[tuple[str, Lease], ...]:
        """Each group with its lease, also those that have ended but were not removed yet."""
        return tuple(self._held.items())

    def after(self, message: Message, now: float) -> tuple[Leases, str, str]:
        """What they are once a message's request is carried out, the group's key, and the reason for a refusal, "" if
        there is none."""
        request = LeaseRequest.of(message.body[LEASE])
        if request is None:
            return self, "", "a lease that says nothing which can be meant"
        leases = Leases(self._held)
        refusal = leases.settle(request, message, now)
        return leases, request.group.casefold(), refusal

    def settle(self, request: LeaseRequest, message: Message, now: float) -> str:
        """Carry out a request at `now` (s of the mind's time); returns the reason for a refusal, or "". What its sender
        holds already is never shortened: who wants that gives it back."""
        refusal = self._refusal(request, message, now)
        if refusal:
            return refusal
        key, held = request.group.casefold(), self._find(request.group, now)
        self._make_room(request, now)
        if request.action is LeaseAction.GIVE:
            self._held.pop(key, None)
        else:
            holder = request.to if request.action is LeaseAction.GRANT else message.sender
            mine = held is not None and held.holder == message.sender
            until = max(held.until, now + request.seconds) if held is not None and mine else now + request.seconds
            self._held[key] = Lease(holder, until, message.sender)
        return ""

    def _refusal(self, request: LeaseRequest, message: Message, now: float) -> str:
        held = self._find(request.group, now)
        mine = held is not None and held.holder == message.sender
        if message.role == Role.ROBOT:
            return "robots have no leases"
        if request.action is LeaseAction.FORCE:
            may = message.role in ("", Role.COMMANDER)
            return "" if may else f"only a commander may force {request.group} from others"
        if request.action is LeaseAction.GRANT:
            if not mine:
                return f"{message.sender} does not have {request.group}, so cannot grant it"
            return "" if request.to else f"say to whom {request.group} is granted"
        if held is not None and not mine:
            return _held_by(held, request.group, now)
        if request.action is not LeaseAction.GIVE and held is None and self._greediest(now) == message.sender:
            return f"no room for another lease: there are {MAX_LEASES}, most of them of {message.sender}"
        return ""

    def _greediest(self, now: float) -> str:
        """Who took the most leases, if there is no room for one more; otherwise ""."""
        living = self._living(now)
        if len(living) < MAX_LEASES:
            return ""
        return Counter(lease.by for lease in living.values()).most_common(1)[0][0]

    def _make_room(self, request: LeaseRequest, now: float) -> None:
        """Whoever took most of all leases loses the one that ends first, so that they leave some for others."""
        greediest, needs_none = self._greediest(now), request.action in (LeaseAction.GIVE, LeaseAction.GRANT)
        if needs_none or request.group.casefold() in self._held or not greediest:
            return
        theirs = {group: lease.until for group, lease in self._held.items() if lease.by == greediest}
        del self._held[min(theirs, key=theirs.__getitem__)]

    def objection(self, sender: str, groups: Collection[str], now: float) -> str:
        """Why a command of this sender does not count in these groups (their keys), "" if it does."""
        return next((why for group, why in self.closed(sender, now) if group in groups), "")

    def closed(self, sender: str, now: float) -> Iterator[tuple[str, str]]:
        """The keys of the groups in which commands of this sender do not count, in order, each with the reason."""
        for group, lease in sorted(self._held.items()):
            if now < lease.until and lease.holder != sender:
                yield group, _held_by(lease, group, now)

    def state(self, now: float) -> dict[str, list[str | float]]:
        """Each group's holder and the remaining seconds."""
        return {group: [lease.holder, lease.until - now] for group, lease in self._living(now).items()}

    def restore(self, state: Mapping[str, list[str | float]], now: float) -> None:
        """Restore stored leases; their remaining seconds start to run now."""
        for group, (holder, seconds) in list(state.items())[:MAX_LEASES]:
            self._held[group] = Lease(str(holder), now + min(float(seconds), MAX_LEASE), str(holder))

    def _find(self, group: str, now: float) -> Lease | None:
        lease = self._held.get(group.casefold())
        return lease if lease is not None and now < lease.until else None

    def _living(self, now: float) -> dict[str, Lease]:
        """The leases that have not ended; the others are removed."""
        self._held = {group: lease for group, lease in self._held.items() if now < lease.until}
        return self._held


def _held_by(lease: Lease, group: str, now: float) -> str:
    left = duration(round(lease.until - now))
    return f"{group} is under the lease of {lease.holder} for {left} more; sleepcast lease request {group} asks"


# ---- the dead man's switch: the operator of a driven robot must be heard, or its body comes to rest

MIN_DEAD_MAN, MAX_DEAD_MAN = 0.2, 3_600.0
"""Bounds of the lease, s: heartbeats come at a third of the lease, and losing one must not end it; beyond an hour it
protects nothing."""
OFF = "off"
OPERATORS = frozenset({Role.OPERATOR.value, Role.COMMANDER.value})
"""Roles whose messages keep a robot going."""


AT_REST = "at rest: nobody drives it any more"
"""What a robot reports that has come to rest because its operator is not heard any more."""


class Driving(NamedTuple):
    """Who drives one robot: what its dead man's switch goes by. Times are s of its mind.

    driver: the operator on whose word the body moves, "" if it is not driven.
    only: whether nobody but the driver keeps it going: a neighbour has told what moves it, for that operator.
    heard: whether a sign of an operator has come since the last tick.
    latest: the tick that followed the latest sign.
    """

    driver: str = ""
    only: bool = False
    heard: bool = False
    latest: float = -inf

    def hear(self, message: Message) -> Driving:
        """Note a message that counts as a sign of the operator. Standing commands may be old, and come from a
        neighbour."""
        counts = is_sign(message) and (not self.only or message.sender == self.driver)
        return self._replace(heard=True) if counts else self

    def move(self, message: Message, now: float) -> Driving:
        """This message has moved the body. The lease of what a neighbour has told begins with it, and so does that of
        an operator who takes over from there."""
        driver = driver_of(message)
        only = message.role == Role.ROBOT and bool(driver)
        return Driving(driver, only, self.heard, now if only or self.only else self.latest)

    def let_go(self) -> Driving:
        """Nobody drives the body any more."""
        return self._replace(driver="", only=False)

    def ticked(self, now: float) -> Driving:
        """A tick begins."""
        return self._replace(heard=False, latest=now) if self.heard else self

    def is_over(self, now: float, lease: float) -> bool:
        """Whether the body is driven, and no authorized sender was heard for longer than the lease, s, inf for none."""
        return bool(self.driver) and now - self.latest > lease


def is_sign(message: Message) -> bool:
    """Whether a message is a sign that an operator is there."""
    return message.role in OPERATORS and not message.standing


def driver_of(message: Message) -> str:
    """The operator who drives a robot that is moved by this message, "" if nobody does. A robot that tells it says for
    whom it does so."""
    if message.kind is not Kind.COMMAND or message.standing:
        return ""
    if message.role in OPERATORS:
        return message.sender
    named = message.body.get(DRIVER)
    told = message.role == Role.ROBOT and isinstance(named, str) and len(named) <= MAX_NAME and named.isprintable()
    return str(named) if told else ""


def read_lease(text: str) -> float:
    """Parse a lease: a time (`1s`, `500ms`, `0.5`), or `off`. Raises MisuseError."""
    if text.strip().casefold() == OFF:
        return inf
    try:
        return in_si(text, TIME, MIN_DEAD_MAN, MAX_DEAD_MAN)
    except QuantityError:
        wanted = f"wanted {MIN_DEAD_MAN:g}s to {MAX_DEAD_MAN:g}s, or {OFF}"
        raise MisuseError(f"a lease of {text!r:.40}: {wanted}{decimal_comma(text)}") from None


# ---- authority


NO_TOLD_HATCH = "no TELL lets robots come or go here (tells_hatch)"
"""Why a robot that another one tells to HATCH or DIE does not."""


class Tells(StrEnum):
    """What robots may have this one do by TELL, as its host says."""

    NONE = "none"
    """Nothing: they are not obeyed."""
    MARKS = "marks"
    """Set marks, variables and groups; not act on its body."""
    ALL = "all"
    """Whatever their role allows."""


NO_TOLD_PRIORITY = f"no TELL gives a rule a {PRIORITY}: only a commander can"
NO_CALLER = "BEST and QUORUM are sent once, by a desk, or told by a robot that collects bids: nobody does so here"
NO_TOLD_INSTANT = "AFTER-ISSUE is sent once, by a desk: nothing else says when it was issued"
NO_TELLS = "this robot obeys no TELL (--tells none)"
"""Why it does nothing of what another robot tells."""
NO_MOTION = "a TELL does not act on the body of this robot (--tells marks)"
"""Why it does not do this part of it."""


class Authority:
    """The authority over one robot. tells: what others may have it do by TELL. Times are s of its mind."""

    def __init__(self, tells: Tells = Tells.ALL) -> None:
        self.tells = tells
        self.leases = Leases()
        self.latch = Latch()
        self._since: dict[Life, float] = {}
        """Arrival of the latest STOP of each sender that holds."""

    def may_stop(self, message: Message, now: float) -> bool:
        """Whether to obey a STOP: always, unless a RELEASE has ended it."""
        latch = self.latch.stop(message)
        if latch is None:
            return False
        self._since |= dict.fromkeys(latch.begun(self.latch, message), arrived(message, now))
        self._since = {mark.life: self._since.get(mark.life, 0.0) for mark in latch.holding}
        self.latch = latch
        return True

    def may_release(self, message: Message) -> bool:
        """Whether to obey a RELEASE: it ends all STOPs that hold."""
        latch = self.latch.release(message)
        self.latch = latch or self.latch
        return latch is not None and not latch.holding

    def stops(self, now: float) -> list[list[object]]:
        """See `stops_told`."""
        return stops_told(self.latch, lambda life: self._since.get(life, 0.0), now)

    def lease(self, message: Message, now: float) -> tuple[str, str]:
        """Carry out a message's request about the lease of a group; returns the group's key and the reason for a
        refusal, "" if there is none."""
        self.leases, group, refusal = self.leases.after(message, now)
        return group, refusal

    def objection(self, message: Message, program: Program, groups: Collection[str], now: float) -> str:
        """Why a command is not to be evaluated on a robot in these groups (their keys), "" if it may be."""
        refusal = objection(message, program, self.tells)
        if refusal or not minds_leases(message):
            return refusal
        return self.leases.objection(message.sender, {*groups, *entered(program)}, now)

    def bars(self, message: Message) -> str:
        """See `bars`."""
        return bars(message, self.tells)

    def state(self, now: float) -> dict[str, object]:
        """What must survive a restart, as plain data with times as seconds from `now`."""
        return {**self.latch.written(), "leases": self.leases.state(now)}

    def restore(self, state: Mapping[str, object], now: float) -> None:
        """Restore a stored state. Raises TypeError and ValueError for malformed data."""
        self.latch = restored(state)
        leases = state.get("leases")
        if isinstance(leases, Mapping):
            self.leases.restore(leases, now)


def objection(message: Message, program: Program, tells: Tells) -> str:
    """Why a command is not to be evaluated on any robot of such a host, "" if it may be where no lease forbids it."""
    if tells is Tells.NONE and _is_told(message):
        return NO_TELLS
    if _is_told(message) and _ranks(program):
        return NO_TOLD_PRIORITY
    called = not message.standing and (AUCTION in message.body or not _is_told(message))
    if not called and auction_of(program.root) is not None:
        return NO_CALLER
    if (message.standing or _is_told(message)) and timed_of(program.root) is not None:
        return NO_TOLD_INSTANT
    if message.kind is not Kind.COMMAND or message.role in ("", Role.COMMANDER) or not rules(program.root):
        return ""
    return f"only a commander's key may change rules, and that of {message.sender} is of role {message.role}"


_RANKS: WeakKeyDictionary[Program, bool] = WeakKeyDictionary()


def _ranks(program: Program) -> bool:
    """Whether a program gives a rule a priority; looked up once, for robots tell the same again and again."""
    gives = _RANKS.get(program)
    if gives is None:
        gives = _RANKS[program] = ranked(program.form) is not None
    return gives


def minds_leases(message: Message) -> bool:
    """Whether leases matter to a message: standing commands are the same on all robots, whatever their leases."""
    return message.kind is Kind.COMMAND and message.role in OPERATORS and not message.standing


def bars_population(message: Message, tells_hatch: bool) -> str:
    """Why whatever a message may be evaluated for is to let no robot come or go, "" if it may."""
    return NO_TOLD_HATCH if _is_told(message) and not tells_hatch else ""


_HATCHES: WeakKeyDictionary[Program, bool] = WeakKeyDictionary()


def hatches(program: Program) -> bool:
    """Whether a program has HATCH or DIE written in it, perhaps in a rule that it stores; looked up once."""
    known = _HATCHES.get(program)
    if known is None:
        heads = (each.head for each in walk_forms(program.form) if isinstance(each, List))
        known = _HATCHES[program] = not DEADLY.isdisjoint(heads)
    return known


def bars(message: Message, tells: Tells) -> str:
    """Why a message that may be evaluated is not to act on the body, "" if it may."""
    return NO_MOTION if tells is Tells.MARKS and _is_told(message) else ""


def outcome_of_untimely(message: Message) -> tuple[str, str]:
    """The outcome of a message that is not obeyed because of its times, as a STOP is; and its fault."""
    return ("late", "") if message.late else ("fault", f"its clock is {differs(-message.ahead)}: it obeys STOP only")


def outlasts(doubt: str, message: Message) -> str:
    """Why a robot that is in doubt (see `Node`) stays stopped after this RELEASE, "" if it may be released: the RELEASE
    may have been sent before a STOP that has been lost."""
    early = doubt and message.issued < age_of(message.body)
    return f"{doubt}: a RELEASE from before the start does not end that" if early else ""


def outcome_of_keys(message: Message, stored: Callable[[], bool]) -> tuple[str, str]:
    """The outcome of a change of keys, which the channel has made already, or refused; and its fault. stored: whether
    the keys are stored, as far as they must be."""
    from sleepcast.channel.keys import KeyChange  # which loads the library of signatures

    refusal = KeyChange.refusal(message)
    lost = "" if stored() else NOT_STORED
    return "fault" if refusal else "matched", refusal or lost


def _is_told(message: Message) -> bool:
    """Whether another robot tells this, also where nobody signs."""
    return message.kind is Kind.COMMAND and (message.role == Role.ROBOT or HOPS in message.body)


def entered(program: Program) -> set[str]:
    """The keys of the groups that a command makes robots join or leave."""
    moving = (part for part in walk(program.root) if part.op == "act" and part.name in ("join", "leave"))
    return {label_of(part).casefold() for part in moving}


# ---- the STOP latch

MAX_MARKS = 64
"""Senders, per epoch, whose STOPs hold at once, and as many whose ended STOPs are remembered: as many as a RELEASE can
name. Beyond, the key that has the most loses the one that has been silent longest; the mark `FORGOTTEN` takes the place
of those that hold."""
FORGOTTEN = "?"
"""Stands in the place of a sender for STOPs that hold, and for which there was no room. Its number grows with each of
them, and only a RELEASE that names it ends it."""
MORE_STOPS = "more STOPs than there is room for"
"""What that mark means."""
Life = tuple[str, int]
"""A sender and one of its epochs."""


class StopMark(NamedTuple):
    """A STOP, and all earlier ones of the same sender and epoch. key: id of the key that signed it, in hexadecimal
    digits; "" if it is unknown. It does not say which STOP it is."""

    sender: str
    epoch: int
    number: int
    key: str = ""

    @property
    def id(self) -> str:
        return message_id(self.sender, self.epoch, self.number)

    @property
    def named(self) -> list[object]:
        """The mark as others name it."""
        return [self.sender, self.epoch, self.number]

    @property
    def life(self) -> Life:
        return self.sender, self.epoch

    @property
    def owner(self) -> str:
        """Whose room it takes: its key, or its sender where the key is unknown."""
        return self.key or self.sender

    def covers(self, other: StopMark) -> bool:
        """Whether the other STOP is one of these."""
        return self.life == other.life and self.number >= other.number


class Latch(NamedTuple):
    """The STOPs of one robot. holding: the latest STOP of each sender that no RELEASE has ended; ended: for each sender
    the STOP up to which all have ended."""

    holding: tuple[StopMark, ...] = ()
    ended: tuple[StopMark, ...] = ()

    def stop(self, message: Message) -> Latch | None:
        """The latch after a STOP; None if the STOP has already ended."""
        mark = mark_of(message)
        if mark.sender == FORGOTTEN:  # nobody has this name; in doubt the robot stops
            return Latch(_with(self.holding, [self._forgotten()]), self.ended)
        if any(each.covers(mark) for each in self.ended):
            return None
        holding = _with(self.holding, [mark])
        if len(holding) > MAX_MARKS:
            holding = _with(_roomy(holding), [self._forgotten()])
        return Latch(holding, self.ended)

    def _forgotten(self) -> StopMark:
        """The mark for one more STOP without room."""
        before = [mark.number for mark in (*self.holding, *self.ended) if mark.sender == FORGOTTEN]
        return StopMark(FORGOTTEN, 0, max(before, default=0) + 1)

    def begun(self, before: Latch, message: Message) -> list[Life]:
        """Whose STOPs have arrived just now, with this message, which has made this latch of the one before."""
        if self.holding == before.holding:
            return []
        known = {mark.life for mark in before.holding} - {mark_of(message).life}
        return [mark.life for mark in self.holding if mark.life not in known]

    def release(self, message: Message) -> Latch | None:
        """The latch after a RELEASE; the robot is free if no STOP is left. None for a malformed RELEASE. A named STOP
        of another sender ends only if it has arrived: if it arrives later, it stops the robot."""
        if age_of(message.body) == inf:
            return None
        own = [mark_of(message)] if message.sender != FORGOTTEN else []
        ends = own + marks_of(message.body.get(ENDS))
        ended = [held for held in self.holding if any(each.covers(held) for each in ends)]
        left = tuple(held for held in self.holding if held not in ended)
        return Latch(left, _roomy(_with(self.ended, [*ended, *own])))

    def refusal(self) -> str:
        """Why a robot with this latch stays stopped after a RELEASE."""
        held = ", ".join(f"{mark.id} ({MORE_STOPS})" if mark.sender == FORGOTTEN else mark.id for mark in self.holding)
        return f"the STOP {held} holds: the RELEASE does not name it" if held else "a RELEASE that cannot be read"

    def written(self) -> dict[str, object]:
        """What `restored` reads, as plain data."""
        return {field: [list(mark) for mark in marks] for field, marks in self._asdict().items()}


def stops_told(latch: Latch, since: Callable[[Life], float], now: float) -> list[list[object]]:
    """The STOPs that hold, each with the seconds since its arrival, or since a restart. since: gives the arrival, s."""
    return [[*mark.named, max(0.0, now - since(mark.life))] for mark in latch.holding]


def arrived(message: Message, now: float) -> float:
    """When a message arrived, s of the mind's time: now, unless that is known better."""
    return now if message.heard is None else message.heard


ENDED = "a RELEASE that was sent later has ended this STOP"
"""The reason why a STOP is not obeyed."""


def is_ended_by(stop: StopMark, release: Message) -> bool:
    """Whether this RELEASE of another sender names this STOP."""
    return any(mark.covers(stop) for mark in marks_of(release.body.get(ENDS)))


def mark_of(message: Message) -> StopMark:
    """The mark of a STOP; for a RELEASE, the mark of the STOPs that were sent before it."""
    sender, epoch, number = message.sender, message.epoch, message.sequence
    first = message.body.get(FIRST)
    if isinstance(first, str) and first.startswith(f"{sender}-{epoch}."):
        digits = first.rpartition(".")[2]
        if len(digits) <= len(str(MAX_NUMBER)) and digits.isascii() and digits.isdigit():
            number = min(number, int(digits))
    return StopMark(sender, epoch, number, message.key)


def marks_of(field: object) -> list[StopMark]:
    """The marks in a body's field; malformed ones are left out."""
    return [mark for mark, _ in marks_and_ages(field)]


def marks_and_ages(field: object) -> list[tuple[StopMark, float]]:
    """The marks in a body's field, each with its age in s, 0 if it has none."""
    marks = []
    for each in field[:MAX_MARKS] if isinstance(field, list | tuple) else ():
        match each:
            case [str() as sender, int() as epoch, int() as number, *rest]:
                if len(sender) <= MAX_NAME and 0 <= epoch <= MAX_NUMBER and 0 <= number <= MAX_NUMBER:
                    more = rest[0] if rest else None
                    age = more if isinstance(more, float) and more >= 0.0 else 0.0
                    key = more if isinstance(more, str) and len(more) <= MAX_NAME else ""
                    marks.append((StopMark(sender, epoch, number, key), age))
    return marks


def restored(state: Mapping[str, object]) -> Latch:
    """The latch that was `written`; missing fields are empty, and so are the keys of one of an earlier version."""
    return Latch(*(_with((), marks_of(state.get(field))) for field in Latch._fields))


def _with(marks: Iterable[StopMark], more: Iterable[StopMark]) -> tuple[StopMark, ...]:
    """The highest mark of each sender and epoch, the latest ones last."""
    latest = {mark.life: mark for mark in marks}
    for mark in more:
        latest[mark.life] = max(latest.pop(mark.life, mark), mark, key=lambda each: each.number)
    return tuple(latest.values())


def _roomy(marks: tuple[StopMark, ...]) -> tuple[StopMark, ...]:
    """These marks with room for `FORGOTTEN`, which is never lost: the key that has the most loses the one that has been
    silent longest."""
    left = list(marks)
    while sum(mark.sender != FORGOTTEN for mark in left) >= MAX_MARKS:
        counts = Counter(mark.owner for mark in left if mark.sender != FORGOTTEN)
        most_of = max(counts.values())
        left.remove(next(mark for mark in left if mark.sender != FORGOTTEN and counts[mark.owner] == most_of))
    return tuple(left)
