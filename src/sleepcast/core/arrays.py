"""Arrays of one number a robot, laid out in memory as the processor's caches want them.

Code that serves many robots at a time goes through fifty such arrays side by side. Each begins with a line of the
caches, so that what is read at once lies in one line and not in two. And they begin at different places of their pages:
where a line may lie in the nearest cache depends on its place in the page, and arrays that all begin at the same one
would put each other out.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import count
from math import prod
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

LINE = 64
"""Bytes of a line of the processor's caches."""
PAGE = 4096
"""Bytes of a page of memory, after which places in the nearest cache come round again. Arrays that are smaller than
this lie as they come."""
STEP = 5 * LINE
"""Bytes from the place of one array in its page to that of the next; by and by each place is used."""

Scalar = TypeVar("Scalar", bound=np.generic)

_offsets = count(0, STEP)


def block(size: int, offset: int = 0) -> NDArray[np.uint8]:
    """So many bytes that hold anything, beginning at this offset, a multiple of LINE, in a page; less than a page
    begins with any line."""
    place = LINE if size < PAGE else PAGE
    memory = np.empty(size + 2 * place, np.uint8)
    first = -memory.ctypes.data % place + offset % place
    return memory[first : first + size]


def filled(value: float, dtype: type[Scalar], *shape: int) -> NDArray[Scalar]:
    """An array of this shape, full of this value."""
    size = prod(shape) * np.dtype(dtype).itemsize
    if size < PAGE:
        return np.full(shape, value, dtype)
    array = block(size, next(_offsets) % PAGE).view(dtype).reshape(shape)
    array[...] = value
    return array


@lru_cache(maxsize=8)
def count_up(count: int, dtype: type[Scalar]) -> NDArray[Scalar]:
    """The numbers from 0 on, so many: one array for all who want so many, into which nobody writes, though it could be
    written, as compiled code takes arrays."""
    return np.arange(count).astype(dtype)


# Scratch memory: the same for every task of every tick. Fresh memory costs more than the work that is done in it, and
# what one task needs another one can do with. Every array begins with a line of the caches.


class Arena:
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

    def take(self, dtype: type[Scalar], *shape: int) -> NDArray[Scalar]:
        """An array that holds anything. Where the block is too small it is memory of its own, this time."""
        size = prod(shape) * np.dtype(dtype).itemsize
        start, self._used = self._used, self._used + size + -size % LINE
        memory = self._block[start : start + size] if self._used <= len(self._block) else block(size)
        return memory.view(dtype).reshape(shape)
