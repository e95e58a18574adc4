"""Rules that fail: whose last evaluation had a fault, or one a short while ago, and on which robots.

A rule that fails now and then counts as failing in between, so that what people are told of it stays calm.
"""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from sleepcast.columns.values import Index, Rows
from sleepcast.core.records import dataclass
from sleepcast.fleet.memory import FleetMemory
from sleepcast.fleet.state import Mind

RECENT = 3.0
"""Seconds of a person's time after a fault for which its rule counts as failing."""
MAX_FAILING = 20
"""Failing rules that a person is told of; more would not be read."""


@dataclass(frozen=True, eq=False)
class FailingRule:
    """A rule that fails on some robots.

    key, name: of the rule
    robots: their places, ascending
    inactive: how many of them have deactivated it because of its faults
    reason: the fault of one of them, "" where that is unknown
    """

    key: str
    name: str
    robots: Index
    inactive: int
    reason: str = ""

    def bits(self, count: int) -> bytes:
        """For each of so many robots a bit that says whether it fails there, the first in bit 0 of the first byte."""
        marks = np.zeros(count, np.bool_)
        marks[self.robots[self.robots < count]] = True
        return np.packbits(marks, bitorder="little").tobytes()


def failing_rules(memory: FleetMemory, since: float) -> list[FailingRule]:
    """The rules of a fleet that fail now, or had a fault at this time (s) or later: those on most robots first."""
    rules = filter(None, (_failing(memory, key, since) for key in memory.statistics.faulted()))
    return most_first(rules)


def most_first(rules: Iterable[FailingRule]) -> list[FailingRule]:
    """Those on most robots first."""
    return sorted(rules, key=lambda rule: (-len(rule.robots), rule.key))


def _failing(memory: FleetMemory, key: str, since: float) -> FailingRule | None:
    tally = memory.statistics[key]
    rows = Rows.of(tally.failing(since))
    rows = rows.take(memory.where(rows, lambda mind: key in mind.rules))  # it may have been forgotten since
    if rows.size == 0:
        return None

    def inactive(mind: Mind) -> bool:
        return not mind.rules[key].active

    first = int(rows.robots[0])
    name = memory.mind_of(first).rules[key].name
    count = int(np.count_nonzero(memory.where(rows, inactive)))
    return FailingRule(key, name, rows.robots, count, tally.last_fault.get(first, ""))
