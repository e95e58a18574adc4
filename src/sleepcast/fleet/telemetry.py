"""Telemetry of a fleet: the values that its robots reported last, and what a test would give by these values.

The columns are copies of the fleet's, each robot's as of its latest telemetry. A test is evaluated on them for all
robots at once, and nothing it could do is done; what the columns cannot say leaves a robot undecided, with the reason.
What buffers and operators hold is asked of the robots' minds as they are now.

A second copy of all variables is little in a small fleet and a quarter of all memory in a large one, where hardly any
is ever looked at. So a large fleet tells the variables that a test has asked for, from the first time on: the robots
that reported last report them at once, and the others with their next telemetry.
"""

from __future__ import annotations

from math import nan

import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.message_batch import ascending
from sleepcast.core.serial import Array
from sleepcast.fleet.columns import Column, FleetState, Index, Mask, Rows, is_true
from sleepcast.fleet.evaluation import by_the_living
from sleepcast.fleet.machine import evaluate
from sleepcast.fleet.memory import FleetMemory, Found
from sleepcast.fleet.messages import Outbox
from sleepcast.fleet.minds import Minds
from sleepcast.fleet.read_set import reads_of
from sleepcast.fleet.schema import TelemetryState
from sleepcast.language.parts import Part, acts
from sleepcast.language.program import Program
from sleepcast.language.rehearsal import CHANCE, DEED, asks, does

MAX_REASONS = 200
"""Different reasons told apart in one judgement, so that one fits a byte; the rest counts as the last of them."""


MANY = 30_000
"""Robots from which on a fleet is large: fewer have less than ten megabytes of variables."""
NOT_YET = "its telemetry does not yet hold what the test reads"


class FleetTelemetry:
    """See the module. state: of the fleet; minds: its table."""

    def __init__(self, state: FleetState, minds: Minds) -> None:
        self._state, self._minds = state, minds
        self._then = state.shadow()
        self._stopped: Mask = np.zeros(state.count, np.bool_)
        self._large = state.count >= MANY
        self._last = Rows.run(0, 0)
        """Those who reported last."""
        self._asked: dict[int, Mask] = {}
        """The slots that a large fleet reports, each with who has reported it."""

    def take(self, robots: Index) -> None:
        """These robots tell of themselves now."""
        rows = self._last = Rows.of(robots)
        self._then.copy_from(self._state, rows, list(self._asked) if self._large else self._state.slots())
        self._then.copy_groups(self._state, rows)
        self._stopped[rows.index] = self._state.stopped[rows.index]
        for those in self._asked.values():
            those[rows.index] = True

    def stopped(self, robots: Index) -> Mask:
        """Which of these robots were stopped at their latest telemetry."""
        found: Mask = self._stopped[robots]
        return found

    def state(self) -> TelemetryState:
        """All of it, as plain data."""
        asked = {slot: Array.of(those) for slot, those in self._asked.items()}
        last = Array.of(self._last.robots.astype(np.int32))
        return TelemetryState(self._then.values(), Array.of(self._stopped), asked, last)

    def restore(self, state: TelemetryState) -> None:
        """Go on with that. Raises SerialError."""
        self._then.refill(state.values)
        shape = self._stopped.shape
        self._stopped = state.stopped.made(np.bool_, shape, "who was stopped")
        self._last = Rows.of(ascending(state.last, len(self._stopped))) if state.last else Rows.run(0, 0)
        asked = state.asked
        if asked is None:  # before it was kept, every robot that reported anything reported everything
            self._asked = {slot: np.ones(shape, np.bool_) for slot in state.values.columns} if self._large else {}
        else:
            self._asked = {slot: those.made(np.bool_, shape, f"who reported {slot}") for slot, those in asked.items()}

    def judge(self, test: Program, robots: Index) -> tuple[Mask, NDArray[np.uint8], list[str]]:
        """What a test says of these robots: where it holds; where that cannot be said, which of the reasons, listed
        last, is why (from 1; 0 where it can be said)."""
        rows = Rows.of(robots)
        memory = QuietMemory(self._then, self._minds)
        if self._large:
            memory.know(rows, self._ask(test, rows))
        values = evaluate(memory, test, rows)
        reason = memory.reason[rows.index]
        return is_true(values) & (reason == 0), reason, memory.reasons

    def _ask(self, test: Program, rows: Rows) -> Mask:
        """From now on these robots report everything that the test reads; gives which of them already have."""
        minds = {self._minds[number] for number in np.unique(self._state.mind[rows.index]).tolist()}
        slots, _ = reads_of(test, minds)
        reported = np.ones(rows.size, np.bool_)
        for slot in self._state.slots() if slots is None else sorted(slots & {*self._state.slots()}):
            if slot not in self._asked:
                self._then.copy_from(self._state, self._last, [slot])
                self._asked[slot] = np.zeros(self._state.count, np.bool_)
                self._asked[slot][self._last.index] = True
            reported &= self._asked[slot][rows.index]
        return reported


