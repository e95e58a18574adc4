"""The stored form of the classic dialect: text to 16-bit shorts, and shorts back to text.

The original keeps every expression as an array of C shorts and lets a short's range say what it is. Reading
(`tokenise`), printing (`display`) and the memory of one robot (`Memory`) are here; `classic_evaluator` walks
the arrays and `classic` puts both together.

Two things follow from the representation and are meant: a literal 30001 *is* the variable V1, 31002 the
buffer E2 and 32010 the function BAD; and a literal 32100 ends its expression. A short in a named range that
has no name (30500 would be variable 500) made the original read past its tables, so the reader refuses it.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from typing import Final

from sleepcast.core.errors import SleepcastError

VARIABLE: Final = 30_000
EXPRESSION: Final = 31_000
FUNCTION: Final = 32_000
END: Final = 32_100

VARIABLE_NAMES: Final = tuple(f"V{i}" for i in range(6))
EXPRESSION_NAMES: Final = tuple(f"E{i}" for i in range(6))
FUNCTION_NAMES: Final = ("(", ")", "SETQ", "COND", "+", "-", "*", "/", "AND", "OR", "BAD", "SETQQ", "PRINT")
OPEN, CLOSE, SETQ, COND, PLUS, MINUS, TIMES, DIVIDE, AND, OR, BAD, SETQQ, PRINT = range(
    FUNCTION, FUNCTION + len(FUNCTION_NAMES)
)

BUFFER_TOKENS: Final = 225
"""Tokens that a buffer holds, its end mark not counted; the original wrote past its array after these."""

TOKEN_CHARACTERS: Final = 24
"""Characters of one token; the original copied longer ones past its scratch array."""

TEXT_CHARACTERS: Final = 16_384
"""Characters of one message: 225 tokens of 24 characters need 5,624; the rest is room for generous blanks."""

_SPACES: Final = (
    (FUNCTION, "function", FUNCTION_NAMES),
    (EXPRESSION, "buffer", EXPRESSION_NAMES),
    (VARIABLE, "variable", VARIABLE_NAMES),
)
_NAMES: Final = {name: base + i for base, _, names in _SPACES for i, name in enumerate(names)}
_TOKEN_NAMES: Final = {token: name for name, token in _NAMES.items()}

_LONG_MIN, _LONG_MAX = -(2**63), 2**63 - 1
_TOKEN = re.compile(r"[()]|[^ \t\r\n\f\v()]+")
_NUMBER = re.compile(r"[0-9]|-.", re.DOTALL)
_ATOI = re.compile(r"-?[0-9]+")
_UPPER = str.maketrans("abcdefghijklmnopqrstuvwxyz", "ABCDEFGHIJKLMNOPQRSTUVWXYZ")


class ClassicError(SleepcastError):
    """What made the original crash, hang or overwrite its memory; the machine can be used on."""


class ClassicReadError(ClassicError):
    """Text that cannot become a stored expression; nothing was evaluated."""

    exit_status = 2


class Memory:
    """The variables and expression buffers of one robot, as the original starts with them.

    `unwritten` is what a buffer holds that nothing was stored in: nothing, or the 0 of the original.
    """

    def __init__(self, unwritten: Sequence[int] = ()) -> None:
        self.values = [30, 31, 32, 33, 34, 35]
        self.buffers = [[END] * (BUFFER_TOKENS + 1) for _ in EXPRESSION_NAMES]
        for index in range(len(EXPRESSION_NAMES)):
            self.store(index, unwritten)
        self.store(1, [125])

    def store(self, index: int, tokens: Sequence[int]) -> None:
        """Write `tokens` into the buffer's own array: what stood behind the new end mark stays there."""
        self.buffers[index][: len(tokens) + 1] = [*tokens, END]

    def contents(self, index: int) -> str:
        """The expression in a buffer as the original prints it."""
        tokens = self.buffers[index]
        return display(tokens[: tokens.index(END)])


def to_short(value: int) -> int:
    """`value` cut to 16 bits, as assigning it to a C short does."""
    return (value + 0x8000 & 0xFFFF) - 0x8000


def tokenise(text: str) -> list[int]:
    """The shorts of `text`, up to the first end mark, which is not among them.

    Raises ClassicReadError for too much text, too many tokens, too long a token, or a number without a name.
    """
    if len(text) > TEXT_CHARACTERS:
        raise ClassicReadError(
            f"the message has {len(text)} characters, and at most {TEXT_CHARACTERS} are read: send less"
        )
    shorts: list[int] = []
    for found in _TOKEN.finditer(text):
        token = _short_of(found.group(), found.start() + 1)
        if token == END:
            break
        if len(shorts) == BUFFER_TOKENS:
            raise ClassicReadError(
                f"the message has more than {BUFFER_TOKENS} tokens (one more stands at character "
                f"{found.start() + 1}); the original wrote past its buffer here: store parts of it with SETQQ"
            )
        shorts.append(token)
    return shorts


def lookup(name: str) -> int:
    """The short that `name` stands for, case ignored as in the original; BAD for an unknown name."""
    return _NAMES.get(name.translate(_UPPER), BAD)


def token_name(token: int) -> str:
    """`token` as the original prints it: a name, or the number in decimal."""
    return _TOKEN_NAMES.get(token) or str(token)


def display(tokens: Iterable[int]) -> str:
    """The expression as the original prints it: a blank before each token, none after `(` and before `)`."""
    parts: list[str] = []
    previous = END
    for token in tokens:
        if previous != OPEN and token != CLOSE:
            parts.append(" ")
        parts.append(token_name(token))
        previous = token
    return "".join(parts)


def closing(tokens: Sequence[int], start: int) -> int | None:
    """Index of the parenthesis that closes the one at `start`, or None if the expression ends before it."""
    depth = 0
    for index in range(start, len(tokens)):
        token = tokens[index]
        if token == OPEN:
            depth += 1
        elif token == CLOSE:
            depth -= 1
            if depth == 0:
                return index
        elif token == END:
            break
    return None


def _short_of(word: str, column: int) -> int:
    """The short of one token of the text; `column` (from 1) is for the error."""
    if len(word) > TOKEN_CHARACTERS:
        raise ClassicReadError(
            f"{word[:TOKEN_CHARACTERS]}... at character {column} has {len(word)} characters, and a token has "
            f"at most {TOKEN_CHARACTERS} (the original wrote past its array here): use a shorter one"
        )
    if not _NUMBER.match(word):
        return lookup(word)
    digits = _ATOI.match(word)
    number = to_short(max(_LONG_MIN, min(_LONG_MAX, int(digits.group())))) if digits else 0
    if number >= VARIABLE and number not in _TOKEN_NAMES and number != END:
        base, kind, names = next(space for space in _SPACES if number >= space[0])
        raise ClassicReadError(
            f"{word} at character {column} reads as {kind} {number - base}, and there are only {len(names)}; "
            f"the original crashed here: write numbers from -32768 to {VARIABLE - 1}"
        )
    return number
