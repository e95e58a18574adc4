"""Explaining: an evaluation as a tree with the value of every part, and why its test did not hold.

A robot keeps what went into an evaluation, not its course: the values before it and what the robot answered while it
ran (a `Recollection`). The course is walked again when somebody asks, which gives the very same values.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from enum import StrEnum
from functools import cached_property
from math import isnan, nan

from sleepcast.core.neighbours import NearIds
from sleepcast.core.records import dataclass
from sleepcast.core.units import value_in_words
from sleepcast.language.evaluate import Entered, Memory, Walker, is_true, too_deep
from sleepcast.language.lint import units_in
from sleepcast.language.parts import Part, deciding, host_of, walk
from sleepcast.language.program import MAX_STEPS, OutOfSteps, Program, decide
from sleepcast.language.reader import List, show
from sleepcast.language.reading_units import COMPARING, as_written
from sleepcast.language.rehearsal import Answer, Rehearsal, Replay
from sleepcast.language.vocabulary import Variable, VariableKind

_BEGINS_NUMBER = frozenset("0123456789.+-")
MAX_DIGITS = 17
"""Significant ones, which tell any two numbers apart."""
HELD_VERDICT = "held by STOP, so it did not move"
"""What a robot did about a command that matched and would have moved it, while STOP held it."""


@dataclass(slots=True)
class Recollection:
    """What went into one evaluation.

    answers: what the memory gave back, in order.
    command: the message's id.
    stopped: whether STOP held the body.
    """

    program: Program
    values: list[float]
    groups: frozenset[str]
    answers: list[Answer]
    time: float = 0.0
    tick: int = 0
    command: str = ""
    stopped: bool = False


@dataclass(frozen=True, slots=True)
class Step:
    """One part of an explained expression.

    value: SI, None: it was not evaluated.
    note: what a person should look at.
    unit: in which people read the value.
    """

    text: str
    value: float | None
    start: int
    end: int
    fault: str | None = None
    note: str = ""
    children: tuple[Step, ...] = ()
    unit: str = ""

    @property
    def evaluated(self) -> bool:
        return self.value is not None

    @property
    def is_literal(self) -> bool:
        """Whether it is a number that is read as it was written, or was not looked at."""
        if self.value is None:
            return self.text[:1] in _BEGINS_NUMBER
        return not self.children and bool(as_written(self.text, self.unit))

    def to_dict(self) -> dict[str, object]:
        """The step for JSON: unknown is the string "UNKNOWN", not evaluated is null."""
        value: object = self.value
        if self.value is not None and isnan(self.value):
            value = "UNKNOWN"
        written: dict[str, object] = {"text": self.text, "value": value, "start": self.start, "end": self.end}
        if self.fault:
            written["fault"] = self.fault
        if self.note:
            written["note"] = self.note
        written["parts"] = [child.to_dict() for child in self.children]
        return written


class BidState(StrEnum):
    """What became of a bid."""

    WAITING = "waiting"
    MEMBER = "member"
    LEFT = "left"
    DECLINED = "declined"
    """It was granted, and the robot did not obey."""
    OUTBID = "outbid"
    UNCHOSEN = "unchosen"
    """Nobody was chosen, since too few have bid."""
    UNHEARD = "unheard"
    """Nobody has granted it in time."""
    WITHDRAWN = "withdrawn"
    """The poll was told again, and its test was not true any more, or its cost unknown."""
    STOPPED = "stopped"
    CANCELLED = "cancelled"
    UNKNOWN = "unknown"
    """The robot did not bid, since its cost was unknown."""


OBEYED = frozenset({BidState.MEMBER, BidState.LEFT})
_AFTER = {
    BidState.WAITING: ("waits to be chosen", "and waits to be chosen"),
    BidState.MEMBER: ("obeyed", "and is one of those who were chosen"),
    BidState.LEFT: ("obeyed", "was one of those who were chosen, and has left since"),
    BidState.DECLINED: ("did not obey", "was chosen, and did not obey then"),
    BidState.OUTBID: ("was outbid", "and others were chosen"),
    BidState.UNCHOSEN: ("was not chosen", "and nobody was chosen"),
    BidState.UNHEARD: ("was not chosen", "and nobody chose it in time"),
    BidState.WITHDRAWN: ("did not bid", "and not when it was asked again"),
    BidState.STOPPED: ("was not chosen", "and STOP ended that"),
    BidState.CANCELLED: ("was not chosen", "and CANCEL ended that"),
    BidState.UNKNOWN: ("did not bid", ""),
}
"""Each state as a verdict, and as what is said after the bid."""


@dataclass(frozen=True, slots=True)
class BidStanding:
    """How a robot's bid for a command with BEST or QUORUM stands.

    name: BEST or QUORUM.
    cost: what it bid; NaN if its cost was unknown, 0 for a QUORUM.
    better: bids before its own, the least first, as the caller has told: names of those who were chosen, or may yet
        be, each with its cost (NaN if that was not told).
    """

    name: str
    cost: float
    state: BidState
    better: tuple[tuple[str, float], ...] = ()

    @property
    def sentence(self) -> str:
        """For a person: `it bid 5.2, and others were chosen: r3 (1.5), r7 (2)`."""
        if self.state is BidState.UNKNOWN:
            return "its cost was unknown, so it did not bid"
        has_cost = self.name == "BEST"
        shown = (name if isnan(cost) or not has_cost else f"{name} ({cost:.6g})" for name, cost in self.better)
        better, bid = ", ".join(shown), f"it bid {self.cost:.6g}" if has_cost else "it accepted"
        if better and self.state is not BidState.OUTBID:
            better = f"{'bids' if has_cost else 'names'} before its own: {better}"
        mark = ": " if self.state is BidState.OUTBID else "; "
        return f"{bid}, {_AFTER[self.state][1]}{mark if better else ''}{better}"

    def to_dict(self) -> dict[str, object]:
        """For JSON: an unknown cost is the string "UNKNOWN"."""
        costs = {name: "UNKNOWN" if isnan(cost) else cost for name, cost in self.better}
        return {"cost": "UNKNOWN" if isnan(self.cost) else self.cost, "state": self.state.value, "better": costs}


@dataclass(frozen=True, slots=True)
class Explanation:
    """Why an evaluation gave what it gave.

    reason: the first test that did not hold and by how much, "" if all did.
    held: the robot obeyed and was to move, and STOP held it.
    priority: of the rule that it tells of.
    bid: how its bid stands, of a command with BEST or QUORUM.
    """

    text: str
    value: float
    matched: bool
    reason: str
    root: Step
    faults: tuple[str, ...] = ()
    command: str = ""
    time: float = 0.0
    held: bool = False
    priority: int = 0
    bid: BidStanding | None = None

    @property
    def verdict(self) -> str:
        """What the robot did about it, in words."""
        if self.bid is not None and not self.matched:
            return _AFTER[self.bid.state][0]
        return (HELD_VERDICT if self.held else "obeyed") if self.matched else "did not obey"

    @property
    def precedence(self) -> str:
        """What its priority means, in words; "" for a rule without one, and for a command."""
        if not self.priority:
            return ""
        return f"priority {self.priority}: rules of a lower one run before it, and its assignments win over theirs"

    def to_dict(self) -> dict[str, object]:
        """The explanation for JSON."""
        return {
            "text": self.text,
            "value": "UNKNOWN" if isnan(self.value) else self.value,
            "matched": self.matched,
            "held": self.held,
            "reason": self.reason,
            "faults": list(self.faults),
            "command": self.command,
            "time": self.time,
            "root": self.root.to_dict(),
            **({} if self.bid is None else {"bid": self.bid.to_dict()}),
        }

    def render(self) -> str:
        """An indented tree, one part a line: its value (`.` if it was skipped), its text, and what is to be noted; and
        why it did not do what the text asks for."""
        lines = list(_lines(self.root, 0))
        width = max(len(value) for value, _, _ in lines)
        shown_lines = [f"{value:>{width}}  {text}{note}" for value, text, note in lines]
        if self.reason:
            shown_lines.append(f"not for this robot: {self.reason}")
        if self.bid is not None:
            shown_lines.append(self.bid.sentence)
        if self.precedence:
            shown_lines.append(self.precedence)
        if self.held:
            shown_lines.append(HELD_VERDICT)
        return "\n".join(shown_lines)


def _lines(step: Step, depth: int) -> Iterator[tuple[str, str, str]]:
    value = value_in_words(step.value, step.unit) or "."
    note = step.fault or step.note
    yield value, "  " * depth + step.text, f"   <- {note}" if note else ""
    for child in step.children:
        if not child.is_literal:
            yield from _lines(child, depth + 1)


def explain(recollection: Recollection) -> Explanation:
    """Walk the recollected evaluation again and say what each part gave."""
    return _explained(recollection, Replay(recollection.values, recollection.groups, recollection.answers))


def with_bid(explanation: Explanation, bid: BidStanding | None) -> Explanation:
    """The same of a command for which the robot has bid: only who was chosen can have obeyed it."""
    if bid is None:
        return explanation
    obeyed = bid.state in OBEYED
    return replace(explanation, matched=explanation.matched and obeyed, held=explanation.held and obeyed, bid=bid)


def rehearse(
    program: Program, memory: Rehearsal, *, command: str = "", stopped: bool = False, priority: int = 0
) -> Explanation:
    """What `program` would do now: walked with nothing done, nothing said and nothing kept. stopped: whether STOP holds
    the body. priority: of the rule that it is."""
    recollection = Recollection(program, list(memory.values), memory.groups, [], command=command, stopped=stopped)
    return replace(_explained(recollection, memory), priority=priority)


def with_units(step: Step, program_of: Callable[[str], Program | None], beside: str | None = None) -> Step:
    """The same step with its units, which another robot does not send. program_of: gives the program of a text, None if
    it has none; beside: the unit beside what the step is compared with, None if it is compared with nothing."""
    program, own, compared = program_of(step.text), "", []
    if program is not None:
        unit = units_in(program)
        own = _unit(program.root, step.value, unit)
        compared = [unit(part) for part in program.root.parts] if _compares(program.root) else []
    sides = compared if len(compared) == len(step.children) else [None] * len(step.children)
    children = tuple(with_units(child, program_of, side) for child, side in zip(step.children, sides, strict=True))
    return replace(step, children=children, unit=own if beside is None else beside)


@dataclass(frozen=True, slots=True)
class Foretold:
    """What an evaluation would come to now, unexplained. faults: one sentence each."""

    value: float
    matched: bool
    faults: tuple[str, ...]


def foretell(program: Program, memory: Rehearsal) -> Foretold:
    """The value, match and faults of `rehearse`, at a fraction of its cost: for whoever does not ask why."""
    value = decide(program, memory)
    return Foretold(value, memory.matched, _sentences(memory))


def _sentences(memory: Rehearsal) -> tuple[str, ...]:
    return tuple(f"{reason} in {show(part.form)}" for part, reason in memory.faults)


def _explained(recollection: Recollection, memory: Rehearsal) -> Explanation:
    program = recollection.program
    tracer = Tracer(memory, program)
    value = decide(program, memory, tracer)
    reasons = {id(part): reason for part, reason in memory.faults}
    reason = "" if memory.matched else refusal(program, tracer)
    root = _step(program.root, tracer, reasons, None if memory.matched else culprit(program, tracer))
    faults = _sentences(memory)
    return Explanation(
        *(program.text, value, memory.matched, reason, root),
        *(faults, recollection.command, recollection.time),
        recollection.stopped and memory.matched and not faults and _moved(tracer),
    )


def _step(part: Part, tracer: Tracer, faults: Mapping[int, str], wanting: Part | None) -> Step:
    """A part and all inside it.

    faults: what went wrong, by the ids of parts.
    wanting: the part that was not true, None if that is none of these.
    """
    children: list[Step] = []
    for inside in part.parts:
        # A WHEN is a COND of one clause with the same text: its pieces are shown as its own.
        # So is what is evaluated for each neighbour.
        pieces = inside.parts if inside.op == "clause" and inside.form is part.form else (inside,)
        children += [_step(piece, tracer, faults, wanting) for piece in pieces]
    inner = tracer.inner.get(part.index)
    if inner is not None:
        children.append(_step(inner.program.root, inner, faults, None))
    note = shortfall(part, tracer) if part is wanting else tracer.around.get(part.index, "")
    value, form = tracer.values.get(part.index), part.form
    unit = _unit(part, value, tracer.unit)
    return Step(show(form), value, form.start, form.end, faults.get(id(part)), note, tuple(children), unit)


# ---- the tracer: remembers the value of every part


class Tracer(Walker):
    """A walk that keeps the value of every part (the last one, inside a loop) and the walks inside it."""

    def __init__(self, memory: Memory, program: Entered, arguments: Sequence[float] = ()) -> None:
        super().__init__(memory, program, arguments)
        self.values: dict[int, float] = {}
        self.inner: dict[int, Tracer] = {}
        self.around: dict[int, str] = {}
        """How many neighbours a part has gone through, in words."""

    @cached_property
    def unit(self) -> Callable[[Part], str]:
        """Gives the unit in which people read the value of a part."""
        return units_in(self.program)

    def value(self, part: Part) -> float:
        value = super().value(part)
        self.values[part.index] = value
        return value

    def went_through(self, part: Part, near: Sequence[float] | None, values: Sequence[float] = ()) -> None:
        if near is None:
            return
        unknown = sum(map(isnan, values))
        words = f"{len(near)} neighbour{'' if len(near) == 1 else 's'}"
        words += f", unknown of {unknown} of them" if unknown else ""
        total = near.total if isinstance(near, NearIds) else len(near)
        self.around[part.index] = words + (f": the nearest of {total}" if total > len(near) else "")

    def enter(self, part: Part, program: Entered | None, arguments: Sequence[float]) -> float:
        memory = self.memory
        if program is None:
            return nan
        refusal = too_deep(memory, program)
        if refusal:
            return memory.fault(part, refusal)
        tracer = self.inner[part.index] = Tracer(memory, program, arguments)
        memory.steps += program.cost
        if memory.steps > MAX_STEPS:
            raise OutOfSteps
        memory.values.extend([nan] * (program.slots - len(memory.values)))
        matched, undecided = memory.matched, memory.undecided
        memory.depth += 1
        memory.levels += program.height
        try:
            return tracer.value(program.root)
        finally:
            memory.depth -= 1
            memory.levels -= program.height
            memory.matched, memory.undecided = matched, undecided


def _moved(tracer: Tracer) -> bool:
    """Whether a part that was evaluated asked the body to move, also in what the program entered."""
    evaluated = (part for part in walk(tracer.program.root) if part.index in tracer.values)
    return any(_moves(part, tracer) for part in evaluated) or any(map(_moved, tracer.inner.values()))


def _moves(part: Part, tracer: Tracer) -> bool:
    """Whether an evaluated part itself asks the body to move: what is unknown is not passed on to it."""
    if part.op == "write" and isinstance(part.data, Variable):
        return part.data.kind is VariableKind.ACTUATOR and not isnan(tracer.values[part.index])
    if part.op != "host":
        return False
    function = host_of(part)
    return function.acts and function.moves and not any(isnan(tracer.values.get(p.index, nan)) for p in part.parts)


# ---- why a test was not true


def culprit(program: Program, tracer: Tracer) -> Part | None:
    """The first operand of the program's test that was not true: the smallest part that says why."""
    if program.for_everybody:
        return None
    part = deciding(program.root)
    if part is None or not part.parts:
        return None
    if part.op == "cond":
        return _narrow(part.parts[0].parts[0], tracer)
    return _narrow(part.parts[0] if part.op == "if" else part, tracer)


