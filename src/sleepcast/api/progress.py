"""How far long work has come: a bar once it has taken two seconds, in a terminal or a notebook."""

from __future__ import annotations

import sys
from collections.abc import Callable, Generator, Iterator
from contextlib import contextmanager
from threading import Timer
from time import perf_counter
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.progress import ProgressColumn

PATIENCE = 2.0
"""Seconds of work after which a person wants to know how long it will take."""


def steps(count: int, title: str, *, quiet: bool = False) -> Generator[int, None, None]:
    """The numbers from 0 up to `count`, with a bar on standard error, or below a notebook's cell, once they have taken
    `PATIENCE` seconds. A caller that may stop early closes it, which removes the bar."""
    began = perf_counter()
    shown = not quiet and _somebody_sees()
    for number in range(count):
        yield number
        if shown and perf_counter() - began > PATIENCE:
            yield from _with_bar(number + 1, count, title)
            return


def _somebody_sees() -> bool:
    """Whether standard error is a terminal, or comes out below a notebook's cell."""
    return sys.stderr is not None and (sys.stderr.isatty() or type(sys.stderr).__module__.startswith("ipykernel"))


def _with_bar(start: int, count: int, title: str) -> Generator[int, None, None]:
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title, total=count, completed=start)
        for number in range(start, count):
            yield number
            bar.advance(task)


@contextmanager
def counting(title: str, count: Callable[[], int], most: int, *, quiet: bool = False) -> Iterator[None]:
    """A line on standard error, or below a notebook's cell, with what `count` gives of `most`, once the block has taken
    `PATIENCE` seconds and something is being counted."""
    if quiet or not _somebody_sees():
        yield
        return
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TimeElapsedColumn

    columns = SpinnerColumn(), counting_column(title, count, most), TimeElapsedColumn()
    line, before = Progress(*columns, console=Console(stderr=True), transient=True), count()

    def begin() -> None:
        if before == 0 or count() > before:
            line.add_task("")
            line.start()

    try:
        with unless_soon(begin):
            yield
    finally:
        line.stop()


@contextmanager
def unless_soon(begin: Callable[[], object]) -> Iterator[None]:
    """Call `begin`, on a thread of its own, once the block has taken `PATIENCE` seconds."""
    timer = Timer(PATIENCE, begin)
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()
        timer.join()


def counting_column(title: str, count: Callable[[], int], most: int) -> ProgressColumn:
    """A column of a line of progress that asks `count` whenever it is drawn."""
    from rich.progress import ProgressColumn, Task
    from rich.text import Text

    class CountColumn(ProgressColumn):
        def render(self, task: Task) -> Text:
            return Text(f"{title} {min(count(), most)} of {most}")

    return CountColumn()
