"""From a sentence to an expression: recursive descent over tokens, without going back, so in time that grows with the
sentence's length.

A sentence has a subject, conditions (`conditions`) and acts. Where a token has no place, the parser notes the stretch
up to the next word that can begin something, and goes on behind it: the notes tell all that is not understood, and
there is no expression then. Nothing is looked up outside the lexicon, so the same sentence always means the same.
"""

from __future__ import annotations

from collections.abc import Callable

from sleepcast.core.errors import MisuseError
from sleepcast.core.records import dataclass
from sleepcast.language import Form, Number, Symbol, show
from sleepcast.language.reader import QUASIQUOTE
from sleepcast.sentences.conditions import Conditions, Test
from sleepcast.sentences.cursor import ARE, MAX_UNCLEAR, Stuck, Unclear, call
from sleepcast.sentences.lexicon import (
    EVERYBODY,
    PLURAL,
    QUANTIFIERS,
    VERBS,
    WITH_RULE,
    WITH_THEMSELVES,
    WITHOUT_OBJECT,
    Lexicon,
)
from sleepcast.sentences.tokens import END, LABEL, NUMBER, WORD

MAX_SENTENCE = 2_000
"""Characters in one sentence: a page of conditions."""


class SentenceError(MisuseError):
    """A text that is too long to be read as a sentence."""


@dataclass(frozen=True, slots=True)
class ParsedSentence:
    """What a sentence means.

    form: the expression, None if anything is unclear.
    unclear: what, in order.
    doubts: what is understood, and probably a slip.
    """

    form: Form | None
    unclear: tuple[Unclear, ...] = ()
    doubts: tuple[Unclear, ...] = ()

    @property
    def text(self) -> str:
        """The expression, "" if there is none."""
        return "" if self.form is None else show(self.form)


def from_sentence(text: str, lexicon: Lexicon) -> ParsedSentence:
    """What `text` means to a fleet. Raises SentenceError if it is longer than `MAX_SENTENCE`, and nothing else."""
    if len(text) > MAX_SENTENCE:
        raise SentenceError(f"a sentence of {len(text):,} characters: at most {MAX_SENTENCE:,} are read")
    parser = _Parser(text, lexicon)
    form = parser.sentence()
    unclear = tuple(parser.unclear[:MAX_UNCLEAR])
    return ParsedSentence(None if unclear else form, unclear, tuple(parser.doubts))


