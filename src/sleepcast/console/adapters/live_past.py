"""The past of a simulated swarm while it runs: a witness of its ticks that keeps pictures, states and inputs.

Pictures are taken as often as a recording takes them, until they fill `FILM`; then every second one is left out, and as
many fewer are taken from then on. A state is copied between two ticks, and compressed on a thread of its own.
"""

from __future__ import annotations

import asyncio
from threading import Thread
from time import thread_time

from sleepcast.channel import Message
from sleepcast.channel.message_batch import MessageBatch
from sleepcast.console.account_table import AccountTable, CommandRow
from sleepcast.console.adapters.again import serve_past
from sleepcast.console.adapters.swarm import SwarmAdapter
from sleepcast.console.film import Kind, Marks, Timeline, Track
from sleepcast.console.kept import Diary
from sleepcast.console.past import OtherFuture, Past
from sleepcast.console.rerunner import Moment, RerunError, Rerunner
from sleepcast.core.clock import Clock
from sleepcast.fleet.marks import Groups, flags_of
from sleepcast.loop import Swarm
from sleepcast.loop.rerun import InputLog
from sleepcast.loop.snapshots import SwarmCopy, copy_of
from sleepcast.station import Station

FILM = 128 * 1024**2
"""Bytes of pictures: nine thousand of a thousand robots, or ninety of a hundred thousand."""
PICTURES_PER_SECOND = 10.0
"""Pictures in a second of a person's time, when the scenario runs at its own speed."""
TICKS_PER_PICTURE = 5
"""Ticks between two pictures at least: more pictures would cost more than the ticks."""
MOST_ACCOUNTS = 20_000
"""Changes of accounts that are kept; older ones are left out where later ones are of the same command."""
HEARD = 20
"""Ticks after a command within which robots have heard it, so that two futures may differ that look alike."""


