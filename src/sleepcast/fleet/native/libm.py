"""The C library's functions by their addresses, for native code: those that give the very numbers of Python's `math`.

Each is tried on some numbers before it is offered: where a platform's `math` goes another way than its C library,
native code leaves that function to the walk.
"""

from __future__ import annotations

import ctypes
import math
from collections.abc import Callable
from functools import cache
from random import Random

TRIALS = 2_000
"""Numbers that each function is tried on, of all sizes."""
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
    """What native code calls a function: not by its own name, of which the optimiser would draw conclusions."""
    return f"sleepcast_{name}"


@cache
def address(name: str) -> int | None:
    """Where the function begins that can be called in place of `math`'s; None if there is none."""
    function, count = _FUNCTIONS[name]
    try:
        native = ctypes.CFUNCTYPE(ctypes.c_double, *[ctypes.c_double] * count)((name, ctypes.CDLL(None)))
    except (
        OSError,
        TypeError,
        AttributeError,
    ):  # there is no library of the process itself on this platform, or no such
        return None
    return ctypes.cast(native, ctypes.c_void_p).value if _agree(function, native, count) else None


def _agree(function: Callable[..., float], native: Callable[..., float], count: int) -> bool:
    """Whether both give the same bits wherever there is a finite result."""
    chance = Random(count)
    for _ in range(TRIALS):
        numbers = [
            chance.uniform(-1.0, 1.0) * 10.0 ** chance.choice((-300, -8, -2, 0, 1, 2, 6, 15)) for _ in range(count)
        ]
        try:
            wanted = function(*numbers)
        except (ArithmeticError, ValueError):
            continue
        if wanted.hex() != native(*numbers).hex():
            return False
    return True
