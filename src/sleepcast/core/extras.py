"""How to install, here, the libraries of an extra: what every sentence says that misses one.

A clone fills its own environment. Anywhere else pip takes the libraries by their names: to ask it for `sleepcast[gym]`
works only where a package index has sleepcast.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

CLONE = Path(__file__).resolve().parents[3]
"""The folder of go.py, if this is a clone."""


def installing(extra: str) -> str:
    """The command that installs an extra of pyproject.toml for this Python."""
    import shlex  # of use only where something is missing

    if (CLONE / "go.py").is_file() and Path(sys.prefix).resolve() == CLONE / ".venv":  # which go.py has made
        go = "go.py" if Path.cwd() == CLONE else shlex.quote(str(CLONE / "go.py"))
        return f"python3 {go} with {extra}"
    wanted = " ".join(map(shlex.quote, _libraries(extra) or [f"sleepcast[{extra}]"]))
    return f"{shlex.quote(sys.executable)} -m pip install {wanted}"


def _libraries(extra: str) -> list[str]:
    """What the installed sleepcast says that the extra needs; nothing where it is not installed but only found."""
    from importlib.metadata import PackageNotFoundError, requires

    try:
        needs = requires("sleepcast") or []
    except PackageNotFoundError:
        return []
    halves = (each.split(";") for each in needs if re.search(rf"\bextra\s*==\s*['\"]{extra}['\"]", each))
    return [name.strip() for name, *_ in halves]
