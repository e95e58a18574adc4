"""A command at a terminal of its own: what a person would type and see."""

from __future__ import annotations

import contextlib
import os
import pty
import re
import select
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from fcntl import ioctl
from pathlib import Path
from struct import pack
from termios import TIOCSWINSZ

import forkserver
from cli.picture import Picture

PATIENCE = 120.0
"""Seconds to wait for what should appear at once; other work on the machine can make it slow."""
_CONTROLS = re.compile(rb"\x1b\[[0-9;?]*[A-Za-z]|\x1b[=>()][A-Z0-9]?|\r")


class Terminal:
    """A running `python -m sleepcast ...`; `screen` is all that it has shown, without control sequences,
    `picture` what is seen now."""

    def __init__(self, process: subprocess.Popen[bytes], master: int, picture: Picture) -> None:
        self.process, self.screen, self.picture = process, "", picture
        self._master = master
        self._looked = 0

    def type(self, text: str) -> None:
        """Press keys."""
        os.write(self._master, text.encode())

    def wait_for(self, text: str) -> str:
        """Wait until `text` appears after what was waited for before; gives what has appeared since."""
        end = time.monotonic() + PATIENCE
        while (found := self.screen.find(text, self._looked)) < 0:
            if not self._read(end - time.monotonic()):
                raise AssertionError(f"{text!r} did not appear; the screen:\n{self.screen}")
        since = self.screen[self._looked : found + len(text)]
        self._looked = found + len(text)
        return since

    def wait_to_see(self, *texts: str) -> list[str]:
        """Wait until all these are seen at once; gives the lines of the screen."""
        return self.wait_until(lambda picture: all(text in picture for text in texts), f"{texts} at once")

    def wait_until(self, seen: Callable[[str], object], what: str) -> list[str]:
        """Wait until the screen is as `seen` wants it, which is told as `what`; gives its lines."""
        end = time.monotonic() + PATIENCE
        while not seen(str(self.picture)):
            if not self._read(end - time.monotonic()):
                raise AssertionError(f"not seen: {what}; the screen:\n{self.picture}")
        return self.picture.lines

    def press_until(self, key: str, *texts: str) -> None:
        """Press a key, time and again, until all these are seen at once: two presses too near to each other count as
        one."""
        end = time.monotonic() + PATIENCE
        while not all(text in str(self.picture) for text in texts):
            assert time.monotonic() < end, f"not seen: {texts} at once; the screen:\n{self.picture}"
            self.type(key)
            until = time.monotonic() + 1.0
            while (left := until - time.monotonic()) > 0.0 and not all(text in str(self.picture) for text in texts):
                self._read(left)

    def interrupt(self) -> None:
        """Ctrl-C for a program that does not read keys itself."""
        self.process.send_signal(signal.SIGINT)

    def status(self) -> int:
        """Wait for the end; the exit status."""
        end = time.monotonic() + PATIENCE
        while self._read(end - time.monotonic()):
            assert time.monotonic() < end, f"it does not end; the screen:\n{self.screen}"
        return self.process.wait(PATIENCE)

    def _read(self, seconds: float) -> bool:
        ready, _, _ = select.select([self._master], [], [], max(0.0, seconds))
        data = b""
        if ready:
            with contextlib.suppress(OSError):  # the other side is gone
                data = os.read(self._master, 65_536)
        # A terminal is asked where its cursor is, and must answer.
        for _ in range(data.count(b"\x1b[6n")):
            os.write(self._master, b"\x1b[1;1R")
        self.picture.feed(data)
        self.screen += _CONTROLS.sub(b"", data).decode(errors="replace")
        return bool(data)


@contextlib.contextmanager
def terminal(
    arguments: Sequence[str],
    home: Path,
    extra: Mapping[str, str] | None = None,
    size: tuple[int, int] = (120, 40),
) -> Iterator[Terminal]:
    """`python -m sleepcast ARGUMENTS` with a terminal of `size` columns and lines, and a home folder of its own."""
    columns, lines = size
    master, slave = pty.openpty()
    ioctl(slave, TIOCSWINSZ, pack("HHHH", lines, columns, 0, 0))
    environment = {**os.environ, "TERM": "xterm-256color", "HOME": str(home), **(extra or {})}
    environment.pop("XDG_DATA_HOME", None)
    process = forkserver.Popen(
        [sys.executable, "-m", "sleepcast", *arguments],
        stdin=slave,
        stdout=slave,
        stderr=slave,
        env=environment,
        start_new_session=True,
    )
    os.close(slave)
    try:
        yield Terminal(process, master, Picture(columns, lines))
    finally:
        if process.poll() is None:
            process.kill()
        process.wait()
        os.close(master)
