"""The walker: evaluates a program by walking its parts; and the operations that every machine leaves to these.

The walker serves the first evaluations of every program, when generating code is not worth it yet, and explanations.
The operations are those with anything unusual in them, on the memory that a program touches: a pure function is unknown
if one of its arguments is, and a fault if it has no finite value. Buffers, rules and operators are entered here, which
bounds how deeply they call each other.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import inf, nan
from typing import Any, Protocol, TypeVar

from sleepcast.language.functions import AMONG_ROBOTS, NO_INSTANT
from sleepcast.language.numerics import normal
from sleepcast.language.parts import Part
from sleepcast.language.vocabulary import Vocabulary

Truth = TypeVar("Truth", covariant=True)

MAX_DEPTH = 32
"""Buffers and operators entered inside one another."""
MAX_LEVELS = 100
"""Parentheses open at once, through all that is entered: every level costs a walk a few calls of the host's own stack,
of which Python grants a thousand."""


class Entered(Protocol):
    """Something that can be entered from inside an evaluation: a program. slots: the length of values it needs.
    vocabulary: what its names mean."""

    root: Part
    text: str
    cost: int
    height: int
    locals: int
    slots: int

    @property
    def vocabulary(self) -> Vocabulary: ...

    def run(self, memory: Memory, *arguments: float) -> float: ...


class Nesting(Protocol):
    """How far inside the programs entered an evaluation is: their number, and the parentheses open in them."""

    depth: int
    levels: int


class Memory(Nesting, Protocol):
    """What a program may touch: one robot's three address spaces. NaN is unknown everywhere.

    Every method that takes a part does what the part says; a refusal is a fault, which returns NaN. undecided: whether
    the top-level test was unknown, as far as the program was walked.
    """

    values: list[float]
    groups: frozenset[str]
    steps: int
    matched: bool
    undecided: bool

    def fault(self, part: Part, reason: str) -> float:
        """Note what went wrong where; gives unknown."""

    def draw(self) -> float:
        """The next random number in [0, 1)."""

    def read(self, part: Part) -> float:
        """The linked variable of a `linked` part, from the host's own memory."""

    def write(self, part: Part, value: float) -> float:
        """Assign an actuator, support, linked or not certainly declared variable."""

    def defined(self, part: Part) -> bool:
        """Whether the user variable of a `defvar` part is there already."""

    def define(self, part: Part, value: float) -> float:
        """Make the user variable of a `defvar` part."""

    def store(self, part: Part, value: float) -> float:
        """Store the expression (or `value`) of a `store` part."""

    def fetch(self, part: Part) -> Entered | None:
        """The program in the buffer or rule of a `fetch` part, None if it is empty."""

    def operator(self, part: Part) -> Entered | None:
        """The program of the operator of a `call` part, None (and a fault) if it is gone."""

    def host(self, part: Part, *arguments: float) -> float:
        """Call the robot's own function of a `host` part."""

    def near(self, part: Part, *arguments: float) -> Sequence[float] | None:
        """The ids of the neighbours that an `over` or `each` part goes through, ascending, at most as many as it says;
        None where that is unknown."""

    def act(self, part: Part, *arguments: float) -> float:
        """Carry out an `act` part."""


def apply(memory: Memory, part: Part, arguments: Sequence[float]) -> float:
    """A pure function: unknown if an argument is; a fault if it has no value, or none that is finite."""
    for argument in arguments:
        if argument != argument:
            return nan
    compute = part.function.compute
    if compute is None:
        raise TypeError(f"{part.name} computes nothing")
    try:
        value = compute(arguments)
    except OverflowError:
        return memory.fault(part, "overflow")
    except (ArithmeticError, ValueError) as error:
        return memory.fault(part, str(error))
    return value if -inf < value < inf else memory.fault(part, "overflow")


def enter(memory: Memory, part: Part, program: Entered | None, arguments: Sequence[float] = ()) -> float:
    """A buffer, rule or operator called from inside an evaluation; an empty one is unknown."""
    if program is None:
        return nan
    refusal = too_deep(memory, program)
    if refusal:
        return memory.fault(part, refusal)
    matched, undecided = memory.matched, memory.undecided
    memory.depth += 1
    memory.levels += program.height
    try:
        return program.run(memory, *arguments)
    finally:
        memory.depth -= 1
        memory.levels -= program.height
        memory.matched, memory.undecided = matched, undecided


