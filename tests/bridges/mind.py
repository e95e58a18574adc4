"""`sleepcast node` as a process, with what it prints."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

PATIENCE = 60.0
"""Seconds that a busy machine may take."""


class Mind:
    """`sleepcast node` with this body, as a process."""

    def __init__(self, uri: str, folder: Path, *options: str) -> None:
        self._screen, self._read = folder / "screen", 0
        with self._screen.open("w") as screen:
            command = ("node", "--name", "v1", "--body", uri, "--no-store", *options)
            self._running = subprocess.Popen(
                [sys.executable, "-m", "sleepcast", *command],
                stdin=subprocess.PIPE,
                stdout=screen,
                stderr=subprocess.STDOUT,
                text=True,
            )

    def say(self, *lines: str) -> None:
        assert self._running.stdin is not None
        self._running.stdin.writelines(f"{line}\n" for line in lines)
        self._running.stdin.flush()

    def wait_for(self, sentence: str) -> None:
        """Until this is printed, after what was waited for before."""
        end = time.monotonic() + PATIENCE
        while (found := self._screen.read_text().find(sentence, self._read)) < 0:
            assert self._running.poll() is None, self._screen.read_text()
            assert time.monotonic() < end, f"waited for {sentence}\n{self._screen.read_text()}"
            time.sleep(0.02)
        self._read = found + len(sentence)

    def printed(self) -> str:
        return self._screen.read_text()

    def close(self) -> None:
        self._running.send_signal(signal.SIGINT)
        try:
            assert self._running.wait(PATIENCE) == 130
        finally:
            self._running.kill()
            self._running.communicate()
