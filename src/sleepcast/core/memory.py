"""How much memory this process takes; sizes as people write them: 300MB; sets that are kept once."""

from __future__ import annotations

import os
import re
import sys
from functools import lru_cache
from pathlib import Path

_STATM = Path("/proc/self/statm")
_UNITS = {"kb": 1e3, "mb": 1e6, "gb": 1e9}
_SIZE = re.compile(r"(\d{1,9}(?:\.\d{1,9})?)\s*(kb|mb|gb)", re.IGNORECASE)


def read_size(text: str) -> float | None:
    """Bytes of `100MB` or `1.5 GB`; None for what is no size."""
    match = _SIZE.fullmatch(text.strip())
    return float(match[1]) * _UNITS[match[2].lower()] if match else None


def shown_size(size: float) -> str:
    """Bytes as people read them: 300 MB."""
    return f"{size / 1e6:,.0f} MB"


def process_in_words() -> str:
    """How much memory this process takes, as a sentence; "" where nobody knows."""
    if _STATM.exists():
        size = int(_STATM.read_text(encoding="ascii").split()[1]) * os.sysconf("SC_PAGE_SIZE")
        return f"This program takes {shown_size(size)} in all."
    if sys.platform == "win32":
        return ""
    import resource  # only on Unix

    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * (1 if sys.platform == "darwin" else 1024)
    return f"This program has taken up to {shown_size(most)} in all."


@lru_cache(maxsize=256)
def same(numbers: frozenset[int]) -> frozenset[int]:
    """One and the same set for equal ones, which many worlds have in common."""
    return numbers
