"""From an expression to a sentence: the one way in which the writer says it, of the many that the parser understands.

What is written is read again before it is given away, and only if the very same expression comes back: so nothing is
said that means something else, whatever the names are.
"""

from __future__ import annotations

from collections.abc import Sequence

from sleepcast.core.records import dataclass
from sleepcast.language import Form, List, Number, Symbol, Text
from sleepcast.language.reader import QUASIQUOTE, UNQUOTE, format_literal
from sleepcast.language.vocabulary import unit_of
from sleepcast.sentences.cursor import call
from sleepcast.sentences.lexicon import (
    COMPARATORS,
    FARTHER,
    ROBOTS,
    SENDERS,
    STATES,
    STOPPED,
    VERBS,
    WITH_RULE,
    WITH_THEMSELVES,
    WITHOUT_OBJECT,
    Lexicon,
)
from sleepcast.sentences.parser import MAX_SENTENCE, from_sentence

_WORDS = {operator: " ".join(words) for words, operator in reversed(COMPARATORS.items())}
"""The words for each comparison: the first that the grammar has."""
_FAR = {"<": "within", ">": " ".join(FARTHER[0]), "<=": _WORDS["<="], ">=": _WORDS[">="]}
_HAD = frozenset({"%", "kg"})
"""Units of what one has: "with more than 50 % fuel", but "whose speed is more than 5 kn"."""
_FLAGS = frozenset(STATES.values())
_ATTACHED = frozenset({"in"})
"""Units that would be read as words if they stood alone."""


@dataclass(frozen=True, slots=True)
class SentencePart:
    """A piece of a sentence, start..end, that stands for a piece of the expression, shown_start..shown_end of the text
    that this was read from."""

    start: int
    end: int
    shown_start: int
    shown_end: int


@dataclass(frozen=True, slots=True)
class Sentence:
    """An expression in words. parts: subject, conditions and acts, in the order of the sentence."""

    text: str
    parts: tuple[SentencePart, ...]


def to_sentence(form: Form, lexicon: Lexicon) -> Sentence | None:
    """The sentence for an expression, None if the grammar has none for it."""
    writer = _Writer(lexicon)
    try:
        writer.order(form)
    except _Beyond:
        return None
    text = writer.text
    if len(text) > MAX_SENTENCE or from_sentence(text, lexicon).form != form:
        return None
    return Sentence(text, tuple(writer.parts))


class _Beyond(Exception):
    """The grammar has no words for this."""


