"""Minds on a real channel, in real time: some with real bodies (`run_robots`), or many with simulated bodies in one
process (`NetworkSwarm`). The order of a tick is the same for both:

    sense    the body's last measurements are read; simulated bodies first advance by a tick
    deliver  messages from the channel are received, and stored if there is a store; STOPs halt bodies
    think    they are evaluated, and the active rules after them
    act      assigned actuators go to the body
    report   results are stored, then the mind's messages are sent

What is stored, and that it is stored before it is answered, is in `durable`. Each mind of a swarm has its own session;
all share one receiver. Between two ticks the swarm listens: messages are received at once, so that STOP never waits.

Ticks that begin late are counted; missed ticks are not made up for. If a body fails, the run ends, unless its owner
goes on without it; however it ends, all bodies are stopped first.
"""

from __future__ import annotations

import gc
import select
import time
from collections.abc import Callable, Sequence
from dataclasses import field
from functools import partial
from math import inf, nan
from typing import TYPE_CHECKING, Protocol, Self

from sleepcast.channel import Channel
from sleepcast.channel.message import Message, Role
from sleepcast.channel.sequencer import Skipped
from sleepcast.channel.session import GATHER_FOR, ChannelSession, Multiplexer, Receiver
from sleepcast.core.clock import Clock, WallClock, WorkClock
from sleepcast.core.errors import SleepcastError
from sleepcast.core.records import dataclass
from sleepcast.loop.durable import Durability, Keeper
from sleepcast.mind.evaluation_budget import EvaluationBudget
from sleepcast.node.node import Node
from sleepcast.robot import Failsafe, Robot, Setpoint

if TYPE_CHECKING:
    from sleepcast.simulator import SafetyLimits, Simulator


class MindChannel(Channel, Protocol):
    """A channel of which STOPs can be received before everything else."""

    def stops(self) -> list[Message]:
        """The STOPs received since the last call of this or `receive`."""


@dataclass(slots=True)
class TickTiming:
    """Timing of a run.

    ticks: number so far.
    late: those that began when the next one was already due.
    worst: greatest delay of a tick, s.
    measured: time of the last new reading.
    """

    ticks: int = 0
    late: int = 0
    worst: float = 0.0
    measured: float = -inf

    def begin(self, lag: float, tick: float) -> None:
        """A tick of `tick` s begins `lag` s after it was due."""
        self.ticks += 1
        if 0.0 < tick <= lag:
            self.late += 1
            self.worst = max(self.worst, lag)

    def __str__(self) -> str:
        return f"{self.ticks} ticks, {self.late} late" + (f", the latest by {self.worst:.2f} s" if self.late else "")


@dataclass(slots=True)
class EmbodiedMind:
    """A mind in a real body.

    clock: of the mind.
    keeper: stores what it knows.
    start: when the mind's time was 0, s of that clock.
    is_catching_up: see `Node.catch_up`.
    """

    node: Node
    robot: Robot
    clock: Clock
    channel: MindChannel
    watch: TickTiming
    keeper: Keeper | None
    start: float
    is_catching_up: Callable[[], bool] = lambda: False

    def deliver(self) -> None:
        """Sense, and receive messages: a STOP stops the body here. Raises what the robot and the channel raise."""
        reading = self.robot.sense()
        if reading.time > self.watch.measured:  # an old reading is not a new measurement: it gets stale
            self.watch.measured = reading.time
            self.node.sense(reading.values, self.clock.now() - self.start)
        for message in self.channel.receive():
            self.node.receive(message)

    def hear_stops(self) -> None:
        """Receive STOPs only, which stop the body here. Raises what the channel raises."""
        for message in self.channel.stops():
            self.node.receive(message)

    def think(self) -> None:
        """Evaluate, and act."""
        self.node.catch_up(self.is_catching_up())
        self.node.think(self.watch.ticks, self.clock.now() - self.start)  # which is after storing
        act(self.node, self.robot)
        self.node.pings.clear()  # there is nothing here that could send them

    def say(self, messages: Sequence[Message]) -> None:
        """Send what the mind says. Raises what the channel raises."""
        for message in messages:
            self.channel.send(message)

    def end(self) -> None:
        """Stop the body, or have it do what it does when nobody drives it any more."""
        if isinstance(self.robot, Failsafe):
            self.robot.let_go()
        else:
            self.robot.stop()


