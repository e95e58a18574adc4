"""The names that a row of expressions would teach a robot, for checking them one after the other without a robot."""

from __future__ import annotations

from sleepcast.language import Form, FreshNames, List, Symbol
from sleepcast.language.program import build
from sleepcast.language.reader import walk
from sleepcast.language.symbols import Group, Operator, Stored, UserVariable
from sleepcast.language.vocabulary import rule_key


class LearnedNames(FreshNames):
    """The names of a robot that has learned everything that `learn` was given, whatever its tests."""

    def learn(self, form: Form) -> None:
        """Take in what a checked expression declares: variables, buffers, rules, operators and groups."""
        for inside in walk(form):
            if isinstance(inside, List) and len(inside.items) >= 2 and isinstance(inside.items[1], Symbol):
                self._take(inside, inside.items[1])

    def _take(self, form: List, name: Symbol) -> None:
        key = name.key
        if form.head == "defvar":
            self._learned[key] = UserVariable(name.text, self.vocabulary.user_slot(key))
        elif form.head == "join":
            self._learned[key] = Group(name.text)
        elif form.head == "defun" and len(form.items) > 3 and isinstance(form.items[2], List):
            parameters = tuple(p.text for p in form.items[2].items if isinstance(p, Symbol))
            self._learned[key] = Operator(name.text, parameters, self._uses(form.items[3:], parameters))
        elif form.head == "area":
            self._learned[key] = Operator(name.text, (), self._uses(form.items[2:], ()))
        elif form.head in ("rule", "setqq") and len(form.items) >= 3:
            self._learned[rule_key(key)] = Stored(name.text, self._uses(form.items[2:3], ()))

    def _uses(self, body: tuple[Form, ...], parameters: tuple[str, ...]) -> frozenset[str]:
        program, _ = build("", body, self, parameters)
        return program.uses
