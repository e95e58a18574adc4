"""What a tick without messages takes of a fleet's minds: the native code of its rules, to be called by somebody else.

`QuietMinds` tells whether all robots have the same rules, all of them in native code, and nothing else to do; which
functions are to be called in a tick, with which tables; and it notes afterwards what the ticks have come to, as
`Fleet.think` does for each of them.
"""

from __future__ import annotations

from sleepcast.core.memory import same
from sleepcast.core.records import NamedTuple
from sleepcast.fleet.evaluation import RuleStatistics
from sleepcast.fleet.fleet import Fleet
from sleepcast.fleet.native.compiler import Kernel
from sleepcast.fleet.native.kernels import SequencePlan
from sleepcast.language.vocabulary import ACTIVE0, BUFFERS, FROZEN, SLEEPING, TICK, TIME_SLOT

MOST = 254
"""Ticks after which a fleet counts what its rules have matched."""


class QuietRules(NamedTuple):
    """The native code of the rules of all robots, leg by leg.

    legs: the addresses of each one's function and table, see `native.compiler`
    moments: addresses of words that are to hold the time, each with what of it (`native.compiler.Moment`)
    steps: the addresses of the columns of steps whose maxima are wanted
    actuators: that rules may assign, by name: the addresses of their values, and of who has assigned them
    drawn: the address of the numbers drawn by each robot, to be 0 before
    """

    legs: list[tuple[int, int]]
    moments: list[tuple[int, int]]
    steps: list[int]
    actuators: dict[str, tuple[int, int]]
    drawn: int


NOTHING = QuietRules([], [], [], {}, 0)


