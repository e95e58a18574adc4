"""How kernels are compiled, and where their code is kept: a folder of the user's, since an installed package may not be
written to.

Contractions to fused multiply-adds are not allowed (they would differ between processors), nor may numbers be infinite
or unknown. Compiled functions let other threads run.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

Kernel = TypeVar("Kernel", bound=Callable[..., Any])

FASTMATH = {"nnan", "ninf", "nsz"}


def cache_folder() -> Path:
    """The user's cache folder, or one among the temporary files where that cannot be written."""
    caches = os.environ.get("XDG_CACHE_HOME") or os.path.join(os.path.expanduser("~"), ".cache")
    folder = Path(caches) / "sleepcast" / "kernels"
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        writable = False
    else:
        writable = os.access(folder, os.W_OK)
    return folder if writable else Path(tempfile.gettempdir()) / f"sleepcast-kernels-{os.getuid()}"


_settings: Any = numba.config
if not _settings.CACHE_DIR:  # the person who set NUMBA_CACHE_DIR knows better
    _settings.CACHE_DIR = str(cache_folder())


def compiled(function: Kernel) -> Kernel:
    """A kernel; compiled when it is first called, and kept."""
    make = numba.njit(fastmath=FASTMATH, cache=True, nogil=True, error_model="numpy")
    return cast(Kernel, make(function))


def inlined(function: Kernel) -> Kernel:
    """A small function that becomes part of the kernels that call it."""
    make = numba.njit(fastmath=FASTMATH, cache=True, nogil=True, error_model="numpy", inline="always")
    return cast(Kernel, make(function))
