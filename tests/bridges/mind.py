"""Programs that print, and take lines, as processes; `sleepcast node` among them."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from collections.abc import Iterable
from contextlib import AbstractContextManager
from pathlib import Path

import forkserver
from processes import running

PATIENCE = 60.0
"""Seconds that a busy machine may take."""
TIMES = 6
"""How often somebody says the same before he gives up."""


def quadcopter(
    port: int, charge: float = 80.0, patience: float = PATIENCE
) -> AbstractContextManager[subprocess.Popen[str]]:
    """A Crazyflie for tests, in a process of its own. It waits for setpoints as long as they do, or it would fall on a
    busy machine."""
    return running(
        sys.executable, Path(__file__).with_name("crazyflie_peer.py"), port, charge, patience, up="is at port"
    )


class Talking:
    """A process of our Python. screen: the file for what it prints. folder: where it runs, if not here. changes: of its
    environment."""

    def __init__(self, screen: Path, *command: object, folder: Path | None = None, **changes: str) -> None:
        self._screen, self._read = screen, 0
        with screen.open("w") as file:
            self._running = forkserver.Popen(
                [sys.executable, *map(str, command)],
                cwd=folder,
                env={**os.environ, **changes},
                stdin=subprocess.PIPE,
                stdout=file,
                stderr=subprocess.STDOUT,
                text=True,
            )

    def say(self, *lines: str) -> None:
        assert self._running.stdin is not None
        self._running.stdin.writelines(f"{line}\n" for line in lines)
        self._running.stdin.flush()

    def wait_for(self, *sentences: str) -> None:
        """Until all are printed, in any order, after what was waited for before."""
        assert self._sees(sentences, PATIENCE), f"waited for {sentences}\n{self.printed()}"
        text = self.printed()
        self._read = max(text.index(sentence, self._read) + len(sentence) for sentence in sentences)

    def insist(self, sentence: str, *lines: str) -> None:
        """Say these, again and again, until it is printed: a node that stood still for a second has lost its body."""
        for _ in range(TIMES):
            self.say(*lines)
            if self._sees((sentence,), PATIENCE / TIMES):
                break
        self.wait_for(sentence)

    def _sees(self, sentences: Iterable[str], seconds: float) -> bool:
        """Wait so long at most; gives whether all were printed."""
        end = time.monotonic() + seconds
        while not all(sentence in self.printed()[self._read :] for sentence in sentences):
            assert self._running.poll() is None, self.printed()
            if time.monotonic() > end:
                return False
            time.sleep(0.02)
        return True

    @property
    def pid(self) -> int:
        return self._running.pid

    def printed(self) -> str:
        return self._screen.read_text()

    def end(self, how: signal.Signals, status: int) -> None:
        """By this signal, after which it exits with this status."""
        self._running.send_signal(how)
        try:
            assert self._running.wait(PATIENCE) == status
        finally:
            self.kill()

    def close(self) -> None:
        self.kill()

    def kill(self) -> None:
        self._running.kill()
        self._running.communicate()


class Mind(Talking):
    """`sleepcast node` with this body."""

    def __init__(self, uri: str, folder: Path, *options: str) -> None:
        command = ("node", "--name", "v1", "--body", uri, "--no-store", *options)
        super().__init__(folder / "screen", "-m", "sleepcast", *command)

    def close(self) -> None:
        self.end(signal.SIGINT, 130)