class QuietMinds:
    """The minds of a fleet in quiet ticks; see the module."""

    def __init__(self, fleet: Fleet) -> None:
        self._fleet = fleet
        self._everybody = fleet.rows()
        self._plan: SequencePlan | None = None
        self.looks = 0
        """How often it was found out which rules there are: as long as it stays the same, so do `rules`."""
        self._assigned: frozenset[int] = frozenset()
        """The slots of the actuators that rules assign."""
        self._tallies: list[RuleStatistics] = []
        self._stamp: tuple[int, ...] | None = None
        """What tells whether anything has changed that rules depend on; None if they cannot be evaluated so."""
        self._settled = False
        """Whether all that ticks come to besides has been noted."""

    def ready(self) -> int:
        """How many ticks may follow in which nothing but native rules are evaluated, on all robots alike, or nothing at
        all; 0 if there is something else to do. Then `rules` says which."""
        fleet = self._fleet
        waiting = not fleet.inbox.empty or not fleet.outbox.empty or fleet.memory.statistics.leases
        if waiting or fleet.bids.busy or fleet.scheduler.left_over or fleet.rests or not fleet.authority.idle:
            return 0
        if (self._stamp != self._stamp_now() and not self._look()) or self._pending():
            return 0
        if self._plan is None:
            return MOST
        if fleet.kernels is not None:
            fleet.kernels.everybody(fleet.state)
        return min([tally.uncounted for tally in self._tallies])

    def _stamp_now(self) -> tuple[int, ...]:
        fleet = self._fleet
        code = fleet.kernels.ready if fleet.kernels is not None else 0
        return fleet.state.turns, fleet.state.layouts, fleet.memory.statistics.changes, code

    def _look(self) -> bool:
        """Find out which rules there are now. False if there is more than native code to be evaluated."""
        fleet, state = self._fleet, self._fleet.state
        self._stamp, self._settled = None, False
        if state.one_mind is None or fleet.measured:
            return False
        mind = fleet.minds[state.one_mind]
        if not mind.running:
            self._plan, self._assigned = None, frozenset()
        else:
            plan = fleet.kernels.known_plan(mind) if fleet.kernels is not None else None
            if plan is None or not self._bound(plan):
                return False
            self._plan = plan
            self._assigned = same(frozenset(slot for kernel in _kernels(plan) for slot in kernel.actuators))
            self._tallies = [fleet.memory.statistics[key] for key in plan.keys]
        self._stamp = self._stamp_now()
        self.looks += 1
        return True

    @property
    def awake(self) -> bool:
        """Whether there are rules."""
        return self._plan is not None

    @property
    def rules(self) -> QuietRules:
        """After `ready`."""
        return NOTHING if self._plan is None else self._of(self._plan)

    def _bound(self, plan: SequencePlan) -> bool:
        """Let the native code of a plan read and write the columns as they are now. False if it cannot."""
        state, scheduler, kernels = self._fleet.state, self._fleet.scheduler, self._fleet.kernels
        if kernels is None or not self._suits(plan) or not scheduler.affordable(plan):
            return False
        part, done = kernels.everybody(state), 0
        for leg, kernel in zip(plan.legs, _kernels(plan), strict=True):
            if not kernel.bind(state, part, scheduler.sinks(plan.keys[done : done + leg.rules], kernel)):
                return False
            done += leg.rules
        return True

    def _suits(self, plan: SequencePlan) -> bool:
        """Whether rules change nothing that matters to other parts of a tick than the bodies' actuators."""
        watched = [SLEEPING, FROZEN, *range(ACTIVE0, ACTIVE0 + BUFFERS)]
        count = self._fleet.state.count
        return not any(each.writes(watched) or each.pings or each.lanes > count for each in _kernels(plan))

    def _pending(self) -> bool:
        """Whether any actuator was assigned that rules do not assign."""
        return any(robots.any() for slot, robots in self._fleet.state.actuated.items() if slot not in self._assigned)

    def _of(self, plan: SequencePlan) -> QuietRules:
        fleet, state, kernels = self._fleet, self._fleet.state, _kernels(plan)
        first, names = fleet.vocabulary.first_actuator, fleet.vocabulary.actuators
        actuators = {slot: places for kernel in kernels for slot, places in kernel.actuators.items()}
        return QuietRules(
            [(kernel.code.address, kernel.table) for kernel in kernels],
            [moment for kernel in kernels for moment in kernel.moments],
            [fleet.memory.statistics[key].own_steps().ctypes.data for key in _entering(plan)],
            {names[slot - first].name: places for slot, places in actuators.items()},
            state.draws.ctypes.data,
        )

    def reads(self) -> frozenset[int]:
        """See `Fleet.reads`."""
        return self._fleet.reads()

    # ---- afterwards

    def note(self, ticks: int, most: list[int]) -> None:
        """So many ticks are over. most: the most steps of each column of `QuietRules.steps`."""
        plan = self._plan
        if plan is None or not ticks:
            return
        for tally in self._tallies:
            tally.ran_often(ticks)
        if most or not self._settled:
            self._settled = True
            highest = dict(zip(_entering(plan), most, strict=True))
            bounds = [steps for kernel in _kernels(plan) for steps in kernel.steps]
            for key, tally, steps in zip(plan.keys, self._tallies, bounds, strict=True):
                tally.ran_alike(steps, highest.get(key))

    def clock(self, tick: int, now: float) -> dict[int, float]:
        """What a tick of this number, which ends at `now` (s), sets on all robots, by slot."""
        return {TICK: float(tick), TIME_SLOT: float(now)} if self._plan is not None else {}

    def at(self, tick: int, now: float) -> None:
        """The last tick has this number, and ends at `now` (s)."""
        if self._plan is not None:
            for slot, value in self.clock(tick, now).items():
                self._fleet.state.assign(slot, self._everybody, value)
            self._fleet.tidy()  # all of what follows a round: nobody rested before, and these rules let nobody rest

    def finish(self, leg: int) -> None:
        """The native code of this leg has left robots in the latest tick: walk them, and let all run the rest of their
        rules."""
        fleet, plan = self._fleet, self._plan
        assert plan is not None
        assert fleet.kernels is not None
        everybody = self._everybody
        fleet.scheduler.resume(plan, leg, fleet.kernels.troubled(0, everybody.size))
        fleet.end_round(everybody)


def _kernels(plan: SequencePlan) -> list[Kernel]:
    return [leg.kernel for leg in plan.legs if leg.kernel is not None]


def _entering(plan: SequencePlan) -> list[str]:
    """The keys of the rules whose steps differ from robot to robot."""
    each = [entering for kernel in _kernels(plan) for entering in kernel.entering]
    return [key for key, entering in zip(plan.keys, each, strict=True) if entering]
