"""Views: one robot of a fleet, seen as a mind of its own, with what a node has to offer."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from sleepcast.channel.message import Message
from sleepcast.core.errors import SleepcastError
from sleepcast.fleet.core import Core, Outcome
from sleepcast.fleet.evaluation import Noted, fault_text
from sleepcast.fleet.evaluation_log import LogEntry, recollect, rehearsal
from sleepcast.language.explain import Explanation, Recollection, explain, rehearse
from sleepcast.language.lint import Checked, check
from sleepcast.language.parts import Part
from sleepcast.language.program import Program
from sleepcast.language.symbols import Declared, UserVariable
from sleepcast.language.vocabulary import TICK, Variable, Vocabulary
from sleepcast.mind.rules import Mind, in_order


@dataclass(frozen=True, slots=True)
class Fault:
    """Something that went wrong in an evaluation. where: the text of the part."""

    reason: str
    text: str
    tick: int

    def __str__(self) -> str:
        return self.text


@dataclass(frozen=True, slots=True)
class RuleView:
    """A rule or buffer as people look at it."""

    name: str
    text: str
    active: bool
    last_value: float
    last_fault: str
    steps: int
    firings: int
    lease: float
    priority: int
    protected: bool


@dataclass(frozen=True, slots=True)
class Result:
    """What came of one text. printed: what it reported, label and values. explanation: made when it is asked for."""

    value: float
    matched: bool
    faults: tuple[Fault, ...]
    cost: int
    steps: int
    printed: tuple[tuple[str, tuple[float, ...]], ...]
    _view: RobotView
    _entry: LogEntry

    @property
    def recollection(self) -> Recollection:
        return self._view.recollection(self._entry)

    @property
    def explanation(self) -> Explanation:
        return explain(self.recollection)


class RobotView:
    """The robot at one place of a fleet. It keeps nothing itself."""

    def __init__(self, fleet: Core, place: int) -> None:
        self._fleet, self.place = fleet, place

    # ---- what others look at

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
        """The numbers by slot, as they are now; NaN is unknown."""
        return self._fleet.state.row(self.place)

    @property
    def groups(self) -> frozenset[str]:
        """Keys of the groups that the robot is in."""
        return self._fleet.state.groups_of(self.place)

    @property
    def stopped(self) -> bool:
        return bool(self._fleet.state.stopped[self.place])

    @property
    def dropped(self) -> int:
        """Assignments and calls that an unknown kept from the body."""
        return int(self._fleet.state.dropped[self.place])

    @property
    def lost(self) -> int:
        """Messages and sayings that found no room."""
        return int(self._fleet.state.lost[self.place])

    @property
    def awake(self) -> bool:
        """Whether the next tick has anything to do: a message, or rules that run."""
        return self._fleet.waiting(self.place) > 0 or bool(self._mind.running)

    @property
    def outbox(self) -> list[Message]:
        """What the robot has to say; whoever sends it clears the list."""
        return self._fleet.outbox.of(self.place)

    @property
    def pings(self) -> list[float]:
        """The castes of its pings; whoever sends them clears the list."""
        return self._fleet.outbox.pings(self.place)

    @property
    def _mind(self) -> Mind:
        return self._fleet.memory.kept(self.place)

    def declared(self, key: str) -> Declared | None:
        """What the robot has learned under this key."""
        return self._mind.declared(key)

    def heard(self) -> Iterable[str]:
        """Every learned name as written."""
        return self._mind.heard()

    def fetch(self, part: Part) -> Program | None:
        """The program in the buffer or rule that a `fetch` part names."""
        kept = self._mind.rules.get(part.name)
        return None if kept is None else kept.program

    def operator(self, part: Part) -> Program | None:
        """The program of the operator that a `call` part names, None if it has none of that name."""
        return self._mind.operators.get(part.name)

    def rules(self) -> list[RuleView]:
        """Every kept expression, in the order of the round."""
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
                    kept.priority,
                    kept.protected,
                )
            )
        return found

    def variables(self) -> list[tuple[str, float]]:
        """Every variable by name, in the order of the vocabulary, user variables last."""
        values = self.values
        found = [(b.name, values[b.slot]) for b in self.vocabulary.bindings.values() if isinstance(b, Variable)]
        learned = [d for d in self._mind.learned.values() if isinstance(d, UserVariable)]
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

    # ---- what comes in

    def receive(self, message: Message) -> None:
        """Take a message from the channel."""
        self._fleet.receive(message, [self.place])

    def sense(self, readings: Sequence[float], now: float) -> None:
        """Take sensor values (SI, in the order of the vocabulary's sensors, NaN: not measured) at `now` (s)."""
        self._fleet.sense(np.array([readings], np.float64), now, [self.place])

    def think(self, tick: int, now: float) -> None:
        """One tick of this robot alone."""
        self._fleet.think(tick, now, [self.place])

    def evaluate(self, text: str) -> Result:
        """Check and evaluate one text in this memory, as if it were a message. Raises ReadError and CheckError."""
        return self.run(check(text, self))

    def run(self, checked: Checked) -> Result:
        """Evaluate a text that has been checked. Raises CheckError if it has errors."""
        outcome = self._fleet.run(checked.required(), self._fleet.rows([self.place]))
        return self.result(outcome, checked.cost)

    def result(self, outcome: Outcome, cost: int) -> Result:
        """What an evaluation by many robots, this one among them, came to on this one."""
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
            self,
            outcome.entry,
        )

    def _faults(self, noted: Iterable[Noted]) -> Iterable[Fault]:
        tick = int(self._fleet.state.row(self.place)[TICK])
        return [Fault(n.reason, fault_text(n), tick) for n in noted if self.place in n.robots]

    def why(self, command: str | None = None) -> Explanation:
        """How a command was evaluated (by its id; None: the last one), or what a rule (by its name) would do now.

        Raises SleepcastError if the robot remembers neither.
        """
        entry = self._fleet.evaluation_log.find(self.place, command)
        if entry is not None:
            return explain(self.recollection(entry))
        kept = self._mind.rules.get((command or "").casefold())
        if kept is not None:
            return rehearse(kept.program, rehearsal(self._fleet.memory, self.place), command=kept.name)
        what = "no command" if command is None else f"no command or rule {command}"
        raise SleepcastError(f"{self.name} remembers {what}: {self._fleet.evaluation_log.limits()}")

    def recollection(self, entry: LogEntry) -> Recollection:
        """What went into a command on this robot."""
        return recollect(entry, self.place, self.vocabulary, self._fleet.state.keys)

    def install(self, name: str, text: str, *, priority: int = 0, protected: bool = True) -> None:
        """Give the robot an active rule of its own; see `Fleet.install`."""
        self._fleet.install(name, text, priority=priority, protected=protected, robots=[self.place])
