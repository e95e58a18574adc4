"""Decorators that compile kernels, and a cache of their machine code. Its keys cover everything the code depends on and
are independent of where the package is installed. (numba's own cache uses path, time and text of one file.)

Contraction to fused multiply-adds is off (results would differ between processors). Only `strict` kernels allow
infinities and NaN. Every function states its mode and whether it is inlined, or it would inherit that of its first
caller. Compiled functions release the GIL.

Only kernels allocate arrays, not the functions they call, so that numba need not count references (with atomic
instructions) at every call. LLVM optimizes a whole kernel once, with all functions in it, and only kernels are kept.
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
from numba.core.codegen import JITCodeLibrary
from numba.core.compiler import Compiler, CompileResult
from numba.core.runtime.nrt import rtsys
from numba.extending import overload, register_jitable

from sleepcast.simulator.simd import formulas
from sleepcast.simulator.simd.cached import CACHE, ENTRIES, ROOM, piece_name, readable
from sleepcast.simulator.simd.entry import NoEntryError, entry_of

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

FASTMATH = {"nnan", "ninf", "nsz"}


class PartLibrary(JITCodeLibrary):
    """LLVM's code of a function that only kernels call. numba would optimize it, and make machine code of it and of all
    that it calls, though each kernel is linked with LLVM's code, optimized again, and has machine code of its own."""

    def _optimize_final_module(self) -> None:
        """It is the kernel that is optimized."""

    def _finalize_final_module(self) -> None:
        self._finalized = True

    @property
    def codegen(self) -> PartLibrary:
        """Whom numba tells where Python's objects are that machine code needs."""
        return self

    def set_env(self, name: str, environment: object) -> None:
        """There is no machine code."""


class PartCompiler(Compiler):
    """numba's compiler, for functions that only kernels call."""

    def __init__(self, typing: Any, target: Any, library: None, *rest: Any) -> None:
        kept: Any = PartLibrary
        super().__init__(typing, target, kept(target.codegen(), "part"), *rest)  # type: ignore[no-untyped-call]  # numba's


PART: dict[str, Any] = {"no_cpython_wrapper": True, "_nrt": False, "pipeline_class": PartCompiler}
"""For functions that only kernels call: no Python wrapper, no reference counting."""


class KernelCache(NullCache):
    """numba's cache of one kernel, by the types of its arguments."""

    def __init__(self, function: Callable[..., Any]) -> None:
        self._function, self._entered = function, readable()

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
    """A part of `strict` kernels that LLVM inlines where it finds that worth it; not callable from Python."""
    return _made(function, fastmath=False, **PART)


def woven(function: Kernel) -> Kernel:
    """A part of `strict` kernels that is inlined into those that call it."""
    return _made(function, fastmath=False, forceinline=True, **PART)


def _made(function: Kernel, **options: Any) -> Kernel:
    modes: dict[str, Any] = {"nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True, "forceinline": False}
    made: Any = numba.njit(**modes | options)(function)
    if "pipeline_class" in options:
        typed = made.get_call_template
        made.get_call_template = lambda kinds, named: typed(tuple(map(types.unliteral, kinds)), named)
    elif Path(function.__code__.co_filename).resolve().is_relative_to(ROOM) and "<locals>" not in function.__qualname__:
        made._cache = KernelCache(function)  # the index of numba's own would not include all dependencies
    return cast(Kernel, made)


@overload(formulas.either)
def _either_of_numbers(condition, yes, no):  # type: ignore[no-untyped-def]  # numba wants it without types
    return (lambda condition, yes, no: yes if condition else no) if condition == types.boolean else None


def usable(formula: Callable[..., Any]) -> None:
    """Let kernels call a formula that is also Python's."""
    register_jitable(forceinline=True, fastmath=False, error_model="numpy", **PART)(formula)


for each in (
    *(formulas.sine_of_rest, formulas.sine_cosine, formulas.arc_tangent),
    *(formulas.wrap, formulas.shortest, formulas.square_within, formulas.rotated),
):
    usable(each)
