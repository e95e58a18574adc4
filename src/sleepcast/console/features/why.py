"""Why a robot did with a command what it did: the robot's own explanation, or one that is found by running again."""

from __future__ import annotations

from collections.abc import Awaitable
from typing import Protocol

import msgspec

from sleepcast.console.explanation import ShownWhy
from sleepcast.console.feature import Then, answers
from sleepcast.console.incoming import Id, Index, PageMessage, Serial
from sleepcast.console.outgoing import DeskMessage


class Why(PageMessage):
    """How a robot (by its index) evaluated a command (by its id)."""

    serial: Serial
    robot: Index
    command: Id


class Explained(DeskMessage):
    """Why a robot obeyed a command or did not."""

    serial: int
    why: ShownWhy


class RunAgain(Protocol):
    """What can be run again up to a tick."""

    def why(self, tick: int, asked: Why) -> Awaitable[msgspec.Raw]: ...


class WhySource(Protocol):
    """Robots that can be asked why. past: of their run."""

    @property
    def past(self) -> RunAgain: ...


class Explainer(Protocol):
    """Robots that say why now."""

    def explain(self, asked: Why) -> Explained | Awaitable[Explained | msgspec.Raw]:
        """The robot's explanation. Raises SleepcastError where it has none."""


def _why_then(source: WhySource, asked: Why, then: Then) -> Awaitable[msgspec.Raw]:
    return source.past.why(then.tick, asked)


@answers(then=_why_then)
def why(source: Explainer, asked: Why) -> Explained | Awaitable[Explained | msgspec.Raw]:
    """How a robot evaluated a command."""
    return source.explain(asked)
