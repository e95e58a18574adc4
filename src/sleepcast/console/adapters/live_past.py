"""The past of a simulated swarm while it runs: a witness of its ticks that keeps pictures, states and inputs.

Pictures are taken as often as a recording takes them, until they fill their part of the budget; then every second one
is left out, and as many fewer are taken from then on. A state is copied between two ticks, and compressed on a thread
of its own. Of messages and changes of obstacles the older half is forgotten when they fill their part, with the states
from which they would be wanted.
"""

from __future__ import annotations

import asyncio
from threading import Thread
from time import thread_time

from sleepcast.channel import Kind, Message
from sleepcast.channel.message_batch import MessageBatch
from sleepcast.console.account_table import AccountTable, CommandRow
from sleepcast.console.adapters.replay_worker import serve_past
from sleepcast.console.adapters.swarm import SwarmAdapter
from sleepcast.console.past import AlternateRun, Past
from sleepcast.console.replay_client import ReplayClient, RerunError, RunMoment
from sleepcast.console.snapshots import Budget, SnapshotTimer
from sleepcast.console.timeline import NAME_SIZE, PICTURE_OVERHEAD, RobotMarks, Timeline, size_of_row
from sleepcast.core.clock import Clock
from sleepcast.core.memory import shown_size
from sleepcast.fleet.marks import GroupCodes, flags_of
from sleepcast.loop import Swarm
from sleepcast.loop.rerun import InputLog
from sleepcast.loop.snapshots import SwarmCopy, copy_of
from sleepcast.simulator.bodies.arrivals import Arrival
from sleepcast.station import Station

TICKS_PER_PICTURE = 5
"""Ticks between two pictures at least: more pictures would cost more than the ticks."""
HEARD = 20
"""Ticks after a command within which robots have heard it, so that two futures may differ that look alike."""


