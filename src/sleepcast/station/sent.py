"""Commands that were sent, with the answers of robots to each, as many as are stored.

What robots answer comes one by one, or of many at once; all answers to a command are kept as columns.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from enum import StrEnum
from functools import cached_property
from math import inf, nan
from sys import float_info

import msgspec
import numpy as np
from numpy.typing import NDArray

from sleepcast.channel import Kind, Message
from sleepcast.channel.message import BOUND, HELD, LOOK, UNKNOWN, WAITING, lasts, outcome_of
from sleepcast.channel.message_batch import AnswerColumns as Said
from sleepcast.channel.message_batch import MessageBatch, NameIndex, NamesThen, ascending, lasting_part, names_of_places
from sleepcast.core.errors import MisuseError, SleepcastError, did_you_mean
from sleepcast.core.serial import Array, SerialError, within
from sleepcast.language.instants import wait_of
from sleepcast.mind.auction import Auctioneer
from sleepcast.mind.authority import StopMark, is_ended_by, mark_of
from sleepcast.station.leases import in_words
from sleepcast.station.rest import RestAccount, RestStates
from sleepcast.station.roster import Index, Seconds, longer
from sleepcast.station.serialized import CommandAnswersState, CommandState

CAME_LATER = "was not there yet when this command was sent"
STILL_WAITS = "waits for the instant of this command, and evaluates it then"
"""Why a robot has not evaluated a command, after its name."""


class Outcome(StrEnum):
    """What a robot answers to a command."""

    MATCHED = "matched"
    NOT_MATCHED = "not matched"
    FAULT = "fault"
    UNKNOWN = "unknown"
    HELD = "held by STOP"
    WAITING = "waiting"


SAID: Mapping[str, Outcome] = {
    "matched": Outcome.MATCHED,
    "not matched": Outcome.NOT_MATCHED,
    "fault": Outcome.FAULT,
    UNKNOWN: Outcome.UNKNOWN,
    HELD: Outcome.HELD,
    WAITING: Outcome.WAITING,
    "answer": Outcome.MATCHED,
    "late": Outcome.FAULT,
    "stopped": Outcome.MATCHED,
    "released": Outcome.MATCHED,
}
"""What an outcome counts as, by the word that a robot uses. Late: it heard the command past its deadline and did
nothing, which is not a decision of its own. Robots of older versions, which cannot say that a test was unknown or that
STOP holds them, say that they did not match, or did."""
ANSWER = "answer"
"""A robot's outcome for a question. If something went wrong on the way to its value, it counts as a fault."""
LATE = "heard after its deadline, so not evaluated"


class Answer(msgspec.Struct, frozen=True):
    """What one robot answered.

    heard: when, in s of the desk's clock
    value: of the command; None for unknown
    bound: by how many s it may have missed the instant at most; None where it has obeyed at none
    """

    outcome: Outcome
    heard: float
    value: float | None = None
    fault: str | None = None
    bound: float | None = None


def answer_from(body: Mapping[str, object], now: float) -> Answer | None:
    """The answer in the body of an ANSWER heard at `now`; None if it is malformed."""
    said = outcome_of(body)
    outcome = SAID.get(said) if isinstance(said, str) else None
    if outcome is None:
        return None
    value, fault = body.get("value"), body.get("fault")
    if said == "late":
        fault = fault or LATE
    elif said == ANSWER and fault:
        outcome = Outcome.FAULT
    known = float(value) if isinstance(value, int | float) and abs(value) <= float_info.max else None
    return Answer(outcome, now, known, fault if isinstance(fault, str) else None, _bound_in(body))


def _bound_in(body: Mapping[str, object]) -> float | None:
    bound = body.get(BOUND)
    return bound if isinstance(bound, float) and 0.0 <= bound < inf else None


