"""The scheduler: how each rule of a robot has performed, and which rules run in a tick, within a budget of steps.

Every active rule is evaluated once a tick, E1 upwards and then the rules in order of arrival; higher priorities run
later, because the last write to an actuator wins. If the budget does not suffice for all, higher priorities are
served first, then rules left over from the tick before; the rest come first in the next tick.
"""

from __future__ import annotations

from collections.abc import Callable
from math import inf, nan

from sleepcast.core.records import dataclass
from sleepcast.language.vocabulary import ACTIVE0, buffer_number
from sleepcast.mind.limits import TICK_STEPS
from sleepcast.mind.rules import Rule, RuleBase, levels, running

RuleSet = dict[str, tuple[Rule, float]]
"""What ROLLBACK restores: each rule that is not built in, by its key, and the end of its lease."""


@dataclass(slots=True)
class RuleRecord:
    """The performance of one rule or buffer.

    rule: its current state.
    lease: time (s) at which it is deactivated, inf for never.
    last_value, last_fault, steps: of its last evaluation.
    firings: number of evaluations in which its test held.
    faults_in_row: number of latest consecutive evaluations with a fault.
    gone: whether the rule was forgotten.
    """

    rule: Rule
    lease: float = inf
    last_value: float = nan
    last_fault: str = ""
    steps: int = 0
    firings: int = 0
    faults_in_row: int = 0
    gone: bool = False


class RuleRecords:
    """The records of all rules of one robot, by key.

    base: the rules.
    values: the robot's variables, which include the flags of buffers.
    version: increases with every change.
    """

    def __init__(self, base: RuleBase, values: list[float]) -> None:
        self._base, self._values = base, values
        self._records: dict[str, RuleRecord] = {}
        self._running: list[RuleRecord] | None = []
        self.version = 0

    def __getitem__(self, key: str) -> RuleRecord:
        return self._records[key]

    @property
    def running(self) -> list[RuleRecord]:
        """The records of the active rules, in order of evaluation; sorted on the first request after a change."""
        if self._running is None:
            self._running = [self._records[rule.key] for rule in running(self._base.rules)]
        return self._running

    def levels(self) -> Callable[[Rule], int]:
        """What orders the rules: see `mind.rules.levels`."""
        return levels(self._base.rules)

    def apply_effects(self) -> None:
        """Apply the effects of the last changes of the rule base to this robot."""
        if not self._base.effects:
            return
        for effect in self._base.effects:
            key, record = effect.key, self._records.get(effect.key)
            if effect.what == "new":
                self._records[key] = RuleRecord(self._base.rules[key])
            elif effect.what in ("active", "inactive"):
                number = buffer_number(key)
                if number is not None:
                    self._values[ACTIVE0 + number] = 1.0 if effect.what == "active" else 0.0
                if record is not None and effect.what == "inactive":
                    record.lease = inf
            elif record is not None and effect.what == "renewed":
                record.last_value, record.last_fault, record.faults_in_row = nan, "", 0
            elif record is not None and effect.what == "gone":
                self._records.pop(key).gone = True
            if key in self._records and key in self._base.rules:
                self._records[key].rule = self._base.rules[key]
        self._base.effects.clear()
        self.version += 1
        self._running = None

    def changed(self) -> None:
        """Update every record from the rule base, and discard the order of evaluation."""
        self.version += 1
        for key, rule in self._base.rules.items():
            self._records[key].rule = rule
        self._running = None

    def deactivate(self, key: str) -> None:
        """Clear the flag of a rule."""
        self._base.activate(key, False)
        self.apply_effects()

    def expire(self, now: float) -> list[Rule]:
        """Deactivate those whose lease has ended, and return them; what the host has protected since goes on."""
        ended = [record.rule for record in self.running if record.lease <= now and not record.rule.protected]
        for rule in ended:
            self.deactivate(rule.key)
        return ended

    def rule_set(self) -> RuleSet:
        """The current rules, for a rollback."""
        rules = self._base.rules.values()
        return {rule.key: (rule, self._records[rule.key].lease) for rule in rules if not rule.protected}

    def restore_leases(self, rule_set: RuleSet) -> None:
        """Restore the leases of restored rules."""
        for key, (_, lease) in rule_set.items():
            self._records[key].lease = lease
        self.changed()


class Scheduler:
    """Rounds over one robot's rules. evaluate: evaluates one rule and records the steps it used."""

    def __init__(self, records: RuleRecords, evaluate: Callable[[RuleRecord], None]) -> None:
        self._records, self._evaluate = records, evaluate
        self._left_over: frozenset[str] = frozenset()

    def round(self) -> None:
        """Evaluate the active rules as far as the budget suffices."""
        chosen = running = self._records.running
        if self._left_over or sum(map(_expected, running)) > TICK_STEPS:
            chosen = self._choose(running)
        used = 0
        for at, record in enumerate(chosen):
            if record.rule.active and not record.gone:
                self._evaluate(record)
                used += record.steps
                if used > TICK_STEPS:
                    done = {each.rule.key for each in chosen[: at + 1]}
                    self._left_over |= {each.rule.key for each in chosen} - done
                    return

    def _choose(self, running: list[RuleRecord]) -> list[RuleRecord]:
        """Those that the budget suffices for, in order of evaluation; the others are left over."""
        left_over, level = self._left_over, self._records.levels()
        urgent = sorted(running, key=lambda r: (-level(r.rule), r.rule.key not in left_over))
        budget = TICK_STEPS
        taken: set[str] = set()
        for record in urgent:
            budget -= _expected(record)
            if budget < 0 and taken:
                break
            taken.add(record.rule.key)
        chosen = [record for record in running if record.rule.key in taken]
        chosen.sort(key=lambda r: (level(r.rule), r.rule.key not in left_over))
        self._left_over = frozenset(record.rule.key for record in running) - taken
        return chosen


def _expected(record: RuleRecord) -> int:
    """Expected number of steps of a rule: its own bound, or what it and everything it enters used last time."""
    return max(record.rule.program.cost, record.steps)
