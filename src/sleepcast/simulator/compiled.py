"""Where compiled kernels are kept: a folder of the user's, since an installed package may not be written to.

Import `njit` from here, so that the folder is known before anything is compiled.
"""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

import numba
from numba import njit

__all__ = ["njit"]


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


if not numba.config.CACHE_DIR:  # the person who set NUMBA_CACHE_DIR knows better
    numba.config.CACHE_DIR = str(cache_folder())
