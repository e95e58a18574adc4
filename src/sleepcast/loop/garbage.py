"""Garbage is looked for right after a tick, when nobody waits for anything.

Left to itself, Python looks for it whenever so many objects have been made, which is mostly while a message is given to
many minds: the last of them had it some milliseconds later than the first. Where time matters it is told when.
"""

from __future__ import annotations

import gc
from typing import Self

THOROUGH = 600
"""Ticks after which all that was made since the beginning is looked through, and not only what is new: a minute's."""


class Sweeper:
    """Looks for garbage when it is told to, during a `with` block, and not at what was there before."""

    def __init__(self) -> None:
        self._ticks = 0
        self._by_itself = gc.isenabled()

    def __enter__(self) -> Self:
        gc.collect()
        gc.freeze()
        gc.disable()
        return self

    def __exit__(self, *_: object) -> None:
        gc.unfreeze()
        if self._by_itself:
            gc.enable()

    def sweep(self) -> None:
        """A tick is over."""
        self._ticks += 1
        gc.collect(1 if self._ticks % THOROUGH else 2)
