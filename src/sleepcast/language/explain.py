"""Explaining: an evaluation as a tree with the value of every part, and why its test did not hold.

A robot keeps what went into an evaluation, not its course: the values before it and what the robot answered while it
ran (a `Recollection`). The course is walked again when somebody asks, which gives the very same values.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from math import isnan, nan

from sleepcast.language.form import List, Number, format_value, show
from sleepcast.language.machine import MAX_STEPS, OutOfSteps, Program
from sleepcast.language.operations import MAX_DEPTH, Entered
from sleepcast.language.parts import Label, Part
from sleepcast.language.vocabulary import FROZEN, MARKED, SLEEPING, Variable, buffer_number
from sleepcast.language.walker import Walker, is_true
from sleepcast.units import shown

Answer = float | bool | Program | None

FLAGS: dict[str, tuple[int, float]] = {
    "sleep": (SLEEPING, 1.0),
    "wake": (SLEEPING, 0.0),
    "freeze": (FROZEN, 1.0),
    "thaw": (FROZEN, 0.0),
    "mark": (MARKED, 1.0),
    "unmark": (MARKED, 0.0),
}
"""The acts that set a support flag: its slot and what it becomes."""


@dataclass(slots=True)
class Recollection:
    """What went into one evaluation. answers: what the memory gave back, in order. command: the message's id."""

    program: Program
    values: list[float]
    groups: frozenset[str]
    answers: list[Answer]
    time: float = 0.0
    tick: int = 0
    command: str = ""


@dataclass(frozen=True, slots=True)
class Step:
    """One part of an explained expression. value None: it was not evaluated. note: what a person should look at."""

    text: str
    value: float | None
    start: int
    end: int
    fault: str | None = None
    note: str = ""
    children: tuple[Step, ...] = ()

    @property
    def evaluated(self) -> bool:
        return self.value is not None

    def to_dict(self) -> dict[str, object]:
        """The step for JSON: unknown is the string "UNKNOWN", not evaluated is null."""
        value: object = self.value
        if self.value is not None and isnan(self.value):
            value = "UNKNOWN"
        found: dict[str, object] = {"text": self.text, "value": value, "start": self.start, "end": self.end}
        if self.fault:
            found["fault"] = self.fault
        if self.note:
            found["note"] = self.note
        found["parts"] = [child.to_dict() for child in self.children]
        return found


@dataclass(frozen=True, slots=True)
class Explanation:
    """Why an evaluation gave what it gave. reason: the first test that did not hold and by how much, "" if all did."""

    text: str
    value: float
    matched: bool
    reason: str
    root: Step
    faults: tuple[str, ...] = ()
    command: str = ""
    time: float = 0.0

    def to_dict(self) -> dict[str, object]:
        """The explanation for JSON."""
        return {
            "text": self.text,
            "value": "UNKNOWN" if isnan(self.value) else self.value,
            "matched": self.matched,
            "reason": self.reason,
            "faults": list(self.faults),
            "command": self.command,
            "time": self.time,
            "root": self.root.to_dict(),
        }

    def render(self) -> str:
        """An indented tree, one part a line: its value (`.` if it was skipped), its text, and what is to be noted."""
        lines = list(_lines(self.root, 0))
        width = max(len(value) for value, _, _ in lines)
        shown_lines = [f"{value:>{width}}  {text}{note}" for value, text, note in lines]
        if self.reason:
            shown_lines.append(f"not for this robot: {self.reason}")
        return "\n".join(shown_lines)


def _lines(step: Step, depth: int) -> Iterator[tuple[str, str, str]]:
    value = "." if step.value is None else format_value(step.value)
    note = step.fault or step.note
    yield value, "  " * depth + step.text, f"   <- {note}" if note else ""
    for child in step.children:
        if child.children or child.text != (value if child.value is not None else ""):
            yield from _lines(child, depth + 1)


def explain(recollection: Recollection) -> Explanation:
    """Walk the recollected evaluation again and say what each part gave."""
    return _explained(recollection, _Replay(recollection))


def rehearse(program: Program, memory: Rehearsal, *, command: str = "") -> Explanation:
    """What `program` would do now: walked with nothing done, nothing said and nothing kept."""
    recollection = Recollection(program, list(memory.values), memory.groups, [], command=command)
    return _explained(recollection, memory)


