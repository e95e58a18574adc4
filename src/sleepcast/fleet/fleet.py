"""The fleet: the minds of many robots with one vocabulary; `fleet[name]` is a view of one of them.

It takes messages and readings, and each tick evaluates all robots. The results equal those of a list of nodes, robot
by robot and bit for bit, but every message and every rule is evaluated for all robots at once.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cached_property
from math import inf, nan
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.message import FOR, NOT, Kind, Message, is_addressed
from sleepcast.channel.message_batch import MessageBatch, NameIndex
from sleepcast.columns.values import Column, Index, Mask, Rows
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.core.model import RestState
from sleepcast.core.threads import ThreadPool
from sleepcast.fleet.authority import FleetAuthority
from sleepcast.fleet.bodies import FleetBodies
from sleepcast.fleet.inspection import EvaluationLog, FleetTelemetry, LogEntry, ReadSet, recollect, rehearsal
from sleepcast.fleet.memory import FleetMemory
from sleepcast.fleet.messages import Inbox, Outbox
from sleepcast.fleet.native.kernels import Kernels, MadeKernels, available
from sleepcast.fleet.obeying import Evaluated, Obeying
from sleepcast.fleet.queries import FleetQueries
from sleepcast.fleet.scheduler import BatchScheduler, end_leases
from sleepcast.fleet.state import FleetState, Mind, MindNames, Minds
from sleepcast.language.explain import Explanation, Recollection, explain, rehearse, with_bid
from sleepcast.language.lint import Checked, check, unit_of_program
from sleepcast.language.parts import Part
from sleepcast.language.program import Program
from sleepcast.language.reader import read, show
from sleepcast.language.symbols import Declared, UserVariable
from sleepcast.language.vocabulary import TICK, TIME_SLOT, Variable, Vocabulary, rule_key
from sleepcast.mind.authority import AT_REST, ENDED, Latch, Tells, outcome_of_untimely
from sleepcast.mind.inspection import BodyState, Details, Self, answer_inspection
from sleepcast.mind.limits import ASKS_TOO_MUCH, MAX_BACKLOG
from sleepcast.mind.rules import in_order
from sleepcast.mind.telemetry import motion_of
from sleepcast.mind.views import Fault, Result, RuleView

SPARE_MINDS = 256
"""Unused minds that may accumulate before they are removed."""


class FleetError(MisuseError):
    """The fleet cannot be created, or a robot is not in it."""


Some: TypeAlias = Rows | Sequence[int] | Index | None
"""Robots by their indices; None means all of them."""


class RobotView:
    """A view of one robot of a fleet; it stores nothing itself."""

    def __init__(self, fleet: Fleet, index: int) -> None:
        self._fleet, self.index = fleet, index

    # ---- state

    @property
    def name(self) -> str:
        return self._fleet.names[self.index]

    @property
    def number(self) -> int:
        return self._fleet.numbers[self.index]

    @property
    def vocabulary(self) -> Vocabulary:
        return self._fleet.vocabulary

    @property
    def values(self) -> list[float]:
        """The variables by slot, current values; NaN is unknown."""
        return self._fleet.state.row(self.index)

    @property
    def groups(self) -> frozenset[str]:
        """See `Node.groups`."""
        return self._fleet.state.groups_of(self.index)

    @property
    def stopped(self) -> bool:
        return bool(self._fleet.state.stopped[self.index])

    @property
    def doubt(self) -> str:
        """See `Node`."""
        return self._fleet.authority.doubts.of(self.index)

    @property
    def driven(self) -> bool:
        """See `Node.driven`."""
        return bool(self._fleet.authority.driving.of(self.index).driver)

    @property
    def catching_up(self) -> bool:
        """See `Node.catch_up`."""
        return self._fleet.authority.catching_up.of(self.index)

    @property
    def itself(self) -> Self:
        """What it knows, as it tells others."""
        values = self.values
        return Self(self.vocabulary, self._mind, values, values.__getitem__, self.groups)

    def body_state(self, now: float) -> BodyState:
        """What it knows of its body, and of who holds it, at `now` (s)."""
        state = self.rest_state() if self.stopped else None
        motion = None if state is None else motion_of(state)
        stops = self._fleet._bodies.stops(self.index, now)
        return BodyState(self.stopped, self.driven, self.doubt, self.catching_up, stops, motion)

    def rest_state(self) -> RestState | None:
        """See `Node.rest_state`."""
        return self._fleet.telemetry.rest_state(self.index)

    @property
    def dropped(self) -> int:
        """See `Node.dropped`."""
        return int(self._fleet.state.dropped[self.index])

    @property
    def lost(self) -> int:
        """Number of messages lost because a queue or the outbox was full."""
        return int(self._fleet.state.lost[self.index])

    @property
    def awake(self) -> bool:
        """See `Node.awake`."""
        fleet = self._fleet
        busy = fleet.waiting(self.index) > 0 or self.index in fleet.bids.busy or bool(fleet.timing.busy[self.index])
        return busy or bool(self._mind.running) or self.driven

    @property
    def outbox(self) -> list[Message]:
        """The messages waiting to be sent; the sender clears the list."""
        return self._fleet.outbox.of(self.index)

    @property
    def pings(self) -> list[float]:
        """The castes of its pings; the sender clears the list."""
        return self._fleet.outbox.pings(self.index)

    @property
    def _mind(self) -> Mind:
        return self._fleet.memory.mind_of(self.index)

    def declared(self, key: str) -> Declared | None:
        """See `Node.declared`."""
        return self._mind.declared(key)

    def heard(self) -> Iterable[str]:
        """See `Node.heard`."""
        return self._mind.heard()

    def fetch(self, part: Part) -> Program | None:
        """See `Node.fetch`."""
        return self._mind.fetch(part)

    def operator(self, part: Part) -> Program | None:
        """See `Node.operator`."""
        return self._mind.operator(part)

    def rules(self) -> list[RuleView]:
        """See `Node.rules`."""
        views, tallies = [], self._fleet.memory.statistics
        for rule in in_order(self._mind.rules):
            tally, leases = tallies[rule.key], tallies.leases.get(rule.key)
            views.append(
                RuleView(
                    rule.name,
                    rule.text,
                    rule.active,
                    float(tally.last_value[self.index]),
                    tally.last_fault.get(self.index, ""),
                    tally.steps_of(self.index),
                    int(tally.firings[self.index]),
                    inf if leases is None else float(leases[self.index]),
                    rule.shown_priority,
                    rule.protected,
                    unit_of_program(rule.program),
                )
            )
        return views

    def variables(self) -> list[tuple[str, float]]:
        """See `Node.variables`."""
        values = self.values
        built_in = [(b.name, values[b.slot]) for b in self.vocabulary.bindings.values() if isinstance(b, Variable)]
        learned = [d for d in self._mind.symbols.values() if isinstance(d, UserVariable)]
        return built_in + [(d.name, values[d.slot]) for d in learned]

    def actuators(self) -> dict[str, float]:
        """The actuators that were assigned since the last call, by name."""
        state, vocabulary = self._fleet.state, self.vocabulary
        values, first = self.values, vocabulary.first_actuator
        assigned = {}
        for slot in sorted(state.actuated):
            if state.actuated[slot][self.index]:
                state.actuated[slot][self.index] = False
                assigned[vocabulary.actuators[slot - first].name] = values[slot]
        return assigned

    # ---- input

    def halt(self, doubt: str = "") -> None:
        """See `Node.halt`."""
        self._fleet.halt(doubt, [self.index])

    def catch_up(self, lasts: bool) -> None:
        """See `Node.catch_up`."""
        self._fleet.catch_up(lasts, [self.index])

    def receive(self, message: Message) -> None:
        """Take a message from the channel."""
        self._fleet.receive(message, [self.index])

    def sense(self, readings: Sequence[float], now: float) -> None:
        """See `Node.sense`."""
        self._fleet.sense(np.array([readings], np.float64), now, [self.index])

    def think(self, tick: int, now: float) -> None:
        """Run one tick of this robot alone."""
        self._fleet.think(tick, now, [self.index])

    def evaluate(self, text: str) -> Result:
        """See `Node.evaluate`."""
        return self.run(check(text, self))

    def run(self, checked: Checked) -> Result:
        """See `Node.run`."""
        outcome = self._fleet.run(checked.required(), self._fleet.rows([self.index]))
        return self.result(outcome, checked.cost)

    def result(self, outcome: Evaluated, cost: int) -> Result:
        """This robot's part of an evaluation on many robots."""
        at = int(np.searchsorted(outcome.rows.robots, self.index))
        tick = int(self._fleet.state.row(self.index)[TICK])
        faults = [
            Fault(noted.reason, show(noted.part.form), tick) for noted in outcome.faults if self.index in noted.robots
        ]
        printed = []
        for robots, label, columns in outcome.printed:
            where = np.flatnonzero(robots == self.index)
            if where.size:
                printed.append((label, tuple(float(column[where[0]]) for column in columns)))
        return Result(
            float(outcome.values[at]),
            bool(outcome.matched[at]),
            tuple(faults),
            cost,
            int(outcome.steps[at]),
            tuple(printed),
            lambda: self.recollection(outcome.entry),
        )

    def why(self, command: str | None = None) -> Explanation:
        """See `Node.why`."""
        entry = self._fleet.evaluation_log.find(self.index, command)
        if entry is not None:
            recollection = self.recollection(entry)
            return with_bid(explain(recollection), self._fleet.bids.standing(self.index, recollection.command))
        rule = self._mind.rules.get((command or "").casefold())
        if rule is not None:
            memory, stopped = rehearsal(self._fleet.memory, self.index), self.stopped
            return rehearse(rule.program, memory, command=rule.name, stopped=stopped, priority=rule.shown_priority)
        what = "no command" if command is None else f"no command or rule {command}"
        raise SleepcastError(f"{self.name} remembers {what}: {self._fleet.evaluation_log.limits()}")

    def recollection(self, entry: LogEntry) -> Recollection:
        """Re-evaluate a logged command for this robot."""
        return recollect(entry, self.index, self.vocabulary, self._fleet.state.keys)

    def install(self, name: str, text: str, *, priority: int = 0, protected: bool = True) -> None:
        """Give the robot an active rule of its own; see `Fleet.install`."""
        self._fleet.install(name, text, priority=priority, protected=protected, robots=[self.index])