def run_robots(
    minds: Sequence[EmbodiedMind],
    clock: Clock,
    *,
    tick: float,
    going: Callable[[], bool],
    sleep: Callable[[float], None] = time.sleep,
    fails: Callable[[EmbodiedMind, SleepcastError], None] | None = None,
) -> None:
    """Run minds in their bodies while `going`, called before each tick, returns true; then stop the bodies. It may add
    minds to those that run.

    clock: of the ticks.
    tick: period in s; 0 for one body in step, whose `sense` waits for the next tick itself (and which is its own
        clock).
    sleep: waits that many s of `clock`.
    fails: takes a mind whose tick has raised SleepcastError, which then ends alone; without it the run ends.

    Raises whatever robots and channels raise, once the bodies are stopped.
    """
    due, running = clock.now(), RunningMinds(minds, clock, tick, fails)
    try:
        while going():
            now = clock.now()
            if now < due:
                sleep(due - now)
                now = clock.now()
            late, due = now - due, max(due + tick, now)
            for mind in minds:
                mind.watch.begin(late, tick)
            running.step()
    finally:
        for mind in minds:
            mind.end()
        running.durability.close()


class RunningMinds:
    """The minds of `run_robots`, all together: no STOP waits until another mind has thought, or its disk has
    written."""

    def __init__(
        self,
        minds: Sequence[EmbodiedMind],
        clock: Clock,
        tick: float,
        fails: Callable[[EmbodiedMind, SleepcastError], None] | None,
    ) -> None:
        self.durability = Durability(self._hear_stops)
        # A body in step is its own clock, which stands still meanwhile.
        self.budget = EvaluationBudget(clock if tick else WallClock(), WorkClock(), self._hear_stops)
        self._minds, self._fails, self._turn, self._tick = minds, fails, 0, tick
        self._running: list[EmbodiedMind] = []

    def step(self) -> None:
        """One tick. A mind that fails takes no further part in it."""
        self._running = list(self._minds)
        for mind in tuple(self._running):
            self._try(mind, mind.deliver)
        self.durability.before(self._keepers())
        self._think()
        for mind, messages in self.durability.after(self._keepers(), self._running):
            self._try(mind, partial(mind.say, messages))
            self.budget.look()

    def _think(self) -> None:
        """Let all of them evaluate, another one first in each tick; STOP is heard all the while."""
        self._turn = (self._turn + 1) % max(1, len(self._running))
        self.budget.begin()
        for mind in (*self._running[self._turn :], *self._running[: self._turn]):
            if any(each is mind for each in self._running):  # another one may have failed meanwhile
                mind.node.budget, mind.node.timing.tick = self.budget, self._tick
                self._try(mind, mind.think)
                self.budget.look()

    def _hear_stops(self) -> None:
        for mind in tuple(self._running):
            self._try(mind, mind.hear_stops)

    def _keepers(self) -> list[Keeper]:
        return [mind.keeper for mind in self._running if mind.keeper is not None]

    def _try(self, mind: EmbodiedMind, part: Callable[[], None]) -> None:
        try:
            part()
        except SleepcastError as error:
            if self._fails is None:
                raise
            self._running.remove(mind)
            self._fails(mind, error)


def act(node: Node, robot: Robot) -> None:
    """Pass a body the actuators that its mind has assigned since the last call."""
    wanted = node.actuators()
    if wanted:
        robot.act(Setpoint(*(wanted.get(actuator.name, nan) for actuator in robot.model.actuators)))


# ---- a network swarm: many minds with simulated bodies


@dataclass(slots=True)
class Member:
    """A mind, the index of its body in the simulator, and its session. keeper: stores what it knows. due: when the
    session must be tended even if nothing arrives, s of Unix time."""

    node: Node
    number: int
    session: ChannelSession
    keeper: Keeper | None = None
    due: float = -inf