class QuietMemory(FleetMemory):
    """A memory to read, in which nothing can be done. reason: by robot, as in `Told.judge`."""

    def __init__(self, state: FleetState, minds: Minds) -> None:
        super().__init__(state, minds, Outbox(state, ()), ())
        self.reason: NDArray[np.uint8] = np.zeros(state.count, np.uint8)
        self.reasons: list[str] = []

    def know(self, rows: Rows, reported: Mask) -> None:
        """Of these robots only the `reported` ones are known."""
        if not reported.all():
            self.reasons.append(NOT_YET)
            self.reason[rows.take(~reported).index] = len(self.reasons)

    def _undecided(self, rows: Rows, reason: str) -> Column:
        """These robots take no further part."""
        if reason not in self.reasons and len(self.reasons) < MAX_REASONS:
            self.reasons.append(reason)
        number = self.reasons.index(reason) + 1 if reason in self.reasons else MAX_REASONS
        before = self.reason[rows.index]
        self.reason[rows.index] = np.where(before == 0, np.uint8(number), before)
        if self.dead is None:
            self.dead = np.zeros(self.state.count, np.bool_)
        self.dead[rows.index] = True
        return np.full(rows.size, nan)

    @by_the_living
    def draw(self, part: Part, rows: Rows) -> Column:
        return self._undecided(rows, CHANCE)

    def fetch(self, part: Part, rows: Rows) -> Found:
        return self._quiet(part, super().fetch(part, rows))

    def operator(self, part: Part, rows: Rows) -> Found:
        return self._quiet(part, super().operator(part, rows))

    def _quiet(self, part: Part, found: Found) -> Found:
        """Programs that do nothing; robots that would enter another one are undecided."""
        quiet: Found = []
        for program, rows, mask in found:
            if program is not None and acts(program.root):
                self._undecided(self._alive(rows), does(part.name))
                quiet.append((None, rows, mask))
            else:
                quiet.append((program, rows, mask))
        return quiet

    def _alive(self, rows: Rows) -> Rows:
        return rows if self.dead is None else rows.take(~self.dead[rows.index])

    @by_the_living
    def host(self, part: Part, rows: Rows, *arguments: Column) -> Column:
        return self._undecided(rows, asks(part.name))

    def defined(self, part: Part, rows: Rows) -> Mask:
        self._undecided(self._alive(rows), DEED)
        return np.zeros(rows.size, np.bool_)

    @by_the_living
    def assign(self, part: Part, rows: Rows, values: Column) -> Column:
        return self._undecided(rows, DEED)

    @by_the_living
    def write(self, part: Part, rows: Rows, values: Column) -> Column:
        return self._undecided(rows, DEED)

    @by_the_living
    def define(self, part: Part, rows: Rows, values: Column) -> Column:
        return self._undecided(rows, DEED)

    @by_the_living
    def store(self, part: Part, rows: Rows, values: Column) -> Column:
        return self._undecided(rows, DEED)

    @by_the_living
    def act(self, part: Part, rows: Rows, *arguments: Column) -> Column:
        return self._undecided(rows, DEED)
