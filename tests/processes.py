"""Programs under test, each in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager

SLEEPCAST = ("env", "--default-signal=INT,TERM", sys.executable, "-m", "sleepcast")
"""The program as a shell starts it in the foreground: signals end it."""


def start(
    *command: object, stdin: int = subprocess.DEVNULL, stderr: int = subprocess.PIPE, **changes: str
) -> subprocess.Popen[str]:
    """A process whose output we read. changes: of its environment."""
    return subprocess.Popen(
        [str(word) for word in command],
        stdin=stdin,
        stdout=subprocess.PIPE,
        stderr=stderr,
        env={**os.environ, **changes},
        text=True,
    )


@contextmanager
def running(
    *command: object, up: str = "", stdin: int = subprocess.DEVNULL, stderr: int = subprocess.PIPE
) -> Iterator[subprocess.Popen[str]]:
    """The same, killed with the block. up: what its first line says, for which we wait."""
    with start(*command, stdin=stdin, stderr=stderr) as process:
        try:
            assert process.stdout is not None
            assert not up or up in process.stdout.readline()
            yield process
        finally:
            process.kill()
