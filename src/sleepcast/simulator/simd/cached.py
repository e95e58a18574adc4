"""Kernels as they are called: machine code of the cache that takes Python's own objects, so that numba is not loaded.

Importing numba takes longer than a short run of few robots. It is loaded, with a kernel's module, only when there is no
code yet for arguments of these types; `compiled` then keeps the kernel's machine code with an `entry` to it. An entry
takes the tuple of arguments, and gives what the kernel gives; or NotImplemented, where an argument is of another type
than those it was written for.
"""

from __future__ import annotations

import ctypes
import os
import sys
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import cache
from hashlib import sha256
from importlib import import_module
from pathlib import Path
from threading import RLock
from typing import Any, TypeAlias

import msgspec
import numpy as np

from sleepcast.core.code_cache import CodeCache, processor, version_of
from sleepcast.core.linking import LinkedCode, in_process

Call: TypeAlias = Callable[[tuple[Any, ...]], Any]

ROOM_NAME = __name__.rpartition(".simd.")[0]
ROOM = Path(__file__).resolve().parent.parent
SOURCES = (
    *("*/kernels*.py", "simd/*.py"),
    *("motion/driving.py", "motion/flying.py", "motion/steps.py", "motion/touching.py"),
    *("neighbours/neighbourhood.py", "world/walls.py", "world/sight.py", "world/roofs.py"),
    *("sonar/noise.py", "sonar/crosstalk.py", "sonar/fields.py", "laser/beams.py"),
    *("quiet/layout.py", "../core/angles.py", "../core/counter_rng.py"),
)
"""Kernels, and the modules with their constants, formulas and named tuples."""
SETTINGS = "NUMBA_CPU_NAME", "NUMBA_CPU_FEATURES", "NUMBA_ENABLE_AVX", "NUMBA_OPT"
"""What a person may say in the environment of the code that numba makes."""
CACHE, ENTRIES = CodeCache("kernels"), CodeCache("kernel-entries")
"""What numba keeps of a kernel, and the same machine code with an entry to it."""
FUNCTION = "C:"
"""What the names of functions of Python's own interface begin with, in the table of an entry."""


class EntryPiece(msgspec.Struct, frozen=True, array_like=True):
    """What is kept of a kernel for arguments of some types.

    outside: functions of the process that the code calls by their names
    needs: the objects and functions whose addresses the entry takes from its table
    entry, kernel: object files; the entry's functions are called `entry`, and `address`, which gives the kernel's own
    """

    outside: tuple[str, ...]
    needs: tuple[str, ...]
    entry: bytes
    kernel: bytes


@cache
def identity() -> str:
    """What all kernels depend on: their sources, the compilers, and the processor."""
    sources = sorted(source for names in SOURCES for source in ROOM.glob(names))
    settings = [f"{name}={os.environ.get(name)}" for name in SETTINGS]
    texts = [sys.implementation.cache_tag or "", processor(), *settings]
    versions = [version_of("numba"), version_of("llvmlite")]
    digest = sha256(b"\0".join([*(text.encode() for text in texts), *versions]))
    for source in sources:
        digest.update(b"\0" + source.read_bytes())
    return digest.hexdigest()[:16]


def compiled_in() -> Path | None:
    """The folder with kernels of these sources for this processor; None if none has been compiled yet."""
    return CACHE.holding(f"{identity()}-")


def compiled_count() -> int:
    """How many kernels of these sources have been compiled for this processor, by any process."""
    return len(CACHE.names(f"{identity()}-"))


def piece_name(module: str, function: str) -> str:
    """What the names of a kernel's pieces begin with, whatever the types of its arguments."""
    return f"{identity()}-{module.rpartition('.')[2]}.{function}-"


_ONE_AT_A_TIME = RLock()


class CachedKernel:
    """A kernel, by the names of its module and of itself. Its arguments are given in their order."""

    def __init__(self, module: str, name: str) -> None:
        self._module, self.__name__ = module, name
        self.entries: tuple[Call, ...] | None = None
        self._compiling: Callable[..., Any] | None = None

    def __call__(self, *arguments: Any) -> Any:
        for entry in self.entries if self.entries is not None else self._load():
            result = entry(arguments)
            if result is not NotImplemented:
                return result
        return self._other()(*arguments)

    def address(self, *arguments: Any) -> int:
        """The address of the kernel's own function for arguments of these types, with numba's convention of calling:
        for other compiled code."""
        for entry in self.entries if self.entries is not None else self._load():
            result = entry.address(arguments)  # type: ignore[attr-defined]  # see `linked_entry`
            if result is not NotImplemented:
                return int(result)
        kernel: Any = self._other()
        kinds = tuple(map(kernel.typeof_pyval, arguments))
        if kinds not in kernel.overloads:
            kernel.compile(kinds)
        made = kernel.overloads[kinds]
        return int(made.library.get_pointer_to_function(made.fndesc.llvm_func_name))

    def _load(self) -> tuple[Call, ...]:
        """The entries that the cache has."""
        with _ONE_AT_A_TIME:
            if self.entries is None:
                self.entries = tuple(_entries(self._module, self.__name__)) if readable() else ()
            return self.entries

    def _other(self) -> Callable[..., Any]:
        """The kernel that compiles itself."""
        if self._compiling is None:
            self._compiling = getattr(import_module(self._module), self.__name__)
        return self._compiling


