"""How far long work has come: a bar on standard error, if that is a terminal and the work takes its time."""

from __future__ import annotations

import sys
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from threading import Timer
from time import perf_counter

from sleepcast.cli.streams import complain

PATIENCE = 2.0
"""Seconds of work after which a person wants to know how long it will take."""


def steps(count: int, title: str, *, quiet: bool) -> Generator[int, None, None]:
    """The numbers from 0 up to `count`, with a bar on standard error once they have taken `PATIENCE` seconds. Whoever
    may stop early closes it, so that the bar is gone."""
    began = perf_counter()
    shown = not quiet and sys.stderr is not None and sys.stderr.isatty()
    for number in range(count):
        yield number
        if shown and perf_counter() - began > PATIENCE:
            yield from _with_bar(number + 1, count, title)
            return


@contextmanager
def unless_soon(sentence: str) -> Iterator[None]:
    """Say on standard error what is going on, if it takes more than `PATIENCE` seconds."""
    timer = Timer(PATIENCE, complain, (sentence,))
    timer.daemon = True
    timer.start()
    try:
        yield
    finally:
        timer.cancel()


def _with_bar(start: int, count: int, title: str) -> Generator[int, None, None]:
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title, total=count, completed=start)
        for number in range(start, count):
            yield number
            bar.advance(task)
