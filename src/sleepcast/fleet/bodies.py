"""What a fleet itself asks of its robots' bodies - to stop, to be released, to hold still while a robot sleeps or is
frozen - many at once where the bodies allow it.

STOP and RELEASE may arrive late and out of order: each robot obeys them as a node does, by its `Latch`; robots that
have received the same ones share a latch.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Protocol, runtime_checkable

import numpy as np

from sleepcast.channel.message import Message
from sleepcast.core.model import RestState
from sleepcast.fleet.state import Column, FleetState, Index, Mask, Rows
from sleepcast.language.vocabulary import FROZEN, SLEEPING
from sleepcast.mind.authority import Latch
from sleepcast.robot import RestSensing, Robot

MAX_LATCHES = 16
"""Stored latches above which those that no robot has any more are removed."""


@runtime_checkable
class ManyBodies(Protocol):
    """Bodies, by the robots' indices, that can be commanded many at once. See `Robot` for what each method does."""

    def stop(self, robots: Index, /) -> None: ...

    def release(self, robots: Index, /) -> None: ...

    def hold(self, robots: Index, still: Mask, /) -> None: ...


@runtime_checkable
class ManyRestSensing(Protocol):
    """Bodies that know many at once whether they have come to rest."""

    def rest_states(self, robots: Index, /) -> tuple[Column, Column]:
        """See `RestState`: speeds and distances."""


class FleetBodies:
    """The bodies of a fleet's robots. bodies: `ManyBodies`, or a list of bodies, each possibly a `Robot`."""

    def __init__(self, state: FleetState, bodies: Sequence[object | None]) -> None:
        self._state, self._bodies = state, bodies
        self._many = bodies if isinstance(bodies, ManyBodies) else None
        self._telling = bodies if isinstance(bodies, ManyRestSensing) else None
        self._any_still = False
        """Whether any body is held still."""

    def obey_stop(self, message: Message, rows: Rows) -> tuple[Rows, Rows]:
        """Stop these robots; returns those that have stopped, and those for which a later RELEASE already ended it."""
        stopped = np.zeros(rows.size, np.bool_)
        for some, found in self._latched(rows, lambda latch: latch.stop(message)):
            stopped[some] = found is not None
        self._stop(rows.take(stopped))
        return rows.take(stopped), rows.take(~stopped)

    def obey_release(self, message: Message, rows: Rows) -> tuple[Rows, list[tuple[Rows, str]]]:
        """Release these robots; returns those that are free, and those that are not, each group with the reason."""
        free, refused = np.zeros(rows.size, np.bool_), []
        for some, found in self._latched(rows, lambda latch: latch.release(message)):
            free[some] = found is not None and not found.holding
            if found is None or found.holding:
                refused.append((rows.take(some), self._latch_of(rows.take(some)).refusal()))
        self._release(rows.take(free))
        return rows.take(free), refused

    def _latch_of(self, rows: Rows) -> Latch:
        """The latch of the first of these robots."""
        return self._state.latches[int(self._state.latch[rows.index][0])]

    def _latched(self, rows: Rows, order: Callable[[Latch], Latch | None]) -> Iterator[tuple[Mask, Latch | None]]:
        """Replace each robot's latch by what `order` makes of it, and yield the robots of each old latch with their new
        one, or None."""
        state = self._state
        before = state.latch[rows.index].copy()
        for number in np.flatnonzero(np.bincount(before)).tolist():
            some, found = before == number, order(state.latches[number])
            if found is not None:
                if found not in state.latches:
                    state.latches.append(found)
                state.latch[rows.take(some).index] = state.latches.index(found)
            yield some, found
        if len(state.latches) > MAX_LATCHES:  # most belong to robots that had not received this message yet
            numbers, state.latch[:] = np.unique(state.latch, return_inverse=True)
            state.latches = [state.latches[number] for number in numbers.tolist()]

    def _stop(self, rows: Rows) -> None:
        """Stop these robots; if the body has no latch of its own, functions that act are refused instead."""
        self._state.stopped[rows.index] = True
        if self._many is not None:
            self._many.stop(rows.robots)
            return
        for robot in rows.robots.tolist():
            body = self._bodies[robot]
            if isinstance(body, Robot):
                body.stop()
            else:
                self._state.held[robot] = True

    def _release(self, rows: Rows) -> None:
        """Undo `_stop` for these robots."""
        self._state.stopped[rows.index] = self._state.held[rows.index] = False
        if self._many is not None:
            self._many.release(rows.robots)
            return
        for body in map(self._bodies.__getitem__, rows.robots.tolist()):
            if isinstance(body, Robot):
                body.release()

    def rest_states(self, robots: Index) -> tuple[Column, Column] | None:
        """Speeds and distances of these robots, see `RestState`; None if such bodies do not tell."""
        return None if self._telling is None else self._telling.rest_states(robots)

    def rest_state(self, robot: int) -> RestState | None:
        """Whether one body has come to rest; None if it does not tell."""
        body = self._bodies[robot]
        return body.rest_state() if isinstance(body, RestSensing) else None

    def resting(self, rows: Rows) -> Mask | None:
        """Which of these robots sleep or are frozen, None if none of them does."""
        asleep, frozen = self._state.read(SLEEPING, rows), self._state.read(FROZEN, rows)
        if isinstance(asleep, float) and isinstance(frozen, float) and not (asleep > 0.0 or frozen > 0.0):
            return None  # one number for all: the most common case
        found = np.greater(asleep, 0.0) | np.greater(frozen, 0.0)
        return np.broadcast_to(found, rows.size) if found.any() else None

    def hold(self, rows: Rows) -> None:
        """Resting robots hold their bodies still, others do not."""
        state, resting = self._state, self.resting(rows)
        if resting is None and not self._any_still:
            return
        now = np.zeros(rows.size, np.bool_) if resting is None else resting
        changed = rows.take(now != state.still[rows.index])
        if changed.size == 0:
            return
        state.still[rows.index] = now
        self._any_still = bool(state.still.any())
        still = state.still[changed.index]
        if self._many is not None:
            self._many.hold(changed.robots, still)
            return
        for robot, one in zip(changed.robots.tolist(), still.tolist(), strict=True):
            body = self._bodies[robot]
            if isinstance(body, Robot):
                body.hold(one)
