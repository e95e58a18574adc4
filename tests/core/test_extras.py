"""What a sentence says that misses a library: a command that works here, before sleepcast is on a package index."""

from __future__ import annotations

import re
import shlex
import sys
import tomllib
from pathlib import Path

import pytest

from sleepcast.core import extras
from sleepcast.core.extras import installing

ROOT = Path(__file__).resolve().parents[2]
EXTRAS = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["optional-dependencies"]


@pytest.fixture
def clone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "my clone"
    (folder / ".venv").mkdir(parents=True)
    (folder / "go.py").touch()
    monkeypatch.setattr(extras, "CLONE", folder)
    monkeypatch.setattr(sys, "prefix", str(folder / ".venv"))
    return folder


def test_in_a_clone_go_py_installs_into_its_environment(clone: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(clone)
    assert installing("gym") == "python3 go.py with gym"
    monkeypatch.chdir(clone.parent)
    assert shlex.split(installing("gym")) == ["python3", str(clone / "go.py"), "with", "gym"]


@pytest.mark.parametrize("extra", EXTRAS)
def test_elsewhere_pip_is_told_the_libraries(extra: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "prefix", "/elsewhere")
    assert shlex.split(installing(extra)) == [sys.executable, "-m", "pip", "install", *EXTRAS[extra]]


def test_nothing_else_says_how_to_install_an_extra() -> None:
    """Neither a sentence nor a page promises what only works with a package index that has sleepcast."""
    pages = [*ROOT.glob("README.md"), *ROOT.glob("docs/**/*.md"), *ROOT.glob("examples/**/*.ipynb")]
    files = [*pages, *ROOT.glob("src/**/*.py"), *ROOT.glob("examples/**/*.md")]
    assert [
        file.name for file in files if re.search(r"pip\s+install \\?[\"']?sleepcast\b(?!-)", file.read_text())
    ] == []
    assert [file.name for file in files if "sleepcast[" in file.read_text()] == ["extras.py"]
