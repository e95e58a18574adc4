"""The scheduler: one round of the active buffers a tick, within a budget of steps.

Every active buffer is evaluated once, E1 upwards and then the rules in the order of their arrival; a higher priority
goes later, because the last write to an actuator wins. If the budget does not reach for all, the higher priority is
served, then those left over from the tick before; the others go first in the next tick.
"""

from __future__ import annotations

from collections.abc import Callable

from sleepcast.mind.limits import TICK_STEPS
from sleepcast.node.buffers import ExpressionBuffer, RuleBase


class Scheduler:
    """Rounds over one robot's rule base. evaluate: evaluates one buffer and notes the steps it used."""

    def __init__(self, rules: RuleBase, evaluate: Callable[[ExpressionBuffer], None]) -> None:
        self._rules, self._evaluate = rules, evaluate
        self._left_over: frozenset[str] = frozenset()

    def round(self) -> None:
        """Evaluate the active buffers as far as the budget reaches."""
        chosen = running = self._rules.running
        if self._left_over or sum(map(_expected, running)) > TICK_STEPS:
            chosen = self._choose(running)
        used = 0
        for buffer in chosen:
            if buffer.active:
                self._evaluate(buffer)
                used += buffer.steps
                if used > TICK_STEPS:
                    done = {b.key for b in chosen[: chosen.index(buffer) + 1]}
                    self._left_over |= {b.key for b in chosen} - done
                    return

    def _choose(self, running: list[ExpressionBuffer]) -> list[ExpressionBuffer]:
        """Those that the budget reaches for, in the order of evaluation; the others are left over."""
        urgent = sorted(running, key=lambda b: (-b.priority, b.key not in self._left_over))
        budget = TICK_STEPS
        taken: set[str] = set()
        for buffer in urgent:
            budget -= _expected(buffer)
            if budget < 0 and taken:
                break
            taken.add(buffer.key)
        chosen = [b for b in running if b.key in taken]
        chosen.sort(key=lambda b: (b.priority, b.key not in self._left_over))
        self._left_over = frozenset(b.key for b in running) - taken
        return chosen


def _expected(buffer: ExpressionBuffer) -> int:
    """Steps that a buffer will probably use: its own bound, or what it and all it enters used the last time."""
    return max(buffer.program.cost, buffer.steps)
