"""What robots on the air have learned, as the texts that they told: names for the checker, programs for previews."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Protocol

from sleepcast.columns.telemetry import Undecided
from sleepcast.core.errors import SleepcastError
from sleepcast.language.parts import Part
from sleepcast.language.program import Library, Program
from sleepcast.language.reader import read_all
from sleepcast.language.rehearsal import holds
from sleepcast.language.symbols import Declared, Group, Operator, Stored, UserVariable
from sleepcast.language.vocabulary import Vocabulary, buffer_number
from sleepcast.mind.telemetry import MindRecord


class FleetVocabulary(Protocol):
    """Whatever knows the names of a fleet, which are others as soon as robots of another type are heard."""

    @property
    def vocabulary(self) -> Vocabulary: ...


class SymbolTable:
    """What all robots of one mind have learned (a `KnownSymbols`), in the names of a fleet."""

    def __init__(self, record: MindRecord, fleet: FleetVocabulary) -> None:
        self.record, self._fleet = record, fleet
        self._groups = {name.casefold(): name for name in record.groups}
        self._operators = {name.casefold(): (name, tuple(given), text) for name, given, text in record.operators}
        self._rules = {name.casefold(): (name, text) for name, text, _ in record.rules}
        self._compiling: LearnedPrograms | None = None

    @property
    def names(self) -> list[str]:
        """All learned names as written, except buffers."""
        rules = (name for key, (name, _) in self._rules.items() if buffer_number(key) is None)
        return [*self._groups.values(), *(name for name, _, _ in self._operators.values()), *rules]

    def has(self, key: str) -> bool:
        """Whether there is a rule, a buffer or an operator of this key."""
        return key in self._rules or key in self._operators

    def text(self, key: str) -> tuple[tuple[str, ...], str]:
        """Parameters and text of what `has` this key."""
        if key in self._operators:
            return self._operators[key][1:]
        return (), self._rules[key][1]

    def fetch(self, part: Part) -> Program | None:
        """The program in the buffer or rule that a `fetch` part names. Raises Undecided where its text means nothing to
        this desk."""
        if not self.has(part.name):
            return None
        program = self._program(part.name)
        if program is None:
            raise Undecided(holds(part.name))
        return program

    def operator(self, part: Part) -> Program | None:
        """The program of the operator that a `call` part names, likewise."""
        return self.fetch(part)

    def declared(self, key: str) -> Declared | None:
        """What has been learned under a key."""

        def uses() -> frozenset[str]:
            program = self._program(key)
            return frozenset() if program is None else program.uses

        return self.sort(key, uses)

    def _program(self, key: str) -> Program | None:
        """The stored expression under a key; None if there is none, or it cannot be compiled."""
        vocabulary = self._fleet.vocabulary
        if self._compiling is None or self._compiling.vocabulary is not vocabulary:
            self._compiling = LearnedPrograms(self, vocabulary)
        return self._compiling.program(key)

    def sort(self, key: str, uses: Callable[[], frozenset[str]]) -> Declared | None:
        """The same. uses: tells what is named by what is kept under the key."""
        if key in self._groups:
            return Group(self._groups[key])
        if key in self._operators:
            return Operator(*self._operators[key][:2], uses())
        return Stored(self._rules[key][0], uses()) if key in self._rules else None


class LearnedPrograms:
    """The texts of a mind, compiled in the names that it knows (a `Names`)."""

    def __init__(self, learned: SymbolTable, vocabulary: Vocabulary) -> None:
        self.vocabulary = vocabulary
        self._learned, self._library = learned, Library()
        self._programs: dict[str, Program | None] = {}

    def program(self, key: str) -> Program | None:
        """The program that is learned under `key`; None if none is, or its text cannot be compiled."""
        if key not in self._programs:
            self._programs[key] = self._compiled(key)
        return self._programs[key]

    def _compiled(self, key: str) -> Program | None:
        if not self._learned.has(key):
            return None
        parameters, text = self._learned.text(key)
        try:
            return self._library.program(text, lambda: read_all(text), self, parameters)
        except SleepcastError:
            return None

    def declared(self, key: str) -> Declared | None:
        """What is learned under a key; what else it uses is of no interest to who does not store anything."""
        declared = self._learned.sort(key, lambda: frozenset())
        slot = self.vocabulary.user_slots.get(key)
        return UserVariable(key, slot) if declared is None and slot is not None else declared

    def heard(self) -> Iterable[str]:
        return self._learned.names
