"""What an evaluation changes of robots' minds, and rule statistics: how each rule has performed on each robot."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Iterator, Sequence
from functools import partial
from math import inf, nan
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from sleepcast.columns.evaluation import Evaluation
from sleepcast.columns.values import Column, Index, Mask, Rows
from sleepcast.core.arrays import filled
from sleepcast.core.serial import Arrays, SerialError, dump_arrays, load_arrays, within
from sleepcast.fleet.native.compiler import ResultColumns
from sleepcast.fleet.schema import RuleStatisticsState, StatisticsState
from sleepcast.fleet.state import FleetState, Mind, Minds
from sleepcast.language.parts import Part
from sleepcast.language.vocabulary import ACTIVE0, TICK, buffer_number
from sleepcast.mind.limits import PROVEN_TICKS
from sleepcast.mind.merging import Merging
from sleepcast.mind.rules import Effect, RuleBase

Key = TypeVar("Key", bound=Hashable)


class FleetEvaluation(Evaluation):
    """An evaluation on robots of a fleet: what it changes of their minds."""

    state: FleetState

    def __init__(self, state: FleetState, minds: Minds) -> None:
        super().__init__(state)
        self.minds, self.statistics = minds, StatisticsTable(state)

    def divide(self, rows: Rows, key: Callable[[int], Key]) -> list[tuple[Key, Rows, Mask | None]]:
        """See `FleetState.divide`."""
        return self.state.divide(rows, key)

    def where(self, rows: Rows, holds: Callable[[Mind], bool]) -> Mask:
        """On which of the rows `holds` is true of the mind."""
        truths = np.zeros(rows.size, np.bool_)
        for truth, _, mask in self.divide(rows, lambda number: holds(self.minds[number])):
            truths[... if mask is None else mask] = truth
        return truths

    def change(self, part: Part, rows: Rows, how: Callable[[RuleBase], str | None]) -> Mask:
        """Change the minds of these robots, unless `how` returns a reason not to; returns where it was done."""
        done = np.ones(rows.size, np.bool_)
        for number, merging, some in self.each_mind(rows):
            draft = self.minds.draft(number, partial(self.changing, some), merging)
            reason = how(draft)
            if reason is None or draft.merges:
                self.turn(some, draft)
            if reason is not None:
                self.refuse(part, some, reason)
                done[rows.indices_of(some.robots)] = False
        return done

    def each_mind(self, rows: Rows) -> Iterator[tuple[int, Merging, Rows]]:
        """The numbers of these robots' minds, with a merging state that may be changed, and the robots that have
        both."""
        for number, some, _ in self.divide(rows, lambda number: number):
            for merging, few, _ in self.state.merging.divide(some):
                yield number, merging.draft(), few

    def turn(self, rows: Rows, draft: RuleBase) -> None:
        """Give these robots the mind of the draft, and its merging state."""
        self.state.turn(rows, self.minds.settle(draft))
        if draft.merges:
            self.state.merging.set(rows, draft.merging)
        self.statistics.apply(draft.effects, rows)

    def changing(self, rows: Rows) -> None:
        """To be called before the rules of these robots change: minds that are proven become the ones to roll back
        to."""
        state = self.state
        ticks = state.column(TICK, rows).astype(np.int64)
        ripe = ticks - state.unproven_since[rows.index] >= PROVEN_TICKS
        if ripe.any():
            some = rows.take(ripe)
            state.proven[some.index] = state.mind[some.index]
            self.statistics.prove(some)
        state.unproven_since[rows.index] = ticks

    def mind_of(self, robot: int) -> Mind:
        """The mind of one robot."""
        return self.minds[int(self.state.mind[robot])]


# ---- rule statistics: how each rule has performed on each robot, and when its lease ends, as columns by its key

MAX_FRESH = 255
"""Evaluations by native code after which its matches, counted in single bytes, are added to the others."""
NARROW = 65_535
"""Largest count of matches in two bytes; beyond it four are used."""


NO_FAULTS: dict[int, str] = {}
"""Of all rules that have had none."""


class RuleStatistics:
    """Statistics of one rule: last value, steps of the last evaluation, firings, consecutive faults, texts of last
    faults.

    Values common to all robots take no column, and counts use the narrowest type possible.
    """

    __slots__ = (
        *("_counted", "_failed_at", "_fired", "_firings", "_fresh", "_in_row", "_sink", "_steps"),
        *("last_fault", "last_value", "most_steps"),
    )

    def __init__(self, count: int) -> None:
        self.last_value: Column = filled(nan, np.float64, count)
        self.most_steps = 0
        """An upper bound of the steps that any robot has used."""
        self._steps: NDArray[np.uint16] | int = 0
        self._firings: NDArray[np.uint16 | np.uint32] = filled(0, np.uint16, count)
        self._fired = 0
        """An upper bound of the firings of any robot."""
        self._fresh: NDArray[np.uint8] = filled(0, np.uint8, count)
        self._counted = 0
        self._in_row: NDArray[np.int8] | None = None
        """Allocated by the first fault."""
        self._failed_at: Column | None = None
        """When each robot had its last fault, s; not part of the state, since only people are told."""
        self.last_fault = NO_FAULTS
        self._sink = ResultColumns(self.last_value, self._fresh, None)

    def sink(self, *, steps: bool) -> ResultColumns:
        """The columns that native code writes. steps: whether it writes them too."""
        if steps and self._sink.steps is None:
            self._sink = self._sink._replace(steps=self.own_steps())
        return self._sink

    # ---- steps

    def steps(self, rows: Rows) -> NDArray[np.uint16] | int:
        """Steps of the last evaluation of each of these robots, or one number if all are equal."""
        return self._steps if isinstance(self._steps, int) else self._steps[rows.index]

    def steps_of(self, robot: int) -> int:
        return self._steps if isinstance(self._steps, int) else int(self._steps[robot])

    def used(self, steps: NDArray[np.int32] | int, rows: Rows) -> None:
        """Store the steps that these robots have used, an array or one number for all."""
        if isinstance(steps, int) and rows.size == len(self._fresh):
            self._steps = steps
            if self._sink.steps is not None:
                self._sink = self._sink._replace(steps=None)
        elif not (isinstance(steps, int) and isinstance(self._steps, int) and self._steps == steps):
            self.own_steps()[rows.index] = steps

    def own_steps(self) -> NDArray[np.uint16]:
        """A column of steps, allocated now if one number stood for all until now."""
        if isinstance(self._steps, int):
            self._steps = filled(self._steps, np.uint16, len(self._fresh))
        return self._steps

    # ---- firings

    @property
    def firings(self) -> NDArray[np.uint16 | np.uint32]:
        """Number of matches of each robot."""
        if self._counted:
            self._gather()
        return self._firings

    def _gather(self) -> None:
        """Add the matches that native code has counted."""
        self._count(slice(None), self._fresh, self._counted)
        self._fresh[...] = 0
        self._counted = 0

    def fired(self, rows: Rows, matched: Mask) -> None:
        """Count one more match on those of these robots that are `matched`."""
        self._count(rows.index, matched.view(np.uint8), 1)

    def _count(self, index: slice | Index, more: NDArray[np.uint8], most: int) -> None:
        """Add to firings. most: upper bound of `more`."""
        if self._fired + most > NARROW and self._firings.dtype == np.uint16:
            self._fired = int(self._firings.max(initial=0))
            if self._fired + most > NARROW:
                self._firings = self._firings.astype(np.uint32)
        self._fired += most
        self._firings[index] += more

    # ---- faults

    @property
    def faulted(self) -> bool:
        """Whether any evaluation has ever had a fault: until then nothing needs counting."""
        return self._in_row is not None

    def in_row(self, rows: Rows) -> NDArray[np.int8]:
        """Number of consecutive evaluations with a fault, for each of these robots."""
        return np.zeros(rows.size, np.int8) if self._in_row is None else self._in_row[rows.index]

    def failing(self, since: float) -> Index:
        """The robots whose last evaluation had a fault, or one at this time (s) or later, ascending."""
        if self._in_row is None:
            return np.zeros(0, np.intp)
        failing = self._in_row > 0
        return np.flatnonzero(failing if self._failed_at is None else failing | (self._failed_at >= since))

    def failed(self, rows: Rows, faulted: Mask, now: Column) -> None:
        """Count an evaluation on these robots; `faulted` marks those where it had a fault. now: their times, s."""
        if self._in_row is None:
            self._in_row = np.zeros(len(self._fresh), np.int8)
        if self._failed_at is None:
            self._failed_at = filled(-inf, np.float64, len(self._fresh))
        self._failed_at[rows.take(faulted).index] = now[faulted]
        self._in_row[rows.index] = np.where(faulted, np.minimum(self._in_row[rows.index], 100) + 1, 0)

    # ---- what happens to an expression

    def ran(self, steps: int, rows: Rows, *, stored: bool) -> None:
        """Native code has evaluated the rule on these robots, without a fault. steps: an upper bound; stored: whether
        the native code has stored each robot's steps, otherwise all have used the bound."""
        if not stored:
            self.used(steps, rows)
        if steps > self.most_steps:
            self.most_steps = max(self.most_steps, int(np.max(self.steps(rows), initial=0)))
        self._counted += 1
        if self._counted == MAX_FRESH:
            self._gather()
        if self._in_row is not None and self._in_row[rows.index].any():
            self._in_row[rows.index] = 0

    @property
    def uncounted(self) -> int:
        """How many evaluations by native code may follow before their matches are added up."""
        return MAX_FRESH - self._counted

    def ran_often(self, times: int) -> None:
        """Native code has evaluated the rule on all robots so many times, at most `uncounted` ones, without a fault."""
        self._counted += times
        if self._counted == MAX_FRESH:
            self._gather()

    def ran_alike(self, steps: int, most: int | None) -> None:
        """What these evaluations have come to besides. most: the most steps that any robot has used, where the code has
        stored them; None: all have used `steps`."""
        if most is None:
            self.used(steps, Rows.run(0, len(self._fresh)))
        self.most_steps = max(self.most_steps, steps if most is None else most)
        if self._in_row is not None:
            self._in_row[:] = 0

    def renew(self, rows: Rows) -> None:
        """The expression was replaced: reset the results of its last evaluation."""
        self.last_value[rows.index] = nan
        if self._in_row is not None:
            self._in_row[rows.index] = 0
        if self._failed_at is not None:
            self._failed_at[rows.index] = -inf
        if self.last_fault:
            for robot in rows.robots.tolist():
                self.last_fault.pop(robot, None)

    def begin(self, rows: Rows) -> None:
        """The expression is new on these robots."""
        self.renew(rows)
        self.used(0, rows)
        self.firings[rows.index] = 0

    # ---- saving and restoring

    def state(self) -> RuleStatisticsState:
        everybody = Rows.run(0, len(self._fresh))
        steps = np.broadcast_to(np.asarray(self.steps(everybody), np.uint16), everybody.size)
        firings, in_row = self.firings.astype(np.int32), self.in_row(everybody)
        arrays: dict[str, NDArray[np.generic]] = {
            "last_value": self.last_value,
            "steps": steps,
            "firings": firings,
            "in_row": in_row,
        }
        return RuleStatisticsState(dump_arrays(arrays), self.most_steps, self.faulted, dict(self.last_fault))

    def restore(self, state: RuleStatisticsState) -> None:
        """Restore these statistics. Raises SerialError."""
        count = len(self._fresh)
        steps, firings = np.zeros(count, np.uint16), np.zeros(count, np.int32)
        in_row = np.zeros(count, np.int8)
        load_arrays(state.arrays, {"last_value": self.last_value, "steps": steps, "firings": firings, "in_row": in_row})
        if not all(0 <= robot < count for robot in state.last_fault):
            raise SerialError("the fault of a robot that is not there")
        within(firings, 0, inf, "how often an expression has matched")
        self._steps = int(steps[0]) if (steps == steps[0]).all() else steps
        self._fired = int(firings.max())
        self._firings = firings.astype(np.uint16 if self._fired <= NARROW else np.uint32)
        self._in_row = in_row if state.faulted else None
        self.most_steps, self.last_fault = state.most_steps, dict(state.last_fault)


