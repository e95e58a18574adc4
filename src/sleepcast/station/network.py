"""The operator's desk on the air: a station that sends through a session, and repeats what was lost.

numbers    messages have the ids that they have on the air
answers    spread over a time that grows with the roster, so that robots do not all answer at once
repeats    robots that are not accounted for are asked again: for STOP until all have confirmed or a person gives up,
           robots included that are first heard after it; for everything else while it is good. A STOP, a RELEASE and a
           question are sent again as a new message that names the first one and the robots that are to answer; a
           command, which must not be evaluated twice, goes out as it was, and its answer is requested
rest       robots that have accepted STOP and still moved are looked at until they are at rest
heartbeat  keeps robots moving that are driven by this desk
others     messages of other operators are heard, too: a RELEASE is not repeated once somebody stops the robots again
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping, Sequence
from math import inf, nan

import msgspec
import numpy as np
from numpy.typing import NDArray

from sleepcast.channel import Kind, Message
from sleepcast.channel.clock_sync import WrongClocks
from sleepcast.channel.fair_table import FairTable
from sleepcast.channel.keys import MAY
from sleepcast.channel.message import (
    ENDS,
    FOR,
    INTRODUCE,
    LOOK,
    MAX_NAME,
    STOPS,
    TO_OPERATOR,
    TOOK,
    WITHIN,
    Inspection,
    LeaseAction,
    Role,
)
from sleepcast.channel.message import MATCHED as WOULD
from sleepcast.channel.message import UNKNOWN as UNSURE
from sleepcast.channel.name_conflicts import UNDECIDED_FOR
from sleepcast.channel.reliable import LIFE
from sleepcast.channel.session import GATHER_ANSWERS, MAX_SPREAD, ChannelSession
from sleepcast.columns.values import Mask
from sleepcast.core.clock import Clock
from sleepcast.core.errors import MisuseError
from sleepcast.language import Checked
from sleepcast.language.parts import rules
from sleepcast.language.program import Program
from sleepcast.language.vocabulary import Vocabulary
from sleepcast.mind.authority import FORGOTTEN, MAX_MARKS, Life, StopMark, mark_of, marks_and_ages
from sleepcast.station.account import COUNTED, account
from sleepcast.station.journal.journal import CONFLICT, Journal, JournalEvent
from sleepcast.station.leases import lease_body, validate_holder
from sleepcast.station.prepared import Draft, Prepared, Terms
from sleepcast.station.remote import RemoteMinds
from sleepcast.station.rest import LOOK_SELDOM, RestWatch
from sleepcast.station.retransmission import LATCHING, SETTLE, Retransmission
from sleepcast.station.roster import NOBODY_SAID, Expectation, Index, RobotNames
from sleepcast.station.sent import Answer, Command
from sleepcast.station.shared_names import SHARED, ContestedNames
from sleepcast.station.station import STALE_AFTER, Station
from sleepcast.station.validation import (
    DEADLINE,
    MAX_LISTED,
    NO,
    UNDECIDED,
    UNKNOWN,
    YES,
    Audience,
    Minds,
    Preview,
    SendPolicy,
    robot_names,
)
from sleepcast.station.whose_names import NEW_WORDS, check_for, refuse_forms

ANSWERS_A_SECOND = 1_000.0
"""Answers that are asked for in a second: 200 kB on the air, a fifth of what a slow radio carries."""
FIRST_WITHIN = 0.5
"""Seconds for answers while the roster is empty, as there might be many robots."""
LEAST_WITHIN = 0.02
"""Seconds for answers at least."""
LOOKS, MOST_BETWEEN = 10, 0.1
"""Looks at what has come while robots answer, and s between two of them at most: each takes as much time as ten
answers. Few robots, who answer at once, are looked at as soon as they can have answered."""
ABOVE = 10
"""Robots that may obey before a desk asks whether that many are meant."""
LEASE = 1.0
"""Seconds for which a robot that is driven goes on without hearing anything, unless set otherwise."""
MAX_DRIVERS = 64
"""Commands whose robots are kept moving; beyond, the oldest is dropped."""
MAX_STOPS = 4 * MAX_MARKS
"""STOPs of others that are remembered; beyond, one that is known by the key that has told of the most is forgotten. A
RELEASE names `MAX_MARKS`, and the next one the others."""
PRESENT_FOR = 30.0
"""Seconds after which a robot that was not heard may have left: its names then inform, and refuse nothing."""
MAX_NEWS = 100
"""Messages of other operators that are stored, to be shown."""


class KnownStop(msgspec.Struct):
    """A STOP of somebody else.

    since: when it was there, s
    holds: whether a robot told that it holds it
    released: how often we have named it in a RELEASE
    """

    mark: StopMark
    since: float
    holds: bool = False
    released: int = 0


class Poll(msgspec.Struct, frozen=True):
    """What robots said themselves of whether they would obey a text (YES, NO, UNDECIDED), by their names.

    asked, taken: when they were asked, and the last of them had answered, s of Unix time
    """

    text: str = ""
    asked: float = -inf
    taken: float = -inf
    said: Mapping[str, int] = msgspec.field(default_factory=dict)


def _unheard(sentence: str) -> None: ...


def _nothing() -> None:
    pass


def _has_new_form(text: str) -> bool:
    """Whether a text may have a new form, or a new part of one, which some robots do not know."""
    return NEW_WORDS.search(text) is not None


class RoleError(MisuseError):
    """A command that our key may not send."""


class NetworkStation(Station):
    """See the module.

    session: the way onto the air, whose times are those of `clock` (Unix time, s)
    heard: when robots were heard before (`PeerCache`)
    expected: which robots there are, heard or not
    within: s for answers, None: by the roster
    holding: whether robots that are driven at our word are to go on
    news: messages of other operators, the latest last

    Its owner calls `pump` or `wait`; nothing happens otherwise.
    """

    def __init__(
        self,
        session: ChannelSession,
        clock: Clock,
        vocabulary: Vocabulary,
        minds: Minds,
        *,
        heard: Mapping[str, float] | None = None,
        journal: Journal | None = None,
        policy: SendPolicy | None = None,
        stale_after: float = STALE_AFTER,
        within: float | None = None,
        expected: Expectation = NOBODY_SAID,
    ) -> None:
        delivery = session.delivery
        super().__init__(
            vocabulary,
            minds,
            self._queue,
            clock,
            operator=delivery.name,
            epoch=delivery.epoch,
            journal=journal,
            stale_after=stale_after,
            policy=SendPolicy(ABOVE, irreversible=True, doubts=True) if policy is None else policy,
        )
        self.session, self.within, self.holding = session, within, False
        self.between: Callable[[], None] = _nothing
        """Called while it waits, each time something may have come: other threads may use the desk then."""
        self.alarm: Callable[[str], None] = _unheard
        """Takes a sentence when it comes out that several robots have one name."""
        self.news: deque[Message] = deque(maxlen=MAX_NEWS)
        self.listened = -inf
        """Everything that came up to this time (s of Unix time) has been heard. A wait is over when this reaches its
        end, not when the clock does: a process that stood still meanwhile has not heard yet what came in time."""
        self._began = clock.now()
        self._polled = Poll()
        self._retransmission = Retransmission(
            delivery, self._sent, self._roster, self._within, self._note_again, self._note_account
        )
        self._drivers: deque[Command] = deque(maxlen=MAX_DRIVERS)
        """Commands that may have set robots in motion, since they were last stopped."""
        self._beat = -inf
        self._rest_watch = RestWatch()
        self.clocks = WrongClocks()
        """Of the robots."""
        self.conflicts = delivery.admission.conflicts
        """Names that several robots have."""
        self._shared = ContestedNames(self.conflicts, self._sent, self._roster)
        self._stops = FairTable[Life, KnownStop, str](MAX_STOPS)
        """The latest STOP that is known of each other sender."""
        for name, time in (heard or {}).items():
            self._roster.hear(name, time)
        self._roster.size = expected.size
        for name in expected.names:
            self._roster.enrol(name)

    @property
    def now(self) -> float:
        """s of Unix time."""
        return self._clock.now()

    # ---- sending

    def _draft(self, text: str, terms: Terms) -> Draft:
        """As every station; raises RoleError for what our key may not send, too."""
        self._validate_role(Kind.COMMAND, terms.standing)
        draft = super()._draft(text, terms)
        self._validate_role(Kind.COMMAND, rules(draft.program.root))
        return draft

    def renewed(self, draft: Draft) -> Draft:
        """The same draft, checked anew if other names count by now. Raises what `draft` raises."""
        same = draft.names == self._names(draft.checked, draft.terms.audience)
        return draft if same else self.draft(draft.text, draft.terms)

    def _names(self, checked: Checked, audience: Audience) -> object:
        minds, decide = self._minds, bool(checked.by) or _has_new_form(checked.text)
        learned = minds.changes if isinstance(minds, RemoteMinds) else 0
        return learned, tuple(self.present(audience.only)) if decide else ()

    def _state(self) -> object:
        shared = self._shared.places(self._clock.now()).tobytes()
        learned = self._minds.changes if isinstance(self._minds, RemoteMinds) else 0
        return self._tellings, self._size, self.policy, self.commanded.count, learned, shared, self._polled.taken

    def unknown_names(self, checked: Checked, only: Sequence[str] | None = None) -> tuple[list[str], int]:
        unknown, minds = checked.unknown, self._minds
        if not unknown or not isinstance(minds, RemoteMinds):
            return [], 0
        present = self.present(only)
        if not all(name in minds and minds[name].learned is not None for name in present):
            return [], 0
        return (unknown, len(present)) if present else ([], 0)

    def _refuse_doubtful(self, prepared: Prepared) -> None:
        super()._refuse_doubtful(prepared)
        self._shared.validate(prepared.places, self._clock.now())

    def post(
        self,
        kind: Kind,
        *,
        text: str = "",
        body: Mapping[str, object] | None = None,
        only: Sequence[str] | None = None,
        seconds: float = DEADLINE,
        standing: bool = False,
    ) -> Command:
        """Send a message with a body of the caller's, and keep account of it; what robots say to it is among what
        `pump` gives. seconds: for which it is good, unless it stands. Raises UnknownRobotError, AudienceError, and
        RoleError for a kind that our key may not send."""
        self.require(kind, text)
        audience = Audience.of(only)
        said = {**audience.body(), **(body or {})}
        good, places = inf if standing else seconds, audience.places(self._roster)
        return self._broadcast(kind, text, standing, good, only=places, body=said)

    def check(self, text: str, *, only: Sequence[str] | None = None, anyway: bool = False) -> Checked:
        """See `Station`; of robots that differ, those decide that are there, and that it is for (`whose_names`)."""
        checked = super().check(text)
        if isinstance(self._minds, RemoteMinds) and checked.errors:
            checked = check_for(checked, self._minds, self.present(only), anyway=anyway)
        return self._in_known_forms(checked, only)

    def _in_known_forms(self, checked: Checked, only: Sequence[str] | None) -> Checked:
        """The same text, wrong if it has new forms that some robots do not know which are there and that it is for."""
        if not _has_new_form(checked.text) or not isinstance(self._minds, RemoteMinds):
            return checked
        return refuse_forms(checked, self._minds, self.present(only))

    def _current(self, draft: Draft) -> Draft:
        """As every station; robots may have come since that do not know its forms. Raises CheckError."""
        current = super()._current(draft)
        self._in_known_forms(current.checked, current.terms.audience.only).required()
        return current

    def present(self, only: Sequence[str] | None = None) -> list[str]:
        """The robots, of these or of all, that this desk itself has heard a short while ago."""
        with self._lock:
            since = max(self._began, self._clock.now() - PRESENT_FOR)
            names = RobotNames(self._roster.names, np.flatnonzero(self._roster.heard[: len(self._roster)] >= since))
            meant = robot_names(only)
            return [name for name in names if meant is None or name in meant]

    def poll(self, text: str, patience: float, *, only: Sequence[str] | None = None) -> tuple[Command, Poll]:
        """Ask robots whether they would obey a text that was checked; nothing is done. For a while the desk goes by
        what they say where it cannot tell by itself. Raises what `post` raises."""
        said: dict[str, int] = {}

        def listen(heard: list[Message]) -> None:
            for message in heard:
                would = message.body.get(WOULD)
                if message.body.get("command") == asked.id and isinstance(would, bool):
                    code = YES if would else UNDECIDED if message.body.get(UNSURE) is True else NO
                    said[message.sender] = code if said.get(message.sender, code) == code else UNKNOWN

        asked = self.post(Kind.ASK, text=text, body={WOULD: True}, only=only)
        self.listeners.append(listen)
        try:
            self.gather(asked, patience)
        finally:
            self.listeners.remove(listen)
        for place in np.flatnonzero(asked.silent).tolist():  # what one robot of several says is not what its name says
            said.pop(self._roster.names[place], None)
        self._polled = Poll(text, asked.message.issued, self.now, said)
        return asked, self._polled

    def _preview(self, program: Program) -> Preview:
        """As every station; whether a name obeys that several robots have, nobody can say."""
        preview, shared = super()._preview(program), self._shared.places(self._clock.now())
        return preview.without(shared[shared < len(preview.codes)], SHARED) if len(shared) else preview

    def _decided(self, codes: NDArray[np.uint8], text: str) -> NDArray[np.uint8]:
        polled = self._polled
        if text != polled.text or self.now - polled.taken > self.stale_after:
            return codes
        decided, current = codes.copy(), self.commanded.of(len(codes)) <= polled.asked
        for place in np.flatnonzero((codes == UNKNOWN) & current).tolist():
            if (code := polled.said.get(self._roster.names[place])) is not None:
                decided[place] = code
        return decided

    def _say_grants(self, body: dict[str, object], now: float) -> None:
        self.session.delivery.post(Kind.REQUEST, now, deadline=now + LIFE, body=body)

    def stop(self) -> Command:
        """As every station: it leaves at once."""
        self._drivers.clear()
        return super().stop()

    def release(self) -> Command:
        """As every station. Raises RoleError for an observer."""
        self.require(Kind.RELEASE)
        return super().release()

    def release_all(self, decided: float | None = None) -> Command:
        """The same, and it ends the STOPs of others of which the desk knows that they were there when this was decided
        (s of Unix time, None: now). Raises RoleError for an observer."""
        self.require(Kind.RELEASE)
        known = [stop for stop in self._stops.values() if decided is None or stop.since <= decided]
        known.sort(key=lambda stop: (stop.mark.sender != FORGOTTEN, stop.released, not stop.holds, -stop.since))
        for stop in known[:MAX_MARKS]:
            stop.released += 1
        body: dict[str, object] = {ENDS: [stop.mark.named for stop in known[:MAX_MARKS]]} if known else {}
        return self._broadcast(Kind.RELEASE, body=body)

    def lease(self, action: LeaseAction, group: str, seconds: float, to: str = "") -> Command:
        """Ask robots about the lease of a group, for so many s. to: whom to grant it. Raises LeaseError for what no
        robot could grant, and for a holder who is known as no operator; RoleError for an observer."""
        body = lease_body(action, group, seconds, to)
        if action is LeaseAction.GRANT:
            validate_holder(to, self.session.delivery.admission.trust)
        return self.post(Kind.COMMAND, body=body)

    def give_up(self, command: str) -> None:
        """Wait no longer for answers to this command. Raises NoSuchCommandError."""
        self._sent.get(command)
        self._retransmission.give_up(command)

    def require(self, kind: Kind, text: str = "") -> None:
        """Raises RoleError for a kind of message that our key may not send."""
        with self._refusing(text):
            self._validate_role(kind)

    def _validate_role(self, kind: Kind, rules_change: bool = False) -> None:
        role, why = self.session.delivery.role, ""
        if kind not in MAY[role]:
            why = f"is an {role}, who may only ask and stop: {kind} needs an operator's key"
        elif rules_change and role is not Role.COMMANDER:
            why = f"is an {role}, who changes no rules: that needs a commander's key"
        if why:
            raise RoleError(f"{self.operator} {why}")

    def _begun(self, command: Command) -> None:
        if command.kind is Kind.COMMAND and command.text:
            self.commanded.note(command.message.issued, command.only)
            if not command.message.standing:
                self._drivers.append(command)
        self._shared.begin(command, self._clock.now())
        self.pump_out()

    def _compose(
        self, kind: Kind, now: float, until: float, text: str, standing: bool, body: dict[str, object]
    ) -> Message:
        named = body.get(FOR)
        within = self._within(len(named) if isinstance(named, list) else max(self._roster.size, len(self._roster)))
        # A RELEASE is not standing: it ends like every one-shot message.
        deadline = None if kind is Kind.RELEASE else until
        body.setdefault(WITHIN, within)
        return self.session.delivery.compose(kind, now, text=text, deadline=deadline, standing=standing, body=body)

    def _queue(self, message: Message) -> None:
        """Queue a message; it is sent by `pump_out`, STOP and RELEASE at once."""
        within = message.body[WITHIN]
        assert isinstance(within, float)
        self.session.delivery.queue(message, self._clock.now())
        self._retransmission.begin(message.id, message.issued + within)
        if message.kind in LATCHING:
            self.pump_out()

    def _within(self, robots: int) -> float:
        """Seconds over which this number of robots is to spread its answers."""
        if self.within is not None:
            return min(self.within, MAX_SPREAD)
        return min(MAX_SPREAD, max(LEAST_WITHIN, robots / ANSWERS_A_SECOND)) if robots else FIRST_WITHIN

    # ---- hearing

    def pump(self) -> list[Message]:
        """Receive, and do what is due. Returns the robots' messages; an answer to a repeated message names the first
        one."""
        heard, began = [], self._clock.now()
        with self._lock, self.notes.together(began):
            for message in self.session.receive():
                if message.kind in TO_OPERATOR:
                    known = self._retransmission.known(message)
                    if not self._is_new(message, known.body.get("command")):
                        continue
                    if message.ahead:  # its clock is wrong, and it answers us: this is of now
                        self.conflicts.hear(msgspec.structs.replace(message, issued=self.now), self.now)
                    heard.append(known)
                    if self._take_in(known) is None and message.key:
                        self.session.delivery.admission.no_room(bytes.fromhex(message.key))
                    if STOPS in known.body:
                        self._learn_stops(known)
                    if TOOK in known.body:
                        self._learn_time(known)
                elif message.kind is Kind.REQUEST:
                    self.auctions.hear(message, began)
                elif message.role != Role.ROBOT or message.kind is Kind.STOP:
                    self._overhear(message)
        self.listened = began
        if heard:
            self._pass_on(heard)
        self.attend()
        self.pump_out()
        return heard

    def wait(self, seconds: float) -> list[Message]:
        """Pump for this many seconds, and return what was received."""
        until, heard = self._clock.now() + seconds, self.pump()
        while (left := until - self._clock.now()) > 0.0:
            heard += self._listen(left)
        return heard

    def wait_until(
        self, done: Callable[[], bool], until: float, every: float = LEAST_WITHIN, gather: float = GATHER_ANSWERS
    ) -> None:
        """Wait until something is so, looking when something has come and every so many seconds, or until everything
        has been heard that came up to a time (s of Unix time). gather: s to wait for what comes with it."""
        while not done() and self.listened < until:
            self._listen(min(every, until - self._clock.now()), gather)

    def _listen(self, seconds: float, gather: float = GATHER_ANSWERS) -> list[Message]:
        """Wait until something has come or is due, at most so many seconds, and pump."""
        self.session.listen(max(0.0, min(seconds, self.due() - self._clock.now())), gather)
        heard = self.pump()
        self.between()
        return heard

    def gather(self, command: Command, patience: float) -> None:
        """Wait until all robots have answered, or the time for answers and `patience` s more are over, or that time is
        over and the roster is empty."""
        pace = self._pace(command)
        self.wait_until(
            lambda: not self.awaits(command) or self.listened >= self.answered(command) + patience, inf, pace, pace
        )

    def settle(self, command: Command, patience: float) -> None:
        """Gather what robots of the same names have to say as well: a name may have answered before another robot that
        has it."""
        told, pace = self.answered(command) + SETTLE, self._pace(command)
        self.wait_until(lambda: self.listened >= told and not self.is_deciding, told + 2.0 * UNDECIDED_FOR, pace, pace)
        self.gather(command, patience)

    def _pace(self, command: Command) -> float:
        """Seconds between two looks at the answers to a command; other threads that use the desk do not wait longer."""
        longest = MOST_BETWEEN if self.between is _nothing else LEAST_WITHIN
        return min(longest, max(LEAST_WITHIN, (self.answered(command) - command.message.issued) / LOOKS))

    def awaits(self, command: Command) -> bool:
        """Whether a robot may still answer: one is silent, or the roster is empty."""
        return command.n_silent > 0 or command.waits or not (command.size or command.addressed)

    def answered(self, command: Command) -> float:
        """When the time for answers to a command is over, s of Unix time: of one that chooses among robots once nobody
        else is chosen, at its deadline until then; of one that waits, after its instant."""
        message, within = command.message, self._within(max(command.size, command.addressed))
        if command.instant is not None and command.waits:
            return command.instant + within
        if command.auctioneer is None:
            return message.issued + within
        return min(command.auctioneer.closed + within, message.deadline)

    def due(self) -> float:
        """When there is something to be sent again, or a heartbeat, s of Unix time."""
        beat = self._beat + LEASE / 3.0 if self.holding and self._drives() else inf
        auction = self.auctions.due(self._clock.now()) if self.auctions.running else inf
        return min(beat, auction, self._retransmission.due(), self._rest_watch.due)

    def conclude(self) -> None:
        """Write the results of all commands into the journal, before the desk leaves the air."""
        with self._lock, self.notes.together(self._clock.now()):
            self._retransmission.end()

    def pump_out(self) -> None:
        """Let what was posted leave now."""
        self.session.flush()

    def _is_new(self, message: Message, command: object) -> bool:
        """Whether a robot says this now. Where its clock is wrong, it does if it answers what we have sent (`command`);
        then it is known how wrong its clock is, and what else it says can be judged by that."""
        if not message.ahead or self._sent.find(command) is not None:
            self.clocks.note(message.sender, message.ahead, message.key)
            return True
        return abs(self.clocks.ahead(message.sender) - message.ahead) <= self.session.delivery.admission.skew

    def _count(self, command: Command, place: int, message: Message, answer: Answer) -> None:
        self._shared.take(command, place, message, answer)

    def _update_latch(self, robots: Index, stopped: Mask, now: float) -> None:
        if self._sent.latch is None:
            return
        plain = self._shared.is_plain(robots, self._clock.now())
        super()._update_latch(robots[plain], stopped[plain], now)

    def values(self, text: str, places: Index | None = None) -> tuple[NDArray[np.float64], RobotNames]:
        """As every station; a name has no value that several robots have."""
        values, asked = super().values(text, places)
        shared = self._shared.places(self._clock.now())
        values[np.isin(np.arange(len(values)) if places is None else places, shared)] = nan
        return values, RobotNames(self._roster.names, np.setdiff1d(asked.places, shared))

    @property
    def shared_names(self) -> frozenset[str]:
        """The names on the roster that several robots have."""
        return frozenset(self._roster.names[place] for place in self._shared.places(self._clock.now()).tolist())

    @property
    def is_deciding(self) -> bool:
        """Whether it is being found out if a robot has restarted, or another one has its name."""
        return bool(self.conflicts.undecided(self._clock.now()))

    def is_over(self, command: Command) -> bool:
        """Whether nothing is to be waited for any more: another operator has ended it, or only robots are missing that
        were heard under the name of another one, and are not heard any more."""
        return bool(command.ended_by) or self._shared.is_over(command, self._clock.now())

    def _attend_names(self, now: float) -> None:
        """Ask robots that may have one name, count their answers again, and write down what has come out."""
        names = [name for name in self.conflicts.to_probe(now) if self._roster.names.index_of(name) is not None]
        if names:
            looks = {LOOK: Inspection.TELEMETRY.value, INTRODUCE: True}
            self.post(Kind.ASK, body=looks, only=names[:MAX_LISTED])
        for name, text in self._shared.review(now).items():
            self._note(JournalEvent.HEARD, name, text=text, details={"kind": CONFLICT})
            self.alarm(text)

    def _overhear(self, message: Message) -> None:
        """Another operator speaks."""
        if message.kind is Kind.HEARTBEAT or LOOK in message.body:
            return
        self.news.append(message)
        details = {"kind": message.kind.value, **message.body}
        self._note(JournalEvent.HEARD, message.sender, subject=message.id, text=message.text, details=details)
        if message.kind is Kind.COMMAND and message.text:
            self.commanded.note(self.now, self._named(message))
        if message.kind is Kind.STOP:
            self.auctions.end()
            self._drivers.clear()
            self._note_stop(KnownStop(mark_of(message), self.now), message.key)
        self._retransmission.overtaken(message)

    def _named(self, message: Message) -> Index | None:
        """The places of the robots that another operator's message is for, None for all."""
        names = message.body.get(FOR)
        if not isinstance(names, list):
            return None
        places = (self._roster.names.index_of(name) for name in names if isinstance(name, str))
        return np.array([place for place in places if place is not None], np.intp)

    def notices(self) -> list[str]:
        """What is going on that a person should know of, as sentences: names that several robots have, clocks that are
        wrong, forgeries, keys that nobody trusts."""
        admission, sentences = self.session.delivery.admission, self._shared.sentences(self._clock.now())
        return (
            sentences
            + self.clocks.of_robots(DEADLINE)
            + [notice.text for notice in admission.drops.notices(admission.trust)]
        )

    def _learn_stops(self, answer: Message) -> None:
        """A robot tells which STOPs hold it, each with the seconds since it came."""
        for mark, age in marks_and_ages(answer.body.get(STOPS)):
            self._note_stop(KnownStop(mark, self.now - age, holds=True), answer.key)

    def _learn_time(self, report: Message) -> None:
        """A robot tells whose time it has taken, and by how many s its clock was behind."""
        match report.body.get(TOOK), report.body.get("values"):
            case str() as whose, [float() as behind] if whose.isprintable() and 0.0 < behind < inf:
                self.clocks.note_took(report.sender, whose[:MAX_NAME], behind, report.key)

    def _note_stop(self, stop: KnownStop, key: str) -> None:
        """Remember a STOP. key: of who says that it was there."""
        known = self._stops.get(stop.mark.life)
        if known is not None and known.mark.number > stop.mark.number:
            stop = known
        elif known is not None and known.mark.number == stop.mark.number:
            stop.since, stop.released = min(stop.since, known.since), known.released
            stop.holds |= known.holds
        self._stops.put(key, stop.mark.life, stop)

    # ---- at every moment

    def attend(self) -> None:
        """Ask those again that are not accounted for, and send a heartbeat if one is due."""
        with self._lock:
            now = self._clock.now()
            self._attend_names(now)
            self._retransmission.attend(now)
            if self.auctions.running:
                self.auctions.attend(now)
            self._watch_rest(now)
            if self.holding and self._drives() and now - self._beat >= LEASE / 3.0:
                self._beat = now
                self.session.delivery.post(Kind.HEARTBEAT, now, deadline=now + LEASE)

    def _watch_rest(self, now: float) -> None:
        """Look at robots that have accepted our STOP, if it holds, and may have come to rest."""
        latch = self._sent.latch
        if latch is None or latch.kind is not Kind.STOP or latch.ended_by:
            self._rest_watch.due = inf
            return
        wanted = self._rest_watch.wanted(latch.id, latch.answers.latest, latch.resting, now)
        if wanted:
            self.post(Kind.ASK, body={LOOK: Inspection.TELEMETRY}, only=wanted, seconds=LOOK_SELDOM)

    def _note_again(self, command: Command) -> None:
        if not command.is_look:
            details = {"silent": command.n_silent}
            self._note(JournalEvent.REPEATED, subject=command.id, text=command.text, details=details)

    def _note_account(self, command: Command) -> None:
        if not command.is_look:
            counted = account(command, self._clock.now(), self._roster.heard)
            silent = RobotNames(self._roster.names, np.flatnonzero(command.silent))
            details = {f"n_{sort}": getattr(counted, f"n_{sort}") for sort in COUNTED} | {"silent": silent}
            details |= {"n_waiting": counted.n_waiting} if counted.n_waiting else {}
            details |= {"n_not_stored": counted.n_not_stored} if counted.n_not_stored else {}
            details |= {} if counted.auction is None else counted.auction.to_dict()
            self._note(JournalEvent.ACCOUNTED, subject=command.id, text=command.text, details=details)

    def _drives(self) -> bool:
        """Whether our commands may be moving robots: one has obeyed, or may yet answer."""
        now = self._clock.now()
        return any(command.may_move(now) for command in self._drivers)
