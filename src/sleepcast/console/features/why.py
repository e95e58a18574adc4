"""Why a robot did with a command what it did: the robot's own explanation, or one that is found by running again."""

from __future__ import annotations

from collections.abc import Awaitable
from math import isnan
from typing import Protocol

import msgspec

from sleepcast.console.feature import answers
from sleepcast.console.incoming import Id, Index, PageMessage, Serial
from sleepcast.console.outgoing import DeskMessage
from sleepcast.core.units import value_in_words
from sleepcast.language import Explanation, Step
from sleepcast.language.functions import BUILT_IN

_TRUTHS = frozenset({"compare", "truth"})


class Why(PageMessage):
    """How a robot (by its index) evaluated a command (by its id)."""

    serial: Serial
    robot: Index
    command: Id


class ShownStep(msgspec.Struct, frozen=True):
    """One part.

    state: "true", "false", "unknown" of a truth; "value" of a number; "skipped"; "fault"
    note: on the first test that did not hold, by how much
    fault: what went wrong here
    """

    text: str
    value: str
    state: str
    note: str = ""
    fault: str = ""
    parts: tuple[ShownStep, ...] = ()


class ShownWhy(msgspec.Struct, frozen=True):
    """Why a robot obeyed a command or did not, see `Explanation`. precedence: what a rule's priority means. bid: how
    its bid stands, in words."""

    text: str
    matched: bool
    reason: str
    faults: tuple[str, ...]
    root: ShownStep
    held: bool = False
    precedence: str = ""
    bid: str = ""


class Explained(DeskMessage):
    """Why a robot obeyed a command or did not."""

    serial: int
    why: ShownWhy


class Explainer(Protocol):
    """Robots that say why now."""

    def explain(self, asked: Why) -> Explained | Awaitable[Explained | msgspec.Raw]:
        """The robot's explanation. Raises SleepcastError where it has none."""


@answers(then=lambda source, asked, then: source.past.why(then.tick, asked))
def why(source: Explainer, asked: Why) -> Explained | Awaitable[Explained | msgspec.Raw]:
    """How a robot evaluated a command."""
    return source.explain(asked)


# ---- an explanation for the page: the same tree, with every value as a person reads it and every part's state


def show_why(explanation: Explanation) -> ShownWhy:
    """`explanation` for the page."""
    about = (explanation.text, explanation.matched, explanation.reason, explanation.faults)
    bid = "" if explanation.bid is None else explanation.bid.sentence
    return ShownWhy(*about, _show(explanation.root), explanation.held, explanation.precedence, bid)


def _show(step: Step) -> ShownStep:
    state = _state(step)
    value = "" if state in ("skipped", "true", "false") else value_in_words(step.value, step.unit)
    parts = tuple(_show(part) for part in step.children if not part.is_literal)
    return ShownStep(step.text, value, state, step.note, step.fault or "", parts)


def _state(step: Step) -> str:
    if step.fault:
        return "fault"
    if step.value is None:
        return "skipped"
    if isnan(step.value):
        return "unknown"
    head = step.text[1:].split(None, 1)[0].rstrip(")") if step.text.startswith("(") and len(step.text) > 2 else ""
    function = BUILT_IN.get(head.casefold())
    if function is not None and function.rule in _TRUTHS:
        return "true" if step.value else "false"
    return "value"
