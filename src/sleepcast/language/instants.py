"""Texts about an instant for all: a command with AFTER-ISSUE around it, and what one waits for."""

from __future__ import annotations

from contextlib import suppress

from sleepcast.language.reader import List, Number, ReadError, read

_HEAD = "(after-issue"


def timed(text: str, seconds: float) -> str:
    """The text of a command that is to be done so many s after it was sent, to the microsecond."""
    end = "\n)" if ";" in text else ")"  # a comment goes to the end of its line
    return f"(AFTER-ISSUE {seconds:.6f}s {text}{end}"


def wait_of(text: str) -> float | None:
    """For how many s after its issue a command waits; None for one that waits for nothing."""
    if not text.lstrip().casefold().startswith(_HEAD):
        return None
    with suppress(ReadError):
        match read(text):
            case List(items=(_, Number(value=wait), _)):
                return wait
    return None
