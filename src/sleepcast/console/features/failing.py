"""On which robots a rule fails, for the map."""

from __future__ import annotations

from math import inf
from typing import Protocol

from sleepcast.console.feature import answers
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


@answers(then=lambda source, asked, then: Answered(asked.serial, source.failed(asked.rule, then.time)))
def failed(source: FailingSource, asked: Failed) -> Answered:
    """On which robots a rule fails now."""
    return Answered(asked.serial, source.failed(asked.rule))
