"""The commands that wait in one robot for their instants (`mind.instants`). Its node evaluates them.

They are stored with the robot's mind, before it answers that they wait. A second answer says what came of each.
"""

from __future__ import annotations

from collections.abc import Iterable
from math import inf, nan

import msgspec

from sleepcast.channel.clock_sync import ClockBound
from sleepcast.channel.message import BOUND, WAITING, Message
from sleepcast.language.parts import Timed
from sleepcast.mind.instants import (
    CANCEL_DISCARDED,
    HELD_UNTIL,
    MAX_WAITING,
    NO_CLOCK,
    RESTARTED,
    STOP_DISCARDED,
    TOO_LATE,
    TOO_MANY_WAIT,
    EqualClocks,
    SenderClocks,
    Timeliness,
    UnknownClocks,
    WaitingCommand,
    discarded,
    in_turn,
)
from sleepcast.mind.views import EvaluatedCommand
from sleepcast.node.evaluating import NodeEvaluator, Thinking


class TimedCommands:
    """See the module. clocks: of those who command the robot, which its owner gives to one on the air; tick: s of
    one."""

    def __init__(self, node: Thinking, *, on_air: bool) -> None:
        self._node, self._robot = node, NodeEvaluator(node)
        self.clocks: SenderClocks = UnknownClocks() if on_air else EqualClocks()
        self.tick = 0.1
        self.waiting: list[WaitingCommand] = []
        self._gone: list[tuple[WaitingCommand, str]] = []
        """Those that were discarded since the last tick, and why."""
        self._stopped = -inf

    @property
    def is_busy(self) -> bool:
        """Whether the next tick has something to do."""
        return bool(self.waiting) or bool(self._gone)

    def restore(self, waiting: Iterable[WaitingCommand], now: float) -> None:
        """These waited when the robot's life before this one ended. A clock that has gone back decides nothing."""
        restarted = [msgspec.structs.replace(each, restarted=True) for each in waiting]
        self._discard([each for each in restarted if each.over > now + each.wait], NO_CLOCK)
        self.waiting = [each for each in restarted if each.over <= now + each.wait][:MAX_WAITING]
        for each in self.waiting:
            self.clocks.want(each.message.sender, each.over, now)

    def stop(self, now: float) -> None:
        """STOP: nothing waits any more."""
        self._stopped = now
        self._discard([*self.waiting], STOP_DISCARDED)
        self.waiting = []

    def cancel(self, sender: str) -> float:
        """Discard what this sender's commands wait for; gives how many there were."""
        gone = discarded(self.waiting, lambda each: each.message.sender == sender)
        self._discard(gone, CANCEL_DISCARDED)
        return float(len(gone))

    def _discard(self, commands: list[WaitingCommand], why: str) -> None:
        self._gone += [(each, why) for each in commands]

    def hear(self, message: Message, timed: Timed, now: float) -> None:
        """Let a command wait, do it if this is its instant, or answer why not."""
        command = WaitingCommand.of(message, timed)
        clock = self.clocks.of(message.sender, now)
        moment = command.moment(now, self.tick, clock, waited=False)
        full = len(self.waiting) >= MAX_WAITING
        if self._robot.is_held_still or full:
            self._node.answer(message, "fault", nan, HELD_UNTIL if self._robot.is_held_still else TOO_MANY_WAIT, {})
        elif moment is not Timeliness.AHEAD:
            self._settle(command, moment, clock, now)
        else:
            self.clocks.want(message.sender, command.over, now)
            self.waiting.append(command)
            self._node.answer(message, WAITING, nan, "", {})

    def tick_at(self, now: float) -> None:
        """Do what is due, and answer for what is over."""
        gone, self._gone = self._gone, []
        for command, why in gone:
            self._node.answer(command.message, "fault", nan, why, {})
        for command in in_turn(self.waiting):
            clock = self.clocks.of(command.message.sender, now)
            moment = command.moment(now, self.tick, clock, waited=not command.restarted)
            if moment is not Timeliness.AHEAD and command in self.waiting:  # one before it may have been a CANCEL
                self.waiting.remove(command)
                self._settle(command, moment, clock, now)

    def _settle(self, command: WaitingCommand, moment: Timeliness, clock: ClockBound | None, now: float) -> None:
        message = command.message
        if moment is Timeliness.OVER and not command.restarted:
            self._node.answer(message, "late", nan, TOO_LATE, {})
        elif moment is not Timeliness.NOW or clock is None:
            self._node.answer(message, "fault", nan, RESTARTED if moment is Timeliness.OVER else NO_CLOCK, {})
        elif self._robot.is_held_still or command.precedes(self._stopped, clock):
            self._node.answer(message, "fault", nan, HELD_UNTIL if self._robot.is_held_still else STOP_DISCARDED, {})
        else:
            self._do(command, clock, now)

    def _do(self, command: WaitingCommand, clock: ClockBound, now: float) -> None:
        """This is the instant: obey, if the sender may still have it done."""
        message = command.at_its_instant()
        text, refusal = message.text, self._robot.objection(message, message.text, now)
        word, value, fault = (
            EvaluatedCommand("fault", nan, refusal) if refusal else self._robot.outcome_of(message, text, now)
        )
        since = now if self._node.clock is None else self._node.clock.now() - self._node.zero
        bound = max(command.bound(moment, self.tick, clock) for moment in (now, since))  # it was between these two
        self._node.answer(command.message, word, value, fault, {BOUND: bound})
