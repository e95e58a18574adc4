"""What a name may mean beyond the vocabulary: what this robot has learned over the air.

User variables, rules, operators and groups come into being while a robot runs. `Names` is what the checker asks;
a robot's mind is one, and `FreshNames` is a robot that has learned nothing yet.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Protocol

from sleepcast.core.errors import with_article
from sleepcast.core.records import dataclass
from sleepcast.language.vocabulary import Vocabulary, buffer_number


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

KIND_NAMES: dict[type, str] = {UserVariable: "user variable", Stored: "rule", Operator: "operator", Group: "group"}


class Naming(Protocol):
    """A program, as far as names go. uses: as in `Stored`."""

    @property
    def uses(self) -> frozenset[str]: ...


class StoredExpression(Protocol):
    """An expression that a mind stores: a rule, or a buffer."""

    @property
    def name(self) -> str: ...

    @property
    def program(self) -> Naming: ...


def declared_in(stored: Mapping[str, StoredExpression], learned: Mapping[str, Declared], key: str) -> Declared | None:
    """What a mind has learned under `key`. stored: its rules and buffers; learned: its other names."""
    if buffer_number(key) is not None and (buffer := stored.get(key)) is not None:
        return Stored(buffer.name, buffer.program.uses)
    return learned.get(key)


class Names(Protocol):
    """The names of one robot."""

    @property
    def vocabulary(self) -> Vocabulary: ...

    def declared(self, key: str) -> Declared | None:
        """What the robot has learned under this key (buffers under e1..e63), or None."""

    def heard(self) -> Iterable[str]:
        """Every learned name as written, for suggestions."""


def given(vocabulary: Vocabulary) -> dict[str, Declared]:
    """What robots of this vocabulary have learned from the start: their areas."""
    return {area.name.casefold(): Operator(area.name, (), frozenset()) for area in vocabulary.areas}


class FreshNames:
    """The names of a robot that has heard nothing yet."""

    def __init__(self, vocabulary: Vocabulary) -> None:
        self.vocabulary, self._learned = vocabulary, given(vocabulary)

    def declared(self, key: str) -> Declared | None:
        """What it has learned under this key."""
        return self._learned.get(key)

    def heard(self) -> Iterable[str]:
        """Every learned name as written."""
        return [each.name for each in self._learned.values()]


def known_groups(names: Names) -> list[str]:
    """The groups of which one of these robots has heard, as written."""
    return [name for name in names.heard() if isinstance(names.declared(name.casefold()), Group)]


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


def circle(key: str, uses: Iterable[str], uses_of: Callable[[str], Iterable[str]]) -> str | None:
    """How `key`, kept with these uses, would come to name itself: "" or ` through OTHERS`; None if it would not."""
    way = reaches(uses, key, uses_of)
    if way is None:
        return None
    return " through " + ", ".join(k.upper() for k in way[:-1]) if len(way) > 1 else ""


def clash(known: Declared | None, wanted: type) -> str | None:
    """Why a name cannot be learned as something of this type, if it cannot: it means something else already."""
    if known is None or isinstance(known, wanted):
        return None
    return f"{known.name} is already {with_article(KIND_NAMES[type(known)])}"


def uses_in(names: Names, key: str) -> frozenset[str]:
    """The keys that a learned rule, buffer or operator names."""
    known = names.declared(key)
    return known.uses if isinstance(known, Stored | Operator) else frozenset()
