"""How far long work has come: a bar once it has taken two seconds, in a terminal or a notebook."""

from __future__ import annotations

import sys
from collections.abc import Generator
from time import perf_counter

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
    """Whether standard error is a terminal, or this is a notebook."""
    return (sys.stderr is not None and sys.stderr.isatty()) or "ipykernel" in sys.modules


def _with_bar(start: int, count: int, title: str) -> Generator[int, None, None]:
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(title, total=count, completed=start)
        for number in range(start, count):
            yield number
            bar.advance(task)