class Rehearsal:
    """A memory in which nothing happens: assignments hold within the one evaluation, acts give 1 and do nothing.

    values: copied. fetch, operator, read: how to reach the robot's programs and linked variables, if there are any.
    """

    def __init__(
        self,
        values: Sequence[float],
        groups: frozenset[str] = frozenset(),
        *,
        fetch: Callable[[Part], Entered | None] | None = None,
        operator: Callable[[Part], Entered | None] | None = None,
        read: Callable[[int], float] | None = None,
        draw: Callable[[], float] | None = None,
    ) -> None:
        self.values, self.groups = list(values), groups
        self.steps = self.depth = 0
        self.matched = False
        self.faults: list[tuple[Part, str]] = []
        self._fetch, self._operator, self._read, self._draw = fetch, operator, read, draw

    def fault(self, part: Part, reason: str) -> float:
        self.faults.append((part, reason))
        return nan

    def draw(self) -> float:
        return self._draw() if self._draw else nan

    def read(self, slot: int) -> float:
        return self._read(slot) if self._read else nan

    def write(self, part: Part, value: float) -> float:
        if part.slot >= 0 and value == value:
            self.values[part.slot] = value
        return value

    def defined(self, part: Part) -> bool:
        return self.values[part.slot] == self.values[part.slot]

    def define(self, part: Part, value: float) -> float:
        self.values[part.slot] = value
        return value

    def store(self, part: Part, value: float) -> float:
        return value

    def fetch(self, part: Part) -> Entered | None:
        return self._fetch(part) if self._fetch else None

    def operator(self, part: Part) -> Entered | None:
        return self._operator(part) if self._operator else None

    def host(self, part: Part, *arguments: float) -> float:
        return nan

    def act(self, part: Part, *arguments: float) -> float:
        apply_flags(self, part)
        return arguments[-1] if part.name == "report" and arguments else 1.0


class _Replay(Rehearsal):
    """A rehearsal in which the memory answers what it answered then."""

    def __init__(self, recollection: Recollection) -> None:
        super().__init__(recollection.values, recollection.groups)
        self._answers = iter(recollection.answers)

    def _number(self) -> float:
        answer = next(self._answers)
        return answer if isinstance(answer, float) else nan

    def _program(self) -> Entered | None:
        answer = next(self._answers)
        return answer if isinstance(answer, Program) else None

    def draw(self) -> float:
        return self._number()

    def read(self, slot: int) -> float:
        return self._number()

    def write(self, part: Part, value: float) -> float:
        answer = self._number()
        linked = isinstance(part.data, Variable) and part.data.linked
        if part.slot >= 0 and answer == answer and not linked:
            self.values[part.slot] = answer
        return answer

    def defined(self, part: Part) -> bool:
        return bool(next(self._answers))

    def define(self, part: Part, value: float) -> float:
        answer = self._number()
        self.values[part.slot] = answer
        return answer

    def store(self, part: Part, value: float) -> float:
        return self._number()

    def fetch(self, part: Part) -> Entered | None:
        return self._program()

    def operator(self, part: Part) -> Entered | None:
        return self._program()

    def host(self, part: Part, *arguments: float) -> float:
        return self._number()

    def act(self, part: Part, *arguments: float) -> float:
        answer = self._number()
        if answer == answer:
            apply_flags(self, part)
        return answer


def apply_flags(memory: Rehearsal, part: Part) -> None:
    """Do of an act what the rest of the same evaluation can see: flags and groups."""
    if part.name in FLAGS:
        slot, value = FLAGS[part.name]
        memory.values[slot] = value
    elif isinstance(part.data, Label):
        key = part.data.text.casefold()
        if part.name == "join":
            memory.groups |= {key}
        elif part.name == "leave":
            memory.groups -= {key}
        elif part.name in ("activate", "deactivate") and (number := buffer_number(key)):
            memory.values[3 + number] = 1.0 if part.name == "activate" else 0.0


class _Tracer(Walker):
    """A walk that keeps the value of every part (the last one, inside a loop) and the walks inside it."""

    def __init__(self, memory: Rehearsal, program: Entered, arguments: Sequence[float] = ()) -> None:
        super().__init__(memory, program, arguments)
        self.found: dict[int, float] = {}
        self.inner: dict[int, _Tracer] = {}

    def value(self, part: Part) -> float:
        value = super().value(part)
        self.found[part.index] = value
        return value

    def enter(self, part: Part, program: Entered | None, arguments: Sequence[float]) -> float:
        memory = self.memory
        if program is None:
            return nan
        if memory.depth >= MAX_DEPTH:
            return memory.fault(part, f"calls nested too deeply: at most {MAX_DEPTH}")
        tracer = self.inner[part.index] = _Tracer(self.memory, program, arguments)  # type: ignore[arg-type]
        memory.steps += program.cost
        if memory.steps > MAX_STEPS:
            raise OutOfSteps
        matched = memory.matched
        memory.depth += 1
        try:
            return tracer.value(program.root)
        finally:
            memory.depth -= 1
            memory.matched = matched


@dataclass
class _Course:
    """Everything an explanation is made of while it is being made."""

    tracer: _Tracer
    faults: dict[tuple[int, int], str] = field(default_factory=dict)