class StatisticsTable:
    """All rule statistics, leases (end in s, inf for none) and, during a round, which expressions robots have lost in
    it."""

    def __init__(self, state: FleetState) -> None:
        self._state = state
        self._tallies: dict[str, RuleStatistics] = {}
        self.leases: dict[str, Column] = {}
        self.proven_leases: dict[str, Column] = {}
        self.lost: dict[str, Mask] = {}
        self.changes = 0
        """How often statistics have changed otherwise than by native code that has evaluated rules on all robots."""

    def __getitem__(self, key: str) -> RuleStatistics:
        statistics = self._tallies.get(key)
        if statistics is None:
            statistics = self._tallies[key] = RuleStatistics(self._state.count)
        return statistics

    def faulted(self) -> list[str]:
        """The keys of expressions that have ever had a fault on any robot."""
        return [key for key, tally in self._tallies.items() if tally.faulted]

    def keep_only(self, keys: set[str]) -> None:
        """Drop the columns of expressions that no robot stores any more."""
        self.changes += 1
        for columns in (self._tallies, self.leases):
            for key in [key for key in columns if key not in keys]:
                del columns[key]

    def lease(self, key: str, rows: Rows, until: Column | float) -> None:
        """Set the time at which an expression is deactivated."""
        self._lease_column(self.leases, key)[rows.index] = until

    def prove(self, rows: Rows) -> None:
        """Remember the current leases for a rollback."""
        for key in self.leases.keys() | self.proven_leases.keys():
            column = self.leases.get(key)
            now: Column | float = inf if column is None else column[rows.index]
            self._lease_column(self.proven_leases, key)[rows.index] = now

    def restore_lease(self, key: str, rows: Rows) -> None:
        """Restore a remembered lease."""
        column = self.proven_leases.get(key)
        if column is not None:
            self.lease(key, rows, column[rows.index])

    def _lease_column(self, columns: dict[str, Column], key: str) -> Column:
        column = columns.get(key)
        if column is None:
            column = columns[key] = np.full(self._state.count, inf)
        return column

    def turn_over(self, parents: Index, children: Index, dead: Index) -> None:
        """Children begin with their parents' leases, and count anew; nothing is left of the dead."""
        self.changes += 1
        for tally in self._tallies.values():
            tally.begin(Rows.of(np.sort(np.concatenate((children, dead)))))
        for columns in (self.leases, self.proven_leases):
            for column in columns.values():
                column[children], column[dead] = column[parents], inf

    def lost_in_round(self, key: str, rows: Rows) -> Mask | None:
        """Which of the rows have lost this expression since the round began, None if none has."""
        lost = self.lost.get(key)
        return None if lost is None else lost[rows.index]

    def apply(self, effects: Sequence[Effect], rows: Rows) -> None:
        """Apply the effects of a change of mind to each of these robots."""
        self.changes += 1
        for effect in effects:
            key = effect.key
            if effect.what == "new":
                self[key].begin(rows)
            elif effect.what == "renewed":
                self[key].renew(rows)
            elif effect.what == "gone":
                lost = self.lost.get(key)
                if lost is None:
                    lost = self.lost[key] = np.zeros(self._state.count, np.bool_)
                lost[rows.index] = True
            elif effect.what in ("active", "inactive"):
                active, buffer = effect.what == "active", buffer_number(key)
                if buffer is not None:
                    self._state.assign(ACTIVE0 + buffer, rows, 1.0 if active else 0.0)
                if not active and key in self.leases:
                    self.leases[key][rows.index] = inf

    def state(self) -> StatisticsState:
        """All statistics between two rounds."""
        tallies = {key: tally.state() for key, tally in self._tallies.items()}
        return StatisticsState(tallies, dump_arrays(self.leases), dump_arrays(self.proven_leases))

    def restore(self, state: StatisticsState) -> None:
        """Restore these statistics. Raises SerialError."""
        self.changes += 1
        self._tallies.clear()
        for key, tally in state.tallies.items():
            self[key].restore(tally)
        self.leases, self.proven_leases = self._columns(state.leases), self._columns(state.proven_leases)

    def _columns(self, state: Arrays) -> dict[str, Column]:
        shape = (self._state.count,)
        return {key: leases.made(np.float64, shape, f"leases of {key}") for key, leases in state.items()}
