"""Calling the command as a shell does: a process of its own, its two streams and its exit status; or, for one of many
calls that differ in a word, the same command in this process."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from io import BytesIO, TextIOWrapper
from pathlib import Path
from typing import TypeVar

import pytest

import forkserver
from sleepcast.cli import main

Found = TypeVar("Found")

LONGEST = 600.0
"""Seconds that a call may take before it counts as hanging: some take half a minute of a quiet processor, and a busy
one has a twentieth of itself for each."""


@dataclass(frozen=True)
class Called:
    """What came of a call."""

    status: int
    out: str
    err: str


def called(*arguments: str | bytes, typed: str | bytes = b"", folder: Path | None = None) -> Called:
    """`python -m sleepcast ARGUMENTS` in `folder`, with `typed` on its standard input."""
    done = forkserver.run(
        [sys.executable, "-m", "sleepcast", *arguments],
        input=typed.encode() if isinstance(typed, str) else typed,
        capture_output=True,
        timeout=LONGEST,
        cwd=folder,
    )
    return Called(done.returncode, done.stdout.decode(), done.stderr.decode())


def called_here(capsys: pytest.CaptureFixture[str], *arguments: str) -> Called:
    """The same without a process of its own, which takes half a second of the processor to load its libraries. For what
    is refused: an exception that the command lets out is the test's."""
    status = main(arguments)
    said = capsys.readouterr()
    return Called(status, said.out, said.err)


def called_warm(*arguments: str) -> Called:
    """The same with nothing typed, in this process: for one of many calls, of which each would take most of its time to
    load the same libraries once more."""
    streams = [TextIOWrapper(BytesIO(), encoding="utf-8", write_through=True) for _ in range(3)]
    with pytest.MonkeyPatch.context() as patch:
        for name, stream in zip(("stdin", "stdout", "stderr"), streams, strict=True):
            patch.setattr(sys, name, stream)
        status = main(arguments)
    out, err = (stream.buffer.getvalue().decode() for stream in streams[1:])  # type: ignore[attr-defined]
    return Called(status, out, err)


def again_until(wanted: Callable[[Found], object], call: Callable[[], Found]) -> Found:
    """What a call gives, made again until it is as wanted: robots of a busy machine may be too late for one."""
    end = time.monotonic() + LONGEST
    while not wanted(found := call()):
        assert time.monotonic() < end, found
    return found
