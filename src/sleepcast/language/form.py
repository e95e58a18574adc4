"""Forms: what a text is once it has been read, and how a form or a value prints.

A form is a `Number`, a `Symbol`, a `Text` or a `List` of forms. Each remembers where it stood in the text it was read
from (character offsets), which is what carets under errors need; two forms are equal if they say the same thing,
wherever they stood. `show` prints a form so that reading it again gives an equal form.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

from sleepcast.core.units import UNITS, Dimension

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
    """A literal. value: in SI, finite. unit: its suffix, a key of `UNITS`, "" for a bare number. text: as written."""

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
        found = waiting.pop()
        yield found
        if isinstance(found, List):
            waiting.extend(reversed(found.items))


def height(form: Form) -> int:
    """How many lists stand inside one another in `form`: 0 for a number or a name."""
    deepest, waiting = 0, [(form, 0)]
    while waiting:
        found, around = waiting.pop()
        if isinstance(found, List):
            deepest = max(deepest, around + 1)
            waiting.extend((item, around + 1) for item in found.items)
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
