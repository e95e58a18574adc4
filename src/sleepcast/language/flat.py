"""Which parts of an expression become one Python expression, and which need statements before it.

Only what has no effect on later parts can stay inside an expression, and Python limits how deeply one may nest.
"""

from __future__ import annotations

from math import inf

from sleepcast.language.parts import Part

FLIPPED = {"<": ">=", "<=": ">", ">": "<=", ">=": "<"}
"""The comparison that holds just if the other does not, when neither operand is unknown."""
INLINED = frozenset({("-", 1), ("/", 2), ("ABS", 1), ("MIN", 2), ("MAX", 2), ("NOT", 1), ("SQRT", 1), ("DIST", 4)})
"""Pure functions, with their number of arguments, whose usual case is written out where they are called."""

_ATOMIC = frozenset({"const", "var", "local", "absent"})
_DEEPEST = 60
"""Parentheses that one Python expression may nest; Python's own limit is 200."""


def flat(part: Part) -> bool:
    """Whether the value of `part` is one Python expression, without statements before it."""
    return _depth(part) <= _DEEPEST


def flat_test(part: Part) -> bool:
    """The same for `part` as a test."""
    return _test_depth(part) <= _DEEPEST


def _depth(part: Part) -> float:
    if part.op in _ATOMIC or part.op == "in":
        return 1
    if part.watch or part.op not in ("pure", "known", "prob", "random", "gauss", "and", "if"):
        return inf
    if part.op == "if":
        return 2 + max(_test_depth(part.parts[0]), *map(_depth, part.parts[1:]))
    if part.op == "pure" and (part.name, len(part.parts)) in INLINED:
        return 4 if all(inside.op in _ATOMIC for inside in part.parts) else inf
    width = len(part.parts) if part.op == "and" else 3
    return width + max(map(_depth, part.parts), default=0)


def _test_depth(part: Part) -> float:
    if part.op in ("and", "or") and not part.watch:
        return 1 + max(map(_test_depth, part.parts), default=inf)
    if part.op == "pure" and part.name == "NOT":
        inside = part.parts[0]
        compared = inside.op == "pure" and inside.name in FLIPPED and len(inside.parts) == 2
        return 1 + (max(map(_depth, inside.parts)) if compared else _depth(inside))
    return 1 + _depth(part)
