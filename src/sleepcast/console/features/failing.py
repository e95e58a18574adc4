"""On which robots a rule fails, for the map."""

from __future__ import annotations

from math import inf
from typing import Protocol

from sleepcast.console.feature import Then, answers
from sleepcast.console.incoming import Id, PageMessage, Serial
from sleepcast.console.outgoing import Answered


class Failed(PageMessage):
    """On which robots a rule fails now; "": any rule."""

    serial: Serial
    rule: Id


class FailingSource(Protocol):
    """Robots whose rules are known to fail."""

    def failed(self, rule: str, time: float = inf) -> bytes:
        """On which robots a rule ("": any rule) failed at a time, s of the page's time: 1 each. Raises MisuseError."""


def _failed_then(source: FailingSource, asked: Failed, then: Then) -> Answered:
    return Answered(asked.serial, source.failed(asked.rule, then.time))


@answers(then=_failed_then)
def failed(source: FailingSource, asked: Failed) -> Answered:
    """On which robots a rule fails now."""
    return Answered(asked.serial, source.failed(asked.rule))
