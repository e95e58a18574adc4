"""The example of a bridge passes the contract of every bridge, as its own test says. That it can be installed and is
found by its scheme, `tests/test_howto.py` shows."""

from __future__ import annotations

import re
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
EXAMPLE = ROOT / "examples" / "line_rover"

sys.path.insert(0, str(EXAMPLE))
try:
    from test_line_rover import TestLineRover  # type: ignore[import-not-found]
finally:
    sys.path.remove(str(EXAMPLE))

__all__ = ["TestLineRover"]


@pytest.mark.parametrize(("sort", "file"), [("py", "line_page.py"), ("js", "line_static/charge.js")])
def test_the_how_to_shows_the_example_as_it_is(sort: str, file: str) -> None:
    """`console/test_page_added.py` opens a page with it."""
    page = (ROOT / "docs" / "howto" / "write-a-plug-in.md").read_text(encoding="utf-8")
    (shown,) = re.findall(rf"^```{sort}\n(.*?)^```$", page, re.MULTILINE | re.DOTALL)
    assert (EXAMPLE / file).read_text(encoding="utf-8").endswith(f"\n\n{shown}")
