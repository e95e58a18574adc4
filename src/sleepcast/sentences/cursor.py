"""What every part of the grammar needs: the tokens from one to the next, names and values, and notes of what is not
understood.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NoReturn

from sleepcast.core.errors import decimal_comma, did_you_mean, slip_of
from sleepcast.core.records import dataclass
from sleepcast.language import Form, List, ReadError, Symbol, read
from sleepcast.language.reader import is_name
from sleepcast.sentences.lexicon import GROUP_WORDS, OPENERS, PLURAL, RESERVED, ROBOTS, Lexicon
from sleepcast.sentences.tokens import END, LABEL, MARK, NUMBER, ODD, WORD, Token, cut

MAX_UNCLEAR = 8
"""Parts not understood that are told of one sentence."""

JOINTS = frozenset({"and", "but", "then"})
HAVE = frozenset({"have", "has"})
ARE = frozenset({"are", "is"})


@dataclass(frozen=True, slots=True)
class Unclear:
    """A part of a sentence, from offset `start` up to `end`, that is not understood, and why. At the end of the
    sentence, where something is missing, both are the same."""

    start: int
    end: int
    message: str


class Stuck(Exception):
    """A token without a place in the grammar. message: why; at: its index."""

    def __init__(self, message: str, at: int) -> None:
        self.message, self.at = message, at


def call(name: str, *items: Form) -> List:
    """The expression `(name item ...)`."""
    return List((Symbol(name), *items))


class Cursor:
    """A sentence, read up to the token at `at`."""

    def __init__(self, text: str, lexicon: Lexicon) -> None:
        self.text, self.lexicon = text, lexicon
        self.tokens = cut(text)
        self.at = 0
        self.unclear: list[Unclear] = []
        self.doubts: list[Unclear] = []
        """What is understood, and probably a slip."""
        self._nouns = {noun.casefold() for noun in (*ROBOTS, *lexicon.nouns)}
        self._places = lexicon.places()
        self._longest_place = max(map(len, self._places), default=0)
        self._depth = 0
        self._comparator = ""
        """Of the amount just read, which "and 70 % ordnance" repeats; "" where there is none."""
        self._comparing = False
        """Whether "and ordnance over 70 %" may follow what was just read."""
        self._telling = False
        self._names_sender = False

    # ---- tokens

    @property
    def token(self) -> Token:
        return self.tokens[self.at]

    def word(self, ahead: int = 0) -> str:
        """The word at this position, case-folded; "" if there is something else."""
        token = self.tokens[min(self.at + ahead, len(self.tokens) - 1)]
        return token.text if token.kind == WORD else ""

    def is_mark(self, mark: str) -> bool:
        return self.token.kind == MARK and self.token.text == mark

    def take(self, *words: str) -> bool:
        """Go past these words if they stand here."""
        if all(self.word(ahead) == word for ahead, word in enumerate(words)):
            self.at += len(words)
            return True
        return False

    def take_mark(self, mark: str) -> bool:
        if self.is_mark(mark):
            self.at += 1
            return True
        return False

    def need(self, word: str) -> None:
        if not self.take(word):
            self.stuck(f'wanted "{word}" here' if self.token.kind != END else f'wanted "{word}"')

    def need_mark(self, mark: str) -> None:
        if not self.take_mark(mark):
            self.stuck(f'wanted "{mark}"')

    def stuck(self, message: str) -> NoReturn:
        raise Stuck(message, self.at)

    def written(self) -> str:
        """What stands here, as it is written."""
        return self.text[self.token.start : self.token.end]

    def note(self, stuck: Stuck) -> None:
        """Note what is not understood, and go on at the next word that can begin something."""
        self.at = stuck.at
        token = self.token
        if token.kind == END:
            self.unclear.append(Unclear(token.start, token.start, f"{stuck.message} at the end"))
            return
        self.at += 1
        while self.token.kind != END and not self.is_seam():
            self.at += 1
        end = self.tokens[self.at - 1].end
        self.unclear.append(Unclear(token.start, end, stuck.message))

    def is_seam(self) -> bool:
        """Whether something of its own can begin here."""
        word = self.word()
        return word in OPENERS or word in JOINTS or word == "or" or self.is_mark(",") or self.begins_act()

    def begins_act(self) -> bool:
        word = self.word()
        return word in PLURAL or (word in ARE and self.word(1) == "now") or self.action() is not None

    def action(self) -> str | None:
        """The body's function that a verb here names."""
        word = self.word()
        function = self.lexicon.action(word) if word and word not in RESERVED else None
        return None if function is None else function.name

    def suggested(self, words: Iterable[str]) -> str:
        """One of these words that is like what stands here, while it is told at all: looking for it takes a while."""
        return did_you_mean(self.written(), words) if len(self.unclear) < MAX_UNCLEAR else ""

    # ---- names and values

    def own(self, name: str) -> Symbol:
        """A variable that the sentence does not name, but needs."""
        declared = self.lexicon.name(name)
        if declared is None:
            raise Stuck(f"these robots have no variable {name}", max(0, self.at - 1))
        return Symbol(declared)

    def variable(self) -> Symbol:
        """The name of a variable or constant."""
        token = self.token
        if token.kind != WORD or token.text in RESERVED:
            self.stuck("wanted the name of a variable" if token.kind == END else "wanted the name of a variable here")
        declared = self.lexicon.name(token.written)
        if declared is None:  # what follows may well be understood
            suggested = self.suggested(self.lexicon.names())
            message = f'"{self.written()}" is no variable that these robots know{suggested}'
            self.unclear.append(Unclear(token.start, token.end, message))
        self.at += 1
        return Symbol(declared or token.written)

    def value(self) -> Form:
        """A number, or the name of a variable or constant."""
        return self.variable() if self.token.kind == WORD else self.number()

    def number(self) -> Form:
        token = self.token
        if token.kind != NUMBER:
            if "," in self.written():
                why = f"numbers have no commas, and a blank follows each comma{decimal_comma(self.written())}"
                self.stuck(f'"{self.written()}" is no number: {why}')
            if token.kind == ODD:
                self.stuck(f'"{self.written()}" is no number with a unit')
            self.stuck("wanted a number")
        try:
            number = read(f"{token.text}{token.unit}")
        except ReadError as error:
            self.stuck(error.reason)
        self.at += 1
        return number

    def open_name(self, what: str) -> Symbol:
        """A name that need not be known: of a group, a rule or an area."""
        token = self.token
        if token.kind != WORD or token.text in RESERVED or not is_name(token.written):
            self.stuck(f"wanted {what}")
        self.at += 1
        return Symbol(token.written)

    def group(self, *, new: bool = False) -> Symbol:
        """The name of a group. new: whether it may well be one of which no robot has heard."""
        for words in GROUP_WORDS:
            if self.take(*words):
                break
        token = self.token
        name = self.open_name("the name of a group")
        meant = None if new or len(self.doubts) >= MAX_UNCLEAR else slip_of(name.text, self.lexicon.groups)
        if meant is not None:
            message = f'unknown group "{name.text}" (did you mean {meant}?)'
            self.doubts.append(Unclear(token.start, token.end, message))
        return name

    def label(self) -> Form:
        token = self.token
        if token.kind != LABEL:
            self.stuck("wanted a text in quotes")
        try:
            label = read(f'"{token.text}"')
        except ReadError as error:
            self.stuck(error.reason)
        self.at += 1
        return label
