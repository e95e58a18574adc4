"""Rehearsals: a memory in which nothing happens, to see what an expression would do or did.

A preview asks what a robot would do now; a replay walks an evaluation again, and the memory answers what the robot's
answered then.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import nan

from sleepcast.core.records import NamedTuple
from sleepcast.language.acts import FLAGS
from sleepcast.language.evaluate import Entered
from sleepcast.language.parts import Label, Part, Storing
from sleepcast.language.vocabulary import ACTIVE0, BUFFERS, Variable, buffer_number


class NotedFault(NamedTuple):
    """A fault that a robot's memory noted, at its place among the answers."""

    part: Part
    reason: str


Answer = float | bool | Entered | NotedFault | tuple[float, ...] | None


class Rehearsal:
    """A memory in which nothing happens: assignments hold within the one evaluation, acts give 1 and do nothing.

    values: copied.
    fetch, operator, read: how to reach the robot's programs and linked variables, if there are any.
    has: whether there is a user variable of this key; without it, one that has no value is taken not to be there.
    """

    def __init__(
        self,
        values: Sequence[float],
        groups: frozenset[str] = frozenset(),
        *,
        fetch: Callable[[Part], Entered | None] | None = None,
        operator: Callable[[Part], Entered | None] | None = None,
        read: Callable[[Part], float] | None = None,
        draw: Callable[[], float] | None = None,
        has: Callable[[str], bool] | None = None,
    ) -> None:
        self.values, self.groups = list(values), groups
        self.steps = self.depth = self.levels = 0
        self.matched = self.undecided = False
        self.faults: list[tuple[Part, str]] = []
        self._fetch, self._operator, self._read, self._draw = fetch, operator, read, draw
        self._has = has
        self._made: set[str] = set()

    def fault(self, part: Part, reason: str) -> float:
        self.faults.append((part, reason))
        return nan

    def draw(self) -> float:
        return self._draw() if self._draw else nan

    def read(self, part: Part) -> float:
        return self._read(part) if self._read else nan

    def write(self, part: Part, value: float) -> float:
        if not isinstance(part.data, Variable):
            if not self.defined(part):
                return self.fault(part, f"no variable {part.name}: make it first with (DEFVAR {part.name})")
        elif value != value:
            return self.fault(part, f"unknown cannot be assigned to {part.data.name}")
        self.values[part.slot] = value
        return value

    def defined(self, part: Part) -> bool:
        if part.name in self._made:
            return True
        if self._has is not None:
            return self._has(part.name)
        return part.slot >= 0 and self.values[part.slot] == self.values[part.slot]

    def define(self, part: Part, value: float) -> float:
        self._made.add(part.name)
        self.values[part.slot] = value
        return value

    def store(self, part: Part, value: float) -> float:
        apply_flags(self, part)
        return 1.0 if isinstance(part.data, Storing) and part.data.activate else value

    def fetch(self, part: Part) -> Entered | None:
        return self._fetch(part) if self._fetch else None

    def operator(self, part: Part) -> Entered | None:
        return self._operator(part) if self._operator else None

    def host(self, part: Part, *arguments: float) -> float:
        return nan

    def near(self, part: Part, *arguments: float) -> Sequence[float] | None:
        return None

    def act(self, part: Part, *arguments: float) -> float:
        apply_flags(self, part)
        return arguments[-1] if part.name == "report" and arguments else 1.0


class Replay(Rehearsal):
    """A rehearsal in which the memory answers what it answered then."""

    def __init__(self, values: Sequence[float], groups: frozenset[str], answers: Sequence[Answer]) -> None:
        super().__init__(values, groups)
        self._answers = iter(answers)

    def _next(self) -> float | bool | Entered | tuple[float, ...] | None:
        answer = next(self._answers)
        while isinstance(answer, NotedFault):
            self.fault(answer.part, answer.reason)
            answer = next(self._answers)
        return answer

    def _number(self) -> float:
        answer = self._next()
        return answer if isinstance(answer, float) else nan

    def _program(self) -> Entered | None:
        answer = self._next()
        return None if answer is None or isinstance(answer, float | bool | tuple) else answer

    def draw(self) -> float:
        return self._number()

    def read(self, part: Part) -> float:
        return self._number()

    def write(self, part: Part, value: float) -> float:
        faults = len(self.faults)
        answer = self._number()
        linked = isinstance(part.data, Variable) and part.data.linked
        if len(self.faults) == faults and not linked:
            self.values[part.slot] = answer
        return answer

    def defined(self, part: Part) -> bool:
        return bool(self._next())

    def define(self, part: Part, value: float) -> float:
        faults = len(self.faults)
        answer = self._number()
        if len(self.faults) == faults:
            self.values[part.slot] = answer
        return answer

    def store(self, part: Part, value: float) -> float:
        answer = self._number()
        if answer == answer:
            apply_flags(self, part)
        return answer

    def fetch(self, part: Part) -> Entered | None:
        return self._program()

    def operator(self, part: Part) -> Entered | None:
        return self._program()

    def host(self, part: Part, *arguments: float) -> float:
        return self._number()

    def near(self, part: Part, *arguments: float) -> Sequence[float] | None:
        answer = self._next()
        return answer if isinstance(answer, tuple) else None

    def act(self, part: Part, *arguments: float) -> float:
        answer = self._number()
        if answer == answer:
            apply_flags(self, part)
        if part.name == "rollback":
            self.values[ACTIVE0 + 1 : ACTIVE0 + BUFFERS] = [self._number() for _ in range(1, BUFFERS)]
        return answer


def apply_flags(memory: Rehearsal, part: Part) -> None:
    """Do of an act what the rest of the same evaluation can see: flags and groups."""
    if part.name in FLAGS:
        slot, value = FLAGS[part.name]
        memory.values[slot] = value
    elif isinstance(part.data, Storing):
        if part.data.activate and (number := buffer_number(part.data.key)):
            memory.values[ACTIVE0 + number] = 1.0
    elif isinstance(part.data, Label):
        key = part.data.text.casefold()
        if part.name == "join":
            memory.groups |= {key}
        elif part.name == "leave":
            memory.groups -= {key}
        elif part.name in ("activate", "deactivate", "forget") and (number := buffer_number(key)):
            memory.values[ACTIVE0 + number] = 1.0 if part.name == "activate" else 0.0


# ---- why a test cannot be judged from a robot's numbers alone

CHANCE = "its test depends on chance"
ACTION = "its test does something itself"


def asks(name: str) -> str:
    """The test calls one of the robot's own functions."""
    return f"its test asks the robot itself: {name.upper()}"


def does(name: str) -> str:
    """The test enters a buffer, rule or operator that acts."""
    return f"its test evaluates {name}, which does something"


def holds(name: str) -> str:
    """The test enters a buffer, rule or operator of a robot that cannot be asked."""
    return f"its test depends on what the robot holds as {name}"
