"""Kernels: which programs get native code, and when.

Code is made in a thread of its own, if llvmlite is installed; until it is there, programs are walked. Which of the two
has run makes no difference to anything but speed.
"""

from __future__ import annotations

import importlib.util
from concurrent.futures import Future, ThreadPoolExecutor

from sleepcast.fleet.columns import Column, Rows
from sleepcast.fleet.evaluation import Evaluation
from sleepcast.fleet.native import ORDERED, Kernel
from sleepcast.language.machine import Program
from sleepcast.language.parts import Part, walk
from sleepcast.language.vocabulary import Kind, Variable

HOT = 4
"""Walks of a program before native code is made for it: a command is heard once, a rule stays."""
MAX_KERNELS = 512
"""Programs that native code is kept for; when full, all are forgotten and made again as they are needed."""
MAX_PARTS = 500
"""Parts of a program at most that becomes native code: the optimiser's time grows faster than the program."""

_OPS = frozenset({"const", "var", "local", "absent", "pure", "and", "or", "known", "cond", "clause", "if", "progn"})
_MORE = frozenset({"let", "set_local", "set_user", "prob"})
_PURE = frozenset({"+", "-", "*", "/", "ABS", "MIN", "MAX", "SQRT", "DIST", "CLAMP", "NOT"})


def available() -> bool:
    """Whether llvmlite is installed."""
    return importlib.util.find_spec("llvmlite") is not None


def translatable(program: Program) -> bool:
    """Whether a program is short enough and has nothing in it but what becomes native code."""
    return program.size <= MAX_PARTS and all(map(_translatable, walk(program.root)))


def _translatable(part: Part) -> bool:
    if part.op == "pure":
        return part.function.name in _PURE or (part.function.name in ORDERED and len(part.parts) > 0)
    if part.op == "write":
        return isinstance(part.data, Variable) and part.data.kind is Kind.ACTUATOR
    return part.op in _OPS or part.op in _MORE


class Kernels:
    """The native code of a fleet's programs, made in a thread of its own. hot: see `HOT`."""

    def __init__(self, hot: int = HOT) -> None:
        self._hot = hot
        self._kernels: dict[Program, int | Future[Kernel] | None] = {}
        self._maker = ThreadPoolExecutor(1, "sleepcast-native")

    def run(self, memory: Evaluation, program: Program, rows: Rows) -> Column | None:
        """Evaluate a program natively, if it can be done for these robots."""
        if not isinstance(rows.index, slice):
            return None
        found = self._kernels.get(program, 0)
        if isinstance(found, Future):
            return found.result().run(memory, rows) if found.done() else None
        if found is not None:
            self._meet(program, found + 1)
        return None

    def _meet(self, program: Program, times: int) -> None:
        """A program has been walked once more."""
        if len(self._kernels) >= MAX_KERNELS and program not in self._kernels:
            self._kernels.clear()
        if times < self._hot:
            self._kernels[program] = times
        else:
            self._kernels[program] = self._maker.submit(Kernel, program) if translatable(program) else None

    def settle(self) -> None:
        """Wait until all code that has been asked for is made."""
        for found in self._kernels.values():
            if isinstance(found, Future):
                found.result()