class _Parser(Conditions):
    """Reads a whole sentence."""

    # ---- the whole

    def sentence(self) -> Form | None:
        form = self.order("")
        if self.token.kind != END:
            self.note(Stuck(f'"{self.written()}" has no place here', self.at))
        return form

    def order(self, marker: str) -> Form | None:
        """Subject, conditions and acts. marker: the word between conditions and acts, "" for none."""
        subject = self.noted(self.subject)
        test = self.noted(self.conditions)
        self.take_mark(",")
        if marker and self.token.kind != END:
            self.noted(lambda: self.need(marker))
        acts = self.acts()
        if self.unclear:
            return None
        form = _both(subject, test)
        if not acts:
            if form is None or marker:
                self.note(Stuck("what the robots are to do is missing", self.at))
            return form
        if form is not None:
            return call("WHEN", form, *acts)
        return acts[0] if len(acts) == 1 else call("PROGN", *acts)

    def noted(self, part: Callable[[], object]) -> object:
        """The value of a part; None, and a note, if it is not understood."""
        try:
            return part()
        except Stuck as stuck:
            self.note(stuck)
            return None

    # ---- who

    def subject(self) -> Test | None:
        """Who is meant: a test, or None for all."""
        if self.word() in EVERYBODY:
            self.at += 1
            return None
        every = self.word() in QUANTIFIERS
        self.at += every
        if self.word() in self._nouns:
            self.at += 1
            return self.numbered()
        if self.take("members", "of"):
            return Test(call("IN", self.group()))
        if every and (self.token.kind == END or self.is_seam()):
            return None
        if self.token.kind == WORD:
            number = self.lexicon.number_of(self.token.written)
            if number is not None:
                self.at += 1
                return Test(call("=", Symbol("id"), Number(float(number))))
        wanted = f'"{self.lexicon.noun}", "members of" a group, or the name of a robot'
        raise Stuck(f"wanted who is meant: {wanted}", self.at)

    def numbered(self) -> Test | None:
        """The numbers of robots, `7` or `1, 2 and 5`; None if there are none."""
        tests: list[Form] = []
        while self.token.kind == NUMBER and not self.token.unit and self.token.text.isdigit():
            tests.append(call("=", Symbol("id"), self.number()))
            following = self.tokens[min(self.at + 1, len(self.tokens) - 1)]
            if following.kind != NUMBER or not (self.take_mark(",") or self.take("and") or self.take("or")):
                break
        if len(tests) > 1:
            return Test(call("OR", *tests))
        return Test(tests[0]) if tests else None

    # ---- acts

    def acts(self) -> list[Form]:
        """Everything that the robots are to do."""
        acts: list[Form] = []
        while self.token.kind != END:
            try:
                acts.append(self.act())
            except Stuck as stuck:
                self.note(stuck)
            if self.token.kind == END:
                break
            if not self.take_joint():
                self.note(Stuck(f'"{self.written()}" has no place here', self.at))
                self.take_joint()
            elif self.token.kind == END:
                self.note(Stuck("wanted what else the robots are to do", self.at))
        return acts

    def take_joint(self) -> bool:
        """Go past what stands between two acts."""
        before = self.at
        self.take_mark(",")
        self.take("and")
        self.take("then")
        return self.at > before

    def act(self) -> Form:
        function = self.action()
        if function is not None:
            self.at += 1
            return call(function)
        if self.word() in ARE and self.word(1) == "now" and self.word(2) == "in":
            self.at += 3
            return call("JOIN", self.group(new=True))
        verb = PLURAL.get(self.word())
        if verb is None:
            if self.token.kind == END:
                self.stuck("wanted what the robots are to do")
            self.stuck(f'"{self.written()}" is nothing that these robots are known to do{self.suggested(VERBS)}')
        self.at += 1
        return self.doing(verb)

    def doing(self, verb: str) -> Form:
        """What stands behind a verb."""
        if verb in WITHOUT_OBJECT:
            return call(WITHOUT_OBJECT[verb])
        if verb in WITH_THEMSELVES:
            if not self.take("themselves"):
                self.take("itself")
            return call(WITH_THEMSELVES[verb])
        if verb in WITH_RULE:
            self.take("rule")
            return call(WITH_RULE[verb], self.open_name("the name of a rule"))
        match verb:
            case "join" | "leave":
                return call(verb.upper(), self.group(new=verb == "join"))
            case "stop":
                return call(self.body("ST"))
            case "go":
                function = self.body("GOTO")
                self.need("to")
                return call(function, *self.point())
            case "drive":
                return self.driving()
            case "set":
                name = self.variable()
                self.need("to")
                return call("SETQ", name, self.value())
            case "report":
                return self.reporting()
            case "say":
                return call(self.body("TK"), self.label())
            case _:
                return self.telling()

    def body(self, name: str) -> str:
        """A function of the robots' bodies, which the verb before this position needs."""
        function = self.lexicon.function(name)
        if function is None:
            verb = self.tokens[self.at - 1]
            self.unclear.append(Unclear(verb.start, verb.end, f"these robots have no function {name}"))
            return name
        return function.name

    def driving(self) -> Form:
        function = self.body("DRIVE")
        self.need("at")
        speed = self.value()
        if self.take("turning"):
            self.need("at")
            return call(function, speed, self.value())
        self.take("straight", "ahead")
        return call(function, speed, Number(0.0, "deg/s", "0deg/s"))

    def reporting(self) -> Form:
        values: list[Form] = [self.label()] if self.token.kind == LABEL else []
        if values and not self.names_value():
            return call("REPORT", *values)
        values.append(self.variable())
        while True:
            before = self.at
            if not (self.take_mark(",") or self.take("and")) or not self.names_value():
                self.at = before
                return call("REPORT", *values)
            values.append(self.variable())

    def names_value(self) -> bool:
        return self.token.kind == WORD and not self.begins_act() and self.lexicon.name(self.token.written) is not None

    def telling(self) -> Form:
        """What robots tell others: an order of its own, up to the end."""
        if self._telling:
            raise Stuck("what robots are told, they do not tell on", self.at - 1)
        self._telling, self._names_sender, self._comparator = True, False, ""
        told = self.order("to")
        self._telling = False
        if told is None:
            return call("TELL")
        return call("TELL", call(QUASIQUOTE, told) if self._names_sender else told)


def _both(subject: object, test: object) -> Form | None:
    """Who is meant, and the conditions, as one test; None for all."""
    if not isinstance(test, Test):
        return subject.form if isinstance(subject, Test) else None
    if not isinstance(subject, Test):
        return test.form
    return call("AND", subject.form, *(test.several or (test.form,)))
