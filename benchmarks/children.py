"""Measuring in a process of its own: nothing that ran before is in its memory, its caches or its thread pools.

A child is a module of this folder; it prints one JSON object as its last line, or fails, and its parent is told why.
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

from benchmarks.report import Json

ROOT = Path(__file__).resolve().parent.parent


class ChildError(Exception):
    """A child gave no result. The text says why, in a few words."""


def child(
    module: str,
    *arguments: str,
    limit: float,
    environment: Mapping[str, str] | None = None,
    python: str = sys.executable,
) -> Json:
    """What the module says of itself, after at most `limit` s. environment: variables to add. python: which one runs
    it. Raises ChildError."""
    try:
        done = subprocess.run(
            [python, "-m", module, *arguments],
            cwd=ROOT,
            env={**os.environ, **(environment or {})},
            capture_output=True,
            text=True,
            timeout=limit,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise ChildError(f"no result within {limit:g} s") from None
    if done.returncode:
        said = [line for line in done.stderr.splitlines() if line and not line[0].isspace()]
        raise ChildError(said[-1] if said else f"ended with {done.returncode}")
    found: Json = json.loads(done.stdout.splitlines()[-1])
    return found


def answer(measure: Callable[..., object]) -> None:
    """As a child: print what comes of the arguments in a JSON object. "numba": false hides numba and llvmlite."""
    wanted = json.loads(sys.argv[1])
    if not wanted.pop("numba"):
        for library in ("numba", "llvmlite"):
            sys.modules[library] = None  # type: ignore[assignment]  # whoever imports it is told that it is not there
    print(json.dumps(measure(**wanted)))
