"""Told: what the robots of a fleet last told of themselves, and what a test would come to on them by that.

The columns are copies of the fleet's, each robot's as it was when it last told. A test is evaluated on them for all
robots at once, and nothing it could do is done; what the columns cannot say leaves a robot undecided, with the reason.
What buffers and operators hold is asked of the robots' minds as they are now.
"""

from __future__ import annotations

from math import nan

import numpy as np
from numpy.typing import NDArray

from sleepcast.fleet.acts import ACTS
from sleepcast.fleet.columns import Column, FleetState, Index, Mask, Rows, is_true
from sleepcast.fleet.evaluation import by_the_living
from sleepcast.fleet.machine import evaluate
from sleepcast.fleet.memory import FleetMemory, Found
from sleepcast.fleet.minds import Minds
from sleepcast.fleet.parcels import ToldParcel
from sleepcast.fleet.speech import Speech
from sleepcast.language.machine import Program
from sleepcast.language.parts import Part, acts
from sleepcast.language.undecided import CHANCE, DEED, asks, does
from sleepcast.parcel import Array

MAX_REASONS = 200
"""Different reasons told apart in one judgement, so that one fits a byte; the rest counts as the last of them."""


class Told:
    """See the module. state: of the fleet; minds: its table."""

    def __init__(self, state: FleetState, minds: Minds) -> None:
        self._state, self._minds = state, minds
        self._then = state.shadow()
        self._stopped: Mask = np.zeros(state.count, np.bool_)

    def take(self, robots: Index) -> None:
        """These robots tell of themselves now."""
        self._then.copy_from(self._state, Rows.of(robots))
        self._stopped[robots] = self._state.stopped[robots]

    def stopped(self, robots: Index) -> Mask:
        """Which of these robots were stopped when they last told."""
        found: Mask = self._stopped[robots]
        return found

    def state(self) -> ToldParcel:
        """All that they told."""
        return ToldParcel(self._then.values(), Array.of(self._stopped))

    def restore(self, parcel: ToldParcel) -> None:
        """Have been told that. Raises ParcelError."""
        self._then.refill(parcel.values)
        self._stopped = parcel.stopped.made(np.bool_, self._stopped.shape, "who was stopped")

    def judge(self, test: Program, robots: Index) -> tuple[Mask, NDArray[np.uint8], list[str]]:
        """What a test says of these robots: where it holds; where that cannot be said, which of the reasons, listed
        last, is why (from 1; 0 where it can be said)."""
        rows = Rows.of(robots)
        memory = _Asked(self._then, self._minds)
        values = evaluate(memory, test, rows)
        reason = memory.reason[rows.index]
        return is_true(values) & (reason == 0), reason, memory.reasons


class _Asked(FleetMemory):
    """A memory to read, in which nothing can be done. reason: by robot, as in `Told.judge`."""

    def __init__(self, state: FleetState, minds: Minds) -> None:
        super().__init__(state, minds, Speech(state, ()), ACTS, ())
        self.reason: NDArray[np.uint8] = np.zeros(state.count, np.uint8)
        self.reasons: list[str] = []

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
