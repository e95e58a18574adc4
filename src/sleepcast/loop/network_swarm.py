"""A network swarm: many minds with simulated bodies in one process, on a real channel and in real time. Each mind has a
session of its own; all share one receiver.

    advance  the bodies move on by one tick
    deliver  what the air has brought is received, and written down if somebody keeps it
    sense    minds that have something to think about get their readings
    think    ... and think
    act      what they want of their bodies' actuators goes there
    report   what has come of it is written down, and what they say goes on the air

Between two ticks the swarm listens: whatever comes is received at once, so that STOP waits for nothing. Ticks that
begin late are counted, and missed ticks are not made up for. However a run ends, all bodies are stopped first.
"""

from __future__ import annotations

import gc
import select
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import inf
from typing import Self

from sleepcast.channel.message import Message, Role
from sleepcast.channel.sequencer import Skipped
from sleepcast.channel.session import GATHER_FOR, ChannelSession, Multiplexer, Receiver
from sleepcast.core.clock import Clock
from sleepcast.loop.real import Keeper, Watch, act
from sleepcast.node.node import Node
from sleepcast.simulator import SafetyLimits, Simulator


@dataclass(slots=True)
class Member:
    """A mind, the index of its body in the simulator, and its line, on which it speaks. due: when the line wants to be
    tended even if nothing comes, s of Unix time."""

    node: Node
    number: int
    session: ChannelSession
    due: float = -inf


@dataclass(slots=True)
class NetworkSwarm:
    """See the module. multiplexer: on which the receiver and all sessions have their ports. clock: for the pace of the
    ticks; air: Unix time, by which they are tended. watch: how it goes. guard: of the bodies' limits. keeper: of what
    the minds know. time: of the minds, which began when their nodes say, s."""

    simulator: Simulator
    members: Sequence[Member]
    multiplexer: Multiplexer
    receiver: Receiver
    clock: Clock
    air: Clock
    watch: Watch = field(default_factory=Watch)
    guard: SafetyLimits | None = None
    keeper: Keeper | None = None
    time: float = 0.0

    def run(self, going: Callable[[], bool]) -> None:
        """Live until `going`, asked before each tick, says no; then every body is stopped. Raises what the channel
        raises, once they are."""
        tick = self.simulator.scenario.tick
        due = self.clock.now()
        try:
            with PacedCollector() as collector:
                while going():
                    self.listen(due)
                    now = self.clock.now()
                    self.watch.begin(now - due, tick)
                    due = max(due + tick, now)
                    self.step()
                    collector.collect()
        finally:
            for member in self.members:
                self.simulator.robots[member.number].stop()

    def step(self) -> None:
        """One tick."""
        if self.guard is not None:
            self.guard.enforce()
        self.simulator.step()
        self.hear()
        awake = [member for member in self.members if member.node.awake]
        if self.keeper is not None:
            self.keeper.before()
        now = self._time()
        if awake:
            readings = self.simulator.readings([member.number for member in awake])
            for member, values in zip(awake, readings, strict=True):
                member.node.sense(values, now)
                self._think(member, now)
        if self.keeper is not None:
            self.keeper.after()
        for member in awake:
            if member.node.outbox:
                self._report(member)

    def listen(self, until: float) -> None:
        """Receive what comes, until that time of `clock`."""
        while (left := until - self.clock.now()) > 0.0:
            wait = min(self.receiver.due(), *(member.due for member in self.members)) - self.air.now()
            if wait > 0.0 and not self.receiver.waits:
                select.select([self.multiplexer], [], [], min(wait, left))
            pause = min(GATHER_FOR, until - self.clock.now()) if self.hear() else 0.0
            if pause > 0.0:
                select.select([], [], [], pause)

    def hear(self) -> bool:
        """Receive what has come, and send what is due; whether anything came from elsewhere. What one says, its
        neighbours hear in their turn."""
        came = self.multiplexer.gather()
        heard = self.receiver.take()
        self._give(heard)  # what has come reaches every mind before anything else is done
        now = self.air.now()
        if self.receiver.due() <= now:
            freed = self.receiver.tend()
            self._give(freed)
            heard += freed
        skipped = self.receiver.skipped()
        for member in self.members:
            self._tend(member, now, skipped, news=bool(heard))
        speaking = [member for member in self.members if member.node.outbox]
        if self.keeper is not None and speaking:
            self.keeper.after()
        for member in speaking:
            self._report(member)
        return came

    def _give(self, messages: Sequence[Message]) -> None:
        """Let every mind hear these, but for what it has said itself."""
        for member in self.members if messages else ():
            name = member.node.name
            member.session.hear(each for each in messages if each.sender != name or each.role != Role.ROBOT)
            self._receive(member)

    def _tend(self, member: Member, now: float, skipped: Sequence[Skipped], *, news: bool) -> None:
        """Let a line do what is due. news: whether it has heard something, and other things may be due now."""
        if skipped:
            member.session.miss(skipped)
        if skipped or news:
            member.due = member.session.due()
        if skipped or member.due <= now:
            member.session.tend()
            self._receive(member)
            member.due = member.session.due()

    @staticmethod
    def _receive(member: Member) -> None:
        for message in member.session.heard():
            member.node.receive(message)

    def _time(self) -> float:
        """That of the minds, s: what is on the wall, as deadlines are of that, however the ticks keep up. It never goes
        back."""
        zero = self.members[0].node.zero if self.members else 0.0
        self.time = max(self.time, self.air.now() - zero)
        return self.time

    def _think(self, member: Member, now: float) -> None:
        node, body = member.node, self.simulator.robots[member.number]
        node.think(self.simulator.tick, now)
        act(node, body)
        for caste in node.pings:
            self.simulator.ping(member.number, caste)
        node.pings.clear()

    @staticmethod
    def _report(member: Member) -> None:
        for message in member.node.outbox:
            member.session.send(message)
        member.node.outbox.clear()
        member.due = member.session.due()


THOROUGH = 600
"""Ticks after which all generations are collected, not only the young ones: a minute's."""


class PacedCollector:
    """Runs the garbage collector right after a tick, when nobody waits. Left to itself, it runs whenever many objects
    have been made, often while a message goes to many minds, and the last of them gets it milliseconds later. Objects
    from before the `with` block are left alone."""

    def __init__(self) -> None:
        self._ticks = 0
        self._by_itself = gc.isenabled()

    def __enter__(self) -> Self:
        gc.collect()
        gc.freeze()
        gc.disable()
        return self

    def __exit__(self, *_: object) -> None:
        gc.unfreeze()
        if self._by_itself:
            gc.enable()

    def collect(self) -> None:
        """A tick is over."""
        self._ticks += 1
        gc.collect(1 if self._ticks % THOROUGH else 2)
