"""Tallies: how each kept expression has fared on each robot, and when its lease ends, as columns by its key."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, nan

import numpy as np
from numpy.typing import NDArray

from sleepcast.fleet.columns import Column, FleetState, Mask, Rows
from sleepcast.fleet.minds import Effect
from sleepcast.fleet.native import Sink
from sleepcast.fleet.parcels import TalliesParcel, TallyParcel
from sleepcast.language.vocabulary import ACTIVE0, buffer_number
from sleepcast.parcel import Arrays, ParcelError, kept, put_back

MOST_FRESH = 255
"""Evaluations by native code until their matches, counted in single bytes, are added to the others."""


class Tally:
    """One key's columns: last value, steps of the last evaluation, firings, faults in a row; texts of last faults.

    sink: those that native code writes.
    """

    def __init__(self, count: int) -> None:
        self.last_value: Column = np.full(count, nan)
        self.steps: NDArray[np.uint16] = np.zeros(count, np.uint16)
        self.most_steps = 0
        """No robot has used more steps in an evaluation."""
        self._firings: NDArray[np.int32] = np.zeros(count, np.int32)
        self._fresh: NDArray[np.uint8] = np.zeros(count, np.uint8)
        self._counted = 0
        self.in_row: NDArray[np.int8] = np.zeros(count, np.int8)
        self.faulted = False
        """Whether any evaluation has ever had a fault: until then nothing has to be counted."""
        self.last_fault: dict[int, str] = {}
        self.sink = Sink(self.last_value, self._fresh, self.steps)

    @property
    def firings(self) -> NDArray[np.int32]:
        """How often each robot has matched."""
        if self._counted:
            self._add_fresh()
        return self._firings

    def _add_fresh(self) -> None:
        self._firings += self._fresh
        self._fresh[...] = 0
        self._counted = 0

    def ran(self, steps: int, rows: Rows) -> None:
        """Native code has evaluated the expression on these robots, without a fault. steps: at most, of one of them."""
        if steps > self.most_steps:
            self.most_steps = max(self.most_steps, int(self.steps[rows.index].max(initial=0)))
        self._counted += 1
        if self._counted == MOST_FRESH:
            self._add_fresh()
        if self.faulted and self.in_row[rows.index].any():
            self.in_row[rows.index] = 0

    def renew(self, rows: Rows) -> None:
        """The expression is another one now: nothing is known of its last evaluation."""
        self.last_value[rows.index] = nan
        self.in_row[rows.index] = 0
        if self.last_fault:
            for robot in rows.robots.tolist():
                self.last_fault.pop(robot, None)

    def begin(self, rows: Rows) -> None:
        """The expression has just come to these robots."""
        self.renew(rows)
        self.steps[rows.index] = 0
        self.firings[rows.index] = 0

    def state(self) -> TallyParcel:
        return TallyParcel(kept(self._arrays()), self.most_steps, self.faulted, dict(self.last_fault))

    def restore(self, parcel: TallyParcel) -> None:
        """Be as that tally was. Raises ParcelError."""
        put_back(parcel.arrays, self._arrays())
        if not all(0 <= robot < len(self.steps) for robot in parcel.last_fault):
            raise ParcelError("the fault of a robot that is not there")
        self.most_steps, self.faulted, self.last_fault = parcel.most_steps, parcel.faulted, dict(parcel.last_fault)

    def _arrays(self) -> dict[str, NDArray[np.generic]]:
        return {
            "last_value": self.last_value,
            "steps": self.steps,
            "firings": self.firings,
            "in_row": self.in_row,
        }


class Tallies:
    """All tallies, leases (s, inf for none) and, while a round runs, which expressions robots have lost in it."""

    def __init__(self, state: FleetState) -> None:
        self._state = state
        self._tallies: dict[str, Tally] = {}
        self.leases: dict[str, Column] = {}
        self.proven_leases: dict[str, Column] = {}
        self.lost: dict[str, Mask] = {}

    def __getitem__(self, key: str) -> Tally:
        found = self._tallies.get(key)
        if found is None:
            found = self._tallies[key] = Tally(self._state.count)
        return found

    def keep_only(self, keys: set[str]) -> None:
        """Forget the columns of expressions that no robot keeps any more."""
        for columns in (self._tallies, self.leases):
            for key in [key for key in columns if key not in keys]:
                del columns[key]

    def lease(self, key: str, rows: Rows, until: Column | float) -> None:
        """Set the time at which an expression is deactivated."""
        self._lease_column(self.leases, key)[rows.index] = until

    def prove(self, rows: Rows) -> None:
        """Remember the leases as they are, to come back to them."""
        for key in self.leases.keys() | self.proven_leases.keys():
            column = self.leases.get(key)
            now: Column | float = inf if column is None else column[rows.index]
            self._lease_column(self.proven_leases, key)[rows.index] = now

    def restore_lease(self, key: str, rows: Rows) -> None:
        """Bring a lease back."""
        column = self.proven_leases.get(key)
        if column is not None:
            self.lease(key, rows, column[rows.index])

    def _lease_column(self, columns: dict[str, Column], key: str) -> Column:
        found = columns.get(key)
        if found is None:
            found = columns[key] = np.full(self._state.count, inf)
        return found

    def lost_in_round(self, key: str, rows: Rows) -> Mask | None:
        """Which of the rows have lost this expression since the round began, None if none has."""
        lost = self.lost.get(key)
        return None if lost is None else lost[rows.index]

    def carry_out(self, effects: Sequence[Effect], rows: Rows) -> None:
        """Do to each of these robots what a change of mind says."""
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
            else:
                self._activate(key, rows, effect.what == "active")

    def _activate(self, key: str, rows: Rows, active: bool) -> None:
        number = buffer_number(key)
        if number is not None:
            self._state.assign(ACTIVE0 + number, rows, 1.0 if active else 0.0)
        if not active and key in self.leases:
            self.leases[key][rows.index] = inf

    def state(self) -> TalliesParcel:
        """All of it between two rounds."""
        tallies = {key: tally.state() for key, tally in self._tallies.items()}
        return TalliesParcel(tallies, kept(self.leases), kept(self.proven_leases))

    def restore(self, parcel: TalliesParcel) -> None:
        """Be as those tallies were. Raises ParcelError."""
        self._tallies.clear()
        for key, tally in parcel.tallies.items():
            self[key].restore(tally)
        self.leases, self.proven_leases = self._columns(parcel.leases), self._columns(parcel.proven_leases)

    def _columns(self, parcel: Arrays) -> dict[str, Column]:
        shape = (self._state.count,)
        return {key: leases.made(np.float64, shape, f"leases of {key}") for key, leases in parcel.items()}