class LivePast(Past):
    """See the module; it begins with the tick in which the swarm is. budget: see `Past`."""

    def __init__(
        self, view: SwarmAdapter, swarm: Swarm, station: Station, clock: Clock, budget: Budget | None = None
    ) -> None:
        scenario = swarm.simulator.scenario
        now = swarm.now()
        timeline = Timeline(view.scene, now, scenario.speed_up, {}, swarm.vocabulary, began=now)
        super().__init__(timeline, scenario.tick, swarm.telemetry_ticks, ReplayClient(serve_past), budget or Budget())
        self._view, self._swarm, self._station, self._clock = view, swarm, station, clock
        self._log = InputLog(swarm)
        self.inputs = self._log.inputs
        self._accounts = AccountTable(station, view, others=view.desks[1:])
        self._rows: dict[str, CommandRow] = {}
        self._groups = GroupCodes()
        self._every = scenario.ticks_of_picture(TICKS_PER_PICTURE)
        self._size = self._of_other = self._of_rows = 0
        """Bytes of pictures, of those that only the alternate run has, and of accounts."""
        self._posted = False
        self._snapshot_timer, self._began = SnapshotTimer(), 0.0
        self._packer: Thread | None = None
        self._packed: tuple[int, bytes, float] | None = None
        swarm.witnesses.append(self)
        self._diverged = asyncio.Event()
        self._compared, self._alike_until = 0, 0
        """The tick up to which two futures were compared last, and that before which it is not worth while to compare
        them again if they look alike."""

    def go_on(self, before: LivePast, state: bytes) -> None:
        """This run goes on from a state of another one, whose past is this one's, too. Of the pictures it leaves room
        for those of the other one: they may have half of it."""
        tick, now = self._view.tick, self._view.now()
        timeline, old = self.timeline, before.timeline
        timeline.began = old.began
        timeline.poses, timeline.marks = old.poses.until(now), old.marks.until(now)
        timeline.obstacles, timeline.failures = old.obstacles.until(now), old.failures.until(now)
        timeline.rows, timeline.names = old.rows.until(now), old.names.until(now)
        self._groups.expect(timeline.marks_at(now).names)
        self._every = before._every
        self._size, self._of_rows = timeline.size_of_pictures, timeline.size_of_rows
        every = self._every
        while old.size_of_pictures - self._size > self.budget.pictures // 2 and len(old.poses.times) > 1:
            every *= 2
            old.thin(every)
        self._of_other = max(0, old.size_of_pictures - self._size)
        self._log.begin_with(before.inputs.between(-1, tick))
        self.states = before.states.until(tick)
        self.states.add(tick, state)
        self.marks.take(before.marks, now)
        self.run = before.run + 1
        self.other = AlternateRun(tick, old, before.inputs, state)

    @property
    def size(self) -> int:
        """Bytes of all that is kept, about."""
        return self._size + self._of_other + self._of_rows + self.states.size + self._log.size

    def _takes(self) -> str:
        return f": {shown_size(self.size)}, of {shown_size(self.budget.most)} at most (--past)."

    async def _live(self) -> None:
        """Look for the first difference to an alternate run, as soon as there may be one."""
        other = self.other
        try:
            while other is not None and other.differs is None:
                await self._diverged.wait()
                if self.other is not other:  # what came since is not known any more
                    break
                tick = self._view.tick
                await self.compare(other, tick)
                self._compared = tick
                self._alike_until = tick + max(HEARD, tick - other.tick)  # all take twice as long as the last
                self._diverged.clear()
        except RerunError as error:
            assert other is not None
            other.difference = str(error)
        await super()._live()

    def _look_for_difference(self, tick: int) -> None:
        """Called with every picture."""
        other = self.other
        if other is None or other.differs is not None or self._diverged.is_set() or tick < self._compared + HEARD:
            return
        now, here, there = self._view.now(), self.timeline, other.timeline
        seen = there.poses.at(now)
        apart = seen is not None and seen[0] == tick
        apart = apart and (seen != here.poses.at(now) or there.marks.at(now) != here.marks.at(now))
        if not apart and tick >= self._alike_until:  # something may have come in one run only, and robots have heard it
            left = self.inputs.between(other.tick, tick).leaves(other.inputs.between(other.tick, tick))
            apart = left is not None and tick - left >= HEARD
        if apart:
            self._diverged.set()

    # ---- as a witness of the swarm

    def ticking(self) -> None:
        """A tick begins."""
        if not self.timeline.poses.times:
            self._picture()
            self._copy(self._view.tick)
        self._log.ticking()
        if self._log.size > self.budget.inputs // 2:  # the other half is for another future
            self._forget_inputs()
        self._began = self._clock.now()

    def came(self, arrival: Arrival) -> None:
        """Somebody has added a robot between two ticks."""
        self._log.came(arrival)

    def posted(self, message: Message) -> None:
        """The operator's message goes on the air in this tick."""
        self._log.posted(message)
        self._posted |= message.kind is not Kind.REQUEST  # an auction says something in every tick

    def said(self, batch: MessageBatch) -> None:
        """Nothing: it is known from the accounts."""

    def ticked(self) -> None:
        """A tick is over."""
        self._log.ticked()
        self.timeline.seconds = self._view.now()
        tick = self._view.tick
        if tick % self._every == 0 or self._posted:
            self._posted = False
            self._picture()
        self._snapshot_timer.worked(self._clock.now() - self._began)
        self._take_over()
        if self._packer is None and self._snapshot_timer.due:
            self._copy(tick)

    # ---- pictures

    def _picture(self) -> None:
        timeline, minds, now = self.timeline, self._view.minds, self._view.now()
        poses = self._view.poses()
        timeline.poses.add(now, (self._view.tick, poses))
        self._size += PICTURE_OVERHEAD + len(poses)
        codes, flags = self._groups.look(minds), flags_of(minds, self._view.exhausted(), self._view.crashed())
        marks = RobotMarks(codes, flags, tuple(self._groups.names), self._groups.second, self._view.colours())
        if timeline.marks.at(now) != marks:
            timeline.marks.add(now, marks)
            self._size += marks.size
        self.marks.groups(now, self._groups.names, self._groups.counts)
        names = self._view.scene.names
        self.marks.names(now, names)
        if timeline.names_at(now) is not names:
            timeline.names.add(now, names)
            self._size += PICTURE_OVERHEAD + NAME_SIZE * len(names)
        rows = self._accounts.rows()
        failures = self._accounts.failing.now
        if timeline.failures_at(now) != failures:
            timeline.failures.add(now, failures)
            self._size += PICTURE_OVERHEAD + failures.size
        self.marks.failing(now, failures.rules)
        for row in rows:
            if self._rows.get(row.id) is not row:
                timeline.rows.add(now, row)
                self._of_rows += size_of_row(row)
        self._rows = {row.id: row for row in rows}
        self.marks.rows(now, rows)
        solid = self._view.obstacles()
        if solid is not None and timeline.obstacles.at(now) != solid:
            timeline.obstacles.add(now, solid)
            self._size = timeline.size_of_pictures
        self._look_for_difference(self._view.tick)
        self._keep_within()

    def _keep_within(self) -> None:
        """Leave out every second picture, and take half as many from now on, and forget accounts, where there are too
        many of them."""
        while self._size + self._of_other > self.budget.pictures and len(self.timeline.poses.times) > 1:
            self._every *= 2
            self.timeline.thin(self._every)
            self._size = self.timeline.size_of_pictures
        if self._of_rows > self.budget.accounts:
            self.timeline.forget_accounts(self.budget.accounts)
            self._of_rows = self.timeline.size_of_rows

    def _forget_inputs(self) -> None:
        """Forget the older half of what came from outside, up to the next state that is kept: what was before cannot be
        run again any more."""
        middle = self._log.inputs.middle
        tick = self.states.after(middle)
        if tick is None and self._log.size > self.budget.inputs:  # they come faster than states are packed
            tick = self._state_from(middle)
        if tick is None:  # a state is on its way
            return
        self.states.forget_before(tick)
        self._log.forget(tick)
        if self.other is not None and self.other.tick < tick:
            self.other = None

    # ---- states

    def moment(self, tick: int, since: int | None = None) -> RunMoment:
        """See `Past`."""
        if self.states.first is None:
            self._wait_for_state()  # the first one is on its way
        self._take_over()
        return super().moment(tick, since)

    def _take_over(self) -> None:
        if self._packed is not None:
            at, state, cost = self._packed
            self.states.add(at, state)
            self._snapshot_timer.kept(cost)
            self._packed = self._packer = None

    def _state_from(self, tick: int) -> int | None:
        """The tick of the first state from this one on. The run waits for it."""
        self._wait_for_state()
        if self.states.after(tick) is None:
            self._copy(self._view.tick)
            self._wait_for_state()
        return self.states.after(tick)

    def _wait_for_state(self) -> None:
        if self._packer is not None:
            self._packer.join()
        self._take_over()

    def _copy(self, tick: int) -> None:
        self._snapshot_timer.begun()
        began = thread_time()
        copy = copy_of(self._swarm)
        spent = thread_time() - began
        self._packer = Thread(target=self._pack, args=(tick, copy, spent), name="state", daemon=True)
        self._packer.start()

    def _pack(self, tick: int, copy: SwarmCopy, copied: float) -> None:
        began = thread_time()  # not the wall clock: what else the machine does makes no state dearer
        state = copy.packed()
        self._packed = tick, state, copied + thread_time() - began