def too_deep(memory: Nesting, program: Entered) -> str:
    """Why `program` cannot be entered from where the evaluation is now; "" if it can."""
    if memory.depth >= MAX_DEPTH:
        return f"calls nested too deeply: at most {MAX_DEPTH}"
    if memory.levels + program.height > MAX_LEVELS:
        return f"calls nested too deeply: at most {MAX_LEVELS} levels of parentheses in all"
    return ""


def prob(memory: Memory, chance: float) -> float:
    """1 with this probability, else 0; an unknown chance draws nothing."""
    if chance != chance:
        return nan
    return 1.0 if memory.draw() < chance else 0.0


def between(memory: Memory, part: Part, low: float, high: float) -> float:
    """RANDOM: evenly between two numbers."""
    if low != low or high != high:
        return nan
    value = low + memory.draw() * (high - low)
    return value if -inf < value < inf else memory.fault(part, "overflow")


def gauss(memory: Memory, part: Part, mean: float, deviation: float) -> float:
    """GAUSS: one draw through the normal quantile."""
    if mean != mean or deviation != deviation:
        return nan
    if deviation < 0:
        return memory.fault(part, f"deviation of {deviation:g}: it cannot be negative")
    value = mean + deviation * normal(memory.draw())
    return value if -inf < value < inf else memory.fault(part, "overflow")


def reduced(memory: Memory, part: Part, near: Sequence[float] | None, values: Sequence[float]) -> float:
    """What an `over` part makes of a value for each of these neighbours: the unknown ones are left out, and the others
    are taken in the order of their ids. Unknown if it is not known who is near."""
    if near is None:
        return nan
    count = 0
    total = best = who = 0.0
    for neighbour, value in zip(near, values, strict=True):
        if value != value:
            continue
        if not count or (value > best if part.name == "MAX-OVER" else value < best):
            best, who = value, neighbour
        count += value != 0.0 if part.name == "COUNT-OVER" else 1
        total += value
    if part.name == "COUNT-OVER":
        return float(count)
    if part.name == "SUM-OVER":
        return total if -inf < total < inf else memory.fault(part, "overflow")
    if not count:
        return nan
    if part.name == "MEAN-OVER":
        return total / count if -inf < total < inf else memory.fault(part, "overflow")
    return who if part.name == "BEST-OVER" else best


class Comparable(Protocol[Truth]):
    """A number, or an array of them, which compare to truths."""

    def __lt__(self, other: float, /) -> Truth: ...

    def __gt__(self, other: float, /) -> Truth: ...


def is_true(value: Comparable[Truth]) -> Truth:
    """Whether a value counts as true: neither 0 nor unknown (NaN). Of an array, which of its values do."""
    below: Any = value < 0.0
    truth: Truth = below | (value > 0.0)
    return truth


class Walker:
    """One walk through one program. arguments: the values of an operator's parameters."""

    def __init__(self, memory: Memory, program: Entered, arguments: Sequence[float] = ()) -> None:
        self.memory, self.program = memory, program
        self.locals = [nan] * program.locals
        self.locals[: len(arguments)] = arguments

    def value(self, part: Part) -> float:
        """The value of `part`, with all its effects."""
        return _HOW[part.op](self, part)

    def enter(self, part: Part, program: Entered | None, arguments: Sequence[float]) -> float:
        """Call a buffer, rule or operator."""
        return enter(self.memory, part, program, arguments)

    def went_through(self, part: Part, near: Sequence[float] | None, values: Sequence[float] = ()) -> None:
        """An `over` or `each` part has gone through these neighbours, whose values were these."""

    def all(self, parts: Sequence[Part]) -> list[float]:
        return [self.value(p) for p in parts]

    def last(self, parts: Sequence[Part]) -> float:
        """One after the other; the value of the last, 0 of none."""
        value = 0.0
        for part in parts:
            value = self.value(part)
        return value


def _and(w: Walker, part: Part) -> float:
    value = 1.0
    for done, inside in enumerate(part.parts):
        if part.watch == done:
            _watched(w, part)
        value = w.value(inside)
        if not is_true(value):
            if done < part.watch:
                _undecided(w, part, value)
            return value
    if part.watch == len(part.parts):
        _watched(w, part)
    return value


def _watched(w: Walker, part: Part) -> None:
    if part.watch:
        w.memory.matched = True


def _undecided(w: Walker, part: Part, value: float) -> None:
    """A test of `part` that does not hold has this value: if it is unknown, so is the top-level test."""
    if part.watch and value != value:
        w.memory.undecided = True


def _or(w: Walker, part: Part) -> float:
    unknown = False
    for inside in part.parts:
        value = w.value(inside)
        if is_true(value):
            return value
        unknown = unknown or value != value
    return nan if unknown else 0.0


