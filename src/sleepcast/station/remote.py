"""Remote minds: the telemetry of robots on the air, in the form in which a desk asks about minds.

Robots of several types may be in one fleet. The desk checks texts in the names of all of them (`merge_schemas`), so
every robot's numbers are put into the slots of that one vocabulary; a variable that a type does not have is unknown on
its robots. Robots that have learned the same share one record, which is known as soon as one of them has sent it; until
then a preview that depends on it says so.

The desk computes the digest of each text itself, so a robot can only give false telemetry about itself.

`TelemetryClient` requests it. A request goes to everybody, or to some; answers come spread over a time, and those that
are lost are asked for again, as for every question. What has to be known besides (the names of a type, what was
learned) is asked for as soon as a robot's telemetry mentions it.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import groupby, islice
from math import inf, nan
from typing import Protocol

import msgspec

from sleepcast.channel.message import LOOK, OF, TELEMETRY, Inspection, Kind, Message, natural_order
from sleepcast.channel.name_conflicts import NameConflicts
from sleepcast.columns.telemetry import KnownSymbols, Undecided
from sleepcast.core.backoff import Backoff
from sleepcast.core.errors import SleepcastError, listed, printable
from sleepcast.core.model import RestState
from sleepcast.core.records import NamedTuple
from sleepcast.language import Checked
from sleepcast.language.explain import Explanation, with_units
from sleepcast.language.functions import FUNCTIONS
from sleepcast.language.parts import Part
from sleepcast.language.program import Program
from sleepcast.language.reader import is_name
from sleepcast.language.rehearsal import holds
from sleepcast.language.symbols import Declared, Group, UserVariable
from sleepcast.language.vocabulary import Variable, Vocabulary, VocabularyError, buffer_number, gives_way
from sleepcast.mind.telemetry import (
    TelemetryError,
    TelemetryRecord,
    digest,
    read_mind,
    read_telemetry,
    read_vocabulary,
    read_why,
)
from sleepcast.station.learned import SymbolTable
from sleepcast.station.roster import CommandedTimes
from sleepcast.station.schema_merge import SlotMap, merge_schemas
from sleepcast.station.sent import Command
from sleepcast.station.telemetry import NUMBER, PlacedRow, SharesSymbols
from sleepcast.station.validation import SlotValues, Telemetry

MAX_TYPES = 32
"""Types of robots in one fleet; robots of further types are heard, but their names stay unknown."""
MAX_MINDS = 1_024
"""Different minds that are stored; beyond, the one received longest ago is dropped."""
MAX_TELLERS = 20_000
"""Robots whose telemetry is stored."""
MAX_ASKED = 4_096
"""Digests whose last request is remembered."""
ASK_AGAIN = 1.0
"""Seconds until names or a mind that did not arrive are requested again; the wait doubles each time."""
MAX_WAIT = 300.0
"""Seconds between two such requests at most: a text that is too long to send costs next to nothing."""
FEW = 3
"""Names in a sentence."""
REUNITE = 30.0
"""Seconds for which robots that told their names keep others from having one of them for something else."""
AT_ONCE = 32
"""Robots that are asked in one message."""

Digest = bytes


class TelemetryRequest(NamedTuple):
    """These robots are to be asked for this."""

    look: Inspection
    robots: list[str]


class _Asked(msgspec.Struct):
    """A digest that was asked for.

    pauses: between two requests
    due: when the next one may follow, s
    times: how often it was asked for
    """

    pauses: Backoff
    due: float = -inf
    times: int = 0


class RemoteRule(msgspec.Struct, frozen=True):
    """An expression that a robot keeps. What it last came to stays with the robot."""

    name: str
    text: str
    active: bool
    protected: bool
    priority: int = 0
    last_value: float = nan
    last_fault: str = ""
    unit: str = ""


class RemoteMind(SharesSymbols):
    """One robot as its telemetry describes it (an `ObservedMind`). reported_at: its time, s of the desk's clock."""

    def __init__(self, name: str, minds: RemoteMinds, telemetry: TelemetryRecord, now: float) -> None:
        self.name, self.telemetry, self.reported_at = name, telemetry, now
        self.others: dict[int, bool] = {}
        """Other robots of this name, by epoch: whether each is stopped."""
        self.values: SlotValues = ()
        """Its variables by slot, once it is known where they belong."""
        self._minds = minds

    @property
    def groups(self) -> frozenset[str]:
        """Keys of the groups that it is in."""
        return self.telemetry.group_keys

    @property
    def stopped(self) -> bool:
        """Whether it is stopped, and so are others that have its name."""
        return self.telemetry.stopped and all(self.others.values())

    def rest_state(self) -> RestState | None:
        """Whether it has come to rest while it is stopped; None if it is not stopped, or does not tell."""
        return self.telemetry.rest_state

    @property
    def doubt(self) -> str:
        """Why it stands although there may have been no STOP; "" otherwise."""
        return printable(self.telemetry.doubt) if self.stopped else ""

    @property
    def learned(self) -> SymbolTable | None:
        """What it has learned; None if no robot has sent that yet."""
        return self._minds.learned(self.telemetry.mind)

    def place(self, slots: SlotMap, vocabulary: Vocabulary) -> None:
        """Put its numbers into the slots of the fleet's vocabulary. Raises TelemetryError for numbers of another
        type, VocabularyError where a variable of its own finds no room."""
        told = self.telemetry
        if len(told.values) != NUMBER * len(slots.slots):
            raise TelemetryError(f"{len(told.values) // NUMBER} numbers of a type that has {len(slots.slots)}")
        own = ((_user_slot(name, vocabulary), value) for name, value in told.user.items())
        self.values = PlacedRow(told, slots, {slot: value for slot, value in own if slot is not None})

    @property
    def symbols(self) -> KnownSymbols:
        """What it has learned: its own, until any robot has told what all of this mind have learned."""
        return self if self.learned is None else self.learned

    def declared(self, key: str) -> Declared | None:
        """What it has learned under this key. Raises Undecided where that is not known."""
        known = self.known(key)
        if known is None and self.learned is None:
            raise Undecided(holds(key))
        return known

    def known(self, key: str) -> Declared | None:
        """What is learned under this key, or None."""
        vocabulary, learned = self._minds.vocabulary, self.learned
        if learned is not None and (shared := learned.declared(key)) is not None:
            return shared
        for name in self.telemetry.groups:
            if name.casefold() == key:
                return Group(name)
        for name in self.telemetry.user:
            if name.casefold() == key and key in vocabulary.user_slots:
                return UserVariable(name, vocabulary.user_slots[key])
        return None

    def heard(self) -> Iterable[str]:
        """Every learned name that is known, as written."""
        return (*self.telemetry.user, *(self.telemetry.groups if self.learned is None else self.learned.names))

    def fetch(self, part: Part) -> Program | None:
        """The program in the buffer or rule that a `fetch` part names. Raises Undecided where it is unknown."""
        if self.learned is None:
            raise Undecided(holds(part.name))
        return self.learned.fetch(part)

    def operator(self, part: Part) -> Program | None:
        """The program of the operator that a `call` part names. Raises Undecided where it is unknown."""
        return self.fetch(part)

    def why(self, command: str | None = None) -> Explanation:
        """Refused: the robot has to be asked on the air."""
        raise SleepcastError(f"{self.name} is far away: ask it why on the air")

    def variables(self) -> list[tuple[str, float]]:
        """Every variable that its type has, by name, and those of its own."""
        vocabulary = self._minds.vocabulary
        own = self._minds.types.get(self.telemetry.type, vocabulary).bindings
        declared = [
            (binding.name, self.values[binding.slot])
            for key, binding in vocabulary.bindings.items()
            if isinstance(binding, Variable) and key in own
        ]
        return declared + [
            (name, self.values[slot])
            for name in self.telemetry.user
            if (slot := vocabulary.user_slots.get(name.casefold())) is not None
        ]

    def rules(self) -> list[RemoteRule]:
        """Every stored expression that is known."""
        if self.learned is None:
            return []
        record = self.learned.record
        return [
            RemoteRule(name, text, self.telemetry.runs(at), own, record.priorities.get(name, 0))
            for at, (name, text, own) in enumerate(record.rules)
        ]


