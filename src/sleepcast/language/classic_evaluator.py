"""The evaluator of the classic dialect: a token pointer that walks arrays of shorts, as the original's does.

One convention explains everything: **an expression is entered with the pointer on its first token and left
with the pointer on its last**, an atom's own token or a list's closing parenthesis. The original breaks it
in five places:

- A false COND clause is skipped from the test's last token on. If the test is a list, that token is a closing
  parenthesis, and is taken for the clause's own: `(COND ((AND 1 0) 99) ((AND 1 1) 88))` gives 0.
- A form that fails with a message returns at once and leaves the pointer inside itself, where its caller
  reads on: `(+ 1 (5) 3)` is 1.
- A list that begins with no function ends at its first closing parenthesis: `(+ 1 (FOO (+ 2 3)) 5)` is 1.
- PRINT ends there too: it tells tokens and evaluates none.
- A SETQ that lacks its last value takes its own closing parenthesis for it and reads on.

With `repairs`, a list always ends on its own parenthesis, and so does a skipped clause (88, 4 and 6). Without `sets`,
SETQ evaluates and gives its values and leaves the variables alone, as in the listing of appendix A.

Recursion is kept on a list of generators instead of Python's stack: each yields the place of an expression
that it needs and is sent its value. So depth and work have bounds of our own, and nothing ends in a
RecursionError.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Generator, Iterable, Sequence
from typing import Final

from sleepcast.core.errors import SleepcastError

# ---- the stored form: text to 16-bit shorts, and back


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


class ClassicRegisters:
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
    for word in _TOKEN.finditer(text):
        token = _short_of(word.group(), word.start() + 1)
        if token == END:
            break
        if len(shorts) == BUFFER_TOKENS:
            raise ClassicReadError(
                f"the message has more than {BUFFER_TOKENS} tokens (one more stands at character "
                f"{word.start() + 1}); the original wrote past its buffer here: store parts of it with SETQQ"
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


ARGUMENTS: Final = 100
"""Arguments of one function call; the original's array has this many and says so when there are more."""

NESTING: Final = 10_000
"""Expressions under evaluation at once: some megabytes of stack in the original, which ended in a crash."""

STEPS: Final = 100_000
"""Expressions evaluated for one message, a fraction of a second here. Six buffers that name each other a
hundred times each would have kept the original busy for minutes."""

_EVERYTHING: Final = (
    *range(VARIABLE, VARIABLE + len(VARIABLE_NAMES)),
    *range(EXPRESSION, EXPRESSION + len(EXPRESSION_NAMES)),
)


class _Pointer:
    """A place in a buffer, the original's `short **t`; `tokens` is the buffer itself, not a copy."""

    __slots__ = ("index", "name", "tokens")

    def __init__(self, name: str, tokens: list[int]) -> None:
        self.name = name
        self.tokens = tokens
        self.index = 0

    @property
    def token(self) -> int:
        return self.tokens[self.index]

    @property
    def where(self) -> str:
        return f"in {self.name} at token {self.index + 1}"

    def step(self) -> int:
        """Go to the next token and return it; the last place of a buffer always holds an end mark."""
        if self.token == END:
            raise self.ran_out()
        self.index += 1
        return self.token

    def leave_list(self) -> None:
        """Go to the first closing parenthesis that is one too many, counting from this very token on."""
        depth = 1
        while True:
            if self.token == OPEN:
                depth += 1
            elif self.token == CLOSE:
                depth -= 1
            if depth == 0:
                return
            self.step()

    def ran_out(self) -> ClassicError:
        if self.index == 0:
            return ClassicError(f"{self.name} is empty: store an expression in it with SETQQ")
        return ClassicError(
            f"the evaluation ran past the end of {self.name} (after {self.index} tokens), as the original "
            "ran out of its buffer: look for a form that failed or lacks an argument"
        )


Evaluation = Generator[_Pointer, int, int]


