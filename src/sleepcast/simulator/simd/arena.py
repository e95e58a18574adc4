"""Scratch memory: the same for every task of every tick. Fresh memory costs more than the work that is done in it, and
what one task needs another one can do with. Every array begins with a line of the caches.
"""

from __future__ import annotations

from math import prod
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from sleepcast.core.arrays import LINE, block

Scalar = TypeVar("Scalar", bound=np.generic)


class Scratch:
    """One block of memory, given out from its beginning and taken back as a whole."""

    def __init__(self) -> None:
        self._block = block(0)
        self._used = 0

    def begin(self, most: int = 0) -> None:
        """A task begins: what was given out to the one before is free. The block is as large as any has needed, and has
        at least `most` bytes."""
        if max(self._used, most) > len(self._block):
            self._block = block(0)
            self._block = block(max(self._used, most))
        self._used = 0

    def take(self, sort: type[Scalar], *shape: int) -> NDArray[Scalar]:
        """An array that holds anything. Where the block is too small it is memory of its own, this time."""
        size = prod(shape) * np.dtype(sort).itemsize
        start, self._used = self._used, self._used + size + -size % LINE
        found = self._block[start : start + size] if self._used <= len(self._block) else block(size)
        return found.view(sort).reshape(shape)
