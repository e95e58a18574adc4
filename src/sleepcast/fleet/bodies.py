"""Bodies: what a fleet asks of its robots' bodies by itself - to stop, to be let go, to keep still while a robot sleeps
or is frozen - of many at once where they can be asked so.

STOP and RELEASE may come late, and in another order than they were sent in: each robot obeys them as a node does, see
`node.authority`."""

from __future__ import annotations

from collections.abc import Sequence
from math import inf
from typing import Protocol, runtime_checkable

import numpy as np

from sleepcast.channel.bodies import age_of
from sleepcast.channel.message import Message
from sleepcast.fleet.columns import FleetState, Index, Mask, Rows
from sleepcast.fleet.limits import MAX_SKEW
from sleepcast.language.vocabulary import FROZEN, SLEEPING, TIME_SLOT
from sleepcast.robot import Robot


@runtime_checkable
class ManyBodies(Protocol):
    """Bodies, by the robots' indices, of which many can be asked at once. See `Robot` for what each does."""

    def stop(self, robots: Index, /) -> None: ...

    def release(self, robots: Index, /) -> None: ...

    def hold(self, robots: Index, still: Mask, /) -> None: ...


class Embodied:
    """The bodies of a fleet's robots. bodies: `ManyBodies`, or one by one what may be a `Robot`."""

    def __init__(self, state: FleetState, bodies: Sequence[object | None]) -> None:
        self._state, self._bodies = state, bodies
        self._many = bodies if isinstance(bodies, ManyBodies) else None
        self._any_still = False
        """Whether any body is held still."""

    def obey_stop(self, message: Message, rows: Rows) -> Mask:
        """Stop these robots, unless the message is sent again for others and was decided so long before a RELEASE that
        was obeyed that no clocks can be wrong by as much; gives which have stopped."""
        age, state = age_of(message.body), self._state
        obeyed = np.ones(rows.size, np.bool_)
        if age not in (0.0, inf):
            obeyed = message.issued - age > state.order("released")[rows.index] - 2.0 * MAX_SKEW
        some = rows.take(obeyed)
        latest = state.order("stopped")
        latest[some.index] = np.maximum(latest[some.index], message.issued)
        self._stop(some)
        return obeyed

    def obey_release(self, message: Message, rows: Rows) -> Mask:
        """Release those of these robots that have obeyed no STOP which was sent after this was decided; gives which."""
        decided, state = message.issued - age_of(message.body), self._state
        obeyed: Mask = decided >= state.order("stopped")[rows.index]
        some = rows.take(obeyed)
        latest = state.order("released")
        latest[some.index] = np.maximum(latest[some.index], np.minimum(decided, state.column(TIME_SLOT, some)))
        self._release(some)
        return obeyed

    def _stop(self, rows: Rows) -> None:
        """Stop these robots; where the body has no latch of its own, functions that act are refused instead."""
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
        """End `_stop` for these robots."""
        self._state.stopped[rows.index] = self._state.held[rows.index] = False
        if self._many is not None:
            self._many.release(rows.robots)
            return
        for body in map(self._bodies.__getitem__, rows.robots.tolist()):
            if isinstance(body, Robot):
                body.release()

    def resting(self, rows: Rows) -> Mask | None:
        """Which of these robots sleep or are frozen, None if none of them."""
        asleep, frozen = self._state.read(SLEEPING, rows), self._state.read(FROZEN, rows)
        if isinstance(asleep, float) and isinstance(frozen, float) and not (asleep > 0.0 or frozen > 0.0):
            return None  # one number for all, as nearly always
        found = np.greater(asleep, 0.0) | np.greater(frozen, 0.0)
        return np.broadcast_to(found, rows.size) if found.any() else None

    def hold(self, rows: Rows) -> None:
        """Robots that rest keep their bodies still, others do not."""
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