def _narrow(part: Part, tracer: Tracer) -> Part:
    """Inside an AND, its first operand that was evaluated and not true; and so on inwards."""
    while part.op == "and":
        failed = next((p for p in part.parts if p.index in tracer.values and not is_true(tracer.values[p.index])), None)
        if failed is None:
            break
        part = failed
    return part


def refusal(program: Program, tracer: Tracer) -> str:
    """Why the program's test did not hold, in a sentence's half; "" if there is nothing to say."""
    part = culprit(program, tracer)
    if part is None:
        return ""
    if part.op == "call" and (inner := tracer.inner.get(part.index)) is not None:
        inside = shortfall(_narrow(inner.program.root, inner), inner)
        return f"{show(part.form)}: {inside}"
    return shortfall(part, tracer)


def shortfall(part: Part, tracer: Tracer) -> str:
    """How far `part` is from true, in a sentence's half: `fuel = 43.1 %, needed > 50 %`."""
    if _compares(part) and len(part.parts) == 2:
        left, right = part.parts
        if left.op == "const" and right.op != "const":
            left, right = right, left
            operator = {"<": ">", ">": "<", "<=": ">=", ">=": "<="}.get(part.name, part.name)
        else:
            operator = part.name
        have = tracer.values.get(left.index, nan)
        had, wanted = _apart((left, right), tracer)
        needed = wanted if right.op == "const" else f"{show(right.form)} ({wanted})"
        known = f"{show(left.form)} = {had}" if have == have else f"{show(left.form)} is unknown"
        return f"{known}, needed {'=' if operator == 'EQ' else operator} {needed}"
    value = tracer.values.get(part.index, nan)
    if part.op == "in":
        return f"not a member of {show(part.form.items[1]) if isinstance(part.form, List) else part.name}"
    if part.op == "or":
        return f"none of {len(part.parts)} alternatives holds in {show(part.form)}"
    if value != value:
        return f"{show(part.form)} is unknown"
    return f"{show(part.form)} = {value_in_words(value, tracer.unit(part))}, needed true"


def _apart(sides: Sequence[Part], tracer: Tracer) -> list[str]:
    """Both sides of a comparison in words: literals as they were written, and with as many digits as it takes to see
    that they differ: 49.999 % is not 50 %."""
    values = [tracer.values.get(part.index, nan) for part in sides]
    texts: list[str] = []
    for digits in (None, *range(5, MAX_DIGITS + 1)):
        texts = [
            as_written(show(part.form), tracer.unit(part)) or value_in_words(value, tracer.unit(part), digits)
            for part, value in zip(sides, values, strict=True)
        ]
        if texts[0] != texts[1] or values[0] == values[1]:
            break
    return texts


def _compares(part: Part) -> bool:
    return part.op == "pure" and part.name in COMPARING


def _unit(part: Part, value: float | None, unit: Callable[[Part], str]) -> str:
    """The unit in which a part's value is read. The 0 of a WHEN or COND of which no test held measures nothing."""
    return "" if part.op == "cond" and value == 0.0 else unit(part)