class _Writer:
    def __init__(self, lexicon: Lexicon) -> None:
        self.lexicon = lexicon
        self.text = ""
        self.parts: list[SentencePart] = []
        self._titles = lexicon.place_titles()
        self._one = False
        """Whether a single robot is spoken of, which "joins"."""
        self._telling = False

    # ---- text

    def put(self, *words: str) -> None:
        for word in words:
            if self.text and word not in (",", ")") and not self.text.endswith("("):
                self.text += " "
            self.text += word

    def part(self, form: Form, start: int) -> None:
        """Note that what was written since `start` stands for `form`."""
        start += self.text[start : start + 1] == " "
        self.parts.append(SentencePart(start, len(self.text), form.start, form.end))

    # ---- the whole

    def order(self, form: Form, marker: str = "") -> None:
        """A command; marker: the word before its acts, "" for none."""
        test, acts = self.split(form)
        if (marker and not acts) or isinstance(form, Symbol):  # a name alone is a question rather than a condition
            raise _Beyond
        conditions = self.subject(test)
        if test is not None and conditions == [test] and _call(test)[0] == "or":
            start = len(self.text)
            self.group(_call(test)[1], "or")
            self.part(test, start)
        else:
            for index, condition in enumerate(conditions):
                self.beside(condition, conditions[index - 1] if index else None)
        if marker:
            self.put(marker)
            self._one = False
        for index, act in enumerate(acts):
            if index:
                self.put("and" if index == len(acts) - 1 else ",")
            start = len(self.text)
            self.act(act, last=index == len(acts) - 1)
            self.part(act, start)

    def split(self, form: Form) -> tuple[Form | None, Sequence[Form]]:
        """The test of a command, None if it has none, and its acts."""
        match _call(form):
            case "when", [test, *acts] if acts:
                return test, acts
            case "progn", [*acts] if len(acts) > 1:
                return None, acts
        return (None, [form]) if self.is_act(form) else (form, [])

    def subject(self, test: Form | None) -> Sequence[Form]:
        """Say who is meant; gives the conditions that are still to be said."""
        if test is None:
            self.put(f"all {self.lexicon.noun}")
            return []
        tests = _operands(test)
        start = len(self.text)
        if not (named := self.named(tests[0])):
            self.put(self.lexicon.noun)
            return tests
        self.put(named)
        self.part(tests[0], start)
        return tests[1:]

    def named(self, test: Form) -> str:
        """The robots that a test picks by group or number, "" for another test."""
        match _call(test):
            case "in", [Symbol() as group]:
                return f"members of {group.text}"
            case "=", [Symbol(key="id"), Number() as number]:
                self._one = True
                return f"{ROBOTS[1]} {_number(number)}"
            case "or", [*choices] if len(choices) > 1:
                numbers = [self.numbered(choice) for choice in choices]
                if all(numbers):
                    return f"{ROBOTS[0]} {', '.join(numbers[:-1])} and {numbers[-1]}"
        return ""

    def numbered(self, test: Form) -> str:
        match _call(test):
            case "=", [Symbol(key="id"), Number() as number]:
                return _number(number)
        return ""

    # ---- conditions

    def beside(self, condition: Form, before: Form | None) -> None:
        """A condition that stands behind the subject, or behind another one."""
        start = len(self.text)
        amounts = before is not None and self.is_amount(condition) and self.is_amount(before)
        if before is not None and amounts and _call(condition)[0] == _call(before)[0]:  # only the amount is said
            self.put("and")
            start = len(self.text)
            self.amount(*_call(condition), repeated=True)
        else:
            if before is not None and not (self.is_had(condition) and not self.is_had(before)):
                self.put("and")
                start = len(self.text)
            self.condition(condition)
        self.part(condition, start)

    def is_had(self, condition: Form) -> bool:
        """Whether a condition begins with "with" or "whose", so that it may stand beside another one."""
        match _call(condition):
            case "=", [Symbol(key="speed"), Number(value=0.0, unit="m/s")]:
                return False
            case "<" | ">" | "<=" | ">=" | "=" | "/=" | "prob" | "known", [*operands]:
                return not any(isinstance(each, List) for each in operands)
        return False

    def is_amount(self, condition: Form) -> bool:
        match _call(condition):
            case "<" | ">" | "<=" | ">=" | "=", [Symbol() as name, Number()]:
                return self.unit(name) in _HAD
        return False

    def unit(self, name: Symbol) -> str:
        return unit_of(name.key, self.lexicon.vocabulary)

    def group(self, conditions: Sequence[Form], joint: str) -> None:
        """Conditions with AND or OR between them, inside others."""
        if len(conditions) < 2:
            raise _Beyond
        for index, condition in enumerate(conditions):
            if index:
                self.put(joint)
            self.condition(condition)

    def condition(self, form: Form) -> None:
        match _call(form):
            case "and", [*conditions]:
                self.put("(")
                self.group(conditions, "and")
                self.put(")")
            case "or", [*conditions]:
                self.put("(")
                self.group(conditions, "or")
                self.put(")")
            case "not", [inside]:
                self.negated(inside)
            case "in", [Symbol() as group]:
                self.put("in", group.text)
            case "inside", [Symbol() as area]:
                self.put("inside", area.text)
            case "known", [Symbol() as name]:
                self.put("whose", self.variable(name), "is known")
            case "prob", [Number() as chance]:
                self.put("with a chance of", _number(chance))
            case operator, operands if operator:
                self.comparison(operator, operands)
            case _ if isinstance(form, Symbol):
                self.flag(form)
            case _:
                raise _Beyond

    def negated(self, inside: Form) -> None:
        match _call(inside):
            case "known", [Symbol() as name]:
                self.put("whose", self.variable(name), "is unknown")
            case _ if isinstance(inside, Symbol) and inside.key not in _FLAGS:
                self.put("with", self.variable(inside), "not set")
            case _:
                self.put("not")
                self.condition(inside)

    def flag(self, name: Symbol) -> None:
        if name.key in _FLAGS:
            self.put(next(word for word, key in STATES.items() if key == name.key))
        else:
            self.put("with", self.variable(name), "set")

    def comparison(self, operator: str, operands: Sequence[Form]) -> None:
        match operator, operands:
            case "=", [Symbol(key="speed"), Number(value=0.0, unit="m/s")]:
                self.put(STOPPED)
            case "<" | "<=" | ">" | ">=", [List() as here, limit] if here.head == "dist":
                self.put(_FAR[operator], self.value(limit), "of" if operator == "<" else "from", self.target(here))
            case "<", [low, List() as here, high] if here.head == "dist":
                self.put("between", self.value(low), "and", self.value(high), "from", self.target(here))
            case "<" | "<=", [low, Symbol() as name, high]:
                first, second = ("between", "and") if operator == "<" else ("from", "to")
                self.put("whose", self.variable(name), "is", first, self.value(low), second, self.value(high))
            case "=" | "/=" | "<" | ">" | "<=" | ">=", [Symbol(), _]:
                self.amount(operator, operands, repeated=False)
            case _:
                raise _Beyond

    def amount(self, operator: str, operands: Sequence[Form], repeated: bool) -> None:
        """A variable compared with a value. repeated: with the words of the condition before."""
        match operands:
            case [Symbol() as name, limit]:
                if self.unit(name) in _HAD and operator != "/=":
                    self.put(*(() if repeated else ("with", _WORDS[operator])), self.value(limit), self.variable(name))
                else:
                    words = {"=": "is", "/=": "is not"}.get(operator) or f"is {_WORDS[operator]}"
                    self.put("whose", self.variable(name), words, self.value(limit))

    # ---- places and values

    def target(self, distance: List) -> str:
        """The other end of a distance from here."""
        match _call(distance):
            case "dist", [Symbol(key="x"), Symbol(key="y"), x, y]:
                return self.point(x, y)
        raise _Beyond

    def point(self, x: Form, y: Form) -> str:
        match x, y:
            case Symbol(), Symbol():
                name = x.key.removesuffix("_x")
                if name != x.key and y.key == f"{name}_y" and name in self._titles:
                    return self._titles[name]
            case List(), List():
                if self._telling and (x, y) == (call(UNQUOTE, Symbol("x")), call(UNQUOTE, Symbol("y"))):
                    return f"the {SENDERS[0]}"
        return f"({self.value(x)}, {self.value(y)})"

    def variable(self, name: Symbol) -> str:
        declared = self.lexicon.name(name.text)
        if declared is None:
            raise _Beyond
        return declared

    def value(self, form: Form) -> str:
        if isinstance(form, Number):
            return _number(form)
        if isinstance(form, Symbol):
            return self.variable(form)
        raise _Beyond

    # ---- acts

    def is_act(self, form: Form) -> bool:
        match _call(form):
            case head, _ if head:
                acts = {"join", "leave", "setq", "report", "tell"}
                names = (*WITHOUT_OBJECT.values(), *WITH_THEMSELVES.values(), *WITH_RULE.values())
                return head in acts or head.upper() in names or self.lexicon.function(head) is not None
        return False

    def do(self, verb: str, *words: str) -> None:
        self.put(VERBS[verb] if self._one else verb, *words)

    def act(self, form: Form, last: bool) -> None:
        match _call(form):
            case "join" | "leave" as verb, [Symbol() as group]:
                self.do(verb, group.text)
            case "goto", [x, y]:
                self.do("go", "to", self.point(x, y))
            case "st", []:
                self.do("stop")
            case "drive", [speed, rate]:
                self.do("drive", "at", self.value(speed))
                if rate != Number(0.0, "deg/s", "0deg/s"):
                    self.put("turning at", self.value(rate))
            case "setq", [Symbol() as name, value]:
                self.do("set", self.variable(name), "to", self.value(value))
            case "report", [*values] if values:
                self.report(values)
            case "tk", [Text() as label]:
                self.do("say", f'"{label.value}"')
            case "tell", [told] if last and not self._telling:
                self.tell(told)
            case head, [] if head:
                self.action(head)
            case head, [Symbol() as rule]:
                self.do(_verb(WITH_RULE, head), "rule", rule.text)
            case _:
                raise _Beyond

    def action(self, head: str) -> None:
        """An act without arguments."""
        if head.upper() in WITHOUT_OBJECT.values():
            self.do(_verb(WITHOUT_OBJECT, head))
        elif head.upper() in WITH_THEMSELVES.values():
            self.do(_verb(WITH_THEMSELVES, head), "itself" if self._one else "themselves")
        else:
            self.put(f"{head}s" if self._one else head)

    def report(self, values: Sequence[Form]) -> None:
        self.do("report")
        if isinstance(values[0], Text):
            self.put(f'"{values[0].value}"')
            values = values[1:]
        for index, value in enumerate(values):
            if not isinstance(value, Symbol):
                raise _Beyond
            if index:
                self.put("and" if index == len(values) - 1 else ",")
            self.put(self.variable(value))

    def tell(self, told: Form) -> None:
        self.do("tell")
        match _call(told):
            case head, [inside] if head == QUASIQUOTE:
                told = inside
        one, self._one, self._telling = self._one, False, True
        self.order(told, marker="to")
        self._one, self._telling = one, False


def _call(form: Form) -> tuple[str, Sequence[Form]]:
    """The key of what a form calls, and the arguments; "" for other forms."""
    if not isinstance(form, List) or form.head is None:
        return "", ()
    return form.head, form.items[1:]


def _operands(test: Form) -> list[Form]:
    """The tests that must all be true."""
    match _call(test):
        case "and", [first, second, *others]:
            return [first, second, *others]
    return [test]


def _verb(verbs: dict[str, str], function: str) -> str:
    for verb, name in verbs.items():
        if name == function.upper():
            return verb
    raise _Beyond


def _number(number: Number) -> str:
    """A number as people write it: the digits, and the unit behind a blank."""
    digits = number.text[: len(number.text) - len(number.unit)] if number.unit else number.text
    try:
        shown = format_literal(float(digits))
    except ValueError:
        raise _Beyond from None
    if not number.unit or number.unit in _ATTACHED:
        return f"{shown}{number.unit}"
    return f"{shown} {number.unit}"
