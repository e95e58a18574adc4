"""The batch scheduler: evaluates the active rules of many robots in a tick, in each robot's own order and budget.

The order is that of one robot's scheduler: E1 upwards, then the rules in order of arrival, higher priorities later.
If the budget does not suffice for all, higher priorities are served first, then those left over from the tick
before. Robots with different rules take different ways; where ways meet in the same rule, the robots evaluate it
together.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

import numpy as np
from numpy.typing import NDArray

from sleepcast.columns.machine import walk_through
from sleepcast.columns.values import Mask, Rows
from sleepcast.fleet.authority import FleetAuthority
from sleepcast.fleet.evaluation import RuleStatistics
from sleepcast.fleet.memory import FleetMemory
from sleepcast.fleet.native.compiler import Kernel, ResultColumns, moment
from sleepcast.fleet.native.kernels import SequencePlan
from sleepcast.language.program import Program
from sleepcast.language.vocabulary import TIME_SLOT
from sleepcast.mind.limits import FAILED, MAX_FAULTS_IN_ROW, TICK_STEPS
from sleepcast.mind.rules import levels


class Way:
    """Robots with the same remaining rules.

    keys: of these rules, in order
    done: number of those already evaluated
    until: number of those to walk now
    """

    def __init__(self, keys: tuple[str, ...], rows: Rows, done: int = 0, until: int | None = None) -> None:
        self.keys, self.rows, self.done = keys, rows, done
        self.until = len(keys) if until is None else until

    @property
    def head(self) -> str:
        return self.keys[self.done]


class BatchScheduler:
    """The rounds of a fleet. left_over: by robot, the rules that the budget of the last tick did not reach."""

    def __init__(self, memory: FleetMemory, authority: FleetAuthority) -> None:
        self._memory, self._authority = memory, authority
        self._used: NDArray[np.int32] = np.zeros(memory.state.count, np.int32)
        self.left_over: dict[int, frozenset[str]] = {}

    def run(self, rows: Rows, *, natively: bool = True) -> None:
        """Run one round on each of these robots, which are awake. natively: also by native code."""
        with self._round():
            for stretch in (self._run_natively(rows) if natively else rows).stretches():
                self._used[stretch.index] = 0
                self._walk(self._ways(stretch))

    @contextmanager
    def _round(self) -> Iterator[None]:
        """Rules that are deactivated meanwhile are lost until its end, when all that was said is settled."""
        lost, outbox = self._memory.statistics.lost, self._memory.outbox
        said = outbox.size
        lost.clear()
        yield
        lost.clear()
        outbox.settle(said)

    # ---- by native code

    def _run_natively(self, rows: Rows) -> Rows:
        """Run the rounds of robots whose rules have native code; returns the others."""
        memory, kernels = self._memory, self._memory.kernels
        if kernels is None or rows.size == 0:
            return rows
        left = []
        for plan, some, _ in memory.divide(rows, lambda number: kernels.plan(memory.minds[number], memory.state)):
            if plan is None or not self.affordable(plan):
                left.append(some)
                continue
            if self.left_over:
                behind = np.isin(some.robots, list(self.left_over))
                left.append(some.take(behind))
                some = some.take(~behind) if behind.any() else some
            if some.size:
                self._follow(plan, some)
        return Rows.together(left) if left else Rows.run(0, 0)

    def affordable(self, plan: SequencePlan) -> bool:
        """Whether the budget suffices for all rules of a plan, whatever branches are taken."""
        expected = plan.of.steps
        for key, size in zip(plan.keys, plan.of.sizes, strict=True):
            expected += max(0, self._memory.statistics[key].most_steps - size.steps)
        return expected <= TICK_STEPS

    def _follow(self, plan: SequencePlan, rows: Rows) -> None:
        """Run one round on robots that all have the rules of a plan, leg by leg."""
        self._used[rows.index] = 0
        self._go_on(plan, rows, 0, None)

    def resume(self, plan: SequencePlan, leg: int, left: Rows) -> None:
        """Finish a round of all robots that others have begun, up to and with the native code of this leg of a plan,
        which has left some robots to be walked."""
        with self._round():
            self._used[:] = 0
            rows = Rows.run(0, self._memory.state.count)
            for done, before in enumerate(plan.legs[:leg]):
                first = sum(each.rules for each in plan.legs[:done])
                if before.kernel is not None:
                    self._note(plan.keys[first : first + before.rules], before.kernel, rows, last=False)
            self._go_on(plan, rows, leg, left)

    def _go_on(self, plan: SequencePlan, rows: Rows, begin: int, left: Rows | None) -> None:
        """The rest of a round, from this leg on. left: the robots that its native code has left to be walked; None if
        it has not run yet."""
        memory = self._memory
        done = sum(leg.rules for leg in plan.legs[:begin])
        for leg in plan.legs[begin:]:
            after = done + leg.rules
            if leg.kernel is None:
                before = memory.state.mind[rows.index].copy()
                way = Way(plan.keys, rows, done, after)
                self._walk([way])
                rows = self._unchanged(way, rows, before)
            else:
                keys, last = plan.keys[done:after], after == len(plan.keys)
                if left is None:
                    left = self._evaluate_natively(keys, leg.kernel, rows)
                well = rows.take(~np.isin(rows.robots, left.robots)) if left.size else rows
                self._note(keys, leg.kernel, well, last=last)
                if left.size:
                    self._walk([Way(plan.keys, left, done)])
                rows, left = well, None
            if rows.size == 0:
                return
            done = after

    def _unchanged(self, way: Way, rows: Rows, before: NDArray[np.int32]) -> Rows:
        """The robots whose minds the walk has not changed; the others, which have different rules now, continue by
        walking."""
        memory = self._memory
        changed = memory.state.mind[rows.index] != before
        for lost in memory.statistics.lost.values():
            changed |= lost[rows.index]
        spent = np.ones(rows.size, np.bool_)
        spent[np.isin(rows.robots, way.rows.robots)] = False
        on = rows.take(changed & ~spent)
        if on.size and way.until < len(way.keys):
            self._walk([Way(way.keys, on, way.until)])
        return rows.take(~(changed | spent)) if changed.any() or spent.any() else rows

    def _evaluate_natively(self, keys: Sequence[str], kernel: Kernel, rows: Rows) -> Rows:
        """Evaluate rules by native code; returns the robots that have to be walked."""
        memory, kernels = self._memory, self._memory.kernels
        assert kernels is not None
        one = int(rows.index.start if isinstance(rows.index, slice) else rows.index[0])
        when = moment(memory.state, Rows.run(one, one + 1))  # all robots of a round have the same tick and time
        return kernels.evaluate(kernel, memory.state, rows, when, self.sinks(keys, kernel))

    def sinks(self, keys: Sequence[str], kernel: Kernel) -> list[ResultColumns]:
        """Where native code writes the results of these rules."""
        tallies = (self._memory.statistics[key] for key in keys)
        return [tally.sink(steps=entering) for tally, entering in zip(tallies, kernel.entering, strict=True)]

    def _note(self, keys: Sequence[str], kernel: Kernel, rows: Rows, *, last: bool) -> None:
        """Native code has evaluated rules on these robots. last: whether nothing follows."""
        if kernel.pings:
            self._memory.outbox.ping_noted()
        tallies = [self._memory.statistics[key] for key in keys]
        for tally, steps, entering in zip(tallies, kernel.steps, kernel.entering, strict=True):
            tally.ran(steps, rows, stored=entering)
            if not last:
                self._used[rows.index] += np.asarray(tally.steps(rows), np.int32)

    # ---- choice and order of rules

    def _ways(self, rows: Rows) -> list[Way]:
        memory, ways = self._memory, []
        for sequence, some, _ in memory.divide(rows, lambda number: memory.minds[number].sequence):
            if not sequence:
                continue
            choosing = self._must_choose(some)
            for robot in some.robots[choosing].tolist():
                ways.append(Way(self._choose(robot), Rows.of(np.array([robot]))))
            if not choosing.all():
                ways.append(Way(sequence, some.take(~choosing) if choosing.any() else some))
        return ways

    def _must_choose(self, rows: Rows) -> Mask:
        """Robots with rules left over, or whose budget may not suffice for all."""
        memory = self._memory
        choosing = np.zeros(rows.size, np.bool_)
        for mind, some, mask in memory.divide(rows, lambda number: memory.minds[number]):
            tallies = [(rule.program.cost, memory.statistics[rule.key]) for rule in mind.running]
            if sum(max(cost, tally.most_steps) for cost, tally in tallies) > TICK_STEPS:
                expected = sum(np.maximum(cost, np.asarray(tally.steps(some), np.int32)) for cost, tally in tallies)
                choosing[... if mask is None else mask] = expected > TICK_STEPS
        if self.left_over:
            choosing |= np.isin(rows.robots, list(self.left_over))
        return choosing

    def _choose(self, robot: int) -> tuple[str, ...]:
        """The rules that one robot's budget suffices for, in order of evaluation; the others are left over."""
        mind = self._memory.mind_of(robot)
        running, level = mind.running, levels(mind.rules)
        left_over = self.left_over.get(robot, frozenset())
        budget = TICK_STEPS
        taken: set[str] = set()
        for rule in sorted(running, key=lambda k: (-level(k), k.key not in left_over)):
            budget -= max(rule.program.cost, self._memory.statistics[rule.key].steps_of(robot))
            if budget < 0 and taken:
                break
            taken.add(rule.key)
        chosen = [rule for rule in running if rule.key in taken]
        chosen.sort(key=lambda k: (level(k), k.key not in left_over))
        self._leave_over(robot, frozenset(rule.key for rule in running) - taken)
        return tuple(rule.key for rule in chosen)

    def _leave_over(self, robot: int, keys: frozenset[str]) -> None:
        if keys:
            self.left_over[robot] = keys
        else:
            self.left_over.pop(robot, None)

    # ---- evaluating

    def _walk(self, ways: list[Way]) -> None:
        """Evaluate one rule after the other, each on all robots for which it comes next."""
        while ways:
            key = _next(ways)
            meeting = [way for way in ways if way.head == key]
            self._evaluate(key, Rows.together([way.rows for way in meeting]))
            for way in meeting:
                way.done += 1
                self._leave_spent(way)
            ways = [way for way in ways if way.done < way.until and way.rows.size]

    def _leave_spent(self, way: Way) -> None:
        """Leave the remaining rules over on robots that have used up their budget."""
        spent = self._used[way.rows.index] > TICK_STEPS
        if spent.any():
            rest = frozenset(way.keys[way.done :])
            for robot in way.rows.robots[spent].tolist():
                self._leave_over(robot, self.left_over.get(robot, frozenset()) | rest)
            way.rows = way.rows.take(~spent)

    def _evaluate(self, key: str, rows: Rows) -> None:
        """Evaluate one rule where it still exists and is active."""
        memory = self._memory

        def active(number: int) -> Program | None:
            rule = memory.minds[number].rules.get(key)
            return rule.program if rule is not None and rule.active else None

        def may_be_replaced(number: int) -> bool:
            return not memory.minds[number].rules[key].protected

        lost = memory.statistics.lost_in_round(key, rows)
        if lost is not None and lost.any():
            rows = rows.take(~lost)
        for program, some, _ in memory.divide(rows, active):
            if program is not None and (behind := self._authority.behind(some)).size:
                for replaced, few, _ in memory.divide(behind, may_be_replaced):
                    if replaced:  # what it has used last time counts as if it ran
                        self._used[few.index] += np.asarray(memory.statistics[key].steps(few), np.int32)
                        some = some.without(few)
            if program is not None and some.size:
                memory.begin(program, some)
                values = walk_through(memory, program, some)
                steps = memory.steps(some)
                self._used[some.index] += steps
                self._tally(key, some, values, steps)

    def _tally(self, key: str, rows: Rows, values: NDArray[np.float64], steps: NDArray[np.int32] | int) -> None:
        """Record the result of the evaluation; a rule with nothing but faults is deactivated."""
        memory, tally = self._memory, self._memory.statistics[key]
        memory.statistics.changes += 1
        first = memory.first_faults()
        faulted = np.zeros(rows.size, np.bool_)
        if first:
            faulted = np.isin(rows.robots, list(first))
            memory.changing(rows.take(faulted))
        lost = memory.statistics.lost_in_round(key, rows)
        if lost is not None and lost.any():  # the rule no longer exists on these robots
            here = ~lost
            gone = set(rows.robots[lost].tolist())
            first = {robot: text for robot, text in first.items() if robot not in gone}
            rows, values, faulted = rows.take(here), values[here], faulted[here]
            steps = steps if isinstance(steps, int) else steps[here]
        tally.last_value[rows.index] = values
        tally.used(steps, rows)
        tally.most_steps = max(tally.most_steps, int(np.max(steps, initial=0)))
        tally.fired(rows, memory.matched[rows.index])
        if first or tally.faulted:
            tally.failed(rows, faulted, memory.state.column(TIME_SLOT, rows))
        if first:
            tally.last_fault = tally.last_fault | first
            self._deactivate(key, tally, rows.take(faulted))

    def _deactivate(self, key: str, tally: RuleStatistics, rows: Rows) -> None:
        """Deactivate a rule after too many consecutive faults, unless it is built in."""
        memory = self._memory
        worn = rows.take(tally.in_row(rows) >= MAX_FAULTS_IN_ROW)
        for number, some, _ in memory.divide(worn, lambda number: number):
            rule = memory.minds[number].rules[key]
            if not rule.protected:
                draft = memory.minds.draft(number)
                draft.activate(key, False)
                memory.turn(some, draft)
                memory.state.unproven_since[some.index] = FAILED
                memory.outbox.report(some, f"rule {rule.name} deactivated", rule=rule.name)


def _next(ways: list[Way]) -> str:
    """The rule to evaluate next: one that no way reaches later, if there is one, so that ways meet."""
    if len(ways) == 1:
        return ways[0].head
    later = {key for way in ways for key in way.keys[way.done + 1 : way.until]}
    robots: Counter[str] = Counter()
    for way in ways:
        robots[way.head] += way.rows.size
    free = {key: size for key, size in robots.items() if key not in later} or robots
    return max(free, key=lambda key: free[key])


def end_leases(memory: FleetMemory, rows: Rows, now: float) -> None:
    """Deactivate expressions whose lease has ended by `now` (s), and report it."""
    leases = memory.statistics.leases
    if not leases:
        return
    for mind, some, _ in memory.divide(rows, lambda number: memory.minds[number]):
        leased = [rule for rule in mind.running if rule.key in leases and not rule.protected]
        ended = [(rule, some.take(leases[rule.key][some.index] <= now)) for rule in leased]
        for rule, where in ended:
            for number, few, _ in memory.divide(where, lambda number: number):
                draft = memory.minds.draft(number)
                draft.activate(rule.key, False)
                memory.turn(few, draft)
        for rule, where in ended:
            memory.outbox.report(where, f"lease of {rule.name} ended")
