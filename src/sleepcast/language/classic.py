"""The classic dialect: SLEEP as the program of the thesis's appendix F reads, stores and evaluates it.

`ClassicMachine` is one robot of that program; `run_transcript` is its interactive form. Text becomes shorts
in buffer E0 (`classic_evaluator.tokenise`), and `classic_evaluator` walks them. There are three modes:

- `faithful` gives what the original gave wherever it had a defined behaviour, the bugs of its token pointer
  included: `(COND ((AND 1 0) 99) ((AND 1 1) 88))` is 0, and after a failed form its caller reads on inside it.
- `classic`, the default, fixes these, and reports an empty buffer and a missing argument, which were 0.
- `appendix-a` is `faithful` with what is known of the listing in appendix A: SETQ does not set.

What made the original crash, hang or write outside its tables is a `ClassicError` in all modes. What was
assigned before it stands, and the machine can be used on.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Final, Literal, get_args

from sleepcast.core.errors import MisuseError
from sleepcast.core.records import dataclass
from sleepcast.language.classic_evaluator import (
    CLOSE,
    EXPRESSION,
    EXPRESSION_NAMES,
    OPEN,
    VARIABLE,
    VARIABLE_NAMES,
    ClassicError,
    ClassicReadError,
    ClassicRegisters,
    Evaluator,
    closing,
    display,
    lookup,
    to_short,
    tokenise,
)

__all__ = [
    "ClassicError",
    "ClassicMachine",
    "ClassicReadError",
    "Mode",
    "TranscriptEntry",
    "run_transcript",
]

MESSAGES: Final = 1_000
"""Lines that one evaluation may say: far more than anybody reads."""

Mode = Literal["classic", "faithful", "appendix-a"]
MODES: Final = get_args(Mode)


class ClassicMachine:
    """One robot of the original program: variables V0 to V5, buffers E0 to E5, and an evaluator.

    `mode` is "classic" (the bugs of the original fixed), "faithful" (as it was) or "appendix-a" (as it was,
    and SETQ does not set). `say` receives each line that the original would print while evaluating: its messages
    and what PRINT shows.
    Raises MisuseError for another mode.
    """

    def __init__(self, mode: Mode = "classic", *, say: Callable[[str], None] | None = None) -> None:
        if mode not in MODES:
            raise MisuseError(f"the classic dialect has no mode {mode!r}: use {', '.join(map(repr, MODES))}")
        self.messages: list[str] = []
        """What the last `evaluate` said, in order: messages of the original and lines of PRINT."""
        self._repairs = mode == "classic"
        self._sets = mode != "appendix-a"
        self._say = say
        self._memory = ClassicRegisters() if self._repairs else ClassicRegisters(unwritten=[0])

    @property
    def variables(self) -> dict[str, int]:
        """The values of V0 to V5 by name, a copy."""
        return dict(zip(VARIABLE_NAMES, self._memory.values, strict=True))

    def set_variable(self, name: str, value: int) -> None:
        """Give one of V0 to V5 a value, cut to 16 bits, also where SETQ does not set. Raises ClassicError."""
        index = lookup(name) - VARIABLE
        if not 0 <= index < len(VARIABLE_NAMES):
            raise ClassicError(f"there is no variable {name!r}: there are {', '.join(VARIABLE_NAMES)}")
        self._memory.values[index] = to_short(value)

    def buffer(self, name: str) -> str:
        """The expression in buffer `name`, as text that reads back ("" for an empty one).

        Raises ClassicError for a name other than E0 to E5.
        """
        index = lookup(name) - EXPRESSION
        if not 0 <= index < len(EXPRESSION_NAMES):
            raise ClassicError(f"there is no buffer {name!r}: there are {', '.join(EXPRESSION_NAMES)}")
        return self._memory.contents(index).lstrip(" ")

    def show(self, text: str) -> str:
        """The stored form of `text` as the original prints it, with one blank before the first token.

        Raises ClassicReadError if the text cannot be stored.
        """
        return display(tokenise(text))

    def evaluate(self, text: str) -> int:
        """Store `text` in E0, evaluate its first expression and return the value, a 16-bit number.

        Anything after the first expression is stored and never looked at, as in the original. Raises
        ClassicReadError if the text cannot be stored, ClassicError for what else crashed the original.
        """
        self.messages = []
        tokens = tokenise(text)
        if not tokens:
            raise ClassicReadError(
                "the message is empty, and the original crashed here: send an expression such as (+ 1 2)"
            )
        if tokens[0] == OPEN and closing(tokens, 0) is None:
            missing = tokens.count(OPEN) - tokens.count(CLOSE)
            raise ClassicReadError(
                f"the message ends inside a list, and the original read on past its buffer: add {missing} ')'"
            )
        self._memory.store(0, tokens)
        return Evaluator(self._memory, repairs=self._repairs, sets=self._sets, tell=self._tell).run(0)

    def _tell(self, line: str) -> None:
        if len(self.messages) >= MESSAGES:
            raise ClassicError(f"the expression says more than {MESSAGES} lines: split the work over several messages")
        self.messages.append(line)
        if self._say is not None:
            self._say(line)


@dataclass(frozen=True)
class TranscriptEntry:
    """One expression of a transcript: what was typed, and what the machine made of it.

    `shown` is the stored form as the original prints it ("" if the text could not be stored), `messages` what
    was said; `value` is None exactly where `error` says why there is none.
    """

    text: str
    shown: str
    messages: tuple[str, ...]
    value: int | None
    error: ClassicError | None


def run_transcript(text: str, machine: ClassicMachine) -> Iterator[TranscriptEntry]:
    """Evaluate input of the original's interactive program: expressions end with `@`, the whole with `$`.

    Entries come as they are evaluated. What follows `$` is not read; the end of `text` stands for a missing
    `$`. An expression without its `@` is not evaluated: its entry has an error.
    """
    *expressions, rest = text.partition("$")[0].split("@")
    for expression in expressions:
        yield _entry(expression.strip(), machine)
    if rest.strip():
        error = ClassicReadError("the last expression is not evaluated: it has no '@' behind it; add one")
        yield TranscriptEntry(rest.strip(), "", (), None, error)


def _entry(text: str, machine: ClassicMachine) -> TranscriptEntry:
    value, error = None, None
    try:
        value = machine.evaluate(text)
    except ClassicError as raised:
        error = raised
    shown = "" if isinstance(error, ClassicReadError) else machine.show(text)
    return TranscriptEntry(text, shown, tuple(machine.messages), value, error)
