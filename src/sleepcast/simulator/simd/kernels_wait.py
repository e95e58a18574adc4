"""A compiled kernel that busy-waits for a word that another thread writes: sleeping and waking would take longer than
most of what threads wait for here. The thread pool calls it."""

from __future__ import annotations

import platform

from llvmlite import ir
from numba.core import types
from numba.extending import intrinsic

from sleepcast.simulator.simd.compiled import compiled

PAUSE = "llvm.x86.sse2.pause"
"""LLVM's name of the instruction that rests a core for some dozen cycles, where the processor has one."""


@intrinsic
def _look(typing, words):
    """The current value of the first of these words (int64), after a moment's rest."""

    def generate(context, build, signature, arguments):
        if platform.machine().lower() in ("x86_64", "amd64"):
            shape = ir.FunctionType(ir.VoidType(), [])
            build.call(build.module.globals.get(PAUSE) or ir.Function(build.module, shape, PAUSE), [])
        data = context.make_array(signature.args[0])(context, build, arguments[0]).data
        return build.load_atomic(data, "acquire", 8)

    return types.int64(words), generate


@compiled
def wait(words, most, moment):
    """Read the first of these words (int64) until it is not 0: up to `most` times, and then `moment` times more."""
    for _ in range(most):
        if _look(words):
            for _ in range(moment):
                _look(words)
            break
