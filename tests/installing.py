"""Packages of the examples, installed without the network where a test wants them."""

from __future__ import annotations

import shutil
import subprocess
import sys
from pathlib import Path

PIP = (sys.executable, "-m", "pip", "--disable-pip-version-check", "install", "--quiet")
OFFLINE = ("--no-index", "--no-deps", "--no-build-isolation")


def install(package: Path, folder: Path) -> None:
    """Build a copy of a package and install it into a folder of Python's path; its programs are in `bin` there."""
    copy = folder / "source" / package.name
    shutil.copytree(package, copy, ignore=shutil.ignore_patterns("__pycache__", "dist"))
    done = subprocess.run([*PIP, *OFFLINE, "--target", folder, copy], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
