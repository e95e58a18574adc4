"""Scratch memory: the same for every task of every tick. Fresh memory costs more than the work that is done in it, and
what one task needs another one can do with. Every array begins with a line of the caches.
"""

from __future__ import annotations

from math import prod
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from sleepcast.arrays import LINE

Scalar = TypeVar("Scalar", bound=np.generic)


class Scratch:
    """One block of memory, given out from its beginning and taken back as a whole."""

    def __init__(self) -> None:
        self._block: NDArray[np.uint8] = np.empty(0, np.uint8)
        self._first = self._used = 0

    def begin(self, most: int = 0) -> None:
        """A task begins: what was given out to the one before is free. The block is as large as any has needed, and has
        at least `most` bytes."""
        if max(self._used, most) > len(self._block):
            self._block = np.empty(0, np.uint8)
            self._block = np.empty(max(self._used, most) + LINE, np.uint8)
            self._first = -self._block.ctypes.data % LINE
        self._used = self._first

    def take(self, sort: type[Scalar], *shape: int) -> NDArray[Scalar]:
        """An array that holds anything. Where the block is too small it is memory of its own, this time."""
        size = prod(shape) * np.dtype(sort).itemsize
        start, self._used = self._used, self._used + size + -size % LINE
        block = self._block
        if self._used > len(block):
            block = np.empty(size + LINE, np.uint8)
            start = -block.ctypes.data % LINE
        return block[start : start + size].view(sort).reshape(shape)
