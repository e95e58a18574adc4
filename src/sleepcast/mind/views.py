"""What a mind shows: its rules, and the faults and results of an evaluation."""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from sleepcast.core.records import dataclass
from sleepcast.language.explain import Explanation, Recollection, explain


@dataclass(frozen=True, slots=True)
class Fault:
    """A fault in an evaluation. where: the text of the part."""

    reason: str
    where: str
    tick: int

    def __str__(self) -> str:
        return f"{self.reason} in {self.where}"


@dataclass(frozen=True, slots=True)
class RuleView:
    """A rule or buffer as shown to people.

    lease: time (s) at which it is deactivated, inf for never.
    last_value, last_fault, steps: of its last evaluation.
    firings: evaluations in which its test held.
    priority: rules with a higher one are evaluated later; of its host, or the `:priority` of its RULE.
    protected: built in.
    unit: in which people read the last value.
    """

    name: str
    text: str
    active: bool
    last_value: float
    last_fault: str
    steps: int
    firings: int
    lease: float
    priority: int
    protected: bool
    unit: str = ""


@dataclass(frozen=True, slots=True)
class Result:
    """The result of one text. printed: its reports, label and values. recall: returns the inputs of the evaluation."""

    value: float
    matched: bool
    faults: tuple[Fault, ...]
    cost: int
    steps: int
    printed: tuple[tuple[str, tuple[float, ...]], ...]
    recall: Callable[[], Recollection]

    @property
    def recollection(self) -> Recollection:
        return self.recall()

    @property
    def explanation(self) -> Explanation:
        """Computed on request."""
        return explain(self.recall())


class EvaluatedCommand(NamedTuple):
    """What came of an evaluation: the word for it, the value, and the fault, "" for none."""

    word: str
    value: float
    fault: str
