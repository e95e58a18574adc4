"""The conditions of a sentence: what is said of robots, with AND, OR, NOT and parentheses.

Conditions that stand beside each other must all hold, as those with "and" between them; OR binds less.
"""

from __future__ import annotations

from sleepcast.core.records import dataclass
from sleepcast.language import Form, Number, Symbol, show
from sleepcast.language.reader import UNQUOTE
from sleepcast.sentences.cursor import ARE, HAVE, Cursor, Stuck, call
from sleepcast.sentences.lexicon import COMPARATORS, FARTHER, OPENERS, RESERVED, SENDERS, STATES, STOPPED
from sleepcast.sentences.tokens import END, NUMBER, ODD

MAX_DEPTH = 12
"""Parentheses and NOTs inside one another."""


@dataclass(frozen=True, slots=True)
class Test:
    """A condition. several: its parts, if they stand beside each other without parentheses."""

    form: Form
    several: tuple[Form, ...] = ()


class Conditions(Cursor):
    """Reads conditions."""

    # ---- conditions

    def conditions(self) -> Test | None:
        """All conditions up to the acts, None if there are none."""
        test = None
        while self.begins_condition():
            try:
                test = self.either()
            except Stuck as stuck:
                self.note(stuck)
                self.joint()
        return test

    def joint(self) -> bool:
        """Go past AND between two conditions."""
        if self.word() not in ("and", "but"):
            return False
        self.at += 1
        return True

    def begins_condition(self) -> bool:
        """Whether a condition stands here: "are frozen" is one, and "are now in bravo" is an act."""
        relative = self.word() in ARE and self.word(1) != "now"
        return relative or self.word() in OPENERS or self.is_mark("(")

    def either(self) -> Test:
        """Conditions with OR between them."""
        tests = [self.every()]
        while self.take("or"):
            tests.append(self.every())
        if len(tests) == 1:
            return tests[0]
        return Test(call("OR", *(each.form for each in tests)))

    def every(self) -> Test:
        """Conditions with AND between them, or beside each other."""
        conditions = [self.condition()]
        while True:
            before = self.at
            self.take_mark(",")
            if not self.joint() and not self.begins_condition():
                self.at = before
                break
            try:
                conditions.append(self.condition())
            except Stuck as stuck:
                self.note(stuck)
        if len(conditions) == 1:
            return Test(conditions[0])
        return Test(call("AND", *conditions), tuple(conditions))

    def condition(self) -> Form:
        """One condition, perhaps with NOT before it."""
        self._depth += 1
        if self._depth > MAX_DEPTH:
            self.stuck(f"more than {MAX_DEPTH} conditions inside one another")
        try:
            return self.one_condition()
        finally:
            self._depth -= 1

    def one_condition(self) -> Form:
        repeated, comparing = self._comparator, self._comparing
        self._comparator, self._comparing = "", False
        if self.take("not"):
            return call("NOT", self.condition())
        if self.take_mark("("):
            test = self.either()
            self.need_mark(")")
            return test.form
        if self.take("that") or self.take("which") or self.take("who"):
            return self.relative()
        if self.word() in ARE:
            self.at += 1
            return self.condition()
        if self.take("with") or self.take("having"):
            return self.having()
        if self.take("whose"):
            return self.whose()
        if repeated and self.token.kind == NUMBER:
            return self.amount(repeated)
        if comparing and self.is_compared():
            return self.whose()
        if (name := STATES.get(self.word())) is not None:
            self.at += 1
            return Symbol(name)
        if self.take(STOPPED):
            return call("=", self.own("speed"), Number(0.0, "m/s", "0m/s"))
        if self.take("in"):
            return call("IN", self.group())
        if self.take("inside"):
            return call("INSIDE", self.open_name("the name of an area"))
        if self.take("outside"):
            return call("NOT", call("INSIDE", self.open_name("the name of an area")))
        return self.distance(comparing)

    def is_compared(self) -> bool:
        """Whether a name stands here, and then what it is."""
        follows = self.word(1)
        verbs = follows in ARE or any(follows == words[0] for words in COMPARATORS)
        return (
            bool(self.word()) and self.word() not in RESERVED and (verbs or self.lexicon.name(self.word()) is not None)
        )

    def relative(self) -> Form:
        """What follows "that"."""
        if self.word() in HAVE:
            self.at += 1
            return self.having()
        if self.word() not in ARE:
            self.stuck('wanted "have" or "are"')
        self.at += 1
        return self.condition()

    # ---- distances

    def distance(self, comparing: bool) -> Form:
        """A distance from a place; with `comparing`, an amount as in "and less than 20 % ordnance" as well."""
        if self.take("within"):
            limit = self.value()
            self.need("of")
            return call("<", self.from_here(), limit)
        if self.take("between"):
            low = self.value()
            self.need("and")
            high = self.value()
            if comparing and self.word() != "from":
                return self.range(low, high, "<")
            self.need("from")
            return call("<", low, self.from_here(), high)
        comparator = ">" if any(self.take(*words) for words in FARTHER) else self.comparator()
        if not comparator:
            self.stuck(f'"{self.written()}" is no condition' if self.token.kind != END else "wanted a condition")
        limit = self.value()
        if comparing and self.word() != "from":
            return self.amount_of(comparator, limit)
        self.need("from")
        return call(comparator, self.from_here(), limit)

    def from_here(self) -> Form:
        return call("DIST", self.own("x"), self.own("y"), *self.point())

    def point(self) -> tuple[Form, Form]:
        """Two coordinates: of a place, or in parentheses."""
        if self.take_mark("("):
            x = self.value()
            self.need_mark(",")
            y = self.value()
            self.need_mark(")")
            return x, y
        if self.word() in SENDERS:
            if not self._telling:
                self.stuck(f'"{self.written()}" is only understood in what robots tell each other')
            self.at += 1
            self._names_sender = True
            return call(UNQUOTE, self.own("x")), call(UNQUOTE, self.own("y"))
        for length in range(self._longest_place, 0, -1):
            name = self._places.get(tuple(self.word(ahead) for ahead in range(length)))
            if name is not None:
                self.at += length
                return Symbol(f"{name}_x"), Symbol(f"{name}_y")
        if self.token.kind == END:
            self.stuck("wanted a place")
        if self.token.kind in (NUMBER, ODD):
            self.stuck("a point is written with parentheses, such as (3 km, 4 km)")
        suggested = self.suggested(" ".join(words) for words in self._places)
        raise Stuck(f'"{self.written()}" is no place that these robots know{suggested}', self.at)

    # ---- amounts

    def comparator(self) -> str:
        """The operator that words here stand for; "" if there are none."""
        for words, operator in COMPARATORS.items():
            if self.take(*words):
                return operator
            if len(words) == 2 and self.word() == words[0] != "at":
                self.at += 1
                self.need(words[1])
        return ""

    def having(self) -> Form:
        """What follows "with": an amount of something, or something and its amount."""
        if self.take("a", "chance", "of"):
            return call("PROB", self.number())
        if self.take("between"):
            low = self.value()
            self.need("and")
            return self.range(low, self.value(), "<")
        if self.token.kind == NUMBER:
            if self.word(1) != "to":
                self.stuck('wanted "more than", "at least" or the like before the amount')
            low = self.number()
            self.need("to")
            return self.range(low, self.value(), "<=")
        comparator = self.comparator()
        if comparator:
            return self.amount(comparator)
        return self.whose()

    def amount(self, comparator: str) -> Form:
        return self.amount_of(comparator, self.value())

    def amount_of(self, comparator: str, limit: Form) -> Form:
        self.take("of")
        test = call(comparator, self.variable(), limit)
        self._comparator, self._comparing = comparator, True
        return test

    def range(self, low: Form, high: Form, operator: str) -> Form:
        self.take("of")
        test = call(operator, low, self.variable(), high)
        self._comparing = True
        return test

    def whose(self) -> Form:
        """A variable, and what is said of it."""
        name = self.variable()
        linked = self.word() in ARE
        self.at += linked
        negated = self.take("not")
        test = self.said_of(name, linked, negated)
        self._comparing = True
        return test

    def said_of(self, name: Form, linked: bool, negated: bool) -> Form:
        if self.take("set"):
            return call("NOT", name) if negated else name
        if self.take("known"):
            return call("NOT", call("KNOWN", name)) if negated else call("KNOWN", name)
        if negated:
            return call("/=", name, self.value())
        if self.take("unknown"):
            return call("NOT", call("KNOWN", name))
        if self.take("between"):
            low = self.value()
            self.need("and")
            return call("<", low, name, self.value())
        if self.take("from"):
            low = self.value()
            self.need("to")
            return call("<=", low, name, self.value())
        comparator = self.comparator()
        if comparator:
            return call(comparator, name, self.value())
        if not linked:
            self.stuck(f'wanted what {show(name)} is: "more than", "at most", "is" or the like')
        return call("=", name, self.value())
