"""Operators in the middle, as other languages have them, and how the same is written here.

`fuel > 50% && ordnance > 70%` inside a list is a row of five things to this language. What is meant is found by the
operators' usual order of binding, for the finding that says so.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

from sleepcast.language.form import Form, List, Symbol

OPERATORS: dict[str, tuple[int, str]] = {
    "||": (1, "OR"),
    "or": (1, "OR"),
    "&&": (2, "AND"),
    "and": (2, "AND"),
    **dict.fromkeys(("=", "=="), (3, "=")),
    **dict.fromkeys(("/=", "!=", "<>"), (3, "/=")),
    **{name: (3, name) for name in ("<", "<=", ">", ">=")},
    **{name: (4, name) for name in ("+", "-")},
    **{name: (5, name) for name in ("*", "/")},
}
"""How closely each operator binds, and its name here."""

ALIASES = {
    "t": "TRUE",
    "else": "TRUE",
    "otherwise": "TRUE",
    "==": "=",
    "!=": "/=",
    "<>": "/=",
    "!": "NOT",
    "&&": "AND",
    "unless": "(WHEN (NOT test) expr ...)",
    "case": "(COND ((= x value) expr ...) ...)",
    "switch": "(COND ((= x value) expr ...) ...)",
    "while": "(RULE name (WHEN test expr ...)), which runs in every tick",
}
"""Names of other languages that nobody declared, and what stands for them here."""

MAX_OPERANDS = 8
"""Of a row that is written anew: whoever joins more does not need to see all of it."""
MAX_BRIEF = 60
"""Characters of one operand in it."""


class Row(NamedTuple):
    """Operands and operators in turn: items first..last of a list."""

    first: int
    last: int


def is_operator(form: Form) -> bool:
    """Whether a form is an operator that could stand in the middle."""
    return isinstance(form, Symbol) and form.key in OPERATORS


def rows(form: List, begin: int) -> Iterator[Row]:
    """Every row of operands with operators between them, among the items of `form` from `begin` on."""
    items, at = form.items, begin + 1
    while at + 1 < len(items):
        if is_operator(items[at]) and not is_operator(items[at - 1]) and not is_operator(items[at + 1]):
            last = at + 1
            while last + 2 < len(items) and is_operator(items[last + 1]) and not is_operator(items[last + 2]):
                last += 2
            yield Row(at - 1, last)
            at = last + 2
        else:
            at += 1


def written(row: Sequence[Form], text: str) -> str:
    """A row of `text` as it is written here, "" for one that is too long."""
    if len(row) >= 2 * MAX_OPERANDS:
        return ""
    values: list[str] = [brief(row[0], text)]
    waiting: list[tuple[int, str]] = []

    def join() -> None:
        name, right, left = waiting.pop()[1], values.pop(), values.pop()
        more = name in ("AND", "OR") and left.startswith(f"({name} ")
        values.append(f"{left[:-1]} {right})" if more else f"({name} {left} {right})")

    for operator, operand in zip(row[1::2], row[2::2], strict=True):
        binding = OPERATORS[operator.key]  # type: ignore[attr-defined]
        while waiting and waiting[-1][0] >= binding[0]:
            join()
        waiting.append(binding)
        values.append(brief(operand, text))
    while waiting:
        join()
    return values[0]


def brief(form: Form, text: str) -> str:
    """What stands in `text` for `form`, on one line, its end left out where it is long."""
    found = " ".join(text[form.start : min(form.end, form.start + MAX_BRIEF + 1)].split())
    return found if form.end - form.start <= MAX_BRIEF else f"{found[:MAX_BRIEF]}..."