OUTCOMES = tuple(Outcome)
SILENT, MATCHED, NOT_MATCHED, FAULT, TEST_UNKNOWN, HELD_BY_STOP, WAITS = range(len(OUTCOMES) + 1)
"""What a robot's code in a column of outcomes means: nothing heard, or one of `OUTCOMES` in their order."""
CODES = {outcome: code for code, outcome in enumerate(OUTCOMES, 1)}


class Answers(Mapping[str, Answer]):
    """The first answer of each robot, by name, kept as columns by the robots' places on the roster (`names`); of those
    that wait for an instant, the answer after that."""

    def __init__(self, names: NameIndex) -> None:
        self.names = names
        self._outcome: NDArray[np.uint8] = np.zeros(len(names), np.uint8)
        self._heard: Seconds = np.empty(0)
        self._value: Seconds = np.empty(0)
        """As long as the roster from the first answer on."""
        self._fault: NDArray[np.int32] | None = None
        """Which of the texts of faults, from 1; made when a robot first says one."""
        self._faults: list[str] = []
        self._count = 0
        self.bound = nan
        """By how many s one of them may have missed the instant at most, by what they say; NaN while none says so."""
        self.version = 0
        """Grows with every answer that counts."""
        self._waiting_since: Seconds | None = None
        """When each robot that has answered since said that it waits, inf for never; made when the first one has."""

    def add(self, robot: int, answer: Answer) -> None:
        """What one robot answers."""
        if len(self._heard) < len(self.names):
            self.make_room()
        before = self._outcome.item(robot)
        if before not in (SILENT, WAITS) or (before == WAITS and answer.outcome is Outcome.WAITING):
            return
        self._count += int(before == SILENT)
        self.version += 1
        if before == WAITS:
            self._note_waiting(np.array([robot]))
        self._note_bound(answer.bound)
        self._outcome[robot] = CODES[answer.outcome]
        self._heard[robot] = answer.heard
        self._value[robot] = nan if answer.value is None else answer.value
        if answer.fault:
            self._faults.append(answer.fault)
            self._fault_numbers()[robot] = len(self._faults)

    def take(self, robots: Index, places: Index, said: Said, now: float) -> None:
        """The answers of many robots, each at its place in `said`; malformed ones are left out."""
        sort = said.outcome[places]
        codes = np.array([CODES[SAID[word]] if word in SAID else SILENT for word in said.outcomes], np.uint8)[sort]
        faults = (*said.faults, LATE)
        fault = said.fault[places]
        if "late" in said.outcomes:
            unsaid = (sort == said.outcomes.index("late")) & (fault == 0)
            fault = np.where(unsaid, np.int32(len(faults)), fault)
        if ANSWER in said.outcomes:
            codes[(sort == said.outcomes.index(ANSWER)) & (fault > 0)] = FAULT
        self._take(robots, codes, said.value[places], faults, fault, now)
        self._note_bound(_bound_in(said.details))

    def _take(
        self,
        robots: Index,
        codes: NDArray[np.uint8],
        values: Seconds,
        faults: Sequence[str],
        fault: NDArray[np.int32],
        now: float,
    ) -> None:
        """Store the answers of robots that have not answered yet. fault: its number among `faults`, from 1, or 0."""
        self.make_room()
        before = self._outcome[robots]
        new = (before == SILENT) & (codes > SILENT) | (before == WAITS) & (codes > SILENT) & (codes != WAITS)
        if not new.all():
            robots, codes, values, fault = robots[new], codes[new], values[new], fault[new]
        self._count += int(np.count_nonzero(self._outcome[robots] == SILENT))
        self.version += 1
        self._note_waiting(robots)
        self._outcome[robots] = codes
        self._heard[robots], self._value[robots] = now, values
        if fault.any():
            self._fault_numbers()[robots] = np.where(fault > 0, fault + len(self._faults), 0)
            self._faults += faults

    def _note_bound(self, bound: float | None) -> None:
        if bound is not None:
            self.bound = bound if self.bound != self.bound else max(self.bound, bound)

    def _note_waiting(self, robots: Index) -> None:
        """These robots answer: remember since when those among them have waited that did."""
        waited = robots[self._outcome[robots] == WAITS]
        if not len(waited):
            return
        before = np.full(0, inf) if self._waiting_since is None else self._waiting_since
        self._waiting_since = np.concatenate((before, np.full(len(self.names) - len(before), inf)))
        self._waiting_since[waited] = self._heard[waited]

    def _fault_numbers(self) -> NDArray[np.int32]:
        if self._fault is None:
            self._fault = np.zeros(len(self._outcome), np.int32)
        return self._fault

    def forget(self, robot: int) -> None:
        """Count the robot at a place as one that has not answered."""
        if robot < len(self._outcome) and self._outcome[robot]:
            self._outcome[robot] = 0
            self._count -= 1

    def wait_no_more(self, robots: Index) -> None:
        """Count those of the robots at these places that wait for an instant as ones that have not answered."""
        robots = robots[robots < len(self._outcome)]
        robots = robots[self._outcome[robots] == WAITS]
        if robots.size:
            self._outcome[robots] = SILENT
            self._count -= robots.size
            self.version += 1

    def go_back(self, time: float) -> None:
        """Forget what was answered after `time`, s."""
        self._outcome = self.codes_at(time)
        self._count = int(np.count_nonzero(self._outcome))
        since = self._waiting_since
        if since is not None:
            again = np.flatnonzero((self._outcome[: len(since)] == WAITS) & (since <= time))
            self._heard[again], since[again] = since[again], inf
            since[since > time] = inf

    def make_room(self) -> None:
        """Robots may have enrolled since the command was sent, and before the first answer there are no columns."""
        self._outcome = longer(self._outcome, len(self.names))
        self._heard, self._value = longer(self._heard, len(self.names)), longer(self._value, len(self.names))
        if self._fault is not None:
            self._fault = longer(self._fault, len(self.names))

    @property
    def codes(self) -> NDArray[np.uint8]:
        """The outcome of each robot by its place, as `SILENT` and the others."""
        return self._outcome

    def codes_at(self, time: float) -> NDArray[np.uint8]:
        """The same as they were known at a time, s."""
        self.make_room()
        codes = self._outcome.copy()
        codes[: len(self._heard)][self._heard > time] = SILENT
        since = self._waiting_since
        if since is not None:
            codes[: len(since)][(codes[: len(since)] == SILENT) & (since <= time)] = WAITS
        return codes

    def codes_of(self, names: Sequence[str], time: float) -> NDArray[np.uint8]:
        """The same for those who have these names, by place: who has come to the place of another robot is silent."""
        codes = self.codes_at(time)
        if not self.names.lasting:
            pairs = enumerate(zip(self.names, names, strict=False))
            codes[[place for place, (was, now) in pairs if was != now]] = SILENT
        return codes

    @property
    def latest(self) -> float:
        """When the last robot answered for the first time, s; -inf if none has."""
        return float(self._heard[self._outcome[: len(self._heard)] > 0].max(initial=-inf))

    @property
    def known(self) -> Seconds:
        """The known values that were answered, in the robots' order."""
        values = self._value[self._outcome[: len(self._value)] > 0]
        return values[~np.isnan(values)]

    def fault(self, place: int) -> str | None:
        """The error of the robot at a place."""
        number = 0 if self._fault is None else int(self._fault[place])
        return self._faults[number - 1] if number else None

    @property
    def faulted(self) -> NDArray[np.bool_]:
        """Which robots have told a fault, whatever their outcome, by place."""
        return np.zeros(len(self._outcome), np.bool_) if self._fault is None else self._fault > 0

    @property
    def not_stored(self) -> NDArray[np.bool_]:
        """Which robots have said that a restart may forget what they answered, by place."""
        numbers = [number for number, fault in enumerate(self._faults, 1) if not lasts(fault)]
        return self.faulted if self._fault is None else np.isin(self._fault, numbers)

    def state(self) -> CommandAnswersState:
        fault = None if self._fault is None else Array.of(self._fault)
        columns = (Array.of(self._outcome), Array.of(self._heard), Array.of(self._value))
        since = None if self._waiting_since is None else Array.of(self._waiting_since)
        return CommandAnswersState(*columns, fault, tuple(self._faults), since, self.bound)

    def restore(self, state: CommandAnswersState) -> None:
        """Be as those answers were. Raises SerialError."""
        most = len(self.names)
        self._outcome = state.outcome.column(np.uint8, most, "answers")
        within(self._outcome, 0, len(OUTCOMES), "answers")
        self._count = int(np.count_nonzero(self._outcome))
        self._heard = state.heard.column(np.float64, most, "when answers were heard")
        self._value = state.value.column(np.float64, most, "values of answers")
        self._fault, self._faults = None, list(state.faults)
        if state.fault is not None:
            self._fault = state.fault.made(np.int32, self._outcome.shape, "faults of answers")
            within(self._fault, 0, len(self._faults), "faults of answers")
        self.bound, since = state.bound, state.waiting_since
        self._waiting_since = None if since is None else since.column(np.float64, most, "when robots began to wait")
        if len({len(self._heard), len(self._value), len(self._outcome) if self._count else len(self._heard)}) > 1:
            raise SerialError("answers without times or values")

    def __getitem__(self, name: str) -> Answer:
        place = self.names.index_of(name)
        if place is None or place >= len(self._outcome) or not self._outcome[place]:
            raise KeyError(name)
        value = float(self._value[place])
        outcome = OUTCOMES[self._outcome[place] - 1]
        return Answer(outcome, float(self._heard[place]), None if value != value else value, self.fault(place))

    def __iter__(self) -> Iterator[str]:
        return (self.names[place] for place in np.flatnonzero(self._outcome).tolist())

    def __len__(self) -> int:
        return self._count


