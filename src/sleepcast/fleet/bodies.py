"""What a fleet itself asks of its robots' bodies - to stop, to be released, to hold still while a robot sleeps or is
frozen - many at once where the bodies allow it.

STOP and RELEASE may arrive late and out of order: each robot obeys them as a node does, by its `Latch`; robots that
have received the same ones share a latch. So do what a robot is in doubt of, and when what holds it has arrived.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

import numpy as np

from sleepcast.channel.message import Message
from sleepcast.columns.values import Column, Index, Mask, Rows
from sleepcast.core.arrays import filled
from sleepcast.core.model import RestState
from sleepcast.fleet.authority import FleetAuthority
from sleepcast.fleet.state import FleetState
from sleepcast.language.vocabulary import FROZEN, SLEEPING, TIME_SLOT
from sleepcast.mind.authority import Latch, Life, outlasts, stops_told
from sleepcast.robot import Failsafe, RestSensing, Robot


@runtime_checkable
class ManyBodies(Protocol):
    """Bodies, by the robots' indices, that can be commanded many at once. See `Robot` for what each method does."""

    def stop(self, robots: Index, /) -> None: ...

    def release(self, robots: Index, /) -> None: ...

    def let_go(self, robots: Index, /) -> None:
        """See `Failsafe`."""

    def hold(self, robots: Index, still: Mask, /) -> None: ...


@runtime_checkable
class ManyRestSensing(Protocol):
    """Bodies that know many at once whether they have come to rest."""

    def rest_states(self, robots: Index, /) -> tuple[Column, Column]:
        """See `RestState`: speeds and distances."""


class FleetBodies:
    """The bodies of a fleet's robots. bodies: `ManyBodies`, or a list of bodies, each possibly a `Robot`."""

    def __init__(self, state: FleetState, bodies: Sequence[object | None], authority: FleetAuthority) -> None:
        self._state, self._bodies, self._authority = state, bodies, authority
        self.arrived: dict[Life, Column] = {}
        """When the latest STOP of each sender that holds any robot has arrived there, s."""
        self._many = bodies if isinstance(bodies, ManyBodies) else None
        self._telling = bodies if isinstance(bodies, ManyRestSensing) else None

    def obey_stop(self, message: Message, rows: Rows) -> tuple[Rows, Rows]:
        """Stop these robots; returns those that have stopped, and those for which a later RELEASE already ended it."""
        stopped = np.zeros(rows.size, np.bool_)
        for latch, some, mask in self._state.latch.divide(rows):
            after = latch.stop(message)
            stopped[... if mask is None else mask] = after is not None
            if after is None:
                continue
            when = message.heard if message.heard is not None else self._state.read(TIME_SLOT, some)
            for life in after.begun(latch, message):
                if life not in self.arrived:
                    self.arrived[life] = filled(0.0, np.float64, self._state.count)
                self.arrived[life][some.index] = when
            self._state.latch.set(some, after)
        self._forget_arrivals()
        self.halt(rows.take(stopped))
        return rows.take(stopped), rows.take(~stopped)

    def begin(self, latch: Latch, rows: Rows, now: float) -> None:
        """These robots begin with this latch, and are stopped if any STOP holds it."""
        self._state.latch.set(rows, latch)
        for mark in latch.holding:
            self.arrived.setdefault(mark.life, filled(0.0, np.float64, self._state.count))[rows.index] = now
        if latch.holding:
            self.halt(rows)

    def _forget_arrivals(self) -> None:
        holding = {mark.life for latch in self._state.latch.values for mark in latch.holding}
        for life in self.arrived.keys() - holding:
            del self.arrived[life]

    def stops(self, robot: int, now: float) -> list[list[object]]:
        """What one robot tells of the STOPs that hold it: see `stops_told`."""
        arrived = self.arrived
        return stops_told(
            self._state.latch.of(robot), lambda life: float(arrived[life][robot]) if life in arrived else 0.0, now
        )

    def obey_release(self, message: Message, rows: Rows) -> tuple[Rows, list[tuple[Rows, str]]]:
        """Release these robots; returns those that are free, and those that are not, each group with the reason."""
        free, refused = np.zeros(rows.size, np.bool_), []
        for doubt, some, _ in self._authority.doubts.divide(rows):
            if refusal := outlasts(doubt, message):
                refused.append((some, refusal))
                continue
            for latch, few, _ in self._state.latch.divide(some):
                after = latch.release(message) or latch
                self._state.latch.set(few, after)
                if after is latch or after.holding:
                    refused.append((few, after.refusal()))
                else:
                    free[rows.indices_of(few.robots)] = True
        self._forget_arrivals()
        self._release(rows.take(free))
        return rows.take(free), refused

    def halt(self, rows: Rows, doubt: str = "") -> None:
        """See `Node.halt`."""
        self._authority.doubts.set(rows, doubt)
        self._stop(rows)

    def let_go(self, rows: Rows) -> Rows:
        """Bring the bodies of these robots, whose operators are gone, to rest; gives those that were not stopped
        anyway."""
        for robots in self._state.actuated.values():
            robots[rows.index] = False
        moving = rows.take(~self._state.stopped[rows.index])
        if self._many is not None:
            self._many.let_go(moving.robots)
            return moving
        for body in map(self._bodies.__getitem__, moving.robots.tolist()):
            if isinstance(body, Failsafe):
                body.let_go()
            elif isinstance(body, Robot):
                body.stop()
                body.release()
        return moving

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
        """Undo `halt` for these robots."""
        self._authority.doubts.set(rows, "")
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
        inactive = np.greater(asleep, 0.0) | np.greater(frozen, 0.0)
        return np.broadcast_to(inactive, rows.size) if inactive.any() else None

    def hold(self, rows: Rows) -> None:
        """Robots that rest or catch up hold their bodies still, others do not."""
        state, resting, behind = self._state, self.resting(rows), self._authority.behind(rows)
        if resting is None and behind.size == 0 and not state.still.any():
            return
        now = np.zeros(rows.size, np.bool_) if resting is None else resting.copy()
        now[rows.indices_of(behind.robots)] = True
        changed = rows.take(now != state.still[rows.index])
        if changed.size == 0:
            return
        state.still[rows.index] = now
        still = state.still[changed.index]
        if self._many is not None:
            self._many.hold(changed.robots, still)
            return
        for robot, one in zip(changed.robots.tolist(), still.tolist(), strict=True):
            body = self._bodies[robot]
            if isinstance(body, Robot):
                body.hold(one)
