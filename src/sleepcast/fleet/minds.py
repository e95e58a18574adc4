"""Minds: what robots have learned - rules, operators, names - kept once for all robots that have learned the same.

A `Mind` never changes. A message that teaches something takes the robots it is for from one mind to another: a draft of
the old mind (a `RuleBase`) is changed, and the table gives the mind that is like it, a new one if there is none yet. So
the work of storing a rule is done once, however many robots store it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable

from sleepcast.language.program import Library, Program
from sleepcast.language.symbols import Declared, declared_in
from sleepcast.language.vocabulary import Vocabulary
from sleepcast.mind.merging import Merging
from sleepcast.mind.rules import Rule, RuleBase, running

UNMERGED = Merging()
"""A fleet hears its commands in one order, so all of them count."""


class Mind:
    """What some robots have learned. rules, operators and symbols by key, in the order of their arrival.

    running: the active rules in the order of the round; sequence: their keys.
    """

    def __init__(self, rules: dict[str, Rule], symbols: dict[str, Declared], operators: dict[str, Program]) -> None:
        self.rules, self.symbols, self.operators = rules, symbols, operators
        self.running = tuple(running(rules))
        self.sequence = tuple(rule.key for rule in self.running)

    def declared(self, key: str) -> Declared | None:
        """What is learned under `key`."""
        return declared_in(self.rules, self.symbols, key)

    def heard(self) -> Iterable[str]:
        """Every learned name as written."""
        return [found.name for found in self.symbols.values()]


class Named:
    """The names of a mind, for the checker."""

    def __init__(self, vocabulary: Vocabulary, mind: Mind) -> None:
        self.vocabulary, self._mind = vocabulary, mind

    def declared(self, key: str) -> Declared | None:
        return self._mind.declared(key)

    def heard(self) -> Iterable[str]:
        return self._mind.heard()


class Minds:
    """The table of minds. vocabulary: of all robots. Number 0 is the mind that has learned nothing."""

    def __init__(self, vocabulary: Vocabulary) -> None:
        self.vocabulary, self.library = vocabulary, Library()
        self._minds: dict[int, Mind] = {}
        self._numbers: dict[tuple[object, ...], int] = {}
        self._next = 0
        self.add(Mind({}, {}, {}))

    def __getitem__(self, number: int) -> Mind:
        return self._minds[number]

    def __len__(self) -> int:
        return len(self._minds)

    def draft(self, number: int, changing: Callable[[], None] = lambda: None) -> RuleBase:
        """A copy of a mind, to be changed. changing: called before its rules change."""
        mind = self._minds[number]
        return RuleBase(
            self.vocabulary,
            self.library,
            UNMERGED,
            changing,
            rules=mind.rules,
            symbols=mind.symbols,
            operators=mind.operators,
        )

    def settle(self, draft: RuleBase) -> int:
        """The number of the mind that is like the draft."""
        return self.add(Mind(draft.rules, draft.symbols, draft.operators))

    def add(self, mind: Mind) -> int:
        """The number of a mind like this one."""
        number = self._numbers.setdefault(_key(mind), self._next)
        if number == self._next:
            self._minds[number] = mind
            self._next += 1
        return number

    @property
    def table(self) -> tuple[dict[int, Mind], int]:
        """Every mind by its number, and the number that the next one gets."""
        return dict(self._minds), self._next

    def fill(self, minds: dict[int, Mind], following: int) -> None:
        """Have just these minds under these numbers, all below `following`, which the next one gets."""
        self._minds, self._numbers, self._next = {}, {}, following
        for number, mind in sorted(minds.items()):
            self._minds[number] = mind
            self._numbers.setdefault(_key(mind), number)

    def keep_only(self, used: set[int]) -> None:
        """Forget the minds that no robot is of any more; 0 stays."""
        self._minds = {number: mind for number, mind in self._minds.items() if number in used or number == 0}
        self._numbers = {key: number for key, number in self._numbers.items() if number in self._minds}


def _key(mind: Mind) -> tuple[object, ...]:
    """What makes a mind the same as another one."""
    return tuple(mind.rules.values()), tuple(mind.symbols.items()), tuple(mind.operators.items())
