"""Minds: what robots have learned - rules, operators, names - kept once for all robots that have learned the same.

A `Mind` never changes. A message that teaches something takes the robots it is for from one mind to another: a
`Transaction` of the old mind is changed, and the table gives the mind that is like it, a new one if there is none yet.
So the work of storing a rule is done once, however many robots store it.

What a draft changes of the single robots (flags, leases, how often a rule has fired) it writes down as `Effect`s.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

from sleepcast.core.errors import SleepcastError
from sleepcast.language.program import Library, Program
from sleepcast.language.reader import read_all
from sleepcast.language.symbols import Declared, Operator, circle, clash, declared_in, uses_in
from sleepcast.language.vocabulary import BUFFERS, Vocabulary, buffer_number


@dataclass(frozen=True, slots=True)
class Rule:
    """One kept expression: key, name as written, text, program, and whether it runs at every tick.

    protected: it cannot be changed over the air. priority: the higher, the later in the round.
    """

    key: str
    name: str
    text: str
    program: Program
    active: bool = False
    protected: bool = False
    priority: int = 0


@dataclass(frozen=True, slots=True)
class Effect:
    """What a change of mind does to each robot. what: "new", "renewed", "gone", "active" or "inactive"."""

    what: str
    key: str


class Mind:
    """What some robots have learned. rules, operators and learned names by key, in the order of their arrival.

    running: the active ones in the order of the round; sequence: their keys.
    """

    def __init__(self, rules: dict[str, Rule], learned: dict[str, Declared], operators: dict[str, Program]) -> None:
        self.rules, self.learned, self.operators = rules, learned, operators
        self.running = tuple(sorted((kept for kept in in_order(rules) if kept.active), key=lambda k: k.priority))
        self.sequence = tuple(kept.key for kept in self.running)

    def declared(self, key: str) -> Declared | None:
        """What is learned under `key`."""
        return declared_in(self.rules, self.learned, key)

    def heard(self) -> Iterable[str]:
        """Every learned name as written."""
        return [found.name for found in self.learned.values()]


def in_order(rules: dict[str, Rule]) -> Iterator[Rule]:
    """E1 upwards, then the rules in the order of their arrival."""
    for number in range(1, BUFFERS):
        if (kept := rules.get(f"e{number}")) is not None:
            yield kept
    yield from (kept for key, kept in rules.items() if buffer_number(key) is None)


class Named:
    """The names of a mind, for the checker."""

    def __init__(self, vocabulary: Vocabulary, mind: Mind) -> None:
        self.vocabulary, self._mind = vocabulary, mind

    def declared(self, key: str) -> Declared | None:
        return self._mind.declared(key)

    def heard(self) -> Iterable[str]:
        return self._mind.heard()


class Transaction:
    """A mind that is being changed; a `Names` as well, so that texts are compiled as the changed mind takes them."""

    def __init__(self, mind: Mind, vocabulary: Vocabulary, library: Library) -> None:
        self.vocabulary, self._library = vocabulary, library
        self.rules, self.learned, self.operators = dict(mind.rules), dict(mind.learned), dict(mind.operators)
        self.effects: list[Effect] = []

    def declared(self, key: str) -> Declared | None:
        return declared_in(self.rules, self.learned, key)

    def heard(self) -> Iterable[str]:
        return [found.name for found in self.learned.values()]

    def learn(self, key: str, found: Declared) -> None:
        before = self.learned.get(key)
        self.learned[key] = found
        if type(before) is not type(found) or isinstance(found, Operator):
            self.resolve_again(key)

    def resolve_again(self, key: str) -> None:
        """What depends on a name that has changed its meaning is compiled anew."""
        for name, kept in self.rules.items():
            if key in kept.program.free:
                self.rules[name] = replace(kept, program=self._library.again(kept.program, self))
        for name, program in self.operators.items():
            found = self.learned[name]
            if key in program.free and isinstance(found, Operator):
                self.operators[name] = self._library.again(program, self, found.parameters)

    def taken(self, key: str, sort: type) -> str | None:
        """Why `key` cannot be learned as something of this sort, if it cannot: it means something else already."""
        return clash(self.learned.get(key), sort)

    def program_for(self, key: str, text: str, parameters: tuple[str, ...]) -> Program | str:
        """The program of a text that is to be kept under `key`, or why it is refused."""
        try:
            program = self._library.program(text, lambda: read_all(text), self, parameters)
        except SleepcastError as error:
            return f"refused: {str(error).splitlines()[0]}"
        through = circle(key, program.uses, lambda k: uses_in(self, k))
        if through is not None:
            return f"{key.upper()} would name itself{through}"
        return program

    # ---- rules

    def put(self, key: str, name: str, text: str, program: Program, *, flag: bool) -> None:
        """Keep an expression; one that is there keeps its place and its flag. flag: of the buffer, if it is new."""
        found = self.rules.get(key)
        if found is None:
            self.rules[key] = Rule(key, name, text, program, flag)
            self.effects.append(Effect("new", key))
        else:
            self.rules[key] = replace(found, text=text, program=program)
            self.effects.append(Effect("renewed", key))

    def remove(self, key: str) -> None:
        """Forget an expression and clear its flag."""
        self.activate(key, False)
        del self.rules[key]
        self.effects.append(Effect("gone", key))

    def activate(self, key: str, active: bool) -> None:
        self.rules[key] = replace(self.rules[key], active=active)
        self.effects.append(Effect("active" if active else "inactive", key))

    def settle_rule(self, key: str, priority: int, protected: bool) -> None:
        """Say how important a rule is, and whether it is built in."""
        self.rules[key] = replace(self.rules[key], priority=priority, protected=protected)

    def named_rules(self) -> int:
        """How many rules with names of their own there are."""
        return sum(buffer_number(key) is None for key in self.rules)


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

    def draft(self, number: int) -> Transaction:
        """A copy of a mind, to be changed."""
        return Transaction(self._minds[number], self.vocabulary, self.library)

    def settle(self, draft: Transaction) -> int:
        """The number of the mind that is like the draft."""
        return self.add(Mind(draft.rules, draft.learned, draft.operators))

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
    return tuple(mind.rules.values()), tuple(mind.learned.items()), tuple(mind.operators.items())
