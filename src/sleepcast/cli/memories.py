"""Memories to type into: one robot's mind without a body, in the standard or the classic dialect.

`eval` and `repl` hand each expression to a memory and get an `EvalOutcome`: the value as it prints, what to say to the
person, and how it ended.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from dataclasses import field
from typing import Protocol

from sleepcast.core.records import dataclass

EVALUATED, REFUSED, UNREADABLE = 0, 1, 2
"""How an evaluation ended, as exit statuses: fully (an unknown value included); refused or faulted; not readable."""

UNKNOWN = "UNKNOWN"


@dataclass(frozen=True, slots=True)
class EvalOutcome:
    """What came of one expression.

    value: as it prints.
    status: EVALUATED, REFUSED or UNREADABLE.
    messages: lines for standard error.
    details: for JSON.
    """

    value: str
    status: int
    messages: tuple[str, ...] = ()
    details: Mapping[str, object] = field(default_factory=dict)

    def to_json(self) -> str:
        """The outcome as one line of JSON."""
        return json.dumps(self.details)


class TypedMemory(Protocol):
    """A memory that expressions can be typed into."""

    def set(self, name: str, value: str) -> None:
        """Give a variable a value before anything is evaluated. Raises MisuseError."""

    def evaluate(self, text: str) -> EvalOutcome:
        """Evaluate one expression."""

    def run(self, text: str) -> Iterator[EvalOutcome]:
        """Evaluate all expressions of a text, as it comes from standard input, up to one that cannot be read."""
