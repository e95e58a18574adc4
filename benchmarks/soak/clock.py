"""The clocks of all simulated computers: as many times faster than this machine's as is wanted, and each as wrong.

Every process of a run is started with `clock.c` before its other libraries: what it reads of the time of day and of the
time since the start, its sleeps and its timeouts follow a page of memory that all of them share, and that may change
while they run. So all clocks agree exactly whenever a process was started, time can go slower for a measurement that
needs this machine's own speed, and one computer's time of day can jump while its time since the start goes on, as when
an administrator sets it.
"""

from __future__ import annotations

import mmap
import shutil
import struct
import subprocess
import time
from pathlib import Path

SOURCE = Path(__file__).with_name("clock.c")
PAGE = struct.Struct("=Qdddd")
JUMP = struct.Struct("=d")


class ClockError(Exception):
    """The clocks cannot be made here; the text says why."""


class Clocks:
    """See the module. folder: where their files lie. Raises ClockError where C cannot be compiled."""

    def __init__(self, folder: Path) -> None:
        compiler = shutil.which("cc") or shutil.which("gcc")
        if compiler is None:
            raise ClockError("wanted a C compiler (cc or gcc), with which the clocks are made, and found none")
        self._folder = folder
        self.library = folder / "clock.so"
        done = subprocess.run(
            [compiler, "-O2", "-shared", "-fPIC", "-o", self.library, SOURCE, "-ldl", "-lpthread"],
            capture_output=True,
            text=True,
            check=False,
        )
        if done.returncode:
            raise ClockError(f"{SOURCE.name} cannot be compiled here: {done.stderr.strip().splitlines()[-1]}")
        now = time.monotonic()
        self._version, self._real, self._shown, self._rate = 0, now, now, 1.0
        self._epoch = time.time() - now
        self._page = _file(folder / "clock", PAGE.size)
        self._jumps: dict[str, mmap.mmap] = {}
        self._write()

    @property
    def rate(self) -> float:
        """How many times faster than this machine's they run."""
        return self._rate

    @rate.setter
    def rate(self, rate: float) -> None:
        now = time.monotonic()
        self._shown, self._real, self._rate = self._since_start(now), now, rate
        self._write()

    def now(self) -> float:
        """The time of day of computers whose clock is right, s of Unix time."""
        return self._since_start(time.monotonic()) + self._epoch

    def sleep(self, seconds: float) -> None:
        """Wait for so many of their seconds, while the rate stays as it is."""
        time.sleep(max(0.0, seconds) / self._rate)

    def jump(self, host: str, seconds: float) -> None:
        """From now on this computer's time of day is wrong by so much."""
        JUMP.pack_into(self._jump_of(host), 0, seconds)

    def environment(self, host: str) -> dict[str, str]:
        """Variables of a process on this computer."""
        self._jump_of(host)
        return {
            "LD_PRELOAD": str(self.library),
            "SOAK_CLOCK": str(self._folder / "clock"),
            "SOAK_JUMP": str(self._folder / f"{host}.jump"),
        }

    def _jump_of(self, host: str) -> mmap.mmap:
        if host not in self._jumps:
            self._jumps[host] = _file(self._folder / f"{host}.jump", JUMP.size)
        return self._jumps[host]

    def _since_start(self, real: float) -> float:
        return self._shown + self._rate * (real - self._real)

    def _write(self) -> None:
        """A reader that meets an odd number looks again."""
        self._version += 2
        struct.pack_into("=Q", self._page, 0, self._version - 1)
        struct.pack_into("=dddd", self._page, 8, self._real, self._shown, self._rate, self._epoch)
        struct.pack_into("=Q", self._page, 0, self._version)


def _file(path: Path, size: int) -> mmap.mmap:
    """A file of so many zeros, in memory for all who open it."""
    path.write_bytes(bytes(size))
    with path.open("r+b") as file:
        return mmap.mmap(file.fileno(), size)
