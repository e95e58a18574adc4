"""Meanings: what the names in a program stand for on robots with one mind, so that all of it can be compiled.

A buffer, a rule or an operator is another program, looked up only when it is evaluated; native code inlines it, so
the code is valid for robots on which those names mean the same.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TypeAlias

from sleepcast.fleet.state import Mind
from sleepcast.language.acts import FLAGS
from sleepcast.language.evaluate import MAX_DEPTH, MAX_LEVELS
from sleepcast.language.parts import Part, host_of, walk
from sleepcast.language.program import MAX_STEPS, Program
from sleepcast.language.symbols import UserVariable
from sleepcast.language.vocabulary import ACTIVE0, BUFFERS, Variable, VariableKind

Name: TypeAlias = tuple[str, str]
"""The op of the part that uses a name - `fetch`, `call` or `known` (a user variable) - and its key."""
Meaning: TypeAlias = Mapping[Name, Program | bool | None]

_EVERYWHERE = frozenset(
    {"const", "var", "local", "absent", "and", "or", "known", "cond", "clause", "if", "progn", "let"}
)
_NATIVE = _EVERYWHERE | {"dotimes", "set_user", "set_local", "in", "prob", "dice", "random", "gauss", "pure"}
_REPEATED = frozenset({"dotimes", "over", "each"})
_ONE_WAY = frozenset({"and", "or", "if", "cond", "clause", "dice"})
"""Parts of which only the first is always evaluated."""


def meaning(programs: Sequence[Program], mind: Mind) -> dict[Name, Program | bool | None]:
    """The meaning in this mind of every name in these programs, and in those that they enter."""
    meanings: dict[Name, Program | bool | None] = {}
    waiting, seen = list(programs), set(programs)
    while waiting:
        for part in walk(waiting.pop().root):
            name = name_of(part)
            if name is not None and name not in meanings:
                meanings[name] = meant = _meant(name, mind)
                if isinstance(meant, Program) and meant not in seen:
                    seen.add(meant)
                    waiting.append(meant)
    return meanings


def name_of(part: Part) -> Name | None:
    """The name whose meaning a part depends on, or None."""
    if part.op in ("fetch", "call"):
        return part.op, part.name
    if part.op == "defvar" or (part.op == "write" and not isinstance(part.data, Variable)):
        return "known", part.name
    return None


def _meant(name: Name, mind: Mind) -> Program | bool | None:
    op, key = name
    if op == "known":
        return isinstance(mind.symbols.get(key), UserVariable)
    if op == "call":
        return mind.operators.get(key)
    rule = mind.rules.get(key)
    return None if rule is None else rule.program


def entered(part: Part, names: Meaning) -> Program | None:
    """The program that a part enters, or None."""
    name = name_of(part)
    program = None if name is None else names[name]
    if not isinstance(program, Program) or (part.op == "call" and program.parameters != len(part.parts)):
        return None
    return program


def is_native(part: Part, names: Meaning, depth: int, levels: int, calls: bool) -> bool:
    """Whether native code supports a part itself; if not, robots that reach it are walked.

    depth, levels: nesting of entered programs, and of parentheses in them.
    calls: whether it may call the robots' own functions.
    """
    if part.op == "host":
        return calls and is_called(part)
    if part.op in ("fetch", "call"):
        inside = entered(part, names)
        if inside is None:
            return part.op == "fetch"
        return depth < MAX_DEPTH and levels + inside.height <= MAX_LEVELS
    if part.op == "write":
        if not isinstance(part.data, Variable):
            return part.slot >= 0 and names["known", part.name] is True
        return part.data.kind is VariableKind.ACTUATOR or not ACTIVE0 < part.slot < ACTIVE0 + BUFFERS
    if part.op == "defvar":
        return names["known", part.name] is True
    return part.op in _NATIVE or (part.op == "act" and (part.name in FLAGS or is_ping(part, calls)))


def is_ping(part: Part, calls: bool) -> bool:
    """Whether a part is a PING that native code notes, one in a round; only in rules, as calls."""
    return calls and part.op == "act" and part.name == "ping"


def is_called(part: Part) -> bool:
    """Whether native code can call the robots' own function of a `host` part.

    A robot whose rules are native runs all of them before the next robot runs its first one; walked, all robots run
    one rule after the other. That is the same because such a function reads nothing that one writes in the same tick:
    see `Writing`.
    """
    function = host_of(part)
    if function.acts:
        return bool(function.writes)
    return part.slot >= 0 or (function.native is not None and function.native.takes(constants(part)))


def constants(part: Part) -> tuple[float | None, ...]:
    """The arguments of a part, None for those that are not the same in every evaluation."""
    return tuple(each.number if each.op == "const" else None for each in part.parts)


class Size:
    """The size of a program including everything that it enters.

    parts: of all
    steps: largest number in one evaluation
    hopeless: every evaluation reaches something that is not native
    """

    def __init__(self, program: Program, names: Meaning, *, calls: bool = False) -> None:
        self._names, self._calls = names, calls
        self.parts, self.steps, self.hopeless = 0, 0, False
        self._enter(program, 1, True, 0, program.height)

    def _enter(self, program: Program, times: int, always: bool, depth: int, levels: int) -> None:
        self.steps += times * program.cost
        if self.steps <= MAX_STEPS:
            self._look(program.root, times, always, depth, levels)

    def _look(self, part: Part, times: int, always: bool, depth: int, levels: int) -> None:
        self.parts += 1
        native = is_native(part, self._names, depth, levels, self._calls)
        self.hopeless |= always and not native
        repeated = times * int(part.number) if part.op in _REPEATED else times
        if repeated:
            for index, inside in enumerate(part.parts):
                self._look(inside, repeated, always and not (part.op in _ONE_WAY and index), depth, levels)
        program = entered(part, self._names)
        if program is not None and native:
            self._enter(program, times, always, depth + 1, levels + program.height)
