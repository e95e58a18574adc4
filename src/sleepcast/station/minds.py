"""Minds: what the desk may ask about the robots' minds, and the names that the fleet knows between them.

The desk never touches a mind, it only asks. A dictionary of nodes by name will do; minds that answer for many robots at
once (`ManyMinds`) spare it asking a million times.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from copy import copy
from typing import Protocol, runtime_checkable

import numpy as np
from numpy.typing import NDArray

from sleepcast.language.evaluate import Entered
from sleepcast.language.explain import Explanation
from sleepcast.language.parts import Part
from sleepcast.language.program import Program
from sleepcast.language.symbols import Declared
from sleepcast.language.vocabulary import Vocabulary

Index = NDArray[np.intp]
Mask = NDArray[np.bool_]


class Telemetry(Protocol):
    """What a robot tells of itself. values: its numbers by slot, SI, NaN unknown. groups: keys of those it is in."""

    @property
    def name(self) -> str: ...

    @property
    def values(self) -> list[float]: ...

    @property
    def groups(self) -> frozenset[str]: ...

    @property
    def stopped(self) -> bool: ...


class Mind(Telemetry, Protocol):
    """One robot's mind, as far as the desk is concerned."""

    def declared(self, key: str) -> Declared | None:
        """What the robot has learned under this key, or None."""

    def heard(self) -> Iterable[str]:
        """Every learned name as written."""

    def fetch(self, part: Part) -> Entered | None:
        """The program in the buffer or rule that a `fetch` part names, None if it is empty."""

    def operator(self, part: Part) -> Entered | None:
        """The program of the operator that a `call` part names, None if it has none of that name."""

    def why(self, command: str | None = None) -> Explanation:
        """How the robot evaluated a command (by its id; None: the last one)."""


Minds = Mapping[str, Mind]
"""The minds of a fleet by the robots' names."""


Judged = tuple[Mask, NDArray[np.uint8], list[str]]
"""What a test says of some robots: where it holds; where that cannot be said, which of the reasons, listed last, is why
(from 1; 0 where it can be said)."""


class TelemetryTable(Protocol):
    """The latest telemetry of robots, by their places."""

    def judge(self, test: Program, robots: Index) -> Judged:
        """The value of a test for these robots, all of which have sent telemetry."""


class FleetTelemetry(TelemetryTable, Protocol):
    """The same of minds that tell all at once."""

    def take(self, robots: Index) -> None:
        """These robots tell of themselves now."""

    def stopped(self, robots: Index) -> Mask:
        """Which of these robots were stopped at their latest telemetry."""


@runtime_checkable
class SharedNames(Protocol):
    """Minds of which one can ask at once what any of them has learned."""

    def declared(self, key: str) -> Declared | None:
        """What any robot has learned under this key, or None."""

    def heard(self) -> Iterable[str]:
        """Every name that any robot has learned, as written."""


@runtime_checkable
class ManyMinds(SharedNames, Protocol):
    """Minds, in the order of the roster, that answer for many robots at once."""

    @property
    def names(self) -> Iterable[str]: ...

    @property
    def telemetry(self) -> FleetTelemetry: ...


class FleetNames:
    """The names that a fleet knows: its vocabulary, and what any of its minds has learned (a `Names` for the checker).

    Slots of new user variables are given out in a copy of the vocabulary: checking a text, keystroke by keystroke,
    leaves nothing behind in the robots' own tables.
    """

    def __init__(self, vocabulary: Vocabulary, minds: Minds) -> None:
        self.vocabulary = copy(vocabulary)
        self.vocabulary.user_slots = dict(vocabulary.user_slots)
        self._minds = minds

    def declared(self, key: str) -> Declared | None:
        """What the first mind that knows `key` has learned under it, or None."""
        if isinstance(self._minds, SharedNames):
            return self._minds.declared(key)
        for mind in self._minds.values():
            found = mind.declared(key)
            if found is not None:
                return found
        return None

    def heard(self) -> Iterable[str]:
        """Every name that some mind has learned, each once."""
        if isinstance(self._minds, SharedNames):
            return self._minds.heard()
        return {name: None for mind in self._minds.values() for name in mind.heard()}
