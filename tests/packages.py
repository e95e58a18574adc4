"""Packages that are installed for a test only: their metadata, and their modules."""

from __future__ import annotations

from pathlib import Path

import pytest


def install(folder: Path, monkeypatch: pytest.MonkeyPatch, package: str, entry_points: str, **modules: str) -> None:
    """Install a package there until the test has ended.

    folder: of its own, for `sys.path`.
    package: its name.
    entry_points: what it adds, as in `entry_points.txt`.
    modules: their texts by their names.
    """
    about = folder / f"{package.replace('-', '_')}-1.0.dist-info"
    about.mkdir(parents=True)
    (about / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {package}\nVersion: 1.0\n")
    (about / "entry_points.txt").write_text(entry_points)
    for name, text in modules.items():
        (folder / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(folder)
