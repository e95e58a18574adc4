"""An explanation for the page: the same tree, with every value as a person reads it and every part's state."""

from __future__ import annotations

import re
from math import isnan

import msgspec

from sleepcast.core.units import UNITS, shown_value
from sleepcast.language import Explanation, Step, Vocabulary
from sleepcast.language.functions import BUILT_IN
from sleepcast.language.vocabulary import unit_of

_LITERAL = re.compile(r"[+-]?(?:\d+\.?\d*|\.\d+)(?:e[+-]?\d+)?(%|[a-z]+(?:/[a-z]+)?\d?)?\Z", re.IGNORECASE)
_TRUTHS = frozenset({"compare", "truth"})


class ShownStep(msgspec.Struct, frozen=True):
    """One part. state: "true", "false", "unknown" of a truth; "value" of a number; "skipped"; "fault".

    note: on the first test that did not hold, by how much. fault: what went wrong here.
    """

    text: str
    value: str
    state: str
    note: str = ""
    fault: str = ""
    parts: tuple[ShownStep, ...] = ()


class ShownWhy(msgspec.Struct, frozen=True):
    """Why a robot obeyed a command or did not, see `Explanation`."""

    text: str
    matched: bool
    reason: str
    faults: tuple[str, ...]
    root: ShownStep
    held: bool = False


def show_why(explanation: Explanation, vocabulary: Vocabulary) -> ShownWhy:
    """`explanation` for the page; the vocabulary says in which units values are read."""
    root = _show(explanation.root, "", vocabulary)
    about = (explanation.text, explanation.matched, explanation.reason, explanation.faults)
    return ShownWhy(*about, root, explanation.held)


def _show(step: Step, unit: str, vocabulary: Vocabulary) -> ShownStep:
    """unit: of what the part is compared with, which reads better than its own."""
    rule = _rule(step)
    inside = _unit_inside(step, vocabulary) if rule == "compare" else ""
    parts = tuple(_show(part, inside, vocabulary) for part in step.children if not _LITERAL.match(part.text))
    state = _state(step, rule)
    value = (
        "" if state in ("skipped", "true", "false") else shown_value(step.value, unit or unit_of(step.text, vocabulary))
    )
    return ShownStep(step.text, value, state, step.note, step.fault or "", parts)


def _rule(step: Step) -> str:
    head = step.text[1:].split(None, 1)[0].rstrip(")") if step.text.startswith("(") and len(step.text) > 2 else ""
    function = BUILT_IN.get(head.casefold())
    return function.rule if function is not None else ""


def _state(step: Step, rule: str) -> str:
    if step.fault:
        return "fault"
    if step.value is None:
        return "skipped"
    if isnan(step.value):
        return "unknown"
    if rule in _TRUTHS:
        return "true" if step.value else "false"
    return "value"


def _unit_inside(step: Step, vocabulary: Vocabulary) -> str:
    """The unit in which the operands of a comparison are read: a literal's as written, else a variable's."""
    units = [match[1] or "" for part in step.children if (match := _LITERAL.match(part.text))]
    units += [unit_of(part.text, vocabulary) for part in step.children]
    return next((unit.casefold() for unit in units if unit.casefold() in UNITS), "")
