"""The scheduler: one round of the active buffers a tick, within a budget of steps.

Every active buffer is evaluated once, in order; what the budget leaves over goes first in the next tick.
"""

from __future__ import annotations

from collections.abc import Callable

from sleepcast.node.buffers import ExpressionBuffer, RuleBase

TICK_STEPS = 50_000
"""Steps that one robot's rules may use in one tick: ten milliseconds of a slow computer, a tenth of a 10 Hz tick."""


class Scheduler:
    """Round robin over one robot's rule base. evaluate: evaluates one buffer and notes the steps it used."""

    def __init__(self, rules: RuleBase, evaluate: Callable[[ExpressionBuffer], None]) -> None:
        self._rules, self._evaluate = rules, evaluate
        self._left_over: list[str] = []

    def round(self) -> None:
        """Evaluate the active buffers, those left over from the last round first."""
        waiting = self._rules.running
        if self._left_over:
            first = [b for b in waiting if b.key in self._left_over]
            waiting = first + [b for b in waiting if b.key not in self._left_over]
            self._left_over = []
        used = 0
        for i, buffer in enumerate(waiting):
            if used >= TICK_STEPS:
                self._left_over = [b.key for b in waiting[i:]]
                return
            if buffer.active:
                self._evaluate(buffer)
                used += buffer.steps
