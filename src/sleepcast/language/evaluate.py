"""The walker: evaluates a program by walking its parts; and, when asked to, keeps the value of each part it met.

It serves the first evaluations of every program, when generating code is not worth it yet, and explanations.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from math import nan

from sleepcast.language.operations import Entered, Memory, apply, between, enter, gauss, prob
from sleepcast.language.parts import Part


def is_true(value: float) -> bool:
    """Whether a value counts as true: neither 0 nor unknown."""
    return value < 0.0 or value > 0.0


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
            return value
    if part.watch == len(part.parts):
        _watched(w, part)
    return value


def _watched(w: Walker, part: Part) -> None:
    if part.watch:
        w.memory.matched = True


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
    return 0.0


def _if(w: Walker, part: Part) -> float:
    if is_true(w.value(part.parts[0])):
        _watched(w, part)
        return w.value(part.parts[1])
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
    "set_user": _set_user,
    "set_local": _set_local,
    "write": lambda w, p: w.memory.write(p, w.value(p.parts[0])),
    "defvar": _defvar,
    "store": lambda w, p: w.memory.store(p, w.last(p.parts)),
    "fetch": _fetch,
    "call": _call,
    "host": lambda w, p: w.memory.host(p, *w.all(p.parts)),
    "missing": lambda w, p: w.memory.fault(p, f"this robot has no function {p.name}"),
    "in": lambda w, p: 1.0 if p.name in w.memory.groups else 0.0,
    "prob": lambda w, p: prob(w.memory, w.value(p.parts[0])),
    "dice": _dice,
    "random": lambda w, p: between(w.memory, p, *w.all(p.parts)),
    "gauss": lambda w, p: gauss(w.memory, p, *w.all(p.parts)),
    "act": lambda w, p: w.memory.act(p, *w.all(p.parts)),
}
