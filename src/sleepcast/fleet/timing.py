"""The commands that wait in many robots for their instants: what `node.timing` does for one, in the same order and with
the same answers. A command that robots have heard together waits once for all of them.

All clocks of one run show the same time, so whether a command is due depends on no robot. Nothing here takes memory
before the first STOP or the first such command.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import inf

import numpy as np
from numpy.typing import NDArray

from sleepcast.channel.message import BOUND, WAITING, Message
from sleepcast.channel.message_batch import ascending
from sleepcast.columns.values import Column, Index, Mask, Rows
from sleepcast.core.serial import Array, SerialError
from sleepcast.fleet.messages import Outbox
from sleepcast.fleet.schema import TimingState
from sleepcast.fleet.state import FleetState
from sleepcast.language.parts import Timed
from sleepcast.language.vocabulary import TIME_SLOT
from sleepcast.mind.instants import (
    CANCEL_DISCARDED,
    HELD_UNTIL,
    MAX_WAITING,
    STOP_DISCARDED,
    TOO_LATE,
    TOO_MANY_WAIT,
    EqualClocks,
    Timeliness,
    WaitingCommand,
)

Obeys = Callable[[Message, Rows, float, Mapping[str, object]], None]
"""Evaluates a message on robots at a time, s, and answers with these details."""


class FleetTiming:
    """See the module. held_still: which robots are stopped or catch up; obeys: see `Obeys`; tick: s of one."""

    def __init__(self, state: FleetState, outbox: Outbox, held_still: Callable[[Rows], Mask], obeys: Obeys) -> None:
        self._state, self._count, self._outbox = state, state.count, outbox
        self._held_still, self._obeys = held_still, obeys
        self.tick = 0.1
        self._clocks = EqualClocks()
        self._waiting: list[tuple[WaitingCommand, Index]] = []
        self._gone: list[tuple[WaitingCommand, str, Index]] = []
        self._stopped: Column | None = None

    @property
    def is_busy(self) -> bool:
        """Whether anything waits on any robot."""
        return bool(self._waiting) or bool(self._gone)

    @property
    def busy(self) -> NDArray[np.bool_]:
        """On which robots."""
        busy = np.zeros(self._count, np.bool_)
        for robots in (*(each[-1] for each in self._waiting), *(each[-1] for each in self._gone)):
            busy[robots] = True
        return busy

    @property
    def due(self) -> float:
        """When there is something to do next, s; inf for never."""
        return -inf if self._gone else min((each.instant for each, _ in self._waiting), default=inf)

    def hear(self, message: Message, timed: Timed, rows: Rows, now: float) -> None:
        """See `TimedCommands.hear`."""
        command = WaitingCommand.of(message, timed)
        moment = self._moment(command, now, waited=False)
        held = self._held_still(rows)
        full = self._counts()[rows.index] >= MAX_WAITING
        self._fault(command, rows.take(held), HELD_UNTIL)
        self._fault(command, rows.take(full & ~held), TOO_MANY_WAIT)
        rows = rows.take(~(held | full))
        if moment is not Timeliness.AHEAD:
            self._settle(command, moment, rows, now)
        elif rows.size:
            self._waiting.append((command, rows.robots))
            self._outbox.answer_alike(message, rows, WAITING)

    def run(self, rows: Rows, now: float) -> None:
        """See `TimedCommands.tick_at`, on these robots."""
        for command, why, robots in self._taken_gone(rows):
            self._fault(command, Rows.of(robots), why)
        for command in sorted((each for each, _ in self._waiting), key=lambda each: each.instant):
            moment = self._moment(command, now, waited=True)
            if moment is not Timeliness.AHEAD:
                self._settle(command, moment, self._take(command, rows), now)

    def stop(self, rows: Rows, message: Message) -> None:
        """STOP: nothing waits on these robots any more."""
        if self._stopped is None:
            self._stopped = np.full(self._count, -inf)
        self._stopped[rows.index] = self._state.read(TIME_SLOT, rows) if message.heard is None else message.heard
        self.discard(rows, STOP_DISCARDED)

    def discard(self, rows: Rows, why: str, sender: str | None = None) -> Column:
        """Discard what waits on these robots, None: whoever has sent it; gives how many there were on each. They answer
        with the reason in the next tick."""
        counts, left = np.zeros(self._count), list[tuple[WaitingCommand, Index]]()
        for command, robots in self._waiting:
            chosen = np.isin(robots, rows.robots) if sender in (None, command.message.sender) else np.zeros(1, np.bool_)
            if chosen.any():
                counts[robots[chosen]] += 1.0
                self._gone.append((command, why, robots[chosen]))
                robots = robots[~chosen]
            if len(robots):
                left.append((command, robots))
        self._waiting = left
        return counts[rows.index]

    def turn_over(self, parents: Index, children: Index, dead: Index) -> None:
        """Other robots, or none, are in these rows from now on, for which nothing waits."""
        changed = np.concatenate((children, dead))
        left = ((each, robots[~np.isin(robots, changed)]) for each, robots in self._waiting)
        self._waiting = [(each, robots) for each, robots in left if robots.size]
        gone = ((each, why, robots[~np.isin(robots, changed)]) for each, why, robots in self._gone)
        self._gone = [(each, why, robots) for each, why, robots in gone if robots.size]
        if self._stopped is not None:
            self._stopped[children], self._stopped[dead] = self._stopped[parents], -inf

    def cancel(self, rows: Rows, sender: str) -> Column:
        """See `TimedCommands.cancel`."""
        return self.discard(rows, CANCEL_DISCARDED, sender)

    def _moment(self, command: WaitingCommand, now: float, *, waited: bool) -> Timeliness:
        return command.moment(now, self.tick, self._clocks.of(command.message.sender, now), waited=waited)

    def _counts(self) -> NDArray[np.int64]:
        """How many commands wait on each robot."""
        counts = np.zeros(self._count, np.int64)
        for _, robots in self._waiting:
            counts[robots] += 1
        return counts

    def _take(self, command: WaitingCommand, rows: Rows) -> Rows:
        """Those of the robots on which a command waits: it does not any more."""
        taken, left = Rows.run(0, 0), list[tuple[WaitingCommand, Index]]()
        for each, robots in self._waiting:
            if each is command:
                chosen = np.isin(robots, rows.robots)
                taken, robots = Rows.of(robots[chosen]), robots[~chosen]
            if len(robots):
                left.append((each, robots))
        self._waiting = left
        return taken

    def _taken_gone(self, rows: Rows) -> list[tuple[WaitingCommand, str, Index]]:
        gone, self._gone = self._gone, []
        taken = []
        for command, why, robots in gone:
            chosen = np.isin(robots, rows.robots)
            taken.append((command, why, robots[chosen]))
            if not chosen.all():
                self._gone.append((command, why, robots[~chosen]))
        return taken

    def _settle(self, command: WaitingCommand, moment: Timeliness, rows: Rows, now: float) -> None:
        clock = self._clocks.of(command.message.sender, now)
        if moment is Timeliness.OVER or clock is None:
            self._outbox.answer_alike(command.message, rows, "late", TOO_LATE)
            return
        held = self._held_still(rows)
        self._fault(command, rows.take(held), HELD_UNTIL)
        rows = rows.take(~held)
        if self._stopped is not None:
            since = self._stopped[rows.index]
            older = np.array([command.precedes(when, clock) for when in since.tolist()], np.bool_)
            self._fault(command, rows.take(older), STOP_DISCARDED)
            rows = rows.take(~older)
        if rows.size:
            self._obeys(command.at_its_instant(), rows, now, {BOUND: command.bound(now, self.tick, clock)})

    def _fault(self, command: WaitingCommand, rows: Rows, why: str) -> None:
        self._outbox.answer_alike(command.message, rows, "fault", why)

    def state(self) -> TimingState | None:
        """Everything that waits."""
        if not self.is_busy and self._stopped is None:
            return None
        stopped = None if self._stopped is None else Array.of(self._stopped)
        waiting = [(each, Array.of(robots.astype(np.int32))) for each, robots in self._waiting]
        gone = [(each, why, Array.of(robots.astype(np.int32))) for each, why, robots in self._gone]
        return TimingState(waiting, gone, stopped)

    def restore(self, state: TimingState) -> None:
        """Have what waited. Raises SerialError."""
        self._waiting = [(each, ascending(robots, self._count)) for each, robots in state.waiting]
        self._gone = [(each, why, ascending(robots, self._count)) for each, why, robots in state.gone]
        if self._counts().max(initial=0) > MAX_WAITING:
            raise SerialError(f"more than {MAX_WAITING} commands that wait in one robot")
        if state.stopped is not None:
            self._stopped = state.stopped.made(np.float64, (self._count,), "when robots were stopped")
