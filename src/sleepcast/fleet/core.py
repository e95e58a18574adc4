"""The core of a fleet: messages and readings come in, a tick lets all robots think.

It does what a list of nodes would do, robot by robot and bit for bit, but evaluates every message and every rule for
all robots at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf, nan
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.message import Kind, Message
from sleepcast.channel.message_batch import Answers, MessageBatch
from sleepcast.channel.name_index import NameIndex
from sleepcast.channel.payload import FOR, NOT, hops_left, is_addressed
from sleepcast.channel.stop_latch import ENDED
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.core.threads import ThreadPool
from sleepcast.fleet.acts import ACTS
from sleepcast.fleet.bodies import Bodies
from sleepcast.fleet.columns import Column, FleetState, Index, Mask, Rows
from sleepcast.fleet.evaluation import Noted, fault_text
from sleepcast.fleet.evaluation_log import EvaluationLog, LogEntry, rehearsal
from sleepcast.fleet.machine import evaluate
from sleepcast.fleet.memory import FleetMemory
from sleepcast.fleet.messages import Inbox, Outbox
from sleepcast.fleet.native.kernels import Kernels, available
from sleepcast.fleet.read_set import ReadSet
from sleepcast.fleet.scheduler import BatchScheduler, expired
from sleepcast.fleet.telemetry import FleetTelemetry
from sleepcast.language.explain import rehearse
from sleepcast.language.form import show
from sleepcast.language.functions import MAX_HOPS
from sleepcast.language.program import Program
from sleepcast.language.reader import read
from sleepcast.language.vocabulary import TICK, TIME_SLOT, Vocabulary, buffer_number
from sleepcast.mind.limits import SPARE_MINDS
from sleepcast.mind.rules import Mind, Minds, Named


class FleetError(MisuseError):
    """A fleet that cannot be made, or robots that are not in it."""


Some: TypeAlias = Rows | Sequence[int] | Index | None
"""Some robots by their indices; None is all of them."""


@dataclass
class Outcome:
    """What came of one text on the robots `rows`. Columns have one value for each of them; faults are in order."""

    rows: Rows
    entry: LogEntry
    values: Column
    matched: Mask
    steps: NDArray[np.int32]
    faults: list[Noted]
    printed: list[tuple[Index, str, Sequence[Column]]]


class Core:
    """See the module.

    names: of the robots. numbers: their `id` in expressions and in their chance, 1 upwards if none are given. seed:
    of the run. bodies: what the functions of the vocabulary are called on; those that are a `Robot` are stopped,
    released and held still as well, all at once if they are `ManyBodies`. native: whether rules that stay may become
    native code, where llvmlite is installed; it makes no difference but in speed. pool: the threads that it may use.
    sensed: where the bodies' sensor values lie, if they lie side by side: SI, NaN for unknown, shape (sensors, robots),
    C order; they are read there and never copied, but for sensors with a freshness limit (see `look`). Raises
    FleetError for a vocabulary with linked variables: what lies in a host's own memory is no column.
    """

    def __init__(
        self,
        names: Sequence[str],
        vocabulary: Vocabulary,
        *,
        numbers: Sequence[int] | None = None,
        seed: int = 0,
        bodies: Sequence[object | None] | None = None,
        native: bool = True,
        pool: ThreadPool | None = None,
        sensed: NDArray[np.float64] | None = None,
    ) -> None:
        if vocabulary.linked:
            linked = ", ".join(sorted(vocabulary.linked))
            raise FleetError(f"{vocabulary.name} links {linked}: give robots with linked variables nodes of their own")
        count = len(names)
        numbers = range(1, count + 1) if numbers is None else numbers
        bodies = [None] * count if bodies is None else bodies
        self.names = names if isinstance(names, NameIndex) else NameIndex(names)
        """The robots' names by index, and the other way round."""
        if count == 0 or not (len(self.names) == len(numbers) == len(bodies) == count):
            raise FleetError(
                f"a fleet needs at least one robot, names that differ, and a number and a body for each: got {count}"
                f" names ({len(self.names)} different), {len(numbers)} numbers and {len(bodies)} bodies"
            )
        self.vocabulary, self.bodies, self.numbers = vocabulary, bodies, numbers
        self.state = FleetState(vocabulary, numbers, seed)
        self.minds = Minds(vocabulary)
        self.outbox = Outbox(self.state, self.names)
        self.kernels = Kernels(pool=pool) if native and available() else None
        self.memory = FleetMemory(self.state, self.minds, self.outbox, ACTS, bodies, self.kernels)
        self.evaluation_log = EvaluationLog(self.memory)
        self.scheduler = BatchScheduler(self.memory)
        self._bodies = Bodies(self.state, bodies)
        self.telemetry = FleetTelemetry(self.state, self.minds)
        """What the robots last told the operator of themselves."""
        self._read_set = ReadSet(self.memory)
        self.inbox = Inbox(count)
        self.minds_used = 1
        """Minds that robots were of when it was last looked."""
        self.measured: dict[int, Column] = {
            vocabulary.first_sensor + i: np.full(count, -inf)
            for i, quantity in enumerate(vocabulary.sensors)
            if quantity.freshness < inf
        }
        """When each robot last measured what grows old, s, by slot."""
        self._sensed = sensed
        if sensed is not None:
            self._share(sensed)

    def _share(self, sensed: NDArray[np.float64]) -> None:
        """Read the sensors where they lie. Raises FleetError for another shape."""
        if sensed.shape != (len(self.vocabulary.sensors), len(self)):
            sensors = len(self.vocabulary.sensors)
            raise FleetError(f"a table of shape {sensed.shape} for {sensors} sensors of {len(self)} robots")
        for slot, row in enumerate(sensed, self.vocabulary.first_sensor):
            if slot not in self.measured:
                self.state.share(slot, row)

    # ---- the robots

    def __len__(self) -> int:
        return len(self.names)

    def rows(self, robots: Some = None) -> Rows:
        """The robots with these indices (None: all). Raises FleetError for one that is not in the fleet."""
        if isinstance(robots, Rows):
            return robots
        if robots is None:
            return Rows.run(0, len(self))
        index = np.asarray(robots, np.intp)
        if not (index[1:] > index[:-1]).all():
            index = np.unique(index)
        if index.size and not (index[0] >= 0 and index[-1] < len(self)):
            raise FleetError(f"the robots of this fleet are 0 to {len(self) - 1}, not {index[0]} to {index[-1]}")
        return Rows.of(index)

    @property
    def awake(self) -> Mask:
        """Which robots have anything to do in the next tick: a message, or rules that run."""
        found = self.inbox.waiting > 0
        found |= self.memory.where(self.rows(), _runs)
        return found

    def restless(self) -> Rows:
        """The robots that are awake."""
        everybody = self.rows()
        if self.inbox.empty:
            sorts = self.memory.divide(everybody, lambda number: _runs(self.minds[number]))
            return next((rows for running, rows, _ in sorts if running), Rows.run(0, 0))
        return everybody.take(self.awake)

    def waiting(self, robot: int) -> int:
        """Messages that wait for a robot's next tick."""
        return int(self.inbox.waiting[robot])

    def said(self) -> list[MessageBatch]:
        """Everything that has been said and lies in no outbox that was looked into; it will come into none."""
        return self.outbox.take()

    def pings(self) -> list[tuple[Index, Column]]:
        """All pings that lie in no list that was looked into: robots, and their castes."""
        return self.outbox.take_pings()

    # ---- what comes in

    def receive(self, message: Message, robots: Some = None) -> None:
        """Take a message on these robots: STOP and RELEASE at once, commands and questions into their queues."""
        heard = meant = self.inbox.first_heard(message, self.rows(robots).robots)
        if FOR in message.body or NOT in message.body:
            meant = np.array([i for i in heard.tolist() if is_addressed(message.body, self.names[i])], np.intp)
        if message.kind is Kind.STOP:  # whoever hears it stops; those that are not addressed need not say so again
            rows = Rows.of(heard)
            stopped, others = self._bodies.obey_stop(message, rows)
            self._answer_alike(message, Rows.of(np.intersect1d(stopped.robots, meant)), "stopped")
            self._answer_alike(message, others, "fault", ENDED)
        elif message.kind is Kind.RELEASE:
            rows = Rows.of(meant)
            free, refused = self._bodies.obey_release(message, rows)
            self._answer_alike(message, free, "released")
            for some, why in refused:
                self._answer_alike(message, some, "fault", why)
        elif message.kind in (Kind.COMMAND, Kind.ASK):
            self.state.lost[self.inbox.put(message, meant)] += 1

    def _answer_alike(self, message: Message, rows: Rows, sort: str, fault: str = "") -> None:
        """The same answer on each of these robots."""
        self.outbox.answer(rows, Answers.alike(message.id, rows.size, sort, fault=fault))

    def sense(self, readings: NDArray[np.float64], now: float, robots: Some = None) -> None:
        """Take sensor values (SI; one row a robot, in the order of the vocabulary's sensors) at `now` (s).

        What is not finite was not measured, so the last measurement stands. For a fleet without a shared table. Raises
        FleetError for another shape.
        """
        rows = self.rows(robots)
        sensors = len(self.vocabulary.sensors)
        if readings.shape != (rows.size, sensors):
            raise FleetError(f"readings of shape {readings.shape} for {rows.size} robots with {sensors} sensors each")
        for i in range(sensors):
            self._measure(self.vocabulary.first_sensor + i, rows, readings[:, i], now)

    def look(self, now: float, robots: Some = None) -> None:
        """Take note that the shared table is up to date for these robots at `now` (s)."""
        if self._sensed is None or not self.measured:
            return
        rows = self.rows(robots)
        for slot in self.measured:
            self._measure(slot, rows, self._sensed[slot - self.vocabulary.first_sensor][rows.index], now)

    def _measure(self, slot: int, rows: Rows, column: Column, now: float) -> None:
        known = np.isfinite(column)
        some = rows if known.all() else rows.take(known)
        if some.size:
            self.state.assign(slot, some, column if some is rows else column[known])
            if slot in self.measured:
                self.measured[slot][some.index] = now

    def think(self, tick: int, now: float, robots: Some = None) -> None:
        """One tick of these robots: their waiting messages, then one round of active rules unless asleep or frozen."""
        state, rows = self.state, self.rows(robots)
        if rows.size == 0:
            return
        state.assign(TICK, rows, float(tick))
        state.assign(TIME_SLOT, rows, float(now))
        state.draws[rows.index] = 0
        self._age(rows, now)
        expired(self.memory, rows, now)
        for message, some in self.inbox.take(rows):
            self._obey(message, some, now)
        resting = self._bodies.resting(rows)
        self.scheduler.run(rows if resting is None else rows.take(~resting))
        self._bodies.hold(rows)
        self._tidy()

    def _age(self, rows: Rows, now: float) -> None:
        """What was measured too long ago becomes unknown."""
        for slot, measured in self.measured.items():
            limit = self.vocabulary.sensors[slot - self.vocabulary.first_sensor].freshness
            old = ~(now - measured[rows.index] <= limit)
            if old.any():
                self.state.assign(slot, rows.take(old), np.full(int(old.sum()), nan))

    def _tidy(self) -> None:
        """Forget minds that no robot is of any more, once there may be many."""
        if len(self.minds) > 2 * self.minds_used + SPARE_MINDS:
            used = {*np.unique(self.state.mind).tolist(), *np.unique(self.state.proven).tolist()}
            self.minds.keep_only(used)
            self.memory.statistics.keep_only({key for number in used for key in self.minds[number].rules})
            self.minds_used = len(self.minds)

    # ---- evaluating

    def evaluate(self, text: str, robots: Some = None) -> list[Outcome]:
        """Check and evaluate one text on these robots, as if it were a message.

        Robots that have learned different things may take it differently: one outcome for each sort. Raises ReadError
        and CheckError, before anything is evaluated, if any of them cannot run it.
        """

        def program(number: int) -> Program:
            return self.minds.library.program(text, lambda: [read(text)], Named(self.vocabulary, self.minds[number]))

        return [self.run(found, rows) for found, rows, _ in self.memory.divide(self.rows(robots), program)]

    def run(self, program: Program, rows: Rows, command: str = "") -> Outcome:
        """Evaluate a program on these robots, and remember how to explain it."""
        memory = self.memory
        entry = self.evaluation_log.remember(program, rows, command)
        memory.hosts, memory.printed = entry.hosts, []
        values = evaluate(memory, program, rows)
        steps = np.broadcast_to(np.asarray(memory.steps(rows), np.int32), rows.size)
        printed, memory.hosts, memory.printed = memory.printed, None, None
        self.evaluation_log.weigh(entry)
        return Outcome(rows, entry, values, memory.matched[rows.index].copy(), steps, memory.noted, printed)

    def install(
        self,
        name: str,
        text: str,
        *,
        priority: int = 0,
        protected: bool = True,
        robots: Some = None,
    ) -> None:
        """Give these robots an active rule of their own. protected: nobody can change it by radio.

        Raises ReadError and CheckError for the text, SleepcastError if the rule is refused for another reason.
        """
        number = buffer_number(name.casefold())
        key = name.casefold() if number is None else f"e{number}"
        for outcome in self.evaluate(f"(RULE {name} {show(read(text))})", robots):
            if outcome.faults:
                raise SleepcastError(f"the rule {name} cannot be installed: {outcome.faults[0].reason}")
            for mind, rows, _ in self.memory.divide(outcome.rows, lambda found: found):
                draft = self.minds.draft(mind)
                draft.settle_rule(key, priority, protected)
                self.memory.turn(rows, draft)

    def _obey(self, message: Message, rows: Rows, now: float) -> None:
        if now > message.deadline:
            self._answer_alike(message, rows, "late")
            return

        def program(number: int) -> Program | str:
            names = Named(self.vocabulary, self.minds[number])
            try:
                return self.minds.library.program(message.text, lambda: [read(message.text)], names)
            except SleepcastError as error:
                return str(error).splitlines()[0]

        self.memory.hops = hops_left(message.body, message.role, MAX_HOPS)
        for found, some, _ in self.memory.divide(rows, program):
            if isinstance(found, str):
                self._answer_alike(message, some, "fault", found)
            elif message.kind is Kind.ASK:
                self._asked(message, found, some)
            else:
                self.outbox.answer(some, _came_of(message, self.run(found, some, message.id)))
        self.memory.hops = MAX_HOPS

    def _asked(self, message: Message, program: Program, rows: Rows) -> None:
        """Answer a question, robot by robot: nothing is done, so there is nothing to do for all at once."""
        for robot in rows.robots.tolist():
            found = rehearse(program, rehearsal(self.memory, robot), command=message.id)
            answers = Answers.alike(message.id, 1, "answer", found.value, "; ".join(found.faults))
            self.outbox.answer(self.rows([robot]), answers)


def _runs(mind: Mind) -> bool:
    """Whether a robot with this mind has something to do in every tick."""
    return bool(mind.running)


_SORTS = ("not matched", "matched", "fault")


def _came_of(message: Message, outcome: Outcome) -> Answers:
    """The answers to a command, in the order of the robots that evaluated it."""
    rows, faults = outcome.rows, [fault_text(noted) for noted in outcome.faults]
    fault = np.zeros(rows.size, np.int32) if faults else np.broadcast_to(np.int32(0), rows.size)
    for number, noted in reversed(list(enumerate(outcome.faults, 1))):
        fault[rows.places(noted.robots)] = number
    sort = outcome.matched.view(np.uint8)
    sort = np.where(fault > 0, np.uint8(2), sort) if faults else sort
    return Answers(message.id, _SORTS, sort, outcome.values, tuple(faults), fault)
