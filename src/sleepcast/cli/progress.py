"""How far long work has come: a line that is renewed in place, or a sentence once it takes its time."""

from __future__ import annotations

import sys
from collections.abc import Iterator
from contextlib import AbstractContextManager, contextmanager
from functools import partial
from shutil import get_terminal_size
from time import perf_counter

from sleepcast.api.progress import counting, unless_soon
from sleepcast.cli.streams import complain

RENEWED = 0.1
"""Seconds between two looks of a line on a terminal; faster could not be read."""
LOGGED = 1.0
"""The same where each look is a line of its own."""


class Status:
    """A line on standard error of how far something has come: on a terminal it is renewed in place, and gone at the
    end; elsewhere, in a log, there is a new one when something has changed, and the last is that of the end."""

    def __init__(self) -> None:
        self._terminal = sys.stderr is not None and sys.stderr.isatty()
        self._shown, self._due, self._wide = "", 0.0, 0
        self._latest = ""

    def __enter__(self) -> Status:
        return self

    def __exit__(self, *ended: object) -> None:
        if not self._terminal and self._latest != self._shown:  # a log does not end with what is not so any more
            complain(self._latest)
        self.clear()

    def show(self, text: str) -> None:
        """Print this, if it is new; while something else was printed a moment ago, only the latest, at the end."""
        now, self._latest = perf_counter(), text
        if text == self._shown or now < self._due:
            return
        self._shown, self._due = text, now + (RENEWED if self._terminal else LOGGED)
        if self._terminal:
            width = get_terminal_size().columns - 1
            self._put(f"\r{text[:width]:<{min(self._wide, width)}}")
            self._wide = min(len(text), width)
        else:
            complain(text)

    def clear(self) -> None:
        """Make room for other lines."""
        if self._terminal and self._wide:
            self._put(f"\r{'':<{self._wide}}\r")
            self._shown, self._wide = "", 0

    @staticmethod
    def _put(text: str) -> None:
        if sys.stderr is not None:
            sys.stderr.write(text)
            sys.stderr.flush()


def told_unless_soon(sentence: str) -> AbstractContextManager[None]:
    """Say on standard error what is going on, if it takes more than `PATIENCE` seconds."""
    return unless_soon(partial(complain, sentence))


@contextmanager
def compiling() -> Iterator[None]:
    """Say that what the simulator needs is being compiled, if it takes a while: at a terminal with a count."""
    from sleepcast.simulator import KERNELS, kernel_count

    what = "compiling the simulator, once on this computer"
    notice: AbstractContextManager[None]
    if sys.stderr is not None and sys.stderr.isatty():
        notice = counting(f"{what}: kernel", kernel_count, KERNELS)
    else:
        notice = told_unless_soon(f"{what}: up to {KERNELS} kernels, at most half a minute of a processor's time")
    with notice:
        yield
