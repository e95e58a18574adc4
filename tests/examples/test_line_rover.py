"""The example of a bridge passes the contract of every bridge, as its own test says. That it can be installed and is
found by its scheme, `tests/test_howto.py` shows."""

from __future__ import annotations

import sys
from pathlib import Path

EXAMPLE = Path(__file__).resolve().parents[2] / "examples" / "line_rover"

sys.path.insert(0, str(EXAMPLE))
try:
    from test_line_rover import TestLineRover  # type: ignore[import-not-found]
finally:
    sys.path.remove(str(EXAMPLE))

__all__ = ["TestLineRover"]
