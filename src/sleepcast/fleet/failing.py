"""Rules that fail: whose last evaluation met a fault, and on which robots."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from sleepcast.fleet.memory import FleetMemory
from sleepcast.fleet.state import Index, Mind, Rows


@dataclass(frozen=True, eq=False)
class FailingRule:
    """A rule that fails on some robots. key, name: of the rule; robots: their places, ascending; inactive: how many of
    them have deactivated it because of its faults; reason: the fault of one of them, "" where that is unknown."""

    key: str
    name: str
    robots: Index
    inactive: int
    reason: str = ""


def failing_rules(memory: FleetMemory) -> list[FailingRule]:
    """The rules of a fleet that fail now: those on most robots first."""
    found = filter(None, (_failing(memory, key) for key in memory.statistics.faulted()))
    return most_first(found)


def most_first(rules: Iterable[FailingRule]) -> list[FailingRule]:
    """Those on most robots first."""
    return sorted(rules, key=lambda rule: (-len(rule.robots), rule.key))


def _failing(memory: FleetMemory, key: str) -> FailingRule | None:
    tally = memory.statistics[key]
    everybody = Rows.run(0, memory.state.count)
    rows = Rows.of(np.flatnonzero(tally.in_row(everybody)))
    rows = rows.take(memory.where(rows, lambda mind: key in mind.rules))  # it may have been forgotten since
    if rows.size == 0:
        return None

    def inactive(mind: Mind) -> bool:
        return not mind.rules[key].active

    first = int(rows.robots[0])
    name = memory.kept(first).rules[key].name
    count = int(np.count_nonzero(memory.where(rows, inactive)))
    return FailingRule(key, name, rows.robots, count, tally.last_fault.get(first, ""))
