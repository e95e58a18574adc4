"""The fleet: the minds of many robots with one vocabulary; `fleet[name]` is a view of one of them.

It takes messages and readings, and each tick evaluates all robots. The results equal those of a list of nodes, robot
by robot and bit for bit, but every message and every rule is evaluated for all robots at once.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import inf, nan
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.message import FOR, HELD, HOPS, NOT, UNKNOWN, Kind, Message, hops_left, is_addressed
from sleepcast.channel.message_batch import AnswerColumns, MessageBatch, NameIndex
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.core.model import RestState
from sleepcast.core.threads import ThreadPool
from sleepcast.fleet.asked import FleetQueries
from sleepcast.fleet.bodies import FleetBodies
from sleepcast.fleet.evaluation import Noted, fault_text
from sleepcast.fleet.inspection import (
    EvaluationLog,
    FleetTelemetry,
    LogEntry,
    ReadSet,
    recollect,
    rehearsal,
)
from sleepcast.fleet.machine import evaluate
from sleepcast.fleet.memory import FleetMemory
from sleepcast.fleet.messages import Inbox, Outbox
from sleepcast.fleet.native.kernels import Kernels, available
from sleepcast.fleet.scheduler import BatchScheduler, expired
from sleepcast.fleet.state import Column, FleetState, Index, Mask, Mind, MindNames, Minds, Rows
from sleepcast.language.explain import Explanation, Recollection, explain, foretell, rehearse
from sleepcast.language.functions import MAX_HOPS
from sleepcast.language.lint import Checked, check, unit_of_program
from sleepcast.language.parts import Part
from sleepcast.language.program import Program
from sleepcast.language.reader import read, show
from sleepcast.language.symbols import Declared, UserVariable
from sleepcast.language.vocabulary import TICK, TIME_SLOT, Variable, Vocabulary, buffer_number
from sleepcast.mind.authority import ENDED
from sleepcast.mind.rules import in_order
from sleepcast.mind.views import Fault, Result, RuleView

SPARE_MINDS = 256
"""Unused minds that may accumulate before they are removed."""


class FleetError(MisuseError):
    """The fleet cannot be created, or a robot is not in it."""


Some: TypeAlias = Rows | Sequence[int] | Index | None
"""Robots by their indices; None means all of them."""


@dataclass
class Evaluated:
    """The result of one text on the robots `rows`. Columns have one value for each of them; faults are in order.
    undecided: where its top-level test was unknown; held: where its bodies were asked to move while STOP holds them;
    None where nobody asks for that."""

    rows: Rows
    entry: LogEntry
    values: Column
    matched: Mask
    steps: NDArray[np.int32]
    faults: list[Noted]
    printed: list[tuple[Index, str, Sequence[Column]]]
    undecided: Mask | None = None
    held: Mask | None = None


class RobotView:
    """A view of one robot of a fleet; it stores nothing itself."""

    def __init__(self, fleet: Fleet, place: int) -> None:
        self._fleet, self.place = fleet, place

    # ---- state

    @property
    def name(self) -> str:
        return self._fleet.names[self.place]

    @property
    def number(self) -> int:
        return self._fleet.numbers[self.place]

    @property
    def vocabulary(self) -> Vocabulary:
        return self._fleet.vocabulary

    @property
    def values(self) -> list[float]:
        """The variables by slot, current values; NaN is unknown."""
        return self._fleet.state.row(self.place)

    @property
    def groups(self) -> frozenset[str]:
        """See `Node.groups`."""
        return self._fleet.state.groups_of(self.place)

    @property
    def stopped(self) -> bool:
        return bool(self._fleet.state.stopped[self.place])

    def rest_state(self) -> RestState | None:
        """See `Node.rest_state`."""
        return self._fleet.telemetry.rest_state(self.place)

    @property
    def dropped(self) -> int:
        """See `Node.dropped`."""
        return int(self._fleet.state.dropped[self.place])

    @property
    def lost(self) -> int:
        """Number of messages lost because a queue or the outbox was full."""
        return int(self._fleet.state.lost[self.place])

    @property
    def awake(self) -> bool:
        """Whether the next tick has anything to do: a message, or active rules."""
        return self._fleet.waiting(self.place) > 0 or bool(self._mind.running)

    @property
    def outbox(self) -> list[Message]:
        """The messages waiting to be sent; the sender clears the list."""
        return self._fleet.outbox.of(self.place)

    @property
    def pings(self) -> list[float]:
        """The castes of its pings; the sender clears the list."""
        return self._fleet.outbox.pings(self.place)

    @property
    def _mind(self) -> Mind:
        return self._fleet.memory.kept(self.place)

    def declared(self, key: str) -> Declared | None:
        """See `Node.declared`."""
        return self._mind.declared(key)

    def heard(self) -> Iterable[str]:
        """See `Node.heard`."""
        return self._mind.heard()

    def fetch(self, part: Part) -> Program | None:
        """See `Node.fetch`."""
        kept = self._mind.rules.get(part.name)
        return None if kept is None else kept.program

    def operator(self, part: Part) -> Program | None:
        """See `Node.operator`."""
        return self._mind.operators.get(part.name)

    def rules(self) -> list[RuleView]:
        """See `Node.rules`."""
        found, tallies = [], self._fleet.memory.statistics
        for kept in in_order(self._mind.rules):
            tally, leases = tallies[kept.key], tallies.leases.get(kept.key)
            found.append(
                RuleView(
                    kept.name,
                    kept.text,
                    kept.active,
                    float(tally.last_value[self.place]),
                    tally.last_fault.get(self.place, ""),
                    tally.steps_of(self.place),
                    int(tally.firings[self.place]),
                    inf if leases is None else float(leases[self.place]),
                    kept.shown_priority,
                    kept.protected,
                    unit_of_program(kept.program),
                )
            )
        return found

    def variables(self) -> list[tuple[str, float]]:
        """See `Node.variables`."""
        values = self.values
        found = [(b.name, values[b.slot]) for b in self.vocabulary.bindings.values() if isinstance(b, Variable)]
        learned = [d for d in self._mind.symbols.values() if isinstance(d, UserVariable)]
        return found + [(d.name, values[d.slot]) for d in learned]

    def actuators(self) -> dict[str, float]:
        """The actuators that were assigned since the last call, by name."""
        state, vocabulary = self._fleet.state, self.vocabulary
        values, first = self.values, vocabulary.first_actuator
        taken = {}
        for slot in sorted(state.actuated):
            if state.actuated[slot][self.place]:
                state.actuated[slot][self.place] = False
                taken[vocabulary.actuators[slot - first].name] = values[slot]
        return taken

    # ---- input

    def receive(self, message: Message) -> None:
        """Take a message from the channel."""
        self._fleet.receive(message, [self.place])

    def sense(self, readings: Sequence[float], now: float) -> None:
        """See `Node.sense`."""
        self._fleet.sense(np.array([readings], np.float64), now, [self.place])

    def think(self, tick: int, now: float) -> None:
        """Run one tick of this robot alone."""
        self._fleet.think(tick, now, [self.place])

    def evaluate(self, text: str) -> Result:
        """See `Node.evaluate`."""
        return self.run(check(text, self))

    def run(self, checked: Checked) -> Result:
        """See `Node.run`."""
        outcome = self._fleet.run(checked.required(), self._fleet.rows([self.place]))
        return self.result(outcome, checked.cost)

    def result(self, outcome: Evaluated, cost: int) -> Result:
        """This robot's part of an evaluation on many robots."""
        at = int(np.searchsorted(outcome.rows.robots, self.place))
        printed = []
        for robots, label, columns in outcome.printed:
            where = np.flatnonzero(robots == self.place)
            if where.size:
                printed.append((label, tuple(float(column[where[0]]) for column in columns)))
        return Result(
            float(outcome.values[at]),
            bool(outcome.matched[at]),
            tuple(self._faults(outcome.faults)),
            cost,
            int(outcome.steps[at]),
            tuple(printed),
            lambda: self.recollection(outcome.entry),
        )

    def _faults(self, noted: Iterable[Noted]) -> Iterable[Fault]:
        tick = int(self._fleet.state.row(self.place)[TICK])
        return [Fault(n.reason, show(n.part.form), tick) for n in noted if self.place in n.robots]

    def why(self, command: str | None = None) -> Explanation:
        """See `Node.why`."""
        entry = self._fleet.evaluation_log.find(self.place, command)
        if entry is not None:
            return explain(self.recollection(entry))
        kept = self._mind.rules.get((command or "").casefold())
        if kept is not None:
            memory, stopped = rehearsal(self._fleet.memory, self.place), self.stopped
            return rehearse(kept.program, memory, command=kept.name, stopped=stopped, priority=kept.shown_priority)
        what = "no command" if command is None else f"no command or rule {command}"
        raise SleepcastError(f"{self.name} remembers {what}: {self._fleet.evaluation_log.limits()}")

    def recollection(self, entry: LogEntry) -> Recollection:
        """Re-evaluate a logged command for this robot."""
        return recollect(entry, self.place, self.vocabulary, self._fleet.state.keys)

    def install(self, name: str, text: str, *, priority: int = 0, protected: bool = True) -> None:
        """Give the robot an active rule of its own; see `Fleet.install`."""
        self._fleet.install(name, text, priority=priority, protected=protected, robots=[self.place])


