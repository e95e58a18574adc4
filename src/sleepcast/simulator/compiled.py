"""How kernels are compiled, and where their code is kept: a folder of the user's, since an installed package may not be
written to.

Contractions to fused multiply-adds are not allowed (they would differ between processors), nor, but for `strict` ones,
may numbers be infinite or unknown. Each function says which it is, as one that did not would take it from whoever
happened to be the first to call it. Compiled functions let other threads run.

Only kernels make arrays, not their parts: then numba need not count, at every call, who holds which array. It does that
with instructions that lock memory, and a part may be called some times for each robot.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from contextlib import suppress
from hashlib import sha256
from pathlib import Path
from stat import S_ISDIR
from typing import Any, TypeVar, cast

import numba
from numba.core import types
from numba.extending import overload, register_jitable

from sleepcast.simulator import driving, formulas

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

FASTMATH = {"nnan", "ninf", "nsz"}
PART: dict[str, Any] = {"no_cpython_wrapper": True, "_nrt": False}
"""Of functions that only kernels call: Python cannot, and who holds arrays is not counted."""
SOURCES = (
    *("kernels*.py", "compiled.py", "lanes.py", "vectors.py"),
    *("formulas.py", "driving.py", "noise.py", "crosstalk.py"),
)


def cache_folder() -> Path:
    """The user's cache folder, or one among the temporary files where that cannot be written. Another one for each
    state of the sources: numba itself would not notice a change in what a kernel takes from another module.

    Code is loaded from there, so among the temporary files a folder serves that is this user's alone.
    """
    caches = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    sources = sorted(source for names in SOURCES for source in Path(__file__).parent.glob(names))
    state = sha256(b"".join(source.read_bytes() for source in sources)).hexdigest()[:12]
    folder = Path(caches) / "sleepcast" / "kernels" / state
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        writable = False
    else:
        writable = os.access(folder, os.W_OK)
    return folder if writable else _private(Path(tempfile.gettempdir()) / f"sleepcast-kernels-{os.getuid()}-{state}")


def _private(folder: Path) -> Path:
    """This folder, if nobody else can write to it, or a new one."""
    with suppress(FileExistsError):
        folder.mkdir(mode=0o700)
    found = folder.lstat()
    mine = S_ISDIR(found.st_mode) and found.st_uid == os.getuid() and not found.st_mode & 0o077
    return folder if mine else Path(tempfile.mkdtemp(prefix="sleepcast-kernels-"))


_settings: Any = numba.config
if not _settings.CACHE_DIR:  # the person who set NUMBA_CACHE_DIR knows better
    _settings.CACHE_DIR = str(cache_folder())


def anything_kept() -> bool:
    """Whether any kernel has ever been compiled by these sources."""
    return any(Path(_settings.CACHE_DIR).rglob("*.nbi"))


def compiled(function: Kernel) -> Kernel:
    """A kernel; compiled when it is first called, and kept."""
    return _made(function, fastmath=FASTMATH)


def strict(function: Kernel) -> Kernel:
    """A kernel that computes the same bits as NumPy, infinite and signed numbers included."""
    return _made(function, fastmath=False)


def inlined(function: Kernel) -> Kernel:
    """A small function that becomes part of the kernels that call it, and can be called by nobody else."""
    return _made(function, fastmath=FASTMATH, forceinline=True, **PART)


def part(function: Kernel) -> Kernel:
    """A part of kernels, as `strict` as these, that is compiled by itself and can be called by nobody else."""
    return _made(function, fastmath=False, **PART)


def woven(function: Kernel) -> Kernel:
    """A part of `strict` kernels that becomes part of those that call it."""
    return _made(function, fastmath=False, forceinline=True, **PART)


def _made(function: Kernel, **options: Any) -> Kernel:
    options |= {"cache": True, "nogil": True, "error_model": "numpy", "no_cfunc_wrapper": True}
    return cast(Kernel, numba.njit(**options)(function))


@overload(formulas.either)
def _either_of_numbers(condition, yes, no):  # type: ignore[no-untyped-def]  # numba wants it without types
    return (lambda condition, yes, no: yes if condition else no) if condition == types.boolean else None


for formula in (formulas.sine_of_rest, formulas.sine_cosine, formulas.arc_tangent, formulas.wrap, *driving.FORMULAS):
    register_jitable(forceinline=True, fastmath=False, error_model="numpy")(formula)
