"""Quiet ticks: those in which nothing comes in or goes out, so that bodies only move, sensors measure and rules run.

Nearly all that a tick of few robots takes is Python: which messages are due, whether somebody's lease has ended, what
is to be measured. As long as that is known to be nothing, ticks are made by compiled code alone, some dozens in one
call, and of many swarms in one call (`QuietTicks`). They come to the same, bit for bit.

`QuietWorld` is the one place that says what a quiet tick is. The last tick of a call may have something to report:
telemetry, a measure, a desk that attends. What else is due - an order, a message, an event - makes a tick one like all
others, which `step_swarm` makes.
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Callable, Mapping, Sequence
from functools import cached_property
from math import inf
from typing import TYPE_CHECKING, Protocol

from sleepcast.channel import Message
from sleepcast.channel.simulated_radio import Radio
from sleepcast.columns.values import Index, Moves, Rows
from sleepcast.core.memory import same
from sleepcast.core.ticks import tick_at
from sleepcast.fleet import Fleet
from sleepcast.fleet.quiet import QuietMinds
from sleepcast.simulator import Order, Simulator
from sleepcast.simulator.quiet.layout import TOUCHED
from sleepcast.simulator.scenario.events import event_ticks

if TYPE_CHECKING:
    from sleepcast.simulator.quiet.blocks import BodyBlock, WorldTable

LONGEST = 20_000
"""Robots times ticks of one call at most: some hundredths of a second, in which nothing can interrupt it."""
SHARED = 1_000
"""Robots from which on several threads make a tick sooner than compiled code on one."""


class QuietDesk(Protocol):
    """A desk as quiet ticks see it."""

    @property
    def next_due(self) -> float: ...

    @property
    def counts_latest(self) -> bool: ...

    def observe_many(self, now: float, robots: Index, /) -> None: ...


class QuietSwarm(Protocol):
    """A swarm as quiet ticks see it; see `swarm.Swarm`."""

    simulator: Simulator
    fleet: Fleet
    radio: Radio
    posted: list[Message]
    mission: list[Order]
    senders: list[Callable[[], None]]
    telemetry_ticks: int
    sonars: frozenset[int]
    thought: Rows
    whole: bool

    @property
    def witnesses(self) -> Sequence[QuietWitness]: ...

    @property
    def desks(self) -> Sequence[QuietDesk]: ...

    @property
    def quiet(self) -> QuietWorld: ...

    def rows_of(self, sonars: frozenset[int], /) -> list[int]: ...

    def report(self) -> None: ...

    def follow(self) -> None: ...

    def advance(self, most: int, /) -> int: ...


class QuietWitness(Protocol):
    """A witness as quiet ticks see it; see `swarm.Witness`."""

    def ticking(self) -> None: ...

    def ticked(self) -> None: ...


class QuietWorld:
    """Makes the quiet ticks of one swarm. ticks: how many it has made."""

    def __init__(self, swarm: QuietSwarm) -> None:
        self._swarm = swarm
        self._minds = QuietMinds(swarm.fleet)
        scenario = swarm.simulator.scenario
        self._tick = scenario.tick
        self._events = sorted(event_ticks(scenario.events, scenario.tick))
        self._everybody, self._nobody = Rows.run(0, len(swarm.fleet)), Rows.run(0, 0)
        self._most = max(1, LONGEST // len(swarm.fleet))
        self._told = 0
        """How often minds had looked at their rules when the block was told of these."""
        self._asked: frozenset[int] = frozenset()
        self._attends = self._reports = False
        """Whether any desk has to attend at some time; whether the last tick has anything to report."""
        self._moves: Moves | None = None
        """What compiled code copies when telemetry is sampled; None if it does not do that."""
        self.ticks = 0

    def make(self, most: int) -> int:
        """Make so many quiet ticks, or fewer; gives how many, 0 if the next tick is none."""
        if self.block is None or not self.begin(most, alone=True):
            return 0
        try:
            self.block.make()
        finally:  # where Ctrl-C comes, which waits for compiled code: the ticks are made
            made = self.end()
        return made

    @cached_property
    def block(self) -> BodyBlock | None:
        """The bodies for compiled code; None where there is none for all that they do."""
        simulator = self._swarm.simulator
        if simulator.bodies.machine.name != "numba" or simulator.population is not None:
            return None
        if simulator.pool.threads > 1 and len(self._swarm.fleet) > SHARED:
            return None
        from sleepcast.simulator.quiet.blocks import BodyBlock, covered

        return BodyBlock(simulator) if covered(simulator) else None

    # ---- what a quiet tick is

    def quiet_for(self, most: int) -> int:
        """How many ticks will be quiet from now on, at most `most`; the last one may have something to report."""
        swarm = self._swarm
        simulator, block = swarm.simulator, self.block
        if swarm.posted or swarm.senders or simulator.news or block is None or not block.suits:
            return 0
        if not all(getattr(each, "patient", False) for each in swarm.witnesses):
            return 0
        now = simulator.tick
        if simulator.supplies is not None:
            most = min(most, simulator.supplies.due - 1 - now)
        most = min(most, self._most, self._before_orders(now), self._before_messages(now), self._before_reports(now))
        most = min(most, self._before_instants(now), self._minds.ready()) if most > 0 else 0
        self._moves = self._sampling() if most > 0 else None
        if swarm.desks and self._moves is None:
            most = min(most, swarm.telemetry_ticks - now % swarm.telemetry_ticks)
        return most

    def _sampling(self) -> Moves | None:
        """What is copied when telemetry is sampled, if nobody has to see each sample."""
        swarm, desks = self._swarm, self._swarm.desks
        if not desks or not swarm.radio.reaches_all or not all(desk.counts_latest for desk in desks):
            return None
        return swarm.fleet.telemetry.moves()

    def _before_orders(self, now: int) -> int:
        """Ticks before the next order or event."""
        swarm = self._swarm
        following = bisect_right(self._events, now)
        due = [self._events[following]] if following < len(self._events) else []
        if swarm.mission and swarm.desks:
            due.append(tick_at(swarm.mission[0].time, self._tick))
        return min(due) - 1 - now if due else self._most

    def _before_messages(self, now: int) -> int:
        """Ticks before something arrives by radio."""
        due = self._swarm.radio.next_due
        if due == inf or due == -inf:
            return self._most if due > 0.0 else 0
        ticks = int(due / self._tick) + 2 - now
        while ticks > 0 and (now + ticks) * self._tick >= due:
            ticks -= 1
        return ticks

    def _before_instants(self, now: int) -> int:
        """Ticks before robots obey a command that waits for an instant: in the tick that is nearest to it."""
        due = self._swarm.fleet.timing.due
        return self._most if due == inf else max(0, int(max(due, 0.0) / self._tick) - 2 - now)

    def _before_reports(self, now: int) -> int:
        """Ticks up to the next one that has something to report, telemetry apart: at least 1."""
        swarm, ticks = self._swarm, [self._most]
        due = min([desk.next_due for desk in swarm.desks], default=inf)
        self._attends = due < inf
        if self._attends:  # a desk that has never sent a heartbeat is overdue since -inf
            ticks.append(max(1, int(max(0.0, due) / self._tick) - 1 - now))
        if swarm.simulator.scenario.measures:
            following = swarm.simulator.measuring.following(now)
            ticks += [] if following is None else [following - now]
        return min(ticks)

    # ---- making them

    def begin(self, most: int, *, alone: bool = False) -> int:
        """Get ready for so many quiet ticks, or fewer; gives how many. `end` is to follow once they are made. alone: by
        this thread, of this world only."""
        ticks = self.quiet_for(most)
        if not ticks or self.block is None:
            return 0
        swarm, block, minds = self._swarm, self.block, self._minds
        if alone:
            block.lend()
        for witness in swarm.witnesses:
            witness.ticking()
        if minds.looks != self._told:
            self._told = minds.looks
            block.think(*minds.rules)
            self._asked = same(swarm.sonars & minds.reads()) if minds.awake else frozenset()
            block.listen(swarm.rows_of(self._asked))
        block.prepare()
        desks, sonars = swarm.desks, bool(swarm.sonars)
        block.sample(0 if self._moves is None else swarm.telemetry_ticks, self._moves, sonars=sonars)
        left = bool(desks) and self._moves is None
        sampled = left and (swarm.simulator.tick + ticks) % swarm.telemetry_ticks == 0
        self._reports = sampled or self._attends
        block.begin(ticks, sampled and sonars and (bool(self._asked) or swarm.radio.reaches_all))
        swarm.whole = False
        return ticks

    def cancel(self) -> None:
        """No tick was made after `begin`."""
        self._swarm.whole = True

    @property
    def may_stop(self) -> bool:
        """After `begin`: whether fewer ticks may be made, since rules run or bodies may touch in the air."""
        return self._minds.awake or (self.block is not None and self.block.flies)

    def end(self, made: int | None = None) -> int:
        """Note what has come of them, and report; gives how many there were. made: that, if they were made in several
        calls."""
        swarm, block, minds = self._swarm, self.block, self._minds
        assert block is not None
        if not block.moved:
            self.cancel()
            return 0
        ticks, left = block.done if made is None else made, block.left
        block.note()
        simulator = swarm.simulator
        minds.note(ticks, block.most_steps)
        begun = left is not None
        self._note_samples(simulator.tick - begun, ticks)
        if left == TOUCHED:
            minds.at(simulator.tick - 1, (simulator.tick - 1) * self._tick)
            swarm.follow()
        else:
            self._follow(left)
        swarm.whole = True
        for witness in swarm.witnesses:
            witness.ticked()
        self.ticks += ticks + begun
        return ticks + begun

    def _follow(self, left: int | None) -> None:
        """The rest of the latest tick, in which rules have run, all of them or up to a leg that has left robots."""
        swarm, minds, simulator = self._swarm, self._minds, self._swarm.simulator
        minds.at(simulator.tick, simulator.time)
        if left is not None:
            minds.finish(left)
        swarm.thought = self._everybody if minds.awake else self._nobody
        if simulator.scenario.measures:
            simulator.measuring.observe(simulator.tick, simulator.time)
        if left is not None or self._reports:
            swarm.report()

    def _note_samples(self, tick: int, ticks: int) -> None:
        """So many ticks were made up to this one: note the telemetry of the last one in which it was sampled."""
        swarm = self._swarm
        last = tick - tick % swarm.telemetry_ticks
        if self._moves is None or last <= tick - ticks:
            return
        now = last * self._tick
        with swarm.fleet.telemetry.taken(self._minds.clock(last, now)):
            for desk in swarm.desks:
                desk.observe_many(now, self._everybody.robots)


class QuietTicks:
    """Several swarms of which each call lets all make ticks; quiet ones in one call of compiled code.

    swarms: of any sizes and scenarios. They are the caller's: between two calls each may be looked at, commanded and
        changed as always, and its ticks come to the same as if it ran alone, bit for bit.
    threads: that share the work; the result does not depend on them.

    Making ready takes a millisecond or two for each swarm, once.
    """

    def __init__(self, swarms: Sequence[QuietSwarm], threads: int = 1) -> None:
        self._swarms, self._threads = list(swarms), threads
        self._places: dict[int, int] = {}
        """Of the swarms in the table."""
        self._table = self._ready()

    def step(self, ticks: int = 1, which: Sequence[int] | None = None) -> None:
        """Let these swarms (indices, ascending; None: all) make so many ticks each."""
        chosen = range(len(self._swarms)) if which is None else which
        left = dict.fromkeys(chosen, ticks)
        while left:
            made = self._make(left)
            for number in left.keys() - made.keys():
                self._swarms[number].advance(1)
            left = {number: most - made.get(number, 1) for number, most in left.items() if most > made.get(number, 1)}

    def _make(self, most: Mapping[int, int]) -> dict[int, int]:
        """Let these swarms make quiet ticks where the next one is, at most so many; gives how many each has made.
        Whatever is raised, each is whole that has raised nothing itself."""
        begun, made, errors = list[int](), dict[int, int](), list[BaseException]()
        try:
            if self._table is not None:
                self._table.provide()
            for number, ticks in most.items():
                begun += [number] if self._swarms[number].quiet.begin(ticks) else []
            if self._table is not None and begun:
                self._table.make([self._places[number] for number in begun])
        except BaseException as error:
            errors.append(error)
        for number in begun:
            try:
                made[number] = self._swarms[number].quiet.end()
            except BaseException as error:
                errors.append(error)
        if errors:
            raise errors[0]
        return made

    # ---- many ticks, some at a time

    def hold(self, most: int) -> int:
        """Get all swarms ready for a stretch of so many quiet ticks, or fewer, of which `go_on` makes some at a time;
        gives how many, 0 where some tick is not quiet or fewer may be made. Until `let_go` nobody may look at the
        swarms."""
        begun, least = list[QuietWorld](), most
        if self._table is not None:
            self._table.provide()
        for swarm in self._swarms if len(self._places) == len(self._swarms) else ():
            ticks = swarm.quiet.begin(most)
            begun += [swarm.quiet] if ticks else []
            least = min(least, 0 if swarm.quiet.may_stop else ticks)
            if not least:
                break
        if len(begun) < len(self._swarms) or not least:
            for each in begun:
                each.cancel()
            return 0
        self._made, self._each = 0, (0, False)
        return least

    def go_on(self, ticks: int, *, sonars: bool) -> None:
        """Make so many ticks of the stretch in all swarms. sonars: whether all of them measure in the last one."""
        assert self._table is not None
        if self._each != (ticks, sonars):
            self._each = ticks, sonars
            self._table.begin(ticks, sonars)
        self._table.make(range(len(self._swarms)))
        self._made += ticks

    def let_go(self) -> None:
        """The stretch is over, or as much of it as was wanted."""
        for swarm in self._swarms:
            swarm.quiet.end(self._made)

    def replace(self, number: int, swarm: QuietSwarm) -> None:
        """Put another swarm in the place of the one with this index: that one is over."""
        self._swarms[number] = swarm
        block, place = swarm.quiet.block, self._places.get(number)
        if self._table is not None and block is not None and place is not None:
            self._table.replace(place, block)
        elif block is not None or place is not None:
            self._table = self._ready()

    def _ready(self) -> WorldTable | None:
        """The table of all swarms for which there is compiled code; None without any."""
        blocks: list[BodyBlock] = []
        self._places.clear()
        for number, swarm in enumerate(self._swarms):
            if swarm.quiet.block is not None:
                self._places[number] = len(blocks)
                blocks.append(swarm.quiet.block)
        if not blocks:
            return None
        from sleepcast.simulator.quiet.blocks import WorldTable

        return WorldTable(blocks, self._threads)
