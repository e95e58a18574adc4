"""What comes in and goes out as text: sources of expressions, results on standard output, the rest on standard error.

Everything read is bounded, and is UTF-8 or refused with the place of the first byte that is not.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, TextIO

from sleepcast.core.errors import MisuseError, SleepcastError

MAX_INPUT = 4 * 1024 * 1024
"""Bytes of one file or of standard input: hundreds of the longest expressions, and read at once without harm."""

_PARENTHESES = re.compile(r'"[^"\n]*"|;[^\n]*|[()]')
_BARE_PARENTHESES = re.compile(r"[()]")


class InputError(MisuseError):
    """A file or standard input that cannot be read as text."""


class OutputError(SleepcastError):
    """There is nowhere to print to."""


class ReaderGone(Exception):
    """The reader of our output has closed it."""


def somebody_there() -> bool:
    """Whether a person at a terminal can be asked."""
    return sys.stdin is not None and sys.stdin.isatty()


def open_streams() -> None:
    """Let every text print: what the terminal's encoding lacks, and bytes that came in undecoded, are escaped."""
    import io

    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def put(line: str) -> None:
    """Print one line of the result. Raises OutputError if standard output is closed, ReaderGone if its reader is."""
    if sys.stdout is None:
        raise OutputError("standard output is closed, so the result cannot be printed; open it or send it to a file")
    _write(sys.stdout, line, now=False)


def announce(line: str) -> None:
    """The same for a line that must be seen at once, though the program goes on."""
    put(line)
    _write(sys.stdout, "", now=True)


def complain(text: str) -> None:
    """Print a sentence for a person on standard error, after the results that came before it."""
    if sys.stdout is not None:
        _write(sys.stdout, "", now=True)
    if sys.stderr is not None:
        _write(sys.stderr, text, now=True)


def _write(stream: TextIO, line: str, *, now: bool) -> None:
    try:
        if line:
            stream.write(f"{line}\n")
        if now:
            stream.flush()
    except BrokenPipeError:
        raise ReaderGone from None


def read_file(path: Path) -> str:
    """The text of a file. Raises InputError."""
    try:
        with path.open("rb") as file:
            data = file.read(MAX_INPUT + 1)
    except IsADirectoryError:
        raise InputError(f"{path} is a directory: name a file in it") from None
    except FileNotFoundError:
        raise InputError(f"there is no file {path}") from None
    except OSError as error:
        raise InputError(f"cannot read {path}: {error.strerror or error}") from None
    return _decoded(data, str(path))


def read_standard_input() -> str:
    """All of standard input. Raises InputError."""
    try:
        data = _input().read(MAX_INPUT + 1)
    except OSError as error:
        raise InputError(f"cannot read standard input: {error.strerror or error}") from None
    return _decoded(data, "standard input")


def incoming_lines() -> Iterator[str]:
    """The lines of standard input as they come, each with its end. Raises InputError."""
    source = _input()
    while True:
        try:
            data = source.readline(MAX_INPUT + 1)
        except OSError as error:
            raise InputError(f"cannot read standard input: {error.strerror or error}") from None
        if not data:
            return
        yield _decoded(data, "standard input")


def _input() -> BinaryIO:
    if sys.stdin is None:
        raise InputError("standard input is closed, so there is nothing to read from it")
    return sys.stdin.buffer


def _decoded(data: bytes, source: str) -> str:
    if len(data) > MAX_INPUT:
        raise InputError(f"{source} is larger than {MAX_INPUT} bytes: give it in smaller parts")
    try:
        return data.decode("utf-8-sig").replace("\r\n", "\n")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise InputError(
            f"{source}, line {line}, is not UTF-8 text: byte 0x{data[error.start]:02x} at offset {error.start}; "
            "save it as UTF-8"
        ) from None


def still_open(text: str, *, classic: bool = False) -> int:
    """How many parentheses of `text` still wait for their `)`; below 0 if there are too many `)`.

    The classic dialect knows neither comments nor labels in quotes.
    """
    marks = (_BARE_PARENTHESES if classic else _PARENTHESES).findall(text)
    return marks.count("(") - marks.count(")")


def pieces(text: str, *, classic: bool = False) -> Iterator[tuple[int, str]]:
    """`text` cut where a line ends with no parenthesis open: the number of each piece's first line, and the piece.

    Blank pieces are left out. A ) too many ends its piece, so that the lines after it are pieces of their own.
    """
    waiting: list[str] = []
    first, depth = 1, 0
    for number, line in enumerate(text.split("\n"), start=1):
        if not waiting:
            first = number
        waiting.append(line)
        depth += still_open(line, classic=classic)
        if depth <= 0:
            if any(map(str.strip, waiting)):
                yield first, "\n".join(waiting)
            waiting, depth = [], 0
    if any(map(str.strip, waiting)):
        yield first, "\n".join(waiting)
