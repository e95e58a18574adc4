"""The reader: text in, forms with exact positions out, or one error with a caret.

One regular expression cuts the text into tokens; a stack builds the lists. Nothing is evaluated and no name is looked
up here. Texts come over the air, so the length, the nesting and the length of a name are bounded.
"""

from __future__ import annotations

import math
import re

from sleepcast.core.errors import MisuseError, did_you_mean, placed, printable, with_caret
from sleepcast.core.units import UNITS, to_si
from sleepcast.language.form import PREFIXES, Form, List, Number, Symbol, Text
from sleepcast.language.infix import brief

MAX_TEXT = 16_384
"""Characters in one text: the largest expression that the channel carries."""
MAX_NESTING = 32
"""Parentheses inside parentheses: deeper than any person writes, shallow enough for every machine's own stack."""
MAX_NAME = 64
"""Characters in a name or a label."""

_TOKEN = re.compile(
    r"""(?P<comment>;[^\n]*)
      | (?P<mark>[()'`,])
      | "(?P<label>[^"\n]*)"
      | (?P<number>[+-]?(?:\d++(?:\.\d*+)?+|\.\d++)(?:[eE][+-]?\d++)?)(?P<unit>%|[A-Za-z]+(?:/[A-Za-z]+)?[0-9]?)?
        (?=[\s()'`,;"]|$)
      | (?P<name>[A-Za-z_*/<>=^%!?$&:][\w+*/<>=^%!?$&.#:-]{0,63}(?=[\s()'`,;"]|$))
      | (?P<odd>[^\s()'`,;"]+)
      | (?P<bad>")""",
    re.VERBOSE | re.ASCII,
)
_NAME = re.compile(r"[A-Za-z_+*/<>=^%!?$&.:-][\w+*/<>=^%!?$&.#:-]*\Z", re.ASCII)
_PREFIX_NAMES = {mark: name for name, mark in PREFIXES.items()}


class ReadError(MisuseError):
    """Text that is no expression. start, end: the offending characters of `text`."""

    def __init__(self, reason: str, text: str, start: int, end: int) -> None:
        self.reason = printable(placed(reason, text, start))
        super().__init__(with_caret(self.reason, text, start, end))
        self.text, self.start, self.end = text, start, end


def read(text: str) -> Form:
    """The one expression in `text`. Raises ReadError if there is none, more than one, or it is not well formed."""
    forms = read_all(text)
    if not forms:
        raise ReadError("no expression @@: wanted a number, a name or (function argument ...)", text, 0, 1)
    if len(forms) > 1:
        second = forms[1]
        raise ReadError(
            "one more expression @@: a message is one expression; put several into (PROGN ...)",
            text,
            second.start,
            second.end,
        )
    return forms[0]


def read_all(text: str) -> list[Form]:
    """Every expression in `text`, in order. Raises ReadError."""
    if len(text) > MAX_TEXT:
        raise ReadError(f"text of {len(text)} characters @@: at most {MAX_TEXT} fit", text[:40], 0, len(text[:40]))
    done: list[Form] = []
    items = done
    # One entry for each open parenthesis or prefix mark: the list around it, the mark and where it stands.
    open_marks: list[tuple[list[Form], str, int]] = []
    depth = 0
    for match in _TOKEN.finditer(text):
        kind = match.lastgroup
        if kind == "comment":
            continue
        start, end = match.span()
        form: Form
        if kind == "mark":
            mark = match.group("mark")
            if mark != ")":
                depth += 1
                if depth > MAX_NESTING:
                    raise ReadError(f"nested too deeply @@: at most {MAX_NESTING} levels", text, start, end)
                open_marks.append((items, mark, start))
                items = []
                continue
            if not open_marks or open_marks[-1][1] != "(":
                raise _unexpected_close(text, start, open_marks)
            around, _, opened = open_marks.pop()
            depth -= 1
            form = List(tuple(items), opened, end)
            items = around
        elif kind == "name":
            form = Symbol(match.group("name"), start, end)
        elif kind == "odd":
            form = _symbol(match.group("odd"), text, start, end, items)
        elif kind == "number" or kind == "unit":
            form = _number(match.group("number"), match.group("unit"), text, start, end)
        elif kind == "label":
            form = _label(match.group("label"), text, start, end)
        else:
            raise ReadError('a " without its closing " @@', text, start, end)
        while open_marks and open_marks[-1][1] != "(":
            around, mark, opened = open_marks.pop()
            depth -= 1
            form = List((Symbol(_PREFIX_NAMES[mark], opened, opened + 1), form), opened, form.end)
            items = around
        items.append(form)
    if open_marks:
        _, mark, opened = open_marks[-1]
        missing = sum(1 for _, m, _ in open_marks if m == "(")
        if mark == "(":
            raise ReadError(f"( @@ is never closed: {missing} ) missing at the end", text, opened, opened + 1)
        raise ReadError(f"{mark} @@ has nothing after it", text, opened, opened + 1)
    return done


def is_name(text: str) -> bool:
    """Whether `text` is written as a name: at most `MAX_NAME` characters, not beginning with a digit."""
    return len(text) <= MAX_NAME and _NAME.match(text) is not None and not _looks_numeric(text)


def _looks_numeric(text: str) -> bool:
    return re.match(r"[+-]?\.?[0-9]", text) is not None


def _symbol(name: str, text: str, start: int, end: int, before: list[Form]) -> Symbol:
    """The symbol of a name that the token pattern was not sure of, after other forms of its list. Raises ReadError."""
    if is_name(name):
        return Symbol(name, start, end)
    if len(name) > MAX_NAME:
        raise ReadError(f"name of {len(name)} characters @@: at most {MAX_NAME}", text, start, end)
    if _looks_numeric(name):
        raise ReadError(f'"{name}" @@ is neither a number nor a name', text, start, end)
    if name == "||":
        left = brief(before[-1], text) if before else "test"
        raise ReadError(f'"||" @@ is no name here: write (OR {left} ...)', text, start, end)
    raise ReadError(
        f'"{name}" @@ has a character that no name has: wanted letters, digits and _ - + * / < > = . ? !',
        text,
        start,
        end,
    )


def _number(digits: str, suffix: str | None, text: str, start: int, end: int) -> Number:
    value = float(digits)
    written = text[start:end]
    unit = suffix.casefold() if suffix else ""
    if unit in UNITS:
        value = to_si(value, unit)
    elif suffix:
        raise ReadError(
            f'unknown unit "{suffix}" @@{did_you_mean(suffix, UNITS)}; units are {" ".join(UNITS)}',
            text,
            start + len(digits),
            end,
        )
    if not math.isfinite(value):
        raise ReadError(f"{written} @@ is too large for a number", text, start, end)
    return Number(value, unit, written, start, end)


def _label(value: str, text: str, start: int, end: int) -> Text:
    if len(value) > MAX_NAME:
        raise ReadError(f"label of {len(value)} characters @@: at most {MAX_NAME}", text, start, end)
    if not value.isprintable():  # it will be shown on other people's terminals
        raise ReadError("a label with a control character @@", text, start, end)
    return Text(value, start, end)


def _unexpected_close(text: str, start: int, open_marks: list[tuple[list[Form], str, int]]) -> ReadError:
    if open_marks:
        mark, opened = open_marks[-1][1], open_marks[-1][2]
        return ReadError(f"{mark} @@ has nothing after it", text, opened, opened + 1)
    return ReadError(") @@ closes nothing: there is one ) too many", text, start, start + 1)