# ---- a command


class Command:
    """A message that the desk sent and keeps account of.

    addressed: how many robots, from the first on, were on the roster when it went out
    only: the places of those among them for whom it was, None for all
    expected: the places of those of which the desk was certain that they would obey
    answers: by robot, the first answer of each
    conflicts: names that several robots have, each with a sentence that says who of them has answered
    size: how many robots there are for whom it is, also such as were never heard; 0 where nobody knows
    """

    def __init__(
        self,
        message: Message,
        names: NameIndex,
        expected: Index | None = None,
        last_sent: float = -inf,
        only: Index | None = None,
        size: int = 0,
    ) -> None:
        self.message, self.addressed, self.last_sent, self.only = message, len(names), last_sent, only
        self.size = size
        self.expected: Index = np.empty(0, np.intp) if expected is None else expected
        self.answers = Answers(names)
        self.conflicts: dict[str, str] = {}
        self.auctioneer: Auctioneer | None = None
        """Of a command that chooses among robots: who collects the bids."""
        self.ended_by = ""
        """Of a STOP or RELEASE: the other operator whose later message to the contrary has ended it, "" if none has."""

    @cached_property
    def rest(self) -> RestStates:
        """Of a STOP: which of those that have accepted it are at rest."""
        return RestStates(self.answers.names)

    def state(self) -> CommandState:
        expected = Array.of(self.expected.astype(np.int32))
        only = None if self.only is None else Array.of(self.only.astype(np.int32))
        kept = (
            expected,
            self.last_sent,
            self.answers.state(),
            only,
            self.rest.state() if self.kind is Kind.STOP else None,
            self.auctioneer,
            names_of_places(self.answers.names, self._known),
        )
        return CommandState(self.message, self.addressed, *kept)

    @property
    def _known(self) -> Index:
        """The places of those that were asked, or have answered."""
        known = self.answers.codes != SILENT
        known[: self.addressed if self.only is None else 0] = True
        known[self.only if self.only is not None else slice(0, 0)] = True
        return np.flatnonzero(known)

    @classmethod
    def restored(cls, state: CommandState, names: NameIndex) -> Command:
        """The command that was kept. Raises SerialError."""
        if state.names is not None:
            names = NamesThen(len(names), state.names)
        command = cls(state.message, names, ascending(state.expected, len(names)), state.last_sent)
        if not 0 <= state.addressed <= len(names):
            raise SerialError(f"a command to {state.addressed} robots, of which there are {len(names)}")
        command.addressed = command.size = state.addressed  # of a swarm, whose robots are all on the roster
        command.only = None if state.only is None else ascending(state.only, state.addressed)
        if state.names is not None and command.only is not None:
            command.size = len(command.only)
        command.answers.restore(state.answers)
        if state.rest is not None:
            command.rest.restore(state.rest)
        if state.auctioneer is not None:
            state.auctioneer.validate()
            command.auctioneer = state.auctioneer
        return command

    @property
    def id(self) -> str:
        return self.message.id

    @property
    def is_look(self) -> bool:
        """Whether robots are only to tell of themselves."""
        return LOOK in self.message.body

    @property
    def kind(self) -> Kind:
        return self.message.kind

    @property
    def text(self) -> str:
        """The expression; else what it is in capitals: `STOP`, `RELEASE`, `LEASE take bravo`."""
        return self.message.text or in_words(self.message.body) or self.message.kind.name

    @property
    def predicted(self) -> frozenset[str]:
        """The names of the robots that were expected to obey."""
        return frozenset(self.answers.names[place] for place in self.expected.tolist())

    def take(self, batch: MessageBatch, said: Said, now: float) -> None:
        """Count what many robots answer, but for those that have come since, where robots do: they are told old
        commands, too."""
        asked = lasting_part(self.answers.names, batch)
        self.answers.take(asked.robots, asked.places, said, now)

    def knows(self, robot: str) -> bool:
        """Whether a robot may have been there when it went out: not one that has come since, where robots do."""
        return self.answers.names.lasting or robot in self.answers.names

    def unexplained(self, robot: str) -> str:
        """Why a robot cannot have evaluated it, as a sentence about the robot; "" if it may have."""
        if not self.knows(robot):
            return f"{robot} {CAME_LATER}"
        waits = (answer := self.answers.get(robot)) is not None and answer.outcome is Outcome.WAITING
        return f"{robot} {STILL_WAITS}" if waits else ""

    def turn_over(self, dead: Index) -> None:
        """These robots are gone: whoever has not answered, or waits for an instant, is not asked any more."""
        self.answers.wait_no_more(dead)
        asked = np.arange(self.addressed) if self.only is None else self.only
        left = asked[~np.isin(asked, dead) | (self.answers.codes[asked] != SILENT)]
        if len(left) < len(asked):
            self.size = max(0, self.size - (len(asked) - len(left)))
            self.only = left

    def extend(self) -> None:
        """It is for those as well that have come onto the roster since."""
        self.answers.make_room()
        self.addressed = len(self.answers.codes)

    @property
    def resting(self) -> RestAccount:
        """Of a STOP: who is at rest among those that have accepted it."""
        places = map(self.answers.names.index_of, self.conflicts)
        shared = [place for place in places if place is not None]
        return self.rest.among(self.answers.codes == MATCHED, shared)

    @property
    def silent(self) -> NDArray[np.bool_]:
        """Which of the robots that were on the roster are yet to answer, by place."""
        return silent(self.answers.codes, self.addressed, self.only)

    @property
    def n_silent(self) -> int:
        """How many of the addressed robots have not answered, including those whose names are unknown."""
        return int(np.count_nonzero(self.silent)) + self.n_nameless

    @cached_property
    def instant(self) -> float | None:
        """When robots that wait are to obey, s of its sender's clock; None if none waits, as for a question."""
        wait = wait_of(self.message.text) if self.kind is Kind.COMMAND else None
        return None if wait is None else self.message.issued + wait

    def owing(self, now: float) -> NDArray[np.bool_]:
        """Which robots are to be asked for their answer at `now`, s, by place: those that are silent, and once the
        instant is over those that waited for it."""
        owing, instant = self.silent, self.instant
        if instant is not None and now > instant:
            owing |= self.answers.codes[: len(owing)] == WAITS
        return owing

    def may_move(self, now: float) -> bool:
        """Whether robots may be moving by it at `now`, s: one has obeyed, waits for its instant, or may yet answer."""
        obeyed = np.isin(self.answers.codes, (MATCHED, WAITS)).any()
        return bool(obeyed) or (self.n_silent > 0 and now <= self.message.deadline)

    @property
    def waits(self) -> bool:
        """Whether robots have said that they wait for the instant of this command, and nothing else yet."""
        return bool((self.answers.codes == WAITS).any())

    @property
    def n_nameless(self) -> int:
        """How many robots are expected that are neither on the roster nor have answered."""
        return nameless(self.size, self.answers.codes, self.addressed, self.only)