@dataclass(slots=True)
class NetworkSwarm:
    """See the module.

    multiplexer: has the ports of the receiver and of all sessions.
    clock: for the pace of the ticks.
    air: Unix time, for sessions.
    watch: timing of the run.
    guard: of the bodies' limits.
    keeper: stores what the minds know, and is that of each member.
    time: of the minds, which began when their nodes say, s.
    """

    simulator: Simulator
    members: Sequence[Member]
    multiplexer: Multiplexer
    receiver: Receiver
    clock: Clock
    air: Clock
    watch: TickTiming = field(default_factory=TickTiming)
    guard: SafetyLimits | None = None
    keeper: Keeper | None = None
    time: float = 0.0
    durability: Durability = field(init=False)
    budget: EvaluationBudget = field(init=False)
    _first: int = 0
    """Number of the member that evaluates first: the one that had to wait in the last tick."""

    def __post_init__(self) -> None:
        self.durability = Durability(self.hear_stops)
        self.budget = EvaluationBudget(self.clock, WorkClock(), self.hear_stops)
        for member in self.members:
            member.keeper, member.node.budget = self.keeper, self.budget
            member.node.timing.tick = self.simulator.scenario.tick

    def run(self, going: Callable[[], bool]) -> None:
        """Run while `going`, called before each tick, returns true; then stop every body. Raises what the channel
        raises, once they are stopped."""
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
            self.durability.close()

    def step(self) -> None:
        """One tick."""
        if self.guard is not None:
            self.guard.enforce()
        self.simulator.step()
        self.hear()
        catching_up = self.receiver.is_catching_up
        for member in self.members:
            member.node.catch_up(catching_up)
        awake = [member for member in self.members if member.node.awake]
        self.durability.before(self._keepers())
        if awake:
            self._think_all(awake)
        self._tell_news()
        self._speak()

    def _tell_news(self) -> None:
        """Let robots report what has befallen their bodies."""
        news = self.simulator.take_news() if self.simulator.news else []
        members = {member.number: member for member in self.members} if news else {}
        for each in news:
            if each.robot in members:
                members[each.robot].node.remark(each.text, self.air.now() - members[each.robot].node.zero)

    def _think_all(self, awake: Sequence[Member]) -> None:
        """Let these evaluate, those first who had to wait in the last tick; STOP is heard all the while."""
        # Real time, because deadlines are in real time, however late the ticks are; it never goes back.
        now = self.time = max(self.time, self.air.now() - self.members[0].node.zero)
        first = self._first
        readings = self.simulator.readings([member.number for member in awake])
        turns = sorted(zip(awake, readings, strict=True), key=lambda turn: (turn[0].number < first, turn[0].number))
        self.budget.begin()
        for member, values in turns:
            waited = self.budget.held_back
            if self.simulator.robots[member.number].reached:
                member.node.sense(values, now)
            self._think(member, now)
            if self.budget.held_back and not waited:
                self._first = member.number
            self.budget.look()

    def listen(self, until: float) -> None:
        """Receive messages until that time of `clock`."""
        while (left := until - self.clock.now()) > 0.0:
            wait = min(self.receiver.due(), *(member.due for member in self.members)) - self.air.now()
            if wait > 0.0 and not self.receiver.waits:
                select.select([self.multiplexer], [], [], min(wait, left))
            pause = min(GATHER_FOR, until - self.clock.now()) if self.hear() else 0.0
            if pause > 0.0:
                select.select([], [], [], pause)

    def hear(self) -> bool:
        """Receive messages and send what is due; returns whether anything came from elsewhere. What one mind sends, the
        others receive in turn."""
        came = self.multiplexer.gather()
        heard = self.receiver.take()
        self._give(heard)  # messages reach every mind before anything else is done
        now = self.air.now()
        if self.receiver.due() <= now:
            freed = self.receiver.tend()
            self._give(freed)
            heard += freed
        skipped = self.receiver.skipped()
        for member in self.members:
            self._tend(member, now, skipped, news=bool(heard))
        if any(member.node.outbox for member in self.members):
            self._speak()
        return came

    def hear_stops(self) -> None:
        """Receive STOPs only, which halt bodies here; their answers wait. All else waits, unread."""
        self._give(self.receiver.stops())

    def _give(self, messages: Sequence[Message]) -> None:
        """Pass these messages to every mind except their sender, which is this one only if the epoch is, too."""
        for member in self.members if messages else ():
            own = member.node.name, member.session.delivery.epoch
            member.session.hear(
                each for each in messages if (each.sender, each.epoch) != own or each.role != Role.ROBOT
            )
            self._receive(member)

    def _tend(self, member: Member, now: float, skipped: Sequence[Skipped], *, news: bool) -> None:
        """Let a session do what is due. news: whether it has received something, so that other things may be due
        now."""
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

    def _think(self, member: Member, now: float) -> None:
        node, body = member.node, self.simulator.robots[member.number]
        node.think(self.simulator.tick, now)
        act(node, body)
        self.simulator.senses.show_groups([member.number], dict.fromkeys(node.groups, 1.0))
        for caste in node.pings:
            self.simulator.ping(member.number, caste)
        node.pings.clear()

    def _keepers(self) -> list[Keeper]:
        return [] if self.keeper is None else [self.keeper]

    def _speak(self) -> None:
        for member, messages in self.durability.after(self._keepers(), self.members):
            for message in messages:
                member.session.send(message)
            member.due = member.session.due()
            self.budget.look()


THOROUGH = 600
"""Ticks between two collections of all generations; the others collect only the young ones: one minute."""


class PacedCollector:
    """Runs the garbage collector right after a tick, when nothing is waiting. By default it runs whenever many objects
    have been allocated, often while a message goes to many minds, and delays the last of them by milliseconds. Objects
    from before the `with` block are not scanned."""

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
        """To be called at the end of a tick."""
        self._ticks += 1
        gc.collect(1 if self._ticks % THOROUGH else 2)
