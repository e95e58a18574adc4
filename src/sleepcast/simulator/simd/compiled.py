"""Decorators that compile kernels, and a cache of their machine code. Its keys cover everything the code depends on and
are independent of where the package is installed. (numba's own cache uses path, time and text of one file.)

Contraction to fused multiply-adds is off (results would differ between processors). Only `strict` kernels allow
infinities and NaN. Every function states its mode, or it would inherit that of its first caller. Compiled functions
release the GIL.

Only kernels allocate arrays, not the functions they call, so that numba need not count references (with atomic
instructions) at every call.
"""

from __future__ import annotations

import pickle
from collections.abc import Callable
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar, cast

import msgspec
import numba
from numba.core import serialize, types
from numba.core.caching import NullCache
from numba.core.compiler import CompileResult
from numba.core.runtime.nrt import rtsys
from numba.extending import overload, register_jitable

from sleepcast.simulator.simd import formulas
from sleepcast.simulator.simd.cached import CACHE, ENTRIES, ROOM, piece_name, readable
from sleepcast.simulator.simd.entry import NoEntryError, entry_of

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

FASTMATH = {"nnan", "ninf", "nsz"}
PART: dict[str, Any] = {"no_cpython_wrapper": True, "_nrt": False}
"""For functions that only kernels call: no Python wrapper, no reference counting."""


class KernelCache(NullCache):
    """numba's cache of one function, by the types of its arguments. called: also from Python, not by kernels alone."""

    def __init__(self, function: Callable[..., Any], *, called: bool) -> None:
        self._function, self._entered = function, called and readable()

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The machine code for these types, None if there is none, or if its entry is lost."""
        code = CACHE.load(self._name(sig))
        if code is None or (self._entered and ENTRIES.load(self._name(sig)) is None):
            return None
        rtsys.initialize(target_context)  # no more than this: full set-up for compiling takes four times as long
        code_types, payload = pickle.loads(code)
        rebuild: Any = CompileResult._rebuild
        return rebuild(target_context, *payload) if code_types == sig else None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Store the machine code for these types, unless it contains addresses of this process."""
        pickled: Any = serialize.dumps
        if data.library.has_dynamic_globals:
            return
        if self._entered:
            ENTRIES.save(self._name(sig), _entry_of(data))
        CACHE.save(self._name(sig), pickled((sig, data._reduce())))

    def _name(self, sig: Any) -> str:
        beginning = piece_name(self._function.__module__, self._function.__qualname__)
        return beginning + sha256(repr(sig).encode()).hexdigest()[:16]


def _entry_of(made: Any) -> bytes:
    """The entry of a kernel as it is kept: nothing where numba's own has to be called."""
    try:
        return msgspec.msgpack.encode(entry_of(made))
    except NoEntryError:
        return b""


def compiled(function: Kernel) -> Kernel:
    """A kernel; compiled when first called, and cached."""
    return _made(function, fastmath=FASTMATH)


def strict(function: Kernel) -> Kernel:
    """A kernel that computes the same bits as NumPy, including infinities and signed zeros."""
    return _made(function, fastmath=False)


def inlined(function: Kernel) -> Kernel:
    """A small function that is inlined into the kernels that call it; not callable from Python."""
    return _made(function, fastmath=FASTMATH, forceinline=True, **PART)


def part(function: Kernel) -> Kernel:
    """A part of `strict` kernels that is compiled separately; not callable from Python."""
    return _made(function, fastmath=False, **PART)


def woven(function: Kernel) -> Kernel:
    """A part of `strict` kernels that is inlined into those that call it."""
    return _made(function, fastmath=False, forceinline=True, **PART)


def _made(function: Kernel, **options: Any) -> Kernel:
    options |= {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
    made = numba.njit(**options)(function)
    if Path(function.__code__.co_filename).resolve().is_relative_to(ROOM) and "<locals>" not in function.__qualname__:
        called = not options.get("no_cpython_wrapper")
        made._cache = KernelCache(
            function, called=called
        )  # the index of numba's own would not include all dependencies
    return cast(Kernel, made)


@overload(formulas.either)
def _either_of_numbers(condition, yes, no):  # type: ignore[no-untyped-def]  # numba wants it without types
    return (lambda condition, yes, no: yes if condition else no) if condition == types.boolean else None


def usable(formula: Callable[..., Any]) -> None:
    """Let kernels call a formula that is also Python's."""
    register_jitable(forceinline=True, fastmath=False, error_model="numpy")(formula)


for each in (
    *(formulas.sine_of_rest, formulas.sine_cosine, formulas.arc_tangent),
    *(formulas.wrap, formulas.shortest, formulas.square_within),
):
    usable(each)