class RemoteMinds(Mapping[str, RemoteMind]):
    """The robots that have sent telemetry, by name; see the module. vocabulary: of the fleet, another one as soon
    as robots of another type are heard. types: of robots, by digest. refused: why a type is left out."""

    def __init__(self) -> None:
        self.vocabulary = Vocabulary("fleet")
        self.types: dict[Digest, Vocabulary] = {}
        self.refused: dict[Digest, str] = {}
        self.malformed = 0
        """How much of the telemetry was malformed."""
        self.changes = 0
        """How often the names that robots have may have changed."""
        self.conflicts: NameConflicts | None = None
        """Names that several robots have: of these only one is shown, the one that was shown before."""
        self._shown: dict[str, int] = {}
        """Which that is, by its epoch."""
        self._fitted: dict[Digest, SlotMap] = {}
        self._texts: dict[Digest, str] = {}
        """The texts of types and minds, as they were received."""
        self._learned: OrderedDict[Digest, SymbolTable] = OrderedDict()
        self._minds: dict[str, RemoteMind] = {}
        self._learned_all = -1
        """How many `changes` there had been when no mind was missing: until the next one, none is."""
        self._waiting: dict[str, RemoteMind] = {}
        """Robots whose names are not known yet, or cannot be united with those of others."""
        self.changed: set[str] = set()
        """Robots that were known, and are waiting now since they came back with other names, or their names stand
        against those of others: what they told before says nothing about them. `TelemetryClient` passes them on."""
        self._united = -inf
        """When the names of all types were united last, s."""
        self.began = -inf
        """When the desk began, s: what is older was told to an earlier one."""
        self._asked: OrderedDict[Digest, _Asked] = OrderedDict()

    def __getitem__(self, name: str) -> RemoteMind:
        return self._minds[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self._minds)

    def __len__(self) -> int:
        return len(self._minds)

    @property
    def known(self) -> list[str]:
        """All robots that have sent telemetry, also such as cannot be foreseen."""
        return [*self._minds, *self._waiting]

    def type_of(self, name: str) -> Digest | None:
        """The type that a robot has told, None if it has told none."""
        mind = self._minds.get(name) or self._waiting.get(name)
        return None if mind is None else mind.telemetry.type

    def learned(self, mind: Digest) -> SymbolTable | None:
        """What robots of this mind have learned, if it is known."""
        return self._learned.get(mind)

    def declared(self, key: str) -> Declared | None:
        """What any robot has learned under this key, or None."""
        for learned in self._learned.values():
            if (shared := learned.declared(key)) is not None:
                return shared
        slot = self.vocabulary.user_slots.get(key)
        if slot is not None:
            return UserVariable(key, slot)
        return next((known for mind in self._minds.values() if (known := mind.known(key)) is not None), None)

    def heard(self) -> Iterable[str]:
        """Every name that any robot has learned, as written."""
        return {name: None for mind in self._minds.values() for name in mind.heard()}

    @property
    def complete(self) -> bool:
        """Whether all names are known of every robot that has sent telemetry."""
        return not self._waiting and all(mind.learned is not None for mind in self._minds.values())

    def standing(self) -> str:
        """Robots that stand although there may have been no STOP, and why, in a sentence; "" if there are none."""
        of_reason: dict[str, list[str]] = {}
        for name in sorted(self._minds, key=natural_order):
            if doubt := self._minds[name].doubt:
                of_reason.setdefault(doubt, []).append(printable(name))
        reasons = (f"{listed(names, FEW)} ({doubt})" for doubt, names in islice(of_reason.items(), FEW))
        return f"stopped until RELEASE: {'; '.join(reasons)}" if of_reason else ""

    def texts(self) -> list[str]:
        """The texts of types and minds, those of types first."""
        return [self._texts[which] for which in (*self.types, *self._learned)]

    # ---- what comes in

    def take(self, message: Message, now: float) -> list[RemoteMind]:
        """Take in an answer that tells something; gives the robots of which another thing is known now, each with the
        time of that telemetry (`reported_at`)."""
        sent = message.body.get(TELEMETRY)
        try:
            if isinstance(sent, str):
                return self._take_text(sent, now)
            telemetry = read_telemetry(sent)
            if self._is_of_another(message, telemetry, now):
                return []
            return self._take_telemetry(message.sender, telemetry, now)
        except TelemetryError:
            self.malformed += 1
            return []

    def restore(self, name: str, told: TelemetryRecord | str, then: float) -> None:
        """Take in what another desk has stored: a text, or what the robot of this name told `then` (s)."""
        try:
            if isinstance(told, str):
                self._take_text(told, then)
            else:
                self._take_telemetry(name, read_telemetry(told), then)
        except TelemetryError:
            self.malformed += 1

    def _is_of_another(self, message: Message, telemetry: TelemetryRecord, now: float) -> bool:
        """Whether another robot has the same name that is shown already: a robot does not jump to and fro."""
        holders = () if self.conflicts is None else self.conflicts.holders(message.sender, now)
        epochs, mind = {each.epoch for each in holders if each.contested}, self._minds.get(message.sender)
        if mind is None or self._shown.get(message.sender) not in epochs:
            self._shown[message.sender] = message.epoch
            if len(self._shown) > MAX_TELLERS:
                del self._shown[next(iter(self._shown))]
        if not epochs and (mind is None or not mind.others):
            return False  # as it is of nearly all
        others = epochs - {self._shown.get(message.sender)}
        if mind is not None:
            mind.others = {epoch: mind.others.get(epoch, False) for epoch in others}
        if mind is None or message.epoch not in others:
            return False
        mind.others[message.epoch] = telemetry.stopped
        return True

    def _take_telemetry(self, name: str, telemetry: TelemetryRecord, now: float) -> list[RemoteMind]:
        if name not in self._minds and len(self._minds) + len(self._waiting) >= MAX_TELLERS:
            return []
        mind = self._minds.get(name) or RemoteMind(name, self, telemetry, now)
        fitted = self._fitted.get(telemetry.type)
        if fitted is None:
            if self._minds.pop(name, None) is not None:
                self.changed.add(name)
            mind.telemetry, mind.reported_at = telemetry, now
            self._waiting[name] = mind
            if telemetry.type in self.refused and now - self._united >= REUNITE:
                return self._unite(now)  # those who stood against it may have left
            return []
        before = mind.telemetry, mind.reported_at
        mind.telemetry, mind.reported_at = telemetry, now
        try:
            mind.place(fitted, self.vocabulary)
        except (TelemetryError, VocabularyError) as error:
            mind.telemetry, mind.reported_at = before
            raise TelemetryError(str(error)) from None
        self._waiting.pop(name, None)
        self.changed.discard(name)
        if name not in self._minds or _names_in(before[0]) != _names_in(telemetry):
            self.changes += 1
        self._minds[name] = mind
        return [mind]

    def _take_text(self, text: str, now: float) -> list[RemoteMind]:
        """Take a vocabulary or a mind, if any robot has it."""
        which = digest(text)
        if any(mind.telemetry.type == which for mind in self._waiting.values()) and len(self.types) < MAX_TYPES:
            self.types[which] = read_vocabulary(text)
            self._texts[which] = text
            return self._unite(now)
        minds = [mind for mind in self._minds.values() if mind.telemetry.mind == which]
        if minds and which not in self._learned:
            self._learned[which], self._texts[which] = SymbolTable(read_mind(text), self), text
            self.changes += 1
            if len(self._learned) > MAX_MINDS:
                del self._texts[self._learned.popitem(last=False)[0]]
        return []

    def _unite(self, now: float) -> list[RemoteMind]:
        """Merge the vocabularies of all types, which moves the numbers of all robots. Where two cannot be merged, the
        type of robots that are there comes first, then the one that was heard first."""
        own, self._united = list(self.vocabulary.user_slots), now
        self.changes += 1
        since = max(self.began, now - REUNITE)
        there = {m.telemetry.type for m in (*self._minds.values(), *self._waiting.values()) if m.reported_at >= since}
        order = sorted(self.types, key=lambda each: each not in there)
        self.vocabulary, self._fitted, self.refused = merge_schemas({each: self.types[each] for each in order})
        for key in own:
            _user_slot(key, self.vocabulary)
        for name in [name for name, mind in self._minds.items() if mind.telemetry.type in self.refused]:
            self._waiting[name] = self._minds.pop(name)
            self.changed.add(name)
        moved = list(self._minds.values())
        for mind in moved:
            mind.place(self._fitted[mind.telemetry.type], self.vocabulary)
        for mind in [mind for mind in self._waiting.values() if mind.telemetry.type in self._fitted]:
            try:
                moved += self._take_telemetry(mind.name, mind.telemetry, mind.reported_at)
            except TelemetryError:
                self.malformed += 1
        return moved

    # ---- what is missing

    def wanted(self, now: float) -> list[TelemetryRequest]:
        """Requests that are due at `now`: for types and minds that are not known yet, one robot for each."""
        room = len(self.types) < MAX_TYPES
        types = (
            (m.telemetry.type, m.name) for m in self._waiting.values() if room and m.telemetry.type not in self.types
        )
        minds: list[tuple[Digest, str]] = []
        if self._learned_all != self.changes:
            minds = [(m.telemetry.mind, m.name) for m in self._minds.values() if m.telemetry.mind not in self._learned]
            if not minds:
                self._learned_all = self.changes
        asked = ((Inspection.VOCABULARY, types), (Inspection.MIND, minds))
        return [TelemetryRequest(look, robots) for look, lacking in asked if (robots := self._chosen(lacking, now))]

    def _chosen(self, lacking: Iterable[tuple[Digest, str]], now: float) -> list[str]:
        """Robots to be asked for these digests, another one each time."""
        tellers: dict[Digest, list[str]] = {}
        for which, name in lacking:
            tellers.setdefault(which, []).append(name)
        due = [which for which in tellers if which not in self._asked or self._asked[which].due <= now]
        chosen = []
        for which in due[:AT_ONCE]:
            asked = self._asked.setdefault(which, _Asked(Backoff(ASK_AGAIN, MAX_WAIT)))
            chosen.append(tellers[which][asked.times % len(tellers[which])])
            asked.due, asked.times = now + asked.pauses.take(), asked.times + 1
        while len(self._asked) > MAX_ASKED:
            self._asked.popitem(last=False)
        return chosen


