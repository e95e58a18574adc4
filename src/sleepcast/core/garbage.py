"""How often Python looks for garbage: seldom, where it would find next to none among many objects that stay."""

from __future__ import annotations

import gc
from collections.abc import Iterator
from contextlib import contextmanager

SELDOM = (100_000, 20, 20)
"""How many new objects Python looks for garbage after, and how often it looks at older ones. Libraries, and the robots
of a fleet, are made of objects that stay. With Python's own numbers the search is a tenth of a short command; a run of
few robots ends before the first one. With many worlds, each search goes through all that are awake."""


@contextmanager
def sought_seldom() -> Iterator[None]:
    """Let Python look for garbage seldom meanwhile, or not at all if it never does."""
    before = gc.get_threshold()
    if before[0] > 0:
        gc.set_threshold(*map(max, before, SELDOM))
    try:
        yield
    finally:
        gc.set_threshold(*before)