def nameless(size: int, codes: NDArray[np.uint8], addressed: int, only: Index | None) -> int:
    """How many of the expected robots are missing, besides those that were asked and those that have answered
    unasked."""
    asked = addressed if only is None else len(only)
    if size <= asked:
        return 0
    unasked = np.count_nonzero(codes[addressed:])
    if only is not None:
        unasked += np.count_nonzero(codes[:addressed]) - np.count_nonzero(codes[only])
    return max(0, size - asked - int(unasked))


def silent(codes: NDArray[np.uint8], addressed: int, only: Index | None) -> NDArray[np.bool_]:
    """Which of the first `addressed` robots, of these only, have the code of silence."""
    unanswered: NDArray[np.bool_] = codes[:addressed] == SILENT
    if only is not None:
        asked = np.zeros(len(unanswered), np.bool_)
        asked[only[only < len(unanswered)]] = True
        unanswered &= asked
    return unanswered


# ---- all of them


MAX_COMMANDS = 1_000
"""Commands whose answers are stored; the journal has them all."""
MAX_LOOKS = 256
"""Questions of the desk itself to robots, whose answers are stored; they are not commands, and are not needed later."""
MAX_ANSWERS = 16_000_000
"""Answers stored for all commands together (with more robots, those of fewer commands): a third of a gigabyte."""