def _names_in(telemetry: TelemetryRecord) -> object:
    """What decides which names a robot has."""
    return telemetry.type, telemetry.mind, telemetry.groups, telemetry.user.keys()


def _user_slot(name: str, vocabulary: Vocabulary) -> int | None:
    """The slot of a robot's own variable; None for a name that cannot be one. Raises VocabularyError."""
    key = name.casefold()
    taken = key in vocabulary.bindings and not gives_way(vocabulary.bindings[key])
    if not is_name(name) or taken or key in FUNCTIONS or buffer_number(key) is not None:
        return None
    return vocabulary.user_slot(key)


# ---- requesting it

MAX_LOOKS = 256
"""Looks whose answers are still expected."""
MAX_FAULT = 200
"""Characters of a robot's error."""
OBEYED = 0.2
"""Seconds after which a robot has heard a command and evaluated it, if nothing was lost."""
SHARE = 0.002
"""Seconds for each robot between two looks at all: their answers take half of that."""


class Requester(Protocol):
    """A desk that can request telemetry."""

    vocabulary: Vocabulary
    commanded: CommandedTimes

    @property
    def now(self) -> float: ...

    def post(self, kind: Kind, *, body: Mapping[str, object], only: Sequence[str] | None = None) -> Command: ...

    def observe(self, now: float, rows: Iterable[Telemetry]) -> None: ...

    def forget(self, robots: Iterable[str]) -> None: ...

    def is_held(self, robot: str, command: str) -> bool: ...

    def check(self, text: str, *, only: Sequence[str] | None = None) -> Checked: ...