class CachedKernels:
    """The kernels of a module of the simulator, such as "sonar.kernels", as attributes."""

    def __init__(self, module: str) -> None:
        self._module = f"{ROOM_NAME}.{module}"

    def __getattr__(self, name: str) -> CachedKernel:
        if name.startswith("__"):
            raise AttributeError(name)
        kernel = _kernel(self._module, name)
        setattr(self, name, kernel)
        return kernel


@cache
def _kernel(module: str, name: str) -> CachedKernel:
    kernel = _KERNELS[f"{module}:{name}"] = CachedKernel(module, name)
    return kernel


_KERNELS: dict[str, CachedKernel] = {}
"""Those that somebody has asked for in this process."""


def in_use() -> list[str] | None:
    """The kernels that were called in this process; None if not all of them came from the cache."""
    asked = {name: each.entries for name, each in _KERNELS.items() if each.entries is not None}
    return list(asked) if all(asked.values()) else None


def load(kernel: str) -> bool:
    """Load a kernel that was `in_use` elsewhere; gives whether the cache has it."""
    found = _kernel(*kernel.split(":"))
    if found.entries is None and not found._load():
        found.entries = None  # it was not called yet
    return found.entries is not None


def _entries(module: str, name: str) -> Iterator[Call]:
    prefix = piece_name(module, name)
    if prefix not in _listed():
        _listed.cache_clear()  # another process may have compiled it meanwhile
    for piece in _listed().get(prefix, ()):
        data = ENTRIES.load(piece)
        if data:  # there is nothing in it where numba's own has to be called
            found = msgspec.msgpack.decode(data, type=EntryPiece)
            if all_in_process(found.outside):  # LLVM ends the process over a function that is missing
                yield linked_entry(found)


@cache
def _listed() -> Mapping[str, Sequence[str]]:
    """The names of the pieces with entries, of each kernel by what they begin with."""
    found = defaultdict(list)
    for name in ENTRIES.names(f"{identity()}-"):
        found[name[: name.rindex("-") + 1]].append(name)
    return dict(found)


def all_in_process(functions: Sequence[str]) -> bool:
    """Whether this process has functions of these names for everybody."""
    return all(in_process(name) is not None for name in functions)


def linked_entry(piece: EntryPiece) -> Call:
    """The entry of a piece, ready to be called."""
    code = LinkedCode((piece.kernel, piece.entry))
    kind = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.py_object, ctypes.c_void_p)
    function, address = (kind(code.address(name)) for name in ("entry", "address"))
    objects = [_needed(name) for name in piece.needs]
    addresses = (ctypes.c_void_p * len(objects))(*(address for _, address in objects))
    table = ctypes.addressof(addresses)

    def call(arguments: tuple[Any, ...]) -> Any:
        return function(arguments, table)

    def tell(arguments: tuple[Any, ...]) -> Any:
        return address(arguments, table)

    call.owns = code, objects, addresses  # type: ignore[attr-defined]  # what must stay as long as it is called
    call.address = tell  # type: ignore[attr-defined]  # of the kernel itself
    return call


@cache
def _needed(name: str) -> tuple[object, int | None]:
    """An object or function of this name, and its address."""
    if name.startswith(FUNCTION):
        return None, in_process(name.removeprefix(FUNCTION))
    module, _, path = name.partition(":")
    found: object = import_module(module)
    for part in path.split("."):
        found = getattr(found, part)
    return found, id(found)


# ---- how objects lie in memory

OBJECT = 16
"""Bytes of an object before what it holds: the count of its references, and its type."""
TYPE, HELD, ITEMS = 8, OBJECT, OBJECT + 8
"""Where an object's type is, a number's value or a tuple's length, and a tuple's items."""
DATA, DIMENSIONS, SHAPE, STRIDES, DTYPE, FLAGS = 16, 24, 32, 40, 56, 64
"""Where an array's parts are."""
ORDER, NUMBER = 26, 28
"""Where a dtype's byte order is, and its number."""


@cache
def readable() -> bool:
    """Whether objects of this Python and this NumPy lie in memory as entries expect."""
    if sys.implementation.name != "cpython" or object.__basicsize__ != OBJECT or sys.byteorder != "little":
        return False
    array, pair, real, whole = np.zeros((3, 2), np.float32)[:, :1], (None, 1), 0.1, np.uint64(2**63 + 1)
    array.flags.writeable = False
    found = [
        *(_word(thing, TYPE) for thing in (array, pair, real, whole)),
        *(_word(pair, HELD), _word(pair, ITEMS), _word(pair, ITEMS + 8)),
        *(ctypes.c_double.from_address(id(real) + HELD).value, _word(whole, HELD)),
        *(_word(array, DATA), ctypes.c_int32.from_address(id(array) + DIMENSIONS).value, _word(array, DTYPE)),
        ctypes.c_int32.from_address(id(array) + FLAGS).value,
        *((ctypes.c_int64 * 2).from_address(_word(array, place))[:] for place in (SHAPE, STRIDES)),
        *(ctypes.c_char.from_address(id(array.dtype) + ORDER).value, _word(array.dtype, NUMBER) & 0xFFFFFFFF),
    ]
    return found == [
        *map(id, (np.ndarray, tuple, float, np.uint64)),
        *(2, id(None), id(pair[1]), real, int(whole)),
        *(array.ctypes.data, 2, id(array.dtype), array.flags.num),
        *([3, 1], [8, 4], b"=", array.dtype.num),
    ]


def _word(thing: object, place: int) -> int:
    """The word at this place of an object."""
    return ctypes.c_uint64.from_address(id(thing) + place).value