class Evaluator:
    """One evaluation in `memory`; `tell` receives each line that the original would print."""

    def __init__(self, memory: ClassicRegisters, *, repairs: bool, sets: bool, tell: Callable[[str], None]) -> None:
        self._memory = memory
        self._repairs = repairs
        self._sets = sets
        self._tell = tell
        self._steps = 0

    def run(self, buffer: int) -> int:
        """The value of the first expression in a buffer. Raises ClassicError."""
        running = [self._expression(self._at(buffer))]
        value: int | None = None
        while True:
            try:
                needed = next(running[-1]) if value is None else running[-1].send(value)
            except StopIteration as finished:
                result: int = finished.value
                running.pop()
                if not running:
                    return result
                value = result
            else:
                self._count(needed, len(running))
                running.append(self._expression(needed))
                value = None

    def _at(self, buffer: int) -> _Pointer:
        return _Pointer(EXPRESSION_NAMES[buffer], self._memory.buffers[buffer])

    def _count(self, t: _Pointer, nesting: int) -> None:
        self._steps += 1
        if nesting >= NESTING:
            raise ClassicError(
                f"more than {NESTING} expressions inside each other ({t.where}): a buffer that names itself "
                "never ends, and the original's stack overflowed; store another expression in it with SETQQ"
            )
        if self._steps >= STEPS:
            raise ClassicError(
                f"more than {STEPS} expressions evaluated for one message ({t.where}): "
                "buffers that name each other many times multiply; split the work over several messages"
            )

    def _fail(self, message: str) -> int:
        self._tell(message)
        return 0

    def _expression(self, t: _Pointer) -> Evaluation:
        token = t.token
        if token < VARIABLE:
            return token
        if token < EXPRESSION:
            return self._memory.values[token - VARIABLE]
        if token < FUNCTION:
            return (yield self._at(token - EXPRESSION))
        if token == END:
            raise t.ran_out()
        if token != OPEN:
            return self._fail(f"eval() found {token_name(token)} without '('")
        end = closing(t.tokens, t.index)
        value = yield from self._list(t)
        if self._repairs and end is not None:
            t.index = end
        return value

    def _list(self, t: _Pointer) -> Evaluation:
        function = t.step()
        if function == COND:
            return (yield from self._cond(t))
        if function == SETQ:
            return (yield from self._setq(t))
        if function == SETQQ:
            return self._setqq(t)
        if function == PRINT:
            return (yield from self._print(t))
        if function in (PLUS, MINUS, TIMES, DIVIDE, AND, OR):
            return (yield from self._call(t, function))
        if function < FUNCTION or self._repairs:
            return self._fail(f"eval() found token {function} after '('")
        while t.token != CLOSE:
            t.step()
        return 0

    def _call(self, t: _Pointer, function: int) -> Evaluation:
        """A function of values. AND and OR stop at the first argument that decides, the others need all."""
        where = t.where
        values: list[int] = []
        while t.step() != CLOSE:
            values.append((yield t))
            if len(values) > ARGUMENTS:
                return self._fail(f"eval numArgs > {ARGUMENTS}")
            if function in (AND, OR) and bool(values[-1]) == (function == OR):
                t.step()
                t.leave_list()
                break
        if function in (AND, OR):
            return values[-1] if values else int(function == AND)
        if not values and self._repairs and function in (MINUS, DIVIDE):
            raise ClassicError(f"{token_name(function)} has no argument {where}: give it one")
        return _arithmetic(function, values, where)

    def _cond(self, t: _Pointer) -> Evaluation:
        while t.step() != CLOSE:
            if t.token != OPEN:
                # The original names COND here, whatever the token was.
                return self._fail("eval(COND ) found COND instead of '('")
            clause_end = closing(t.tokens, t.index)
            t.step()
            value = yield t
            if value:
                while t.step() != CLOSE:
                    value = yield t
                t.step()
                t.leave_list()
                return value
            if self._repairs and clause_end is not None:
                t.index = clause_end
            else:
                t.leave_list()
        return 0

    def _setq(self, t: _Pointer) -> Evaluation:
        """Assign each value to the variable before it, and give the last one."""
        target = t.step()
        while VARIABLE <= target < EXPRESSION:
            lacks_value = t.step() == CLOSE
            value = yield t
            if self._sets:
                self._memory.values[target - VARIABLE] = value
            target = t.step()
            if target == CLOSE or (lacks_value and self._repairs):
                return value
        return self._fail(f"eval(SETQ ) found {target} as dest")

    def _setqq(self, t: _Pointer) -> int:
        """Copy the second argument as it stands into the buffer that the first one names."""
        target = t.step()
        if not EXPRESSION <= target < FUNCTION:
            raise ClassicError(
                f"SETQQ found {token_name(target)} {t.where}, and the original wrote outside its tables: "
                f"name one of the buffers {', '.join(EXPRESSION_NAMES)}"
            )
        if t.step() in (CLOSE, END):
            raise ClassicError(f"SETQQ has nothing to store {t.where}: write (SETQQ E2 expression)")
        start = t.index
        if t.token == OPEN:
            end = closing(t.tokens, start)
            if end is None:
                raise ClassicError(f"SETQQ found a list {t.where} that does not end: close it with ')'")
            t.index = end
        self._memory.store(target - EXPRESSION, t.tokens[start : t.index + 1])
        t.step()
        return 0

    def _print(self, t: _Pointer) -> Evaluation:
        """Tell variables and buffers among the arguments by name, others by value; everything if none.

        The original tells every token up to the first closing parenthesis, and evaluates none.
        """
        if t.step() == CLOSE:
            for token in _EVERYTHING:
                self._tell(self._line(token))
        while t.token != CLOSE:
            if VARIABLE <= t.token < FUNCTION or not self._repairs:
                self._tell(self._line(t.token))
            else:
                value = yield t
                self._tell(str(value))
            t.step()
        return 0

    def _line(self, token: int) -> str:
        """A token as PRINT tells it; the original says its kind first, and a blank more before an expression."""
        kind, blank = ("", "") if self._repairs else (f"{_kind(token)} ", " ")
        name = kind + token_name(token)
        if token < VARIABLE or token >= FUNCTION:
            return name
        if token < EXPRESSION:
            return f"{name} = {self._memory.values[token - VARIABLE]}"
        return f"{name} ={blank}{self._memory.contents(token - EXPRESSION)}"


def _kind(token: int) -> str:
    """The kind of a token as the original's PRINT calls it."""
    return "NUM" if token < VARIABLE else "VAR" if token < EXPRESSION else "EXP" if token < FUNCTION else "FUN"


def _arithmetic(function: int, values: list[int], where: str) -> int:
    """`+ - * /` over shorts from left to right; every intermediate result is a short, division truncates."""
    if function == PLUS:
        return to_short(sum(values))
    if len(values) < 2:
        values = [0 if function == MINUS else 1, *values]
    result = values[0]
    for value in values[1:]:
        if function == MINUS:
            result -= value
        elif function == TIMES:
            result *= value
        elif value == 0:
            raise ClassicError(f"{result} divided by 0 {where}, and the original crashed here: test the divisor first")
        else:
            quotient = abs(result) // abs(value)
            result = quotient if (result < 0) == (value < 0) else -quotient
        result = to_short(result)
    return result