class Fleet(Mapping[str, RobotView]):
    """See the module.

    names: of the robots
    numbers: their `id` in expressions and random streams, 1 upwards by default
    seed: of the run
    bodies: targets of the vocabulary's functions; those that are a `Robot` are also stopped, released and held still,
        all at once if they are `ManyBodies`
    native: whether rules may be compiled to native code where llvmlite is installed, which changes nothing but speed
    pool: threads to use
    sensed: the bodies' table of sensor values, if there is one: SI, NaN for unknown, shape (sensors, robots), C
        order; it is read in place, never copied, except for sensors with a freshness limit (see `look`)
    lease, tells: see `Node`
    on_air: whether it behaves as nodes on a real channel do

    Raises FleetError for a vocabulary with linked variables, which lie in a host's own memory and have no column.
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
        lease: float = inf,
        tells: Tells = Tells.ALL,
        on_air: bool = False,
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
        self.kernels: Kernels | None = None
        if native and available():
            self.kernels = Kernels(pool=pool, bodies=bodies, made=vocabulary.common(MadeKernels))
        self.memory = FleetMemory(self.state, self.minds, self.outbox, bodies, self.kernels)
        self.evaluation_log = EvaluationLog(self.memory)
        self.authority = FleetAuthority(self.state, tells=tells, lease=lease)
        self.scheduler = BatchScheduler(self.memory, self.authority)
        self._bodies = FleetBodies(self.state, bodies, self.authority)
        self._obeying = Obeying(self.memory, self.evaluation_log, self.authority, self._look, on_air=on_air)
        self.bids, self.timing = self._obeying.bids, self._obeying.timing
        self.telemetry = FleetTelemetry(self.state, self.minds, self._bodies)
        """The latest telemetry of each robot."""
        self._read_set = ReadSet(self.memory)
        self.queries = FleetQueries(self.state, self.minds, bodies)
        """The expressions that are asked for on all robots; see `values_of`."""
        self.inbox = Inbox(count, self._obeying.comes_after, MAX_BACKLOG) if on_air else Inbox(count)
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
        self.state.share(self.vocabulary.first_sensor, sensed, self.measured)

    # ---- the robots

    def __getitem__(self, name: str) -> RobotView:
        index = self.names.index_of(name)
        if index is None:
            raise KeyError(name)
        return RobotView(self, index)

    def __iter__(self) -> Iterator[str]:
        return filter(None, self.names)

    def at(self, index: int) -> RobotView:
        """The robot with this index."""
        return RobotView(self, index)

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
            declared = mind.declared(key)
            if declared is not None:
                return declared
        return None

    def heard(self) -> list[str]:
        """Every name that any of the robots has learned, as written."""
        return list(dict.fromkeys(name for mind in self._different() for name in mind.heard()))

    def _different(self) -> Iterator[Mind]:
        """The distinct minds that robots have now."""
        one = self.state.one_mind
        there = np.flatnonzero(np.bincount(self.state.mind)).tolist() if one is None else [one]
        return (self.minds[number] for number in there)

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
        slots = self._read_set.slots(self.inbox.messages())
        return frozenset(self.state.slots()) if slots is None else slots

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
        """Which robots have anything to do in the next tick: a message, a bid, active rules, or a driven body."""
        awake = (self.inbox.waiting > 0) | self.timing.busy
        awake[self.bids.busy] = True
        awake |= self.memory.where(self.rows(), _runs)
        awake[self.authority.driven().index] = True
        return awake

    def awake_rows(self) -> Rows:
        """The robots that are awake."""
        everybody = self.rows()
        idle = self.inbox.empty and not self.bids.busy and not self.timing.is_busy
        if idle and not self.authority.driven().size:
            groups = self.memory.divide(everybody, lambda number: _runs(self.minds[number]))
            return next((rows for running, rows, _ in groups if running), Rows.run(0, 0))
        return everybody.take(self.awake)

    def waiting(self, robot: int) -> int:
        """Number of messages waiting for a robot's next tick."""
        return int(self.inbox.waiting[robot])

    def take_messages(self) -> list[MessageBatch]:
        """Take all outgoing messages that are not in a robot's `outbox` list yet."""
        return self.outbox.take()

    def take_pings(self) -> list[tuple[Index, Column]]:
        """Take all pings that are not in a robot's `pings` list yet: robots, and their castes."""
        return self.outbox.take_pings()

    # ---- input

    def receive(self, message: Message, robots: Some = None) -> None:
        """Receive a message on these robots: STOP and RELEASE take effect at once, commands and questions are
        queued."""
        if message.kind is Kind.REQUEST:  # which is no sign that somebody drives
            self.bids.hear(message, self.rows(() if message.ahead else robots).robots)
            return
        heard = meant = self.inbox.first_heard(message, self.rows(robots).robots)
        if FOR in message.body or NOT in message.body:
            meant = np.array([i for i in heard.tolist() if is_addressed(message.body, self.names[i])], np.intp)
        if message.ahead and message.kind is not Kind.STOP:
            self.outbox.answer_alike(message, Rows.of(meant), *outcome_of_untimely(message))
            return
        self.authority.hear(message, Rows.of(heard))
        if message.kind is Kind.STOP:  # whoever hears it stops; only those that it is addressed to answer
            stopped, released = self._bodies.obey_stop(message, Rows.of(heard))
            self.bids.stop(stopped.robots)
            self.timing.stop(stopped, message)
            self.outbox.answer_alike(message, Rows.of(np.intersect1d(stopped.robots, meant)), "stopped")
            self.outbox.answer_alike(message, released, "fault", ENDED)
        elif message.kind is Kind.RELEASE:
            free, refused = self._bodies.obey_release(message, Rows.of(meant))
            self.outbox.answer_alike(message, free, "released")
            for some, why in refused:
                self.outbox.answer_alike(message, some, "fault", why)
        elif message.kind in (Kind.COMMAND, Kind.ASK):
            self._enqueue(message, meant)

    def _enqueue(self, message: Message, robots: Index) -> None:
        refusing = self.inbox.refusing_question(message, robots)
        if refusing.size:
            self.outbox.answer_alike(message, Rows.of(refusing), "fault", ASKS_TOO_MUCH)
            self.state.lost[refusing] += 1
            robots = np.setdiff1d(robots, refusing)
        self.state.lost[self.inbox.put(message, robots)] += 1

    def _look(self, message: Message, robot: int, now: float) -> Details:
        """What a robot tells about itself."""
        view = self.at(robot)
        return answer_inspection(message.body, view.itself, view.body_state(now), view.why)

    def halt(self, doubt: str = "", robots: Some = None) -> None:
        """See `Node.halt`."""
        self._bodies.halt(self.rows(robots), doubt)

    def catch_up(self, lasts: bool, robots: Some = None) -> None:
        """See `Node.catch_up`."""
        rows = self.authority.catching_up.where(self.rows(robots), lambda before: before is not lasts)
        self.authority.catching_up.set(rows, lasts)
        self._bodies.hold(rows)

    def begin(self, latch: Latch, now: float, robots: Some) -> None:
        """These robots have come at `now`, s, with this latch: they are stopped if any STOP holds it."""
        self._bodies.begin(latch, self.rows(robots), now)

    @property
    def arrived(self) -> dict[tuple[str, int], Column]:
        """When the latest STOP of each sender and epoch that holds any robot has arrived there, s."""
        return self._bodies.arrived

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
        unattended = self.authority.unattended(rows, now)
        if unattended.size:  # nothing resumes on its own when their operators are heard again
            self.authority.let_go(unattended)
            self.outbox.report(self._bodies.let_go(unattended), AT_REST)
        end_leases(self.memory, rows, now)
        self._obeying.obey_all(self.inbox.take(rows), rows, now)
        resting = self._bodies.resting(rows)
        self._run_rules(rows if resting is None else rows.take(~resting))
        self.end_round(rows)

    def end_round(self, rows: Rows) -> None:
        """What follows a round of rules: whoever rests holds still, and minds that nobody has any more go."""
        self._bodies.hold(rows)
        self.tidy()

    @property
    def rests(self) -> bool:
        """Whether any robot sleeps, is frozen, or holds its body still."""
        # Of few robots a count takes a fraction of what `any` takes, and this is asked before each quiet tick.
        return self._bodies.resting(self.rows()) is not None or bool(np.count_nonzero(self.state.still))

    def _run_rules(self, rows: Rows) -> None:
        """One round of the active rules. A driven robot whose rules move its body is not driven any more."""
        walked = self.authority.walked(rows)
        if walked.size:
            moved = self.memory.moved = np.zeros(self.state.count, np.bool_)
            self.scheduler.run(walked, natively=False)
            self.memory.moved = None
            self.authority.let_go(walked.take(moved[walked.index]))
        self.scheduler.run(rows.without(walked))

    def age(self, now: float, robots: Some = None) -> None:
        """Let be unknown what these robots have measured too long before `now` (s)."""
        self._age(self.rows(robots), now)

    def _age(self, rows: Rows, now: float) -> None:
        """Set values to unknown whose measurement is too old."""
        for slot, measured in self.measured.items():
            limit = self.vocabulary.sensors[slot - self.vocabulary.first_sensor].freshness
            old = ~(now - measured[rows.index] <= limit)
            if old.any():
                self.state.assign(slot, rows.take(old), np.full(int(old.sum()), nan))

    def tidy(self) -> None:
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

        return [self.run(meaning, rows) for meaning, rows, _ in self.memory.divide(self.rows(robots), program)]

    def values_of(self, text: str, now: float) -> Column:
        """The value of an expression on each robot at `now` (s), NaN for unknown, without side effects.

        Raises ReadError, CheckError, and FleetError for an expression with side effects, random numbers or a function
        that makes a body do something.
        """
        values, reason = self.queries[text].values(float(now))
        if reason:
            raise FleetError(f"{text} cannot be previewed: {reason}")
        return values

    def run(self, program: Program, rows: Rows) -> Evaluated:
        """Evaluate a program on these robots, and log its inputs for explanations."""
        return self._obeying.run(program, rows)

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
        for outcome in self.evaluate(f"(RULE {name} {show(read(text))})", robots):
            if outcome.faults:
                raise SleepcastError(f"the rule {name} cannot be installed: {outcome.faults[0].reason}")
            for mind, rows, _ in self.memory.divide(outcome.rows, lambda number: number):
                draft = self.minds.draft(mind)
                draft.rank(rule_key(name), priority, protected)
                self.memory.turn(rows, draft)


def _runs(mind: Mind) -> bool:
    """Whether a robot with this mind has something to do in every tick."""
    return bool(mind.running)
