"""What a name may mean beyond the vocabulary: what this robot has learned over the air.

User variables, rules, operators and groups come into being while a robot runs. `Names` is what the checker asks;
a robot's mind is one, and `FreshNames` is a robot that has learned nothing yet.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Protocol

from sleepcast.language.vocabulary import Vocabulary


@dataclass(frozen=True, slots=True)
class UserVariable:
    """A variable made by DEFVAR."""

    name: str
    slot: int


@dataclass(frozen=True, slots=True)
class Stored:
    """A rule, or a buffer that holds an expression. uses: keys of the buffers, rules and operators that it names."""

    name: str
    uses: frozenset[str]


@dataclass(frozen=True, slots=True)
class Operator:
    """An operator made by DEFUN. parameters: as written. uses: as in `Stored`."""

    name: str
    parameters: tuple[str, ...]
    uses: frozenset[str]


@dataclass(frozen=True, slots=True)
class Group:
    """A group that this robot has heard of."""

    name: str


Declared = UserVariable | Stored | Operator | Group

SORTS: dict[type, str] = {UserVariable: "user variable", Stored: "rule", Operator: "operator", Group: "group"}


class Names(Protocol):
    """The names of one robot."""

    @property
    def vocabulary(self) -> Vocabulary: ...

    def declared(self, key: str) -> Declared | None:
        """What the robot has learned under this key (buffers under e1..e63), or None."""

    def heard(self) -> Iterable[str]:
        """Every learned name as written, for suggestions."""


class FreshNames:
    """The names of a robot that has learned nothing yet."""

    def __init__(self, vocabulary: Vocabulary) -> None:
        self.vocabulary = vocabulary

    def declared(self, key: str) -> Declared | None:
        """Nothing."""
        return None

    def heard(self) -> Iterable[str]:
        """Nothing."""
        return ()


def reaches(start: Iterable[str], goal: str, uses_of: Callable[[str], Iterable[str]]) -> tuple[str, ...] | None:
    """A way from one of the keys `start` to `goal` along what each key uses, or None if there is none."""
    waiting: list[tuple[str, ...]] = [(key,) for key in start]
    seen: set[str] = set()
    while waiting:
        way = waiting.pop()
        if way[-1] == goal:
            return way
        if way[-1] not in seen:
            seen.add(way[-1])
            waiting.extend((*way, key) for key in uses_of(way[-1]))
    return None


def uses_in(names: Names, key: str) -> frozenset[str]:
    """The keys that a learned rule, buffer or operator names."""
    found = names.declared(key)
    return found.uses if isinstance(found, Stored | Operator) else frozenset()
