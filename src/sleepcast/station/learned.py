"""What robots far away have learned: names, and texts that are compiled when a preview comes upon them."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from sleepcast.core.errors import SleepcastError
from sleepcast.language.program import Library, Program
from sleepcast.language.reader import read_all
from sleepcast.language.symbols import Declared, Group, Operator, Stored, UserVariable
from sleepcast.language.vocabulary import Vocabulary, buffer_number
from sleepcast.station.telling import MindTold


class Learned:
    """What all robots of one mind have learned."""

    def __init__(self, told: MindTold) -> None:
        self.told = told
        self._groups = {name.casefold(): name for name in told.groups}
        self._operators = {name.casefold(): (name, tuple(given), text) for name, given, text in told.operators}
        self._rules = {name.casefold(): (name, text) for name, text, _ in told.rules}
        self._compiling: Compiling | None = None

    @property
    def names(self) -> list[str]:
        """All of them as written, but for buffers."""
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

    def program(self, key: str, vocabulary: Vocabulary) -> Program | None:
        """What is kept under a key as a program in these names; None if there is none, or none that can be compiled."""
        if self._compiling is None or self._compiling.vocabulary is not vocabulary:
            self._compiling = Compiling(self, vocabulary)
        return self._compiling.program(key)

    def found(self, key: str, vocabulary: Vocabulary) -> Declared | None:
        """What has been learned under a key. vocabulary: of the fleet."""

        def uses() -> frozenset[str]:
            program = self.program(key, vocabulary)
            return frozenset() if program is None else program.uses

        return self.sort(key, uses)

    def sort(self, key: str, uses: Callable[[], frozenset[str]]) -> Declared | None:
        """The same. uses: tells what is named by what is kept under the key."""
        if key in self._groups:
            return Group(self._groups[key])
        if key in self._operators:
            return Operator(*self._operators[key][:2], uses())
        return Stored(self._rules[key][0], uses()) if key in self._rules else None


class Compiling:
    """The texts of a mind, compiled in the names that it knows (a `Names`)."""

    def __init__(self, learned: Learned, vocabulary: Vocabulary) -> None:
        self.vocabulary = vocabulary
        self._learned, self._library = learned, Library()
        self._programs: dict[str, Program | None] = {}

    def program(self, key: str) -> Program | None:
        """See `Learned.program`."""
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
        found = self._learned.sort(key, lambda: frozenset())
        slot = self.vocabulary.user_slots.get(key)
        return UserVariable(key, slot) if found is None and slot is not None else found

    def heard(self) -> Iterable[str]:
        return self._learned.names