def _explained(recollection: Recollection, memory: Rehearsal) -> Explanation:
    program = recollection.program
    memory.values.extend([nan] * (program.slots - len(memory.values)))
    memory.matched = program.test is None
    memory.steps = program.cost
    tracer = _Tracer(memory, program)
    try:
        value = tracer.value(program.root)
    except OutOfSteps:
        value = memory.fault(program.root, f"out of steps: at most {MAX_STEPS} in one evaluation")
    if program.test is program:
        memory.matched = is_true(value)
    course = _Course(tracer, {(id(part), 0): reason for part, reason in memory.faults})
    reason = "" if memory.matched else _reason(program, tracer)
    root = _step(program.root, program.text, course, tracer, _culprit(program, tracer))
    faults = tuple(f"{reason} in {show(part.form)}" for part, reason in memory.faults)
    return Explanation(
        program.text, value, memory.matched, reason, root, faults, recollection.command, recollection.time
    )


def _step(part: Part, text: str, course: _Course, tracer: _Tracer, culprit: Part | None) -> Step:
    children = [_step(inside, text, course, tracer, culprit) for inside in part.parts]
    inner = tracer.inner.get(part.index)
    if inner is not None:
        children.append(_step(inner.program.root, inner.program.text, course, inner, None))
    note = _shortfall(part, tracer) if part is culprit else ""
    value = tracer.found.get(part.index)
    fault = course.faults.get((id(part), 0))
    return Step(show(part.form), value, part.form.start, part.form.end, fault, note, tuple(children))


# ---- why not


def _culprit(program: Program, tracer: _Tracer) -> Part | None:
    """The first operand of the program's test that was not true: the smallest part that says why."""
    if program.test is None:
        return None
    part: Part | None = program.root
    while part is not None and part.op in ("progn", "let"):
        part = next((p for p in part.parts if p.op in ("cond", "if", "and", "progn", "let")), None)
    if part is None or (part.op == "and" and is_true(tracer.found.get(part.index, 0.0))):
        return None
    tests = [c.parts[0] for c in part.parts] if part.op == "cond" else [part]
    if part.op == "if":
        tests = [part.parts[0]]
    return _narrow(tests[0], tracer) if tests else None


def _narrow(part: Part, tracer: _Tracer) -> Part:
    """Inside an AND, its first operand that was evaluated and not true; and so on inwards."""
    while part.op == "and":
        failed = next((p for p in part.parts if p.index in tracer.found and not is_true(tracer.found[p.index])), None)
        if failed is None:
            break
        part = failed
    return part


def _reason(program: Program, tracer: _Tracer) -> str:
    culprit = _culprit(program, tracer)
    if culprit is None:
        return ""
    if culprit.op == "call" and (inner := tracer.inner.get(culprit.index)) is not None:
        inside = _shortfall(_narrow(inner.program.root, inner), inner)
        return f"{show(culprit.form)}: {inside}"
    return _shortfall(culprit, tracer)


def _shortfall(part: Part, tracer: _Tracer) -> str:
    """How far `part` is from true, in a sentence's half: `fuel = 43.1 %, needed > 50 %`."""
    if part.op == "pure" and part.name in ("<", "<=", ">", ">=", "=", "EQ", "/=") and len(part.parts) == 2:
        left, right = part.parts
        if left.op == "const" and right.op != "const":
            left, right = right, left
            operator = {"<": ">", ">": "<", "<=": ">=", ">=": "<="}.get(part.name, part.name)
        else:
            operator = part.name
        unit = _unit(left, right)
        have, want = (tracer.found.get(p.index, nan) for p in (left, right))
        needed = shown(want, unit) if right.op == "const" else f"{show(right.form)} ({shown(want, unit)})"
        known = f"{show(left.form)} = {shown(have, unit)}" if have == have else f"{show(left.form)} is unknown"
        return f"{known}, needed {'=' if operator == 'EQ' else operator} {needed}"
    value = tracer.found.get(part.index, nan)
    if part.op == "in":
        return f"not a member of {show(part.form.items[1]) if isinstance(part.form, List) else part.name}"
    if part.op == "or":
        return f"none of {len(part.parts)} alternatives holds in {show(part.form)}"
    if value != value:
        return f"{show(part.form)} is unknown"
    return f"{show(part.form)} = {format_value(value)}, needed true"


def _unit(left: Part, right: Part) -> str:
    """The unit to show two compared values in: of the literal as it was written, else of the variable."""
    for part in (right, left):
        if isinstance(part.form, Number) and part.form.unit:
            return part.form.unit
    for part in (left, right):
        if isinstance(part.data, Variable):
            quantity = part.data.quantity
            return quantity.shown_as or quantity.unit
    return ""