class TelemetryClient:
    """Requests telemetry from robots on the air. minds: where it is stored."""

    def __init__(self, station: Requester, minds: RemoteMinds) -> None:
        self.minds = minds
        self._station = station
        self._looked = -inf
        """When all were asked for telemetry last."""
        self._looks: OrderedDict[str, Command] = OrderedDict()
        self._whys: OrderedDict[tuple[str, str], Explanation | SleepcastError | None] = OrderedDict()
        """Explanations by the id of the request and the robot; None until they arrive."""
        self._tell(minds.values())

    def look(self, robots: Sequence[str] | None = None) -> Command:
        """Ask these robots (None: all) for telemetry."""
        if robots is None:
            self._looked = self._station.now
        return self._ask({LOOK: Inspection.TELEMETRY}, robots)

    def is_due(self, every: float) -> bool:
        """Whether all are to be asked for telemetry again: so many seconds after the last time, or soon after a
        command, since what they reported before does not say any more who would obey."""
        now, obeyed = self._station.now, self._station.commanded.latest + OBEYED
        if now - self._looked < SHARE * len(self.minds):
            return False
        return now - self._looked >= every or self._looked < obeyed <= now

    def ask_why(self, robot: str, command: str | None) -> Command:
        """Ask a robot how it evaluated a command (its id), what a rule (its name) would do, or, for None, how the last
        command went. Raises UnknownRobotError."""
        question = self._ask({LOOK: Inspection.WHY} | ({} if command is None else {OF: command}), [robot])
        self._whys[question.id, robot] = None
        if len(self._whys) > MAX_LOOKS:
            self._whys.popitem(last=False)
        return question

    def explanation(self, asked: Command, robot: str) -> Explanation | None:
        """What the robot said to that question, with the units in which people here read its values; None while nothing
        has come. Raises SleepcastError for what it said it cannot tell. One of version 0.2.0 does not say here that
        STOP held it; its answer to the command did."""
        explained = self._whys.get((asked.id, robot))
        if isinstance(explained, SleepcastError):
            raise explained
        if explained is None:
            return None
        held = explained.held or self._station.is_held(robot, explained.command)
        return replace(explained, held=held, root=with_units(explained.root, partial(self._program, robot)))

    def _program(self, robot: str, text: str) -> Program | None:
        """The program of a text that this robot sent, None for one that cannot be read: a long one has lost its end."""
        try:
            return self._station.check(text, only=[robot]).program
        except SleepcastError:
            return None

    def hear(self, heard: Iterable[Message]) -> None:
        """Take in answers, and request what is missing then."""
        told: list[RemoteMind] = []
        for message in heard:
            if message.kind is not Kind.ANSWER:
                continue
            command = str(message.body.get("command"))
            if self._whys and (command, message.sender) in self._whys:
                self._whys[command, message.sender] = _why(message)
            elif TELEMETRY in message.body and command in self._looks:
                # Answers are spread over time: the telemetry is of when it was asked for, or later.
                told += self.minds.take(message, self._looks[command].message.issued)
        self._tell(told)
        for look, robots in self.minds.wanted(self._station.now):
            self._ask({LOOK: look}, robots)

    def _tell(self, minds: Iterable[RemoteMind]) -> None:
        """Give the desk what is known of these, all of one time at once."""
        self._station.vocabulary = self.minds.vocabulary
        for time, some in groupby(minds, lambda mind: mind.reported_at):
            self._station.observe(time, some)
        if self.minds.changed:
            self._station.forget(self.minds.changed)
            self.minds.changed.clear()

    def _ask(self, body: Mapping[str, object], robots: Sequence[str] | None) -> Command:
        command = self._station.post(Kind.ASK, body=body, only=robots)
        self._looks[command.id] = command
        if len(self._looks) > MAX_LOOKS:
            self._looks.popitem(last=False)
        return command

    def learning(self, since: float) -> bool:
        """Whether names or minds were asked for, at this time (s of Unix time) or later, that have not come yet."""
        asked = (
            c
            for c in self._looks.values()
            if c.message.issued >= since and c.message.body[LOOK] != Inspection.TELEMETRY
        )
        return any(command.n_silent for command in asked)


def _why(message: Message) -> Explanation | SleepcastError:
    sent, fault = message.body.get(TELEMETRY), message.body.get("fault")
    if isinstance(sent, str):
        try:
            return read_why(sent)
        except TelemetryError as error:
            return SleepcastError(f"{message.sender} explained it in a way that cannot be read: {error}")
    return SleepcastError(printable(fault)[:MAX_FAULT] if isinstance(fault, str) else f"{message.sender} does not tell")