class LivePast(Past):
    """See the module; it begins with the tick in which the swarm is."""

    def __init__(self, view: SwarmAdapter, swarm: Swarm, station: Station, clock: Clock) -> None:
        scenario = swarm.simulator.scenario
        now = swarm.now()
        film = Timeline(view.scene, now, scenario.speed_up, {}, swarm.vocabulary, began=now)
        super().__init__(film, scenario.tick, swarm.telemetry_ticks, Rerunner(serve_past))
        self._view, self._swarm, self._station, self._clock = view, swarm, station, clock
        self._log = InputLog(swarm)
        self.inputs = self._log.inputs
        self._accounts = AccountTable(station, view)
        self._rows: dict[str, CommandRow] = {}
        self._groups = Groups()
        self._every = max(TICKS_PER_PICTURE, round(scenario.speed_up / PICTURES_PER_SECOND / scenario.tick))
        self._size, self._posted = 0, False
        self._diary, self._began = Diary(), 0.0
        self._packer: Thread | None = None
        self._packed: tuple[int, bytes, float] | None = None
        swarm.witnesses.append(self)
        self._diverged = asyncio.Event()
        self._compared, self._alike_until = 0, 0
        """The tick up to which two futures were compared last, and that before which it is not worth while to compare
        them again if they look alike."""

    def go_on(self, before: LivePast, state: bytes) -> None:
        """This run goes on from a state of another one, whose past is this one's, too."""
        tick, now = self._view.tick, self._view.now()
        film, old = self.film, before.film
        film.began = old.began
        cut(film.poses, old.poses, now)
        cut(film.marks, old.marks, now)
        cut(film.obstacles, old.obstacles, now)
        cut(film.rows, old.rows, now)
        cut(film.failures, old.failures, now)
        self._groups.expect(film.marks_at(now).names)
        self._every = before._every
        self._size = _pictures(film)
        earlier = before.inputs.between(-1, tick)
        self.inputs.posted[:0], self.inputs.changes[:0] = earlier.posted, earlier.changes
        self.states = before.states.until(tick)
        self.states.add(tick, state)
        self.marks.take(before.marks, now)
        self.run = before.run + 1
        self.other = OtherFuture(tick, old, before.inputs, state)

    async def _live(self) -> None:
        """Look for the first difference to another future, as soon as there may be one."""
        other = self.other
        try:
            while other is not None and other.differs is None:
                await self._diverged.wait()
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
        now, here, there = self._view.now(), self.film, other.film
        seen = there.poses.at(now)
        apart = seen is not None and seen[0] == tick
        apart = apart and (seen != here.poses.at(now) or there.marks.at(now) != here.marks.at(now))
        if apart or (tick >= self._alike_until and self._differ_unseen(other, tick)):
            self._diverged.set()

    def _differ_unseen(self, other: OtherFuture, tick: int) -> bool:
        """Whether something has come in one future only, and robots have heard it."""
        left = self.inputs.between(other.tick, tick).leaves(other.inputs.between(other.tick, tick))
        return left is not None and tick - left >= HEARD

    # ---- as a witness of the swarm

    def ticking(self) -> None:
        """A tick begins."""
        if not self.film.poses.times:
            self._picture()
            self._copy(self._view.tick)
        self._log.ticking()
        self._began = self._clock.now()

    def posted(self, message: Message) -> None:
        """The operator's message goes on the air in this tick."""
        self._log.posted(message)
        self._posted = True

    def said(self, batch: MessageBatch) -> None:
        """Nothing: it is known from the accounts."""

    def ticked(self) -> None:
        """A tick is over."""
        self._log.ticked()
        self.film.seconds = self._view.now()
        tick = self._view.tick
        if tick % self._every == 0 or self._posted:
            self._posted = False
            self._picture()
        self._diary.worked(self._clock.now() - self._began)
        self._keep(tick)

    # ---- pictures

    def _picture(self) -> None:
        film, minds, now = self.film, self._view.minds, self._view.now()
        poses = self._view.poses()
        film.poses.add(now, (self._view.tick, poses))
        codes, flags = self._groups.look(minds), flags_of(minds, self._view.exhausted())
        marks = Marks(codes, flags, tuple(self._groups.names), self._groups.second, self._view.colours())
        if film.marks.at(now) != marks:
            film.marks.add(now, marks)
            self._size += _size(marks)
        self.marks.groups(now, self._groups.names, self._groups.counts)
        rows = self._accounts.rows()
        failures = self._accounts.failing.now
        if film.failures_at(now) != failures:
            film.failures.add(now, failures)
            self._size += failures.size
        self.marks.failing(now, failures.rules)
        for row in rows:
            if self._rows.get(row.id) is not row:
                film.rows.add(now, row)
        self._rows = {row.id: row for row in rows}
        self.marks.rows(now, rows)
        solid = self._view.obstacles()
        if solid is not None and film.obstacles.at(now) != solid:
            film.obstacles.add(now, solid)
        self._size += len(poses)
        self._look_for_difference(self._view.tick)
        if self._size > FILM:
            self._thin()
        if len(film.rows.times) > MOST_ACCOUNTS:
            _drop_superseded(film)

    def _thin(self) -> None:
        """Leave out every second picture, and take half as many from now on."""
        self._every *= 2
        film, poses = self.film, self.film.poses
        kept = [at for at, (tick, _) in enumerate(poses.values) if tick % self._every == 0 or at == 0]
        poses.times, poses.values = [poses.times[at] for at in kept], [poses.values[at] for at in kept]
        _keep_seen(film.marks, poses.times)
        _keep_seen(film.failures, poses.times)
        self._size = _pictures(film)

    # ---- states

    def moment(self, tick: int, since: int | None = None) -> Moment:
        """See `Past`."""
        if self.states.first is None and self._packer is not None:
            self._packer.join()  # the first state is on its way
        self._take_over()
        return super().moment(tick, since)

    def _keep(self, tick: int) -> None:
        """Keep a state if it is time to, and take over the one that is packed."""
        self._take_over()
        if self._packer is None and self._diary.due:
            self._copy(tick)

    def _take_over(self) -> None:
        if self._packed is not None:
            at, state, cost = self._packed
            self.states.add(at, state)
            self._diary.kept(cost)
            self._packed = self._packer = None

    def _copy(self, tick: int) -> None:
        self._diary.begun()
        began = thread_time()
        copy = copy_of(self._swarm)
        spent = thread_time() - began
        self._packer = Thread(target=self._pack, args=(tick, copy, spent), name="state", daemon=True)
        self._packer.start()

    def _pack(self, tick: int, copy: SwarmCopy, copied: float) -> None:
        began = thread_time()  # not the wall clock: what else the machine does makes no state dearer
        state = copy.packed()
        self._packed = tick, state, copied + thread_time() - began


def cut(into: Track[Kind], track: Track[Kind], time: float) -> None:
    """Have what a track has up to a time."""
    count = track.before(time)
    into.times, into.values = track.times[:count], track.values[:count]


def _keep_seen(track: Track[Kind], times: list[float]) -> None:
    """Leave out what a track has at none of these times."""
    needed = sorted({at - 1 for time in times if (at := track.before(time))})
    track.times, track.values = [track.times[at] for at in needed], [track.values[at] for at in needed]


def _pictures(film: Timeline) -> int:
    """Bytes of all pictures."""
    marks = sum(map(_size, film.marks.values)) + sum(each.size for each in film.failures.values)
    return sum(len(data) for _, data in film.poses.values) + marks


def _size(marks: Marks) -> int:
    return len(marks.groups) + len(marks.flags) + len(marks.second) + len(marks.colours)


def _drop_superseded(film: Timeline) -> None:
    """Leave out the older half of the accounts where there is a later one of the same command in it."""
    rows = film.rows
    half = len(rows.times) // 2
    latest = {row.id: at for at, row in enumerate(rows.values[:half])}
    kept = [*sorted(latest.values()), *range(half, len(rows.times))]
    rows.times, rows.values = [rows.times[at] for at in kept], [rows.values[at] for at in kept]