def _known(w: Walker, part: Part) -> float:
    value = w.value(part.parts[0])
    return 1.0 if value == value else 0.0


def _cond(w: Walker, part: Part) -> float:
    for clause in part.parts:
        test, *body = clause.parts
        value = w.value(test)
        if is_true(value):
            _watched(w, clause)
            return w.last(body) if body else value
        _undecided(w, clause, value)
    return 0.0


def _if(w: Walker, part: Part) -> float:
    value = w.value(part.parts[0])
    if is_true(value):
        _watched(w, part)
        return w.value(part.parts[1])
    _undecided(w, part, value)
    return w.last(part.parts[2:])


def _let(w: Walker, part: Part) -> float:
    count = int(part.number)
    w.locals[part.slot : part.slot + count] = w.all(part.parts[:count])
    return w.last(part.parts[count:])


def _dotimes(w: Walker, part: Part) -> float:
    for i in range(int(part.number)):
        w.locals[part.slot] = float(i)
        w.all(part.parts)
    return 0.0


def _over(w: Walker, part: Part) -> float:
    *which, body = part.parts
    near = w.memory.near(part, *w.all(which))
    values = []
    for neighbour in near or ():
        w.locals[part.slot] = neighbour
        values.append(w.last(body.parts))
    w.went_through(part, near, values)
    return reduced(w.memory, part, near, values)


def _each(w: Walker, part: Part) -> float:
    *which, body = part.parts
    near = w.memory.near(part, *w.all(which))
    for neighbour in near or ():
        w.locals[part.slot] = neighbour
        w.all(body.parts)
    w.went_through(part, near)
    return nan if near is None else 0.0


def _set_user(w: Walker, part: Part) -> float:
    value = w.value(part.parts[0])
    w.memory.values[part.slot] = value
    return value


def _set_local(w: Walker, part: Part) -> float:
    value = w.value(part.parts[0])
    w.locals[part.slot] = value
    return value


def _defvar(w: Walker, part: Part) -> float:
    if w.memory.defined(part):
        return w.memory.values[part.slot]
    return w.memory.define(part, w.value(part.parts[0]) if part.parts else nan)


def _dice(w: Walker, part: Part) -> float:
    drawn, total = w.memory.draw(), 0.0
    for side in part.parts:
        total += w.value(side.parts[0])
        if total != total:
            return nan
        if drawn < total:
            return w.value(side.parts[1])
    return 0.0


def _fetch(w: Walker, part: Part) -> float:
    return w.enter(part, w.memory.fetch(part), ())


def _call(w: Walker, part: Part) -> float:
    program = w.memory.operator(part)
    return nan if program is None else w.enter(part, program, w.all(part.parts))


_HOW: dict[str, Callable[[Walker, Part], float]] = {
    "const": lambda w, p: p.number,
    "var": lambda w, p: w.memory.values[p.slot],
    "local": lambda w, p: w.locals[p.slot],
    "linked": lambda w, p: w.memory.read(p),
    "absent": lambda w, p: nan,
    "pure": lambda w, p: apply(w.memory, p, w.all(p.parts)),
    "and": _and,
    "or": _or,
    "known": _known,
    "cond": _cond,
    "if": _if,
    "progn": lambda w, p: w.last(p.parts),
    "let": _let,
    "dotimes": _dotimes,
    "over": _over,
    "each": _each,
    "set_user": _set_user,
    "set_local": _set_local,
    "write": lambda w, p: w.memory.write(p, w.value(p.parts[0])),
    "defvar": _defvar,
    "store": lambda w, p: w.memory.store(p, w.last(p.parts)),
    "fetch": _fetch,
    "call": _call,
    "host": lambda w, p: w.memory.host(p, *w.all(p.parts)),
    "missing": lambda w, p: w.memory.fault(p, f"this robot has no function {p.name}"),
    "auction": lambda w, p: w.memory.fault(p, f"{p.name} chooses {AMONG_ROBOTS}"),
    "timed": lambda w, p: w.memory.fault(p, NO_INSTANT),
    "in": lambda w, p: 1.0 if p.name in w.memory.groups else 0.0,
    "prob": lambda w, p: prob(w.memory, w.value(p.parts[0])),
    "dice": _dice,
    "random": lambda w, p: between(w.memory, p, *w.all(p.parts)),
    "gauss": lambda w, p: gauss(w.memory, p, *w.all(p.parts)),
    "act": lambda w, p: w.memory.act(p, *w.all(p.parts)),
}
