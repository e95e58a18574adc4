"""Packages of the examples, installed without the network where a test wants them; environments that borrow of ours."""

from __future__ import annotations

import shutil
import subprocess
import sys
import sysconfig
import venv
from pathlib import Path

PIP = (sys.executable, "-m", "pip", "--disable-pip-version-check", "install", "--quiet")
OFFLINE = ("--no-index", "--no-deps", "--no-build-isolation")


def install(package: Path, folder: Path) -> None:
    """Build a copy of a package and install it into a folder of Python's path; its programs are in `bin` there."""
    copy = folder / "source" / package.name
    shutil.copytree(package, copy, ignore=shutil.ignore_patterns("__pycache__", "dist"))
    done = subprocess.run([*PIP, *OFFLINE, "--target", folder, copy], capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr


def borrowing(folder: Path, library: str = "") -> None:
    """Make an environment that borrows all our libraries, or this one: to install pip takes five seconds."""
    venv.EnvBuilder(symlinks=True).create(folder)
    (site,) = folder.glob("lib/python*/site-packages")
    ours = Path(sysconfig.get_path("purelib"))
    if library:
        (site / library).symlink_to(ours / library)
    else:  # path files in a folder named by a path file are not followed: our editable install stays behind
        (site / "libraries.pth").write_text(str(ours))


def with_pip(folder: Path, **_: object) -> None:
    """Make an environment that has nothing but pip."""
    borrowing(folder, "pip")