class Fleet(Mapping[str, RobotView]):
    """See the module.

    names: of the robots. numbers: their `id` in expressions and random streams, 1 upwards by default. seed: of the
    run. bodies: targets of the vocabulary's functions; those that are a `Robot` are also stopped, released and held
    still, all at once if they are `ManyBodies`. native: whether rules may be compiled to native code where llvmlite
    is installed, which changes nothing but speed. pool: threads to use. sensed: the bodies' table of sensor values,
    if there is one: SI, NaN for unknown, shape (sensors, robots), C order; it is read in place, never copied, except
    for sensors with a freshness limit (see `look`). Raises FleetError for a vocabulary with linked variables, which
    lie in a host's own memory and have no column.
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
        """Maps indices to the robots' names and back."""
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
        self.memory = FleetMemory(self.state, self.minds, self.outbox, bodies, self.kernels)
        self.evaluation_log = EvaluationLog(self.memory)
        self.scheduler = BatchScheduler(self.memory)
        self._bodies = FleetBodies(self.state, bodies)
        self.telemetry = FleetTelemetry(self.state, self.minds, self._bodies)
        """The latest telemetry of each robot."""
        self._read_set = ReadSet(self.memory)
        self.asked = FleetQueries(self.state, self.minds, bodies)
        """The expressions that are asked for on all robots; see `values_of`."""
        self.inbox = Inbox(count)
        self.minds_used = 1
        """Number of minds in use when last counted."""
        self.measured: dict[int, Column] = {
            vocabulary.first_sensor + i: np.full(count, -inf)
            for i, quantity in enumerate(vocabulary.sensors)
            if quantity.freshness < inf
        }
        """For variables with a freshness limit, the time when each robot last measured them, s, by slot."""
        self._sensed = sensed
        if sensed is not None:
            self._share(sensed)

    def _share(self, sensed: NDArray[np.float64]) -> None:
        """Read the sensors in place. Raises FleetError for a wrong shape."""
        if sensed.shape != (len(self.vocabulary.sensors), len(self)):
            sensors = len(self.vocabulary.sensors)
            raise FleetError(f"a table of shape {sensed.shape} for {sensors} sensors of {len(self)} robots")
        for slot, row in enumerate(sensed, self.vocabulary.first_sensor):
            if slot not in self.measured:
                self.state.share(slot, row)

    # ---- the robots

    def __getitem__(self, name: str) -> RobotView:
        place = self.names.place(name)
        if place is None:
            raise KeyError(name)
        return RobotView(self, place)

    def __iter__(self) -> Iterator[str]:
        return iter(self.names)

    def at(self, place: int) -> RobotView:
        """The robot with this index."""
        return RobotView(self, place)

    def column(self, slot: int) -> Column:
        """A variable of all robots, NaN for unknown; read-only."""
        return self.state.column(slot, self.rows())

    @property
    def stopped(self) -> Mask:
        """Which robots are stopped."""
        return self.state.stopped

    @property
    def groups(self) -> Mapping[str, Mask]:
        """The members of each group, by its key."""
        return self.state.groups

    def members(self) -> dict[str, int]:
        """Number of robots in each group."""
        counts = {key: int(members.sum()) for key, members in self.state.groups.items()}
        return {key: count for key, count in sorted(counts.items()) if count}

    def declared(self, key: str) -> Declared | None:
        """What any of the robots has learned under this key."""
        for mind in self._different():
            found = mind.declared(key)
            if found is not None:
                return found
        return None

    def heard(self) -> list[str]:
        """Every name that any of the robots has learned, as written."""
        return list(dict.fromkeys(name for mind in self._different() for name in mind.heard()))

    def _different(self) -> Iterator[Mind]:
        """The distinct minds that robots have now."""
        return (self.minds[number] for number in np.flatnonzero(np.bincount(self.state.mind)).tolist())

    def actuators(self, name: str) -> tuple[slice | Index, Column]:
        """The robots that have assigned this actuator since the last call, and their values (SI), read-only."""
        slot = self._actuator_slots.get(name.casefold())
        if slot is None:
            raise FleetError(f"{self.vocabulary.name} has no actuator {name}")
        assigned = self.state.assigned(slot)
        everybody = self.rows()
        rows = everybody if assigned.all() else everybody.take(assigned)
        if rows.size:
            assigned[rows.index] = False
        return rows.index, self.state.column(slot, rows)

    @cached_property
    def _actuator_slots(self) -> dict[str, int]:
        """The slots of the actuators by their names' keys."""
        names = (quantity.name.casefold() for quantity in self.vocabulary.actuators)
        return {name: slot for slot, name in enumerate(names, self.vocabulary.first_actuator)}

    def reads(self) -> frozenset[int]:
        """The slots of the variables that any active rule or waiting message may read in the next tick."""
        found = self._read_set.slots(self.inbox.messages())
        return frozenset(self.state.slots()) if found is None else found

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
        """Which robots have anything to do in the next tick: a message, or active rules."""
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
        """Number of messages waiting for a robot's next tick."""
        return int(self.inbox.waiting[robot])

    def said(self) -> list[MessageBatch]:
        """Take all outgoing messages that are not in a robot's `outbox` list yet."""
        return self.outbox.take()

    def pings(self) -> list[tuple[Index, Column]]:
        """Take all pings that are not in a robot's `pings` list yet: robots, and their castes."""
        return self.outbox.take_pings()

    # ---- input

    def receive(self, message: Message, robots: Some = None) -> None:
        """Receive a message on these robots: STOP and RELEASE take effect at once, commands and questions are
        queued."""
        heard = meant = self.inbox.first_heard(message, self.rows(robots).robots)
        if FOR in message.body or NOT in message.body:
            meant = np.array([i for i in heard.tolist() if is_addressed(message.body, self.names[i])], np.intp)
        if (
            message.kind is Kind.STOP
        ):  # every robot that receives STOP stops; robots that it is not addressed to need not report it again
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
        """Give the same answer on each of these robots."""
        self.outbox.answer(rows, AnswerColumns.alike(message.id, rows.size, sort, fault=fault))

    def sense(self, readings: NDArray[np.float64], now: float, robots: Some = None) -> None:
        """Take sensor values (SI; one row per robot, in the order of the vocabulary's sensors) at `now` (s).

        Values that are not finite count as not measured, so the last measurement remains. For a fleet without a
        shared table. Raises FleetError for a wrong shape.
        """
        rows = self.rows(robots)
        sensors = len(self.vocabulary.sensors)
        if readings.shape != (rows.size, sensors):
            raise FleetError(f"readings of shape {readings.shape} for {rows.size} robots with {sensors} sensors each")
        for i in range(sensors):
            self._measure(self.vocabulary.first_sensor + i, rows, readings[:, i], now)

    def look(self, now: float, robots: Some = None) -> None:
        """Tell the fleet that the shared table is up to date for these robots at `now` (s)."""
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
        """Run one tick of these robots: their waiting messages, then one round of active rules unless asleep or
        frozen."""
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
        """Set values to unknown whose measurement is too old."""
        for slot, measured in self.measured.items():
            limit = self.vocabulary.sensors[slot - self.vocabulary.first_sensor].freshness
            old = ~(now - measured[rows.index] <= limit)
            if old.any():
                self.state.assign(slot, rows.take(old), np.full(int(old.sum()), nan))

    def _tidy(self) -> None:
        """Remove unused minds once there may be many."""
        if len(self.minds) > 2 * self.minds_used + SPARE_MINDS:
            used = {*np.unique(self.state.mind).tolist(), *np.unique(self.state.proven).tolist()}
            self.minds.keep_only(used)
            self.memory.statistics.keep_only({key for number in used for key in self.minds[number].rules})
            self.minds_used = len(self.minds)

    # ---- evaluating

    def evaluate(self, text: str, robots: Some = None) -> list[Evaluated]:
        """Check and evaluate one text on these robots, as if it were a message.

        The text may mean different things on robots with different minds: there is one result per meaning. Raises
        ReadError and CheckError, before anything is evaluated, if any of the robots cannot run it.
        """

        def program(number: int) -> Program:
            return self.minds.library.program(
                text, lambda: [read(text)], MindNames(self.vocabulary, self.minds[number])
            )

        return [self.run(found, rows) for found, rows, _ in self.memory.divide(self.rows(robots), program)]

    def values_of(self, text: str, now: float) -> Column:
        """The value of an expression on each robot at `now` (s), NaN for unknown, without side effects.

        Raises ReadError, CheckError, and FleetError for an expression with side effects, random numbers or a function
        that makes a body do something.
        """
        asked = self.asked[text]
        self.state.assign(TIME_SLOT, asked.rows, float(now))  # idle robots have not looked at their clocks
        found, reason = asked.values()
        if reason:
            raise FleetError(f"{text} cannot be previewed: {reason}")
        return found

    def run(self, program: Program, rows: Rows, command: str = "", *, answered: bool = False) -> Evaluated:
        """Evaluate a program on these robots, and log its inputs for explanations. answered: whether a person is told
        what came of it."""
        memory = self.memory
        entry = self.evaluation_log.remember(program, rows, command)
        memory.hosts, memory.printed = entry.hosts, []
        if answered:
            memory.undecided, memory.moved = np.zeros((2, self.state.count), np.bool_)
        values = evaluate(memory, program, rows)
        steps = np.broadcast_to(np.asarray(memory.steps(rows), np.int32), rows.size)
        printed, memory.hosts, memory.printed = memory.printed, None, None
        self.evaluation_log.weigh(entry)
        found = Evaluated(rows, entry, values, memory.matched[rows.index].copy(), steps, memory.noted, printed)
        if memory.undecided is not None and memory.moved is not None:
            found.undecided = memory.undecided[rows.index]
            found.held = memory.moved[rows.index] & self.state.stopped[rows.index]
        memory.undecided = memory.moved = None
        return found

    def install(
        self,
        name: str,
        text: str,
        *,
        priority: int = 0,
        protected: bool = True,
        robots: Some = None,
    ) -> None:
        """Give these robots an active rule of their own. protected: it cannot be changed by radio.

        Raises ReadError and CheckError for the text, SleepcastError if the rule is refused for another reason.
        """
        number = buffer_number(name.casefold())
        key = name.casefold() if number is None else f"e{number}"
        for outcome in self.evaluate(f"(RULE {name} {show(read(text))})", robots):
            if outcome.faults:
                raise SleepcastError(f"the rule {name} cannot be installed: {outcome.faults[0].reason}")
            for mind, rows, _ in self.memory.divide(outcome.rows, lambda found: found):
                draft = self.minds.draft(mind)
                draft.rank(key, priority, protected)
                self.memory.turn(rows, draft)

    def _obey(self, message: Message, rows: Rows, now: float) -> None:
        if now > message.deadline:
            self._answer_alike(message, rows, "late")
            return
        asked = message.kind is Kind.ASK

        def program(number: int) -> Program | str:
            names = MindNames(self.vocabulary, self.minds[number])
            try:
                return self.minds.library.program(message.text, lambda: [read(message.text)], names, asked=asked)
            except SleepcastError as error:
                return str(error).splitlines()[0]

        self.memory.hops = hops_left(message.body, message.role, MAX_HOPS)
        for found, some, _ in self.memory.divide(rows, program):
            if isinstance(found, str):
                self._answer_alike(message, some, "fault", found)
            elif asked:
                self._asked(message, found, some)
            else:
                answered = HOPS not in message.body  # nobody counts what becomes of what robots tell each other
                self.outbox.answer(some, _came_of(message, self.run(found, some, message.id, answered=answered)))
        self.memory.hops = MAX_HOPS

    def _asked(self, message: Message, program: Program, rows: Rows) -> None:
        """Answer a question robot by robot: it changes nothing, so there is nothing to do for all at once."""
        for robot in rows.robots.tolist():
            found = foretell(program, rehearsal(self.memory, robot))
            answers = AnswerColumns.alike(message.id, 1, "answer", found.value, "; ".join(found.faults))
            self.outbox.answer(self.rows([robot]), answers)


def _runs(mind: Mind) -> bool:
    """Whether a robot with this mind has something to do in every tick."""
    return bool(mind.running)


_SORTS = ("not matched", "matched", "fault", UNKNOWN, HELD)


def _came_of(message: Message, outcome: Evaluated) -> AnswerColumns:
    """The answers to a command, in the order of the robots that evaluated it."""
    rows, faults = outcome.rows, [fault_text(noted) for noted in outcome.faults]
    fault = np.zeros(rows.size, np.int32) if faults else np.broadcast_to(np.int32(0), rows.size)
    for number, noted in reversed(list(enumerate(outcome.faults, 1))):
        fault[rows.places(noted.robots)] = number
    sort = outcome.matched.view(np.uint8)
    if outcome.undecided is not None and outcome.undecided.any():
        sort = np.where(outcome.undecided & (sort == 0), np.uint8(3), sort)
    if outcome.held is not None and outcome.held.any():
        sort = np.where(outcome.held & (sort == 1), np.uint8(4), sort)
    sort = np.where(fault > 0, np.uint8(2), sort) if faults else sort
    return AnswerColumns(message.id, _SORTS, sort, outcome.values, tuple(faults), fault)
