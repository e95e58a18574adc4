"""Addresses of C library functions for native code: those that give exactly the numbers of Python's `math`.

Each is tested on some numbers first: where a platform's `math` differs from its C library, native code leaves that
function to the walk.
"""

from __future__ import annotations

import ctypes
import math
from array import array
from collections.abc import Callable
from functools import cache
from itertools import cycle, islice, product
from random import Random

TRIALS = 2_000
"""Numbers, of all magnitudes, that each function is tested on."""
MAGNITUDES = tuple(10.0**power for power in (-300, -8, -2, 0, 1, 2, 6, 15))
_FUNCTIONS: dict[str, tuple[Callable[..., float], int]] = {
    "sin": (math.sin, 1),
    "cos": (math.cos, 1),
    "tan": (math.tan, 1),
    "exp": (math.exp, 1),
    "log": (math.log, 1),
    "pow": (math.pow, 2),
    "fmod": (math.fmod, 2),
}


NAMES = tuple(_FUNCTIONS)


def symbol(name: str) -> str:
    """The name of a function in native code: not its own, from which the optimiser would draw conclusions."""
    return f"sleepcast_{name}"


@cache
def address(name: str) -> int | None:
    """The address of a function that can replace `math`'s; None if there is none."""
    function, count = _FUNCTIONS[name]
    try:
        native = ctypes.CFUNCTYPE(ctypes.c_double, *[ctypes.c_double] * count)((name, ctypes.CDLL(None)))
    except (
        OSError,
        TypeError,
        AttributeError,
    ):  # this platform has no library of the process itself, or no such function in it
        return None
    return ctypes.cast(native, ctypes.c_void_p).value if _agree(function, native, count) else None


def _agree(function: Callable[..., float], native: Callable[..., float], count: int) -> bool:
    """Whether both give the same bits wherever the result is finite."""
    draw, wanted, given = Random(count).random, array("d"), array("d")
    magnitudes = cycle(product(MAGNITUDES, repeat=count))
    for sizes in islice(magnitudes, TRIALS):
        numbers = [size * (2.0 * draw() - 1.0) for size in sizes]
        try:
            wanted.append(function(*numbers))
        except (ArithmeticError, ValueError):
            continue
        given.append(native(*numbers))
    return wanted.tobytes() == given.tobytes()
