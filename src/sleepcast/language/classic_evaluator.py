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

With `repairs`, a list always ends on its own parenthesis, and so does a skipped clause (88, 4 and 6).

Recursion is kept on a list of generators instead of Python's stack: each yields the place of an expression
that it needs and is sent its value. So depth and work have bounds of our own, and nothing ends in a
RecursionError.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import Final

from sleepcast.language.classic_tokens import (
    AND,
    CLOSE,
    COND,
    DIVIDE,
    END,
    EXPRESSION,
    EXPRESSION_NAMES,
    FUNCTION,
    MINUS,
    OPEN,
    OR,
    PLUS,
    PRINT,
    SETQ,
    SETQQ,
    TIMES,
    VARIABLE,
    VARIABLE_NAMES,
    ClassicError,
    Memory,
    closing,
    to_short,
    token_name,
)

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

    def __init__(self, memory: Memory, *, repairs: bool, tell: Callable[[str], None]) -> None:
        self._memory = memory
        self._repairs = repairs
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
    """The sort of a token as the original's PRINT calls it."""
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