class NoSuchCommandError(MisuseError):
    """An id that belongs to no command of this desk."""

    def __init__(self, command: str, known: Iterable[str]) -> None:
        names = list(known)
        super().__init__(f'no command "{command}" was sent from this desk{did_you_mean(command, names)}')


class NoExplanationError(SleepcastError):
    """The robot cannot say why: it did not hear the command, or has forgotten how it went."""


REPEAT_AFTER = 0.5
"""Seconds between two sendings of a STOP or RELEASE while robots are not accounted for."""


class SentCommands:
    """The commands of one desk. latch: the last STOP or RELEASE."""

    def __init__(self) -> None:
        self.latch: Command | None = None
        self._commands: dict[str, Command] = {}
        self._looks: dict[str, Command] = {}

    def __contains__(self, command: object) -> bool:
        return command in self._commands

    @property
    def stop(self) -> Command | None:
        """The last STOP, None if there is none or this desk has released it since."""
        return self.latch if self.latch is not None and self.latch.kind is Kind.STOP else None

    @property
    def stops(self) -> StopMark | None:
        """By what others name all STOPs so far, None if there is none."""
        return None if self.latch is None else mark_of(self.latch.message)

    def stop_ended_by(self, others: Iterable[SentCommands]) -> bool:
        """Whether the last STOP has been ended by a RELEASE of others."""
        stop = self.stop
        sent = (each for other in others for each in (other.latch, *other.all()) if each is not None)
        releases = (each.message for each in sent if each.kind is Kind.RELEASE)
        return stop is not None and any(is_ended_by(mark_of(stop.message), release) for release in releases)

    def silent(self, now: float) -> int:
        """How many robots the latch is to be sent to again at `now`, s."""
        if self.latch is None or now - self.latch.last_sent < REPEAT_AFTER:
            return 0
        return self.latch.n_silent

    @property
    def next_repeat(self) -> float:
        """When that is so if nothing is heard until then, s; inf for never."""
        return self.latch.last_sent + REPEAT_AFTER if self.latch is not None and self.latch.n_silent else inf

    def on_air(self, message: Message, now: float) -> None:
        """A message goes out now that may have been composed before."""
        latest = self.latch
        if latest is not None and latest.id == message.id and latest.last_sent == message.issued:
            latest.last_sent = now

    def answer(self, command: str, robot: str) -> Answer | None:
        """What a robot has answered to a command, if anything is known of either."""
        sent = self.find(command)
        return None if sent is None else sent.answers.get(robot)

    def ids(self) -> list[str]:
        """The stored commands and questions, oldest first."""
        return list(self._commands)

    def all(self) -> list[Command]:
        """All stored commands, oldest first."""
        return list(self._commands.values())

    def find(self, command: object) -> Command | None:
        """The command with this id, if it is stored."""
        if not isinstance(command, str):
            return None
        return self._commands.get(command) or self._looks.get(command)

    def get(self, command: str) -> Command:
        """The command with this id. Raises NoSuchCommandError."""
        sent = self.find(command)
        if sent is None:
            raise NoSuchCommandError(command, self._commands)
        return sent

    def add(self, command: Command, roster: int) -> None:
        """Store a command to a roster of this size; the oldest ones are dropped."""
        if command.is_look:
            self._looks[command.id] = command
            while len(self._looks) > MAX_LOOKS:
                del self._looks[next(iter(self._looks))]
            return
        self._commands[command.id] = command
        if command.kind in (Kind.STOP, Kind.RELEASE):
            self.latch = command
        most = max(1, min(MAX_COMMANDS, MAX_ANSWERS // max(1, roster)))
        while len(self._commands) > most:
            del self._commands[next(iter(self._commands))]

    def turn_over(self, dead: Index) -> None:
        """These robots are gone."""
        for command in dict.fromkeys((*self.all(), *self._looks.values(), *([self.latch] if self.latch else ()))):
            command.turn_over(dead)

    def go_back(self, time: float) -> None:
        """Forget what was answered after `time`, s, and what was sent from then on: a command is on the air only in the
        tick after it was issued, which is not over at `time`."""
        self._commands = {key: each for key, each in self._commands.items() if each.message.issued < time}
        self._looks.clear()
        latches = [each for each in self._commands.values() if each.kind in (Kind.STOP, Kind.RELEASE)]
        self.latch = latches[-1] if latches else None
        for command in self._commands.values():
            command.answers.go_back(time)
            if command.auctioneer is not None:
                command.auctioneer.go_back(time)
            if command.kind is Kind.STOP:
                command.rest.forget()  # robots will tell anew

    def state(self) -> tuple[list[CommandState], CommandState | None]:
        """The commands and the latch."""
        return [command.state() for command in self.all()], self.latch.state() if self.latch is not None else None

    def restore(self, commands: Sequence[CommandState], latch: CommandState | None, names: NameIndex) -> None:
        """Have what was kept. Raises SerialError."""
        if len(commands) > MAX_COMMANDS:
            raise SerialError(f"{len(commands)} commands of a desk")
        restored = [Command.restored(command, names) for command in commands]
        self._commands = {command.id: command for command in restored}
        if latch is not None:
            kept = Command.restored(latch, names)
            self.latch = self._commands.get(kept.id, kept)
