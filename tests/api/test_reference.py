"""The reference of the Python API: every public name has a docstring, and the page is made without a warning."""

from __future__ import annotations

import inspect
import subprocess
import sys
from pathlib import Path

import pytest

import sleepcast as sc

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize("name", sc.__all__)
def test_every_public_name_says_what_it_is(name: str) -> None:
    found = getattr(sc, name)
    assert inspect.getdoc(found)
    if inspect.isclass(found):
        for key in dir(found):
            member = inspect.getattr_static(found, key)
            if not key.startswith("_") and (inspect.isroutine(member) or isinstance(member, property)):
                assert inspect.getdoc(getattr(found, key) if inspect.isroutine(member) else member), f"{name}.{key}"


def test_the_reference_is_made(tmp_path: Path) -> None:
    command = [sys.executable, str(ROOT / "docs" / "reference.py"), str(tmp_path)]
    made = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (made.returncode, made.stderr) == (0, "")
    page = (tmp_path / "sleepcast.html").read_text(encoding="utf-8")
    assert all(f'id="{name}"' in page for name in sc.__all__ if not inspect.ismodule(getattr(sc, name)))
