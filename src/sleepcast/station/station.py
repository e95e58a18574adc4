"""An operator's station: check a text, see who would obey, send it, and keep account of each command's outcome.

The station knows no page, socket or body. It sends to an `outbox` that it was given; `hear` and `observe` bring what
robots say, one by one or many at once, and find the command that an answer is about. Time comes from the swarm's clock.

Threads: every public method may be called from any thread; a lock guards the roster, the commands and the journal,
and is never held while a text is checked or a preview is evaluated. `outbox` is called with the lock held, so that
messages leave in the order of their numbers: it must only queue the message, never wait for another thread.
A preview reads what robots have learned (operators, buffers) out of their minds without stopping them.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import inf, nan
from threading import RLock

import numpy as np
from numpy.typing import NDArray

from sleepcast.channel import Kind, Message
from sleepcast.channel.message import ENDS, FOR, RULE, TELEMETRY, LeaseAction
from sleepcast.channel.message_batch import AnswerColumns, MessageBatch, NameIndex
from sleepcast.columns.telemetry import BulkTelemetry, TelemetryTable, validate_reading
from sleepcast.columns.values import Mask
from sleepcast.core.clock import Clock
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.core.serial import SerialError, pack, room_for, unpack
from sleepcast.language import Checked, CheckError, Explanation
from sleepcast.language.parts import auction_of
from sleepcast.language.program import Program
from sleepcast.language.symbols import Declared
from sleepcast.language.vocabulary import Vocabulary
from sleepcast.station.account import Account, account
from sleepcast.station.auctions import DeskAuctions
from sleepcast.station.failures import RuleFailures
from sleepcast.station.journal.journal import Journal, JournalEvent, JournalWriter, MemoryJournal, PendingEntry, Report
from sleepcast.station.journal.snapshot import dump_journal, restore_journal
from sleepcast.station.leases import lease_body
from sleepcast.station.prepared import (
    GOOD_FOR,
    ONCE,
    Draft,
    Prepared,
    Terms,
    validate_address,
    validate_count,
    validate_type,
    with_instant,
)
from sleepcast.station.rest import motion_said
from sleepcast.station.roster import CommandedTimes, Index, RobotNames, Roster
from sleepcast.station.sent import Answer, Command, NoExplanationError, Outcome, SentCommands, answer_from
from sleepcast.station.serialized import AccountState, ReportState, StationState
from sleepcast.station.telemetry import ToldTelemetry
from sleepcast.station.validation import (
    DEADLINE,
    Audience,
    FleetNames,
    ManyMinds,
    Minds,
    Preview,
    SendPolicy,
    Telemetry,
    UnknownNameError,
    preview,
)

DESK = "desk"
"""Who sends where nobody is named."""
STALE_AFTER = 5.0
"""Seconds after which telemetry decides nothing in a preview."""
MAX_REPORTS = 1_000
"""Latest reports that are stored for the page."""
MANY = "robots"
"""The sender in the journal, for messages of one kind from many robots at once."""


class Station:
    """One operator's desk; see the module for who may call what.

    vocabulary, minds: the names and the minds of the fleet (see `preview`); `minds` is looked into, never
    changed. Minds that answer for many tell by `observe_many`, others by `observe`. outbox: takes what is sent.
    operator, epoch: who sends, and which life of that sender this is. policy: what it refuses, or asks about, beyond
    what every desk does. heartbeat: s between two signs that the operator is there, inf for none; see `hold`.
    """

    def __init__(
        self,
        vocabulary: Vocabulary,
        minds: Minds,
        outbox: Callable[[Message], None],
        clock: Clock,
        *,
        operator: str = DESK,
        epoch: int = 1,
        journal: Journal | None = None,
        stale_after: float = STALE_AFTER,
        policy: SendPolicy | None = None,
        heartbeat: float = inf,
    ) -> None:
        self.operator = operator
        self.holding, self._heartbeat, self._beat = False, heartbeat, -inf
        """Whether robots that are driven are to go on; s between two heartbeats; when the last one was sent."""
        self.notes = JournalWriter(MemoryJournal() if journal is None else journal)
        self.failures = RuleFailures()
        """What robots reported of rules that they have deactivated."""
        self.reports: list[Report] = []
        """What robots reported unasked, the latest last."""
        self.listeners: list[Callable[[list[Message]], None]] = []
        """Functions that get the messages of robots, each time some were heard."""
        self._minds, self._clock = minds, clock
        self._roster = Roster(minds.names if isinstance(minds, ManyMinds) else minds, len(minds))
        self.told = ToldTelemetry(minds)
        """What robots told one by one."""
        self._fleet_telemetry: BulkTelemetry | None = minds.telemetry if isinstance(minds, ManyMinds) else None
        self.telemetry: TelemetryTable = self._fleet_telemetry or self.told
        """What robots told last, by their places on the roster."""
        self._sent = SentCommands()
        self._lock = RLock()
        self.epoch, self.stale_after = epoch, stale_after
        self.commanded = CommandedTimes()
        """What robots reported before they were commanded does not say who will obey."""
        self.policy = SendPolicy() if policy is None else policy
        self.vocabulary, self._outbox = vocabulary, outbox
        self.beside: Sequence[Station] = ()
        """The desks of further operators that know of each other what they send: those of one simulated run."""
        self.auctions = DeskAuctions(self._say_grants)
        self._sequence = self._tellings = 0
        """The number of the latest message; how often robots have told of themselves."""

    @property
    def journal(self) -> Journal:
        """Everything that was sent, heard and decided."""
        return self.notes.journal

    @property
    def trouble(self) -> str:
        """What is wrong with the journal, for a person; "" while nothing is."""
        return self.notes.trouble

    @property
    def names(self) -> Sequence[str]:
        """Of all robots on the roster, in its order."""
        return self._roster.names

    @property
    def roster(self) -> dict[str, float | None]:
        """Every robot by name, with the time at which it was last heard (s of the desk's clock), None if never."""
        with self._lock:
            return self._roster.by_name()

    @property
    def fleet_size(self) -> int:
        """How many robots there are at least, heard or not; 0 where that is unknown."""
        return self._roster.size

    @property
    def _size(self) -> int:
        """How many robots are on the roster or expected."""
        return self._roster.count + self._roster.nameless

    def state(self) -> bytes:
        """Everything that it knows, except the telemetry of single robots. Raises SerialError for more than
        fits."""
        with self._lock:
            commands, latch = self._sent.state()
            reports = [ReportState(report.robot, report.heard, report.body) for report in self.reports]
            account = AccountState(
                self.operator, self.epoch, self._sequence, commands, latch, reports, self.holding, self._beat
            )
            roster = self._roster.state(len(self._minds))
            parcel = StationState(account, roster, dump_journal(self.journal))
        return pack(parcel, room_for(len(self._minds)))

    def restore(self, state: bytes) -> None:
        """Know what a desk knew, of the same minds, that gave this state; a journal that is not kept in memory goes on
        by itself. Raises SerialError for anything else."""
        desk = unpack(StationState, state, room_for(len(self._minds)), "the part of the desk")
        parcel = desk.account
        if len(parcel.reports) > MAX_REPORTS or parcel.sequence < 0:
            raise SerialError(f"{len(parcel.reports)} reports of a desk")
        with self._lock:
            self.operator, self.epoch, self._sequence = parcel.operator, parcel.epoch, parcel.sequence
            self.holding, self._beat = parcel.holding, parcel.beat
            self._roster.restore(desk.roster)
            self._sent.restore(parcel.commands, parcel.latch, self._roster.names)
            self.auctions.go_on(self._sent.all(), self._clock.now())
            self.reports.extend(Report(report.robot, report.heard, report.body) for report in parcel.reports)
            if isinstance(self.journal, MemoryJournal):
                restore_journal(self.journal, desk.journal, self._roster.names)

    def turn_over(self, names: NameIndex, children: Index, dead: Index) -> None:
        """Robots have come to places of the roster, and others have gone: nothing was heard from there yet."""
        with self._lock:
            self._roster.turn_over(names, np.concatenate((children, dead)))
            self._sent.turn_over(dead)
            self.failures.forget((*children.tolist(), *dead.tolist()))

    def go_back(self, time: float) -> None:
        """Know what it knew at `time`, s of its clock, of the commands that it has: for a run that goes on from then.
        Numbers of messages are not used twice."""
        with self._lock:
            self._sent.go_back(time)
            self.auctions.go_on(self._sent.all(), time)
            kept = [report for report in self.reports if report.heard <= time]
            self.reports.clear()
            self.reports.extend(kept)
            self._roster.go_back(time)

    # ---- before sending

    def check(self, text: str, *, only: Sequence[str] | None = None, anyway: bool = False) -> Checked:
        """Everything that is wrong or doubtful in `text`, in the names of the fleet. only: it is for these robots, None
        for all; anyway: robots' names are to make nothing wrong, for a sender who insists. Both matter where robots
        differ, and some have left. Raises ReadError."""
        return self.learned.check(text)

    @property
    def learned(self) -> FleetNames:
        """The names that the fleet knows, what robots have learned over the air among them."""
        return FleetNames(self.vocabulary, self._minds)

    def preview(self, text: str | Checked) -> Preview:
        """Who would obey a text now. Raises ReadError, and CheckError for a text that no robot could run."""
        checked = self.check(text) if isinstance(text, str) else text
        return self._preview(checked.required())

    def _preview(self, program: Program) -> Preview:
        since = self.commanded.of(len(self._roster))
        return preview(program, self._roster, self.telemetry, self._clock.now(), self.stale_after, since)

    def values(self, text: str, places: Index | None = None) -> tuple[NDArray[np.float64], RobotNames]:
        """The value of an expression that only reads, by recent telemetry and by place on the roster, SI, NaN for
        unknown; and the robots that would have to be asked. places: ascending, of the robots that are wanted; None
        stands for all. Raises ReadError, CheckError, and MisuseError for an expression that would do something."""
        checked = self.check(text)
        program = checked.required()
        if checked.unknown:
            raise CheckError(checked.findings, text, checked.more)
        validate_reading(text, program)
        times = self._roster.reported[: len(self._roster)]
        told = (now := self._clock.now()) - times <= self.stale_after
        known = np.flatnonzero(told if places is None else told[places])
        fresh = known if places is None else places[known]
        values = np.full(len(times) if places is None else len(places), nan)
        values[known], reason, _ = self.telemetry.values(program, fresh, now, times)
        return values, RobotNames(self._roster.names, fresh[reason > 0])

    # ---- sending

    def draft(self, text: str, terms: Terms = ONCE) -> Draft:
        """Read and check a command. Raises ReadError and CheckError for a text that no robot could run,
        NotConfirmedError if it would go to everybody and the terms do not say so, CommandTypeError for a standing
        command that has a test and joins a group (who matches is a matter of the moment) or a deadline, and
        AudienceError."""
        with self._refusing(text):
            return self._draft(text, terms)

    def _draft(self, text: str, terms: Terms) -> Draft:
        whole = with_instant(text, terms.at, self._clock.now())
        if terms.at is not None:  # what is wrong is to be told of what was written, not of what stands around it
            self.check(text, only=terms.audience.only, anyway=terms.anyway).required()
        checked = self.check(whole, only=terms.audience.only, anyway=terms.anyway)
        program = checked.required()
        if self.policy.strict and checked.findings:
            raise CheckError(checked.findings, text, checked.more)
        validate_address(program, terms.everybody or terms.audience.named, self._size)
        seconds = validate_type(program, terms.standing, terms.deadline)
        terms.audience.body()  # raises AudienceError
        names = self._names(checked, terms.audience)
        return Draft(checked, program, terms, seconds, self.vocabulary, self._meanings(program), names, text)

    def _names(self, checked: Checked, audience: Audience) -> object:
        """Something that changes when this text would be checked in other names."""
        return None

    def _meanings(self, program: Program) -> dict[str, Declared | None]:
        """What robots have learned under the names in a program."""
        names = self.learned
        return {key: names.declared(key) for key in sorted(program.free)}

    def prepare(self, text: str, terms: Terms = ONCE) -> Prepared:
        """Read and check a command, and find out who would obey it now. Raises what `draft` and `foresee` raise."""
        return self.foresee(self.draft(text, terms))

    def foresee(self, draft: Draft, of: Prepared | None = None) -> Prepared:
        """Who would obey a command now. of: the same command to others, which was just foreseen. Raises
        UnknownRobotError."""
        with self._refusing(draft.text):
            fresh = of is not None and self._is_fresh(of)
            return self._foresee(draft, of.preview if of is not None and fresh else None)

    def _foresee(self, draft: Draft, preview: Preview | None = None) -> Prepared:
        at, state, audience = self._clock.now(), self._state(), draft.terms.audience
        with self._lock:
            places = audience.places(self._roster)
        foreseen = self._preview(draft.program) if preview is None else preview
        codes = self._decided(foreseen.codes, draft.text)
        nameless = 0 if audience.named else self._roster.nameless
        insists = draft.terms.anyway or draft.terms.strange
        unknown, informed = ([], 0) if insists else self.unknown_names(draft.checked, audience.only)
        chosen = codes if places is None else codes[places]
        return Prepared(draft, foreseen, chosen, places, nameless, tuple(unknown), informed, at, state)

    def _decided(self, codes: NDArray[np.uint8], text: str) -> NDArray[np.uint8]:
        """The codes of a preview of a text, with what robots themselves have said of it."""
        return codes

    def unknown_names(self, checked: Checked, only: Sequence[str] | None = None) -> tuple[list[str], int]:
        """The names in a text that no robot has, of these or of all, and how many robots have told all of theirs; none
        where they do not tell, or not all have."""
        return [], 0

    def _state(self) -> object:
        """Something that changes with whatever may change who would obey, or whether that matters: telemetry, the
        roster, learned names and the policy. Minds that are looked into may have learned at any other time."""
        return self._tellings, self._size, self.policy, self.commanded.count, self._clock.now()

    def _is_fresh(self, prepared: Prepared) -> bool:
        """Whether who would obey is still as it was prepared."""
        return prepared.state == self._state() and 0.0 <= self._clock.now() - prepared.at <= GOOD_FOR

    def accept(self, prepared: Prepared, *, count: int | None = None, confirmed: bool = False) -> Prepared:
        """What `commit` would send: who would obey is foreseen once more where anything has changed, without reading
        or checking the text again, unless a name in it means something else by now. Raises what `commit` raises."""
        with self._refusing(prepared.draft.text):
            current = prepared if self._is_fresh(prepared) else self._foresee(self._current(prepared.draft))
            self._settle(current, count, confirmed)
            return current

    def _current(self, draft: Draft) -> Draft:
        same = draft.vocabulary is self.vocabulary and draft.meanings == self._meanings(draft.program)
        return draft if same else self._draft(draft.text, draft.terms)

    def _settle(self, prepared: Prepared, count: int | None, confirmed: bool) -> None:
        """Raises what is left to ask of the sender."""
        if self.policy.doubts and not confirmed:
            self._refuse_doubtful(prepared)
        validate_count(prepared.draft.program, prepared.may, self._size, count, self.policy)

    def _refuse_doubtful(self, prepared: Prepared) -> None:
        """Raises DoubtError for what is hardly meant."""
        prepared.refuse_doubtful()

    def commit(self, prepared: Prepared, *, count: int | None = None, confirmed: bool = False) -> Command:
        """Broadcast what was prepared, and keep account of it.

        count: how many robots may obey (`Prepared.may`), where the desk asks for that. confirmed: send it although it
        is doubted. Raises DoubtError for what is hardly meant, where the desk asks about that, CountNeededError for a
        missing or wrong count, and NobodyHeardError; the same `prepared` may then be committed with the answer.
        """
        draft = (ready := self.accept(prepared, count=count, confirmed=confirmed)).draft
        whom = ready.expected, ready.places, draft.terms.audience.body()
        command = self._broadcast(Kind.COMMAND, draft, draft.terms.standing, draft.seconds, *whom)
        if (auction := auction_of(draft.program.root)) is not None:
            with self._lock:
                self.auctions.begin(command, auction)
        return command

    def _say_grants(self, body: dict[str, object], now: float) -> None:
        """Send what a caller of an auction says."""
        self._outbox(self._compose(Kind.REQUEST, now, inf, "", False, body))

    def send(
        self,
        text: str,
        *,
        standing: bool = False,
        deadline: float | None = None,
        everybody: bool = False,
        count: int | None = None,
        only: Sequence[str] | None = None,
        but: Sequence[str] | None = None,
        confirmed: bool = False,
        undecided: bool = False,
        at: float | None = None,
    ) -> Command:
        """Prepare an expression and commit it, for who has nobody to ask.

        A one-shot command (the default) is evaluated within `deadline` seconds from now (`DEADLINE` unless given) or
        never; a standing one is good until it has reached everybody. everybody: it may go to all robots. only, but: for
        these robots, or for all except these. undecided: send it although its test is unknown on all robots, which is
        doubted too; for programs, which may send while a sensor knows nothing. at: see `Terms`; count, confirmed: see
        `commit`. Raises what these raise, and `draft` and `foresee`.
        """
        audience = Audience.of(only, but)
        terms = Terms(standing, deadline, everybody, audience, anyway=confirmed, undecided=undecided, at=at)
        return self.commit(self.prepare(text, terms), count=count, confirmed=confirmed)

    def ask(
        self,
        text: str | Checked,
        *,
        only: Sequence[str] | None = None,
        but: Sequence[str] | None = None,
        anyway: bool = False,
    ) -> Command:
        """Ask robots for the value of an expression; nothing changes on them, whatever the expression does.

        Who answers is accounted for as who matched. text: may have been checked before. only, but: as for `send`;
        anyway: as for `check`, and although no robot has a name in it. Raises ReadError and CheckError for a text that
        no robot could run, UnknownNameError, UnknownRobotError and AudienceError.
        """
        audience, written = Audience.of(only, but), text if isinstance(text, str) else text.text
        with self._refusing(written):
            checked = self.check(text, only=only, anyway=anyway) if isinstance(text, str) else text
            self._validate_question(checked, audience, anyway)
            places, body = audience.places(self._roster), audience.body()
        return self._broadcast(Kind.ASK, written, seconds=DEADLINE, only=places, body=body)

    def _validate_question(self, checked: Checked, audience: Audience, anyway: bool) -> None:
        checked.required()
        if self.policy.strict and checked.findings:
            raise CheckError(checked.findings, checked.text, checked.more)
        unknown, informed = ([], 0) if anyway else self.unknown_names(checked, audience.only)
        if self.policy.doubts and unknown:
            raise UnknownNameError(unknown, informed)

    def stop(self) -> Command:
        """Stop every body at once, whatever it is doing; it stays stopped until `release`."""
        for desk in (self, *self.beside):
            desk.auctions.end()
        return self._broadcast(Kind.STOP)

    def release(self) -> Command:
        """End our own STOPs on every robot; nothing old resumes by itself."""
        return self._broadcast(Kind.RELEASE)

    def release_all(self) -> Command:
        """The same for a person, who sees whom others have stopped: it ends the STOPs of desks beside this one, too."""
        ends = [stops.named for desk in self.beside if (stops := desk._sent.stops) is not None]
        return self._broadcast(Kind.RELEASE, body={ENDS: ends} if ends else {})

    def lease(self, action: LeaseAction, group: str, seconds: float, to: str = "") -> Command:
        """Do something about the lease of a group, for so many seconds. to: who is granted it. Raises LeaseError."""
        return self._broadcast(Kind.COMMAND, seconds=DEADLINE, body=lease_body(action, group, seconds, to))

    def hold(self, lasts: bool) -> None:
        """Send heartbeats from now on, so that robots that are driven go on; or no more."""
        self.holding = lasts

    @contextmanager
    def _refusing(self, text: str) -> Iterator[None]:
        """Write down why a text is refused."""
        try:
            yield
        except SleepcastError as error:
            self._note(JournalEvent.REFUSED, text=text, details={"reason": str(error)})
            raise

    def attend(self) -> None:
        """Send the last STOP or RELEASE again if robots are not accounted for; call this at every tick or so."""
        with self._lock:
            now = self._clock.now()
            if self.holding and self._heartbeat < now - self._beat:
                self._beat = now
                self._outbox(self._compose(Kind.HEARTBEAT, now, now + self._heartbeat, "", False, {}))
            if self.auctions.running:
                self.auctions.attend(now)
            silent, latest = self._sent.silent(now), self._sent.latch
            if latest is not None and silent and not self._sent.stop_ended_by(desk._sent for desk in self.beside):
                latest.last_sent = now
                self._note(JournalEvent.REPEATED, subject=latest.id, text=latest.text, details={"silent": silent})
                self._outbox(latest.message)

    @property
    def next_due(self) -> float:
        """Before when `attend` has nothing to do, s of the desk's clock, as long as nothing is heard."""
        beat = self._beat + self._heartbeat if self.holding else inf
        return min(self._sent.next_repeat, self.auctions.due(self._clock.now()), beat)  # NaN is never less

    def _broadcast(
        self,
        kind: Kind,
        said: str | Draft = "",
        standing: bool = False,
        seconds: float = inf,
        expected: Index | None = None,
        only: Index | None = None,
        body: Mapping[str, object] | None = None,
    ) -> Command:
        with self._lock:
            now = self._clock.now()
            text = said if isinstance(said, str) else said.sent_at(now)
            until, fields, only = now + seconds, dict(body or {}), self._roster.asked(only)
            message = self._compose(kind, now, until, text, standing, dict(fields))
            command = Command(message, self._roster.names, expected, now, only, self._roster.meant(only, FOR in fields))
            urgent = kind in (Kind.STOP, Kind.RELEASE)
            if urgent:  # nothing comes before these, not even the journal
                self._outbox(message)
            if not command.is_look:  # what a desk asks in order to show it decides nothing
                predicted = RobotNames(self._roster.names, command.expected)
                details: dict[str, object] = {"kind": kind.value, "standing": standing, "deadline": until}
                details |= {"digest": hashlib.sha256(text.encode()).hexdigest(), "predicted": predicted}
                self._note(JournalEvent.SENT, subject=message.id, text=text, details=details | fields, first=not urgent)
            self._sent.add(command, len(self._roster))
            if not urgent:
                self._outbox(message)
            self._begun(command)
            return command

    def _begun(self, command: Command) -> None:
        """An account of what was sent has begun: for desks that have more to do then."""

    def _compose(
        self, kind: Kind, now: float, until: float, text: str, standing: bool, body: dict[str, object]
    ) -> Message:
        """The message that goes out next. now, until: when it is issued, and its deadline, s of the desk's clock."""
        self._sequence += 1
        return Message(self.operator, self.epoch, self._sequence, kind, now, until, text, standing, body)

    def on_air(self, message: Message) -> None:
        """A message goes out now that may have been composed before: only from now on robots can answer it."""
        with self._lock:
            self._sent.on_air(message, self._clock.now())

    # ---- what comes in

    def hear(self, message: Message) -> None:
        """Take in a robot's message: an ANSWER to a command, a REPORT, or anything that shows that it is there."""
        self._take_in(message)
        self._pass_on([message])

    def _pass_on(self, messages: list[Message]) -> None:
        for listener in tuple(self.listeners):
            listener(messages)

    def _take_in(self, message: Message) -> int | None:
        """Gives the robot's place, None if there is no room for one more."""
        with self._lock:
            now = self._clock.now()
            place = self._roster.hear(message.sender, now, message.key)
            if message.kind is Kind.REPORT:
                del self.reports[: max(0, len(self.reports) + 1 - MAX_REPORTS)]
                self.reports.append(Report(message.sender, now, message.body))
                if place is not None and RULE in message.body:
                    self.failures.hear(place, message.body, now)
            elif message.kind is Kind.ANSWER:
                command, answer = self._sent.find(message.body.get("command")), answer_from(message.body, now)
                if command is not None and answer is not None and place is not None and command.knows(message.sender):
                    self._count(command, place, message, answer)
                if self._sent.latch is not None:
                    self._take_rest(place, message)
                if TELEMETRY in message.body or (command is not None and command.is_look):
                    return place
            else:
                self.auctions.hear(message, now)
                return place
            subject, details = str(message.body.get("command", "")), {"kind": str(message.kind), **message.body}
            self.notes.write(PendingEntry(now, message.sender, JournalEvent.HEARD, subject, details=details))
            return place

    def _count(self, command: Command, place: int, message: Message, answer: Answer) -> None:
        """Count what the robot at a place answers."""
        command.answers.add(place, answer)

    def hear_many(self, batch: MessageBatch) -> None:
        """Take in what many robots say at once; their places are those of the roster. Reports are heard one by one, as
        many as are kept; answers are one entry in the journal."""
        if not isinstance(said := batch.words, AnswerColumns):
            for message in (batch.take(slice(-MAX_REPORTS, None)) if batch.kind is Kind.REPORT else batch).messages():
                self.hear(message)
        with self._lock:
            now = self._clock.now()
            self._roster.hear_many(batch.names, batch.robots, now)
            if isinstance(said, AnswerColumns):
                command = self._sent.find(said.command)
                if command is not None:
                    command.take(batch, said, now)
                    if command is self._sent.latch:
                        self._take_rests(batch.robots)
                counts = np.bincount(said.outcome[batch.places], minlength=len(said.outcomes)).tolist()
                outcomes = {word: count for word, count in zip(said.outcomes, counts, strict=True) if count}
                details = {"kind": batch.kind.value, "robots": len(batch), "outcomes": outcomes}
                self._note(JournalEvent.HEARD, MANY, subject=said.command, details=details)
        if isinstance(said, AnswerColumns) and self.listeners:
            self._pass_on(list(batch.messages()))

    def observe(self, now: float, rows: Iterable[Telemetry]) -> None:
        """Take in telemetry of `now` (s of the desk's clock): what robots tell of themselves. Nodes are such rows."""
        with self._lock:
            heard, stopped = [], []
            for row in rows:
                place = self._roster.enrol(row.name)
                if place is not None:
                    self.told.take(place, row)
                    heard.append(place)
                    stopped.append(row.stopped)
            robots = np.array(heard, np.intp)
            self._tellings += 1
            self._roster.observe(robots, now)
            self._update_latch(robots, np.array(stopped, np.bool_), now)

    def forget(self, robots: Iterable[str]) -> None:
        """Let what these robots told one by one count no more: they are others now, of which nothing is known."""
        with self._lock:
            self._tellings += 1
            self.told.forget(self._roster.forget(robots))

    def observe_many(self, now: float, robots: Index) -> None:
        """The same for robots whose minds answer many at once. Raises MisuseError for minds that do not."""
        if self._fleet_telemetry is None:
            raise MisuseError("these minds tell one by one: give their rows to observe")
        with self._lock:
            self._tellings += 1
            self._fleet_telemetry.take(robots)
            self._roster.observe(robots, now)
            if self._sent.latch is not None:
                self._update_latch(robots, self._fleet_telemetry.stopped(robots), now)

    @property
    def counts_latest(self) -> bool:
        """Whether only the latest telemetry counts, until somebody looks: it accounts for no STOP or RELEASE."""
        return self._sent.latch is None

    def _update_latch(self, robots: Index, stopped: Mask, now: float) -> None:
        """Robots that tell that they are stopped, or not, account for a STOP or RELEASE that was sent before."""
        latest = self._sent.latch
        if latest is None or now < latest.message.issued:
            return
        there = robots[stopped == (latest.kind is Kind.STOP)]
        latest.answers.take(there, np.arange(len(there)), AnswerColumns.alike(latest.id, len(there), "stopped"), now)
        self._take_rests(there)

    def _take_rest(self, place: int | None, message: Message) -> None:
        """A robot may tell whether it has come to rest since the STOP that holds."""
        if (stop := self._sent.stop) and place is not None and (state := motion_said(message)) is not None:
            stop.rest.add(place, state)

    def _take_rests(self, robots: Index) -> None:
        """Robots that are stopped tell how they move, where their minds tell that of many at once."""
        stop, telemetry = self._sent.stop, self._fleet_telemetry
        if stop is not None and telemetry is not None and (states := telemetry.rest_states(robots)) is not None:
            stop.rest.take(robots, *states)

    def _note(
        self,
        event: JournalEvent,
        who: str = "",
        *,
        subject: str = "",
        text: str = "",
        details: Mapping[str, object],
        first: bool = False,
    ) -> None:
        """Write an entry. first: before what it tells happens; then it raises JournalError."""
        with self._lock:
            note = PendingEntry(self._clock.now(), who or self.operator, event, subject, text, details)
            (self.notes.write_first if first else self.notes.write)(note)

    # ---- afterwards

    def commands(self) -> list[Command]:
        """What was sent, oldest first."""
        with self._lock:
            return self._sent.all()

    def accounting(self, command: str) -> Account:
        """The account of the command with this id. Raises NoSuchCommandError."""
        with self._lock:
            sent = self._sent.get(command)
            return account(sent, self._clock.now(), self._roster.heard, self.check)

    def is_held(self, robot: str, command: str) -> bool:
        """Whether this robot has answered a command by saying that STOP held it."""
        with self._lock:
            return (answer := self._sent.answer(command, robot)) is not None and answer.outcome is Outcome.HELD

    def outcomes(self, command: str, time: float, names: Sequence[str]) -> NDArray[np.uint8]:
        """What the command with this id had come to at a time (s of the desk's clock) on each robot: see
        `Answers.codes_of`. Raises NoSuchCommandError."""
        with self._lock:
            return self._sent.get(command).answers.codes_of(names, time)

    def answers(self, command: str, robots: Sequence[str], time: float = inf) -> list[Answer | None]:
        """What each of these robots had answered to the command with this id by a time (s of the desk's clock), None
        for who is silent. Raises NoSuchCommandError."""
        with self._lock:
            answers = map(self._sent.get(command).answers.get, robots)
            return [answer if answer is not None and answer.heard <= time else None for answer in answers]

    def why(self, robot: str, command: str | None = None) -> Explanation:
        """How `robot` evaluated a command (None: its last one), or what a rule of its, by name, would do now: the tree
        of values and the first test that failed. Raises UnknownRobotError, NoSuchCommandError, and NoExplanationError
        if the robot cannot say."""
        with self._lock:
            self._roster.place(robot)
        mind = self._minds.get(robot)
        try:
            if mind is None:
                raise SleepcastError(f"{robot} cannot be asked from here: only its radio is known, not its mind")
            return mind.why(command)
        except SleepcastError as error:
            with self._lock:
                why = "" if command is None else self._sent.get(command).unexplained(robot)
            raise NoExplanationError(why or str(error)) from error
