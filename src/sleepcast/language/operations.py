"""What every machine leaves to these: the memory a program touches, and the operations with anything unusual in them.

A pure function is unknown if one of its arguments is, and a fault if it has no finite value. Buffers, rules and
operators are entered here, which bounds how deeply they call each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from math import inf, nan
from typing import Protocol

from sleepcast.language.numerics import normal
from sleepcast.language.parts import Part

MAX_DEPTH = 32
"""Buffers and operators entered inside one another."""
MAX_LEVELS = 100
"""Parentheses open at once, through all that is entered: every level costs a walk a few calls of the host's own stack,
of which Python grants a thousand."""


class Entered(Protocol):
    """Something that can be entered from inside an evaluation: a program. slots: the length of values it needs."""

    root: Part
    text: str
    cost: int
    height: int
    locals: int
    slots: int

    def run(self, memory: Memory, *arguments: float) -> float: ...


class Nesting(Protocol):
    """How far inside the programs entered an evaluation is: their number, and the parentheses open in them."""

    depth: int
    levels: int


class Memory(Nesting, Protocol):
    """What a program may touch: one robot's three address spaces. NaN is unknown everywhere.

    Every method that takes a part does what the part says; a refusal is a fault, which returns NaN.
    """

    values: list[float]
    groups: frozenset[str]
    steps: int
    matched: bool

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
    matched = memory.matched
    memory.depth += 1
    memory.levels += program.height
    try:
        return program.run(memory, *arguments)
    finally:
        memory.depth -= 1
        memory.levels -= program.height
        memory.matched = matched


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
