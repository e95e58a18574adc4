"""The classic dialect at the command line: the machines of the thesis's listings as a memory to type into."""

from __future__ import annotations

import re
from collections.abc import Iterator

from sleepcast.cli.memories import EVALUATED, REFUSED, UNKNOWN, EvalOutcome
from sleepcast.cli.streams import pieces
from sleepcast.core.errors import MisuseError
from sleepcast.language.classic import ClassicError, ClassicMachine, Mode, run_transcript


class ClassicMemory:
    """Variables V0 to V5 and buffers E0 to E5; `mode` is one of `classic.MODES`."""

    def __init__(self, mode: Mode) -> None:
        self._machine = ClassicMachine(mode)

    def set(self, name: str, value: str) -> None:
        """Give one of V0 to V5 a whole number. Raises MisuseError."""
        if name.upper() not in self._machine.variables:
            raise MisuseError(f"--set {name}={value}: the classic dialect has the variables V0 to V5 only")
        if not re.fullmatch("-?[0-9]{1,5}", value) or not -32768 <= int(value) < 30000:
            raise MisuseError(f"--set {name}={value}: the classic dialect has whole numbers from -32768 to 29999 only")
        self._machine.set_variable(name, int(value))

    def evaluate(self, text: str) -> EvalOutcome:
        """Evaluate one expression."""
        value, error = None, None
        try:
            value = self._machine.evaluate(text)
        except ClassicError as raised:
            error = raised
        return _outcome(text, value, tuple(self._machine.messages), error)

    def run(self, text: str) -> Iterator[EvalOutcome]:
        """Evaluate all of `text`: either expressions that end with `@`, the whole with `$`, or one a line."""
        if "@" in text or "$" in text:
            for entry in run_transcript(text, self._machine):
                yield _outcome(entry.text, entry.value, entry.messages, entry.error)
        else:
            yield from (self.evaluate(piece.strip()) for _, piece in pieces(text, classic=True))


def _outcome(text: str, value: int | None, messages: tuple[str, ...], error: ClassicError | None) -> EvalOutcome:
    status = EVALUATED if error is None else max(REFUSED, error.exit_status)
    details = {
        "text": text,
        "value": value,
        "status": status,
        "messages": list(messages),
        "error": None if error is None else str(error),
    }
    lines = messages if error is None else (*messages, str(error))
    return EvalOutcome(UNKNOWN if value is None else str(value), status, lines, details)
