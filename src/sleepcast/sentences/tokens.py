"""Cuts a sentence into words, numbers with their units, labels in quotes, commas and parentheses."""

from __future__ import annotations

import re

from sleepcast.core.records import dataclass
from sleepcast.core.units import UNITS
from sleepcast.sentences.lexicon import ARTICLE, UNIT_WORDS

WORD, NUMBER, LABEL, MARK, ODD, END = "word", "number", "label", "mark", "odd", "end"

_TOKEN = re.compile(
    r"""(?P<mark>[(),])
      | "(?P<label>[^"\n]*)"
      | (?P<number>[+-]?(?:\d+(?:\.\d+)?|\.\d+)(?:[eE][+-]?\d+)?)(?P<unit>%|[A-Za-z]+(?:/[A-Za-z]+)?[0-9]?)?
        (?=[\s()"]|,(?!\d)|\Z)
      | (?P<odd>"|[0-9]+(?:,[0-9]+)+[^\s(),"]*)
      | (?P<word>[^\s(),"]+)""",
    re.VERBOSE | re.ASCII,
)


@dataclass(frozen=True, slots=True)
class Token:
    """A piece of a sentence from offset `start` up to, not including, `end`.

    text: of a word, case-folded; of a number, its digits; of a label, what stands in the quotes.
    unit: of a number, a key of `UNITS` or "".
    written: a word as it stands.
    """

    kind: str
    text: str
    start: int
    end: int
    unit: str = ""
    written: str = ""


def cut(text: str) -> list[Token]:
    """The tokens of a sentence, the last one of the kind END. Articles are left out, and a full stop at the end."""
    length = len(text.rstrip().removesuffix("."))
    tokens = [token for match in _TOKEN.finditer(text, 0, length) if (token := _token(match)).text != ARTICLE]
    end = tokens[-1].end if tokens else length
    return _with_units([*tokens, Token(END, "", end, end)])


def _token(match: re.Match[str]) -> Token:
    kind, (start, end) = match.lastgroup, match.span()
    if kind in ("number", "unit"):
        unit = (match["unit"] or "").casefold()
        if unit and unit not in UNITS:
            return Token(ODD, match[0], start, end, written=match[0])
        return Token(NUMBER, match["number"], start, end, unit)
    if kind == "label":
        return Token(LABEL, match["label"], start, end)
    if kind == "mark":
        return Token(MARK, match[0], start, end)
    if kind == "odd" or match[0][0].isdigit():
        return Token(ODD, match[0], start, end, written=match[0])
    return Token(WORD, match[0].casefold(), start, end, written=match[0])


def _with_units(tokens: list[Token]) -> list[Token]:
    """The tokens with the units that stand as words behind their numbers drawn into these."""
    joined: list[Token] = []
    at = 0
    while at < len(tokens):
        token = tokens[at]
        at += 1
        if token.kind == NUMBER and not token.unit:
            unit, used = _unit([each.text if each.kind == WORD else "" for each in tokens[at : at + 3]])
            if used:
                token = Token(NUMBER, token.text, token.start, tokens[at + used - 1].end, unit)
                at += used
        joined.append(token)
    return joined


def _unit(words: list[str]) -> tuple[str, int]:
    """The unit with which a list of words begins, and how many of them it takes; 0 for none."""
    first, second, third = (*words, "", "", "")[:3]
    if first == "nautical" and second in ("mile", "miles"):
        return "nmi", 2
    if first == "per" and second == "cent":
        return "%", 2
    unit = UNIT_WORDS.get(first, "")
    if second == "per" and f"{unit}/{UNIT_WORDS.get(third, '')}" in UNITS:
        return f"{unit}/{UNIT_WORDS[third]}", 3
    return unit, 1 if unit else 0
