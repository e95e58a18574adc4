"""Buffers and rules: the expressions that a robot keeps, and which of them run at every tick.

The buffers E1 to E63 and the rules with names of their own are kept alike; a rule's active flag lies here, a buffer's
in the variable active1 to active63. The round is E1 upwards, then the rules in the order of their arrival.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from math import inf, nan

from sleepcast.language.program import Program
from sleepcast.language.vocabulary import ACTIVE0, BUFFERS, buffer_number
from sleepcast.mind.merging import Making


@dataclass(slots=True)
class ExpressionBuffer:
    """One kept expression.

    key: e1 to e63, or the rule's case-folded name. name: as written. text: of the expression. lease: time (s) at
    which it is deactivated, inf for never. protected: built in, cannot be changed over the air. priority: the higher,
    the later in the round (its writes win) and the safer from a budget that does not reach for all. last_value,
    last_fault, steps: of its last evaluation. firings: evaluations in which its test held. faults_in_row: of its last
    evaluations, how many without a break had a fault.
    """

    key: str
    name: str
    text: str
    program: Program
    active: bool = False
    lease: float = inf
    protected: bool = False
    priority: int = 0
    last_value: float = nan
    last_fault: str = ""
    steps: int = 0
    firings: int = 0
    faults_in_row: int = 0


RuleSet = Mapping[str, tuple[str, str, Program, bool, float]]
"""What ROLLBACK brings back: key to name, text, program, active flag and lease."""


class RuleBase:
    """The kept expressions of one robot by key. values: the robot's numbers, where the active flags of buffers lie."""

    def __init__(self, values: list[float]) -> None:
        self._values = values
        self.kept: dict[str, ExpressionBuffer] = {}
        self.running: list[ExpressionBuffer] = []
        """The active ones, in the order of the round; made anew by `changed`."""
        self.leases = False
        """Whether any of them has a lease."""
        self.version = 0
        """Grows with every change."""

    def put(self, key: str, name: str, text: str, program: Program) -> ExpressionBuffer:
        """Keep an expression; one that is there already keeps its place, its flag and its lease."""
        found = self.kept.get(key)
        if found is None:
            found = self.kept[key] = ExpressionBuffer(key, name, text, program)
            found.active = self._flag(key) > 0.0
        else:
            found.text, found.program = text, program
            found.last_value, found.last_fault, found.faults_in_row = nan, "", 0
        self.changed()
        return found

    def remove(self, key: str) -> None:
        """Forget an expression and clear its flag."""
        self.activate(self.kept[key], False)
        del self.kept[key]
        self.changed()

    def activate(self, buffer: ExpressionBuffer, active: bool) -> None:
        """Set an active flag, wherever it lies."""
        number = buffer_number(buffer.key)
        if number is not None:
            self._values[ACTIVE0 + number] = 1.0 if active else 0.0
        buffer.active = active
        if not active:
            buffer.lease = inf
        self.changed()

    def flags_assigned(self) -> None:
        """Take over the flags active1 to active63 after an expression has assigned one."""
        for buffer in self.kept.values():
            if buffer_number(buffer.key) is not None:
                buffer.active = self._flag(buffer.key) > 0.0
        self.changed()

    def changed(self) -> None:
        """Make the round anew: in order, a higher priority later."""
        self.version += 1
        self.running = sorted((b for b in self.in_order() if b.active), key=lambda b: b.priority)
        self.leases = any(buffer.lease < inf for buffer in self.running)

    def in_order(self) -> Iterator[ExpressionBuffer]:
        """All of them: E1 upwards, then the rules in the order of their arrival."""
        for number in range(1, BUFFERS):
            if (buffer := self.kept.get(f"e{number}")) is not None:
                yield buffer
        for buffer in self.kept.values():
            if buffer_number(buffer.key) is None:
                yield buffer

    def arrange(self, first: Callable[[str], Making]) -> None:
        """Let the rules run in the order in which they were first made; those of the same place stay as they are."""
        keys = list(self.kept)
        ordered = sorted(keys, key=first)
        if keys != ordered:
            self.kept = {key: self.kept[key] for key in ordered}
            self.changed()

    def rules(self) -> int:
        """How many rules with names of their own there are."""
        return sum(buffer_number(key) is None for key in self.kept)

    def rule_set(self) -> RuleSet:
        """All of them as they are, to come back to."""
        return {b.key: (b.name, b.text, b.program, b.active, b.lease) for b in self.kept.values() if not b.protected}

    def restore(self, rule_set: RuleSet) -> None:
        """Bring a rule set back; what is protected stays."""
        for key in [b.key for b in self.kept.values() if not b.protected]:
            self.remove(key)
        for key, (name, text, program, active, lease) in rule_set.items():
            buffer = self.put(key, name, text, program)
            self.activate(buffer, active)
            buffer.lease = lease
        self.changed()

    def expire(self, now: float) -> list[ExpressionBuffer]:
        """Deactivate those whose lease has ended; gives them."""
        ended = [buffer for buffer in self.running if buffer.lease <= now]
        for buffer in ended:
            self.activate(buffer, False)
        return ended

    def _flag(self, key: str) -> float:
        number = buffer_number(key)
        return 0.0 if number is None else self._values[ACTIVE0 + number]
