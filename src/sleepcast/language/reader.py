"""The reader: text in, forms with exact positions out, or one error with a caret; and how a form or a value prints.

A form is a `Number`, a `Symbol`, a `Text` or a `List` of forms. Each remembers where it stood in the text it was read
from (character offsets), which is what carets under errors need; two forms are equal if they say the same thing,
wherever they stood. `show` prints a form so that reading it again gives an equal form.

One regular expression cuts the text into tokens; a stack builds the lists. Nothing is evaluated and no name is looked
up here. Texts come over the air, so the length, the nesting and the length of a name are bounded. Operators in the
middle, as in `(fuel > 50% && ordnance > 70%)`, are only found, for the error that shows how the same is written here.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Sequence

from sleepcast.core.errors import MisuseError, did_you_mean, placed, printable, with_caret
from sleepcast.core.records import NamedTuple
from sleepcast.core.units import UNITS, Dimension, to_si

# ---- forms


QUOTE, QUASIQUOTE, UNQUOTE = "quote", "quasiquote", "unquote"
PREFIXES = {QUOTE: "'", QUASIQUOTE: "`", UNQUOTE: ","}


class Form:
    """A piece of read text from offset `start` up to, not including, `end`."""

    __slots__ = ("end", "start")
    start: int
    end: int

    def _same(self) -> object:
        raise TypeError("a Form is one of Number, Symbol, Text and List")

    def __eq__(self, other: object) -> bool:
        return type(self) is type(other) and self._same() == other._same()

    def __hash__(self) -> int:
        return hash(self._same())

    def __repr__(self) -> str:
        return f"<{show(self)}>"


class Number(Form):
    """A literal.

    value: in SI, finite.
    unit: its suffix, a key of `UNITS`, "" for a bare number.
    text: as written.
    """

    __slots__ = ("text", "unit", "value")

    def __init__(self, value: float, unit: str = "", text: str = "", start: int = 0, end: int = 0) -> None:
        self.value, self.unit, self.text = value, unit, text or format_literal(value)
        self.start, self.end = start, end

    @property
    def dimension(self) -> Dimension | None:
        """Of its unit; None for a bare number, which takes the unit of what it meets."""
        return UNITS[self.unit].dimension if self.unit else None

    def _same(self) -> object:
        return self.value, math.copysign(1.0, self.value), self.dimension


class Symbol(Form):
    """A name. text: as written. key: case-folded, what names are compared by."""

    __slots__ = ("key", "text")

    def __init__(self, text: str, start: int = 0, end: int = 0) -> None:
        self.text, self.key, self.start, self.end = text, text.casefold(), start, end

    def _same(self) -> object:
        return self.key


class Text(Form):
    """A label in double quotes. value: without the quotes."""

    __slots__ = ("value",)

    def __init__(self, value: str, start: int = 0, end: int = 0) -> None:
        self.value, self.start, self.end = value, start, end

    def _same(self) -> object:
        return (self.value,)


class List(Form):
    """`(item ...)`. items: a tuple of forms, possibly empty."""

    __slots__ = ("items",)

    def __init__(self, items: tuple[Form, ...], start: int = 0, end: int = 0) -> None:
        self.items, self.start, self.end = items, start, end

    def _same(self) -> object:
        return self.items

    @property
    def head(self) -> str | None:
        """The key of the first item if it is a symbol, else None."""
        return self.items[0].key if self.items and isinstance(self.items[0], Symbol) else None


def walk(form: Form) -> Iterator[Form]:
    """`form` and every form inside it, outside first, left to right."""
    waiting = [form]
    while waiting:
        inner = waiting.pop()
        yield inner
        if isinstance(inner, List):
            waiting.extend(reversed(inner.items))


def height(form: Form) -> int:
    """How many lists stand inside one another in `form`: 0 for a number or a name."""
    deepest, waiting = 0, [(form, 0)]
    while waiting:
        inner, around = waiting.pop()
        if isinstance(inner, List):
            deepest = max(deepest, around + 1)
            waiting.extend((item, around + 1) for item in inner.items)
    return deepest


def show(form: Form) -> str:
    """The text of `form` on one line; reading it gives an equal form."""
    if isinstance(form, List):
        head = form.head
        if head in PREFIXES and len(form.items) == 2:
            return PREFIXES[head] + show(form.items[1])
        return f"({' '.join(map(show, form.items))})"
    if isinstance(form, Text):
        return f'"{form.value}"'
    return form.text  # type: ignore[attr-defined,no-any-return]


def replaced(form: Form, what: Callable[[], Form]) -> Form:
    """A template with something else in its unquoted places, in their order."""
    if not isinstance(form, List):
        return form
    if form.head == UNQUOTE and len(form.items) == 2:
        return what()
    return List(tuple(replaced(item, what) for item in form.items), form.start, form.end)


def format_literal(value: float) -> str:
    """The shortest text that reads back to the very same finite number (the sign of a zero included)."""
    value = float(value)
    if value.is_integer() and abs(value) < 1e16 and (value or math.copysign(1.0, value) > 0):
        return str(int(value))
    return repr(value)


def format_value(value: float) -> str:
    """A value as people see it: an integer where it is one, else the shortest form that reads back, or UNKNOWN."""
    if math.isnan(value):
        return "UNKNOWN"
    return "0" if value == 0 else format_literal(value)


# ---- operators in the middle


OPERATORS: dict[str, tuple[int, str]] = {
    "||": (1, "OR"),
    "or": (1, "OR"),
    "&&": (2, "AND"),
    "and": (2, "AND"),
    **dict.fromkeys(("=", "=="), (3, "=")),
    **dict.fromkeys(("/=", "!=", "<>"), (3, "/=")),
    **{name: (3, name) for name in ("<", "<=", ">", ">=")},
    **{name: (4, name) for name in ("+", "-")},
    **{name: (5, name) for name in ("*", "/")},
}
"""How closely each operator binds, and its name here."""

ALIASES = {
    "t": "TRUE",
    "else": "TRUE",
    "otherwise": "TRUE",
    "==": "=",
    "!=": "/=",
    "<>": "/=",
    "!": "NOT",
    "&&": "AND",
    "unless": "(WHEN (NOT test) expr ...)",
    "case": "(COND ((= x value) expr ...) ...)",
    "switch": "(COND ((= x value) expr ...) ...)",
    "while": "(RULE name (WHEN test expr ...)), which runs in every tick",
}
"""Names of other languages that nobody declared, and what stands for them here."""

MAX_OPERANDS = 8
"""Of a row that is written anew: a longer one need not be shown whole."""
MAX_BRIEF = 60
"""Characters of one operand in it."""


class Row(NamedTuple):
    """Operands and operators in turn: items first..last of a list."""

    first: int
    last: int


def is_operator(form: Form) -> bool:
    """Whether a form is an operator that could stand in the middle."""
    return isinstance(form, Symbol) and form.key in OPERATORS


def rows(form: List, begin: int) -> Iterator[Row]:
    """Every row of operands with operators between them, among the items of `form` from `begin` on."""
    items, at = form.items, begin + 1
    while at + 1 < len(items):
        if is_operator(items[at]) and not is_operator(items[at - 1]) and not is_operator(items[at + 1]):
            last = at + 1
            while last + 2 < len(items) and is_operator(items[last + 1]) and not is_operator(items[last + 2]):
                last += 2
            yield Row(at - 1, last)
            at = last + 2
        else:
            at += 1


def is_row(forms: Sequence[Form]) -> bool:
    """Whether these are operands with operators between them, and nothing else."""
    return len(forms) >= 3 and len(forms) % 2 == 1 and all(is_operator(f) == bool(at % 2) for at, f in enumerate(forms))


def written(row: Sequence[Form], text: str) -> str:
    """A row of `text` as it is written here, "" for one that is too long."""
    if len(row) >= 2 * MAX_OPERANDS:
        return ""
    values: list[str] = [brief(row[0], text)]
    waiting: list[tuple[int, str]] = []

    def join() -> None:
        name, right, left = waiting.pop()[1], values.pop(), values.pop()
        more = name in ("AND", "OR") and left.startswith(f"({name} ")
        values.append(f"{left[:-1]} {right})" if more else f"({name} {left} {right})")

    for operator, operand in zip(row[1::2], row[2::2], strict=True):
        binding = OPERATORS[operator.key]  # type: ignore[attr-defined]
        while waiting and waiting[-1][0] >= binding[0]:
            join()
        waiting.append(binding)
        values.append(brief(operand, text))
    while waiting:
        join()
    return values[0]


def brief(form: Form, text: str) -> str:
    """What stands in `text` for `form`, on one line, its end left out where it is long."""
    shortened = " ".join(text[form.start : min(form.end, form.start + MAX_BRIEF + 1)].split())
    return shortened if form.end - form.start <= MAX_BRIEF else f"{shortened[:MAX_BRIEF]}..."


# ---- what was probably meant by several forms in a row: `fuel > 50%` without parentheses, `IN bravo`, `5 m`. It only
# words what an error proposes; nothing is obeyed of it.


MAX_MEANT = 16
"""Of a text for which something is proposed: more are prose."""
CONDITIONS = ("if", "when", "where")
_ALONE = re.compile(rf"(\d)\s+({'|'.join(map(re.escape, UNITS))})(?=[\s()]|$)")


def meant(forms: Sequence[Form], text: str) -> str:
    """The expression that the forms of `text` probably stand for; "" where that cannot be guessed."""
    joined = _ALONE.sub(r"\1\2", text)
    forms = forms if joined == text else read_all(joined)
    return "" if len(forms) > MAX_MEANT else _meant(forms, joined)


def _meant(forms: Sequence[Form], text: str) -> str:
    if len(forms) == 1:
        return brief(forms[0], text)
    if is_row(forms):
        return written(forms, text)
    words = [form.key if isinstance(form, Symbol) else "" for form in forms]
    conditional = ""
    if words[0] in CONDITIONS and "then" in words:  # if TEST then ACTION
        at = words.index("then")
        conditional = _when(forms[1:at], forms[at + 1 :], text)
    elif at := next((at for at, word in enumerate(words) if at and word in CONDITIONS), 0):  # ACTION if TEST
        conditional = _when(forms[at + 1 :], forms[:at], text)
    return conditional or _call(forms, text)


def _when(test: Sequence[Form], action: Sequence[Form], text: str) -> str:
    if not (test and action):
        return ""
    condition, does = (_meant(each, text) for each in (test, action))
    if not (condition and does):
        return ""
    return f"(WHEN {condition} {does if does.startswith('(') else f'({does})'})"


def _call(forms: Sequence[Form], text: str) -> str:
    """A function before what it is given, or an action before the test for it."""
    first, rest = forms[0], forms[1:]
    if not isinstance(first, Symbol) or first.key in CONDITIONS or (is_operator(first) and len(rest) < 2):
        return ""
    from sleepcast.language.functions import BUILT_IN  # only needed when something is wrong already

    known = BUILT_IN.get(first.key)
    if is_row(rest) and (known is None or known.most == 0):
        return _when(rest, forms[:1], text)
    if known is None and not first.text.isupper():
        return ""  # any word
    given = [written(rest, text)] if is_row(rest) else [brief(each, text) for each in rest]
    return f"({first.text} {' '.join(given)})"


# ---- reading


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
        first, second = forms[:2]
        if proposed := meant(forms, text):
            raise ReadError(f"this is no expression @@: write {proposed}", text, first.start, forms[-1].end)
        if isinstance(first, Symbol):
            wanted = 'an expression starts with "(", as in (WHEN (> fuel 50%) (ST))'
            raise ReadError(f"this is no expression @@: {wanted}", text, first.start, first.end)
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
            closing = 'a ")"' if missing == 1 else f'{missing} ")"'
            raise ReadError(f'the "(" @@ is not closed: add {closing} at the end', text, opened, opened + 1)
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
