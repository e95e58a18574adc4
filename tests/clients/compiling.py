"""Building clients/c in a folder of its own, with the compiler of this machine, in the ways that a test asks for."""

from __future__ import annotations

import os
import shutil
import subprocess
from dataclasses import dataclass
from pathlib import Path

import pytest

CLIENTS = Path(__file__).resolve().parents[2] / "clients" / "c"
SOURCES = Path(__file__).resolve().parent / "c"
STRICT = "-O1 -std=c89 -pedantic -Wall -Wextra -Wshadow -Werror"
WAYS = {"native": "", "32 bit": "-m32", "watched": "-g -fsanitize=address,undefined -fno-sanitize-recover=all"}
"""Flags of each way: as it comes, for machines whose long has four bytes, and watched at every access to memory."""


def in_ways(*ways: str) -> list[object]:
    """Parameters for these ways; for machines whose long has four bytes only at night."""
    return [pytest.param(way, marks=[pytest.mark.nightly] * (way == "32 bit")) for way in ways]


@dataclass(frozen=True)
class Workshop:
    """A copy of clients/c with its library built in one way."""

    folder: Path
    flags: str

    def make(self, target: str, flags: str = STRICT) -> None:
        """`make TARGET`; any warning fails."""
        done = subprocess.run(
            ["make", "-s", f"CFLAGS={flags} {self.flags}", target],
            cwd=self.folder,
            env=quiet_environment(),
            capture_output=True,
            text=True,
            check=False,
        )
        assert (done.returncode, done.stderr) == (0, ""), done.stdout + done.stderr

    def program(self, source: Path, flags: str = STRICT) -> Path:
        """A program of one file, with the library; built when it is first asked for."""
        made = self.folder / "built" / source.stem
        if made.exists():
            return made
        made.parent.mkdir(exist_ok=True)
        command = ["cc", *flags.split(), *self.flags.split(), "-I.", "-o", str(made), str(source), "libNclient.a"]
        done = subprocess.run(command, cwd=self.folder, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        return made


def quiet_environment() -> dict[str, str]:
    """This process's, without what a make that started it would tell the one that it starts."""
    return {name: value for name, value in os.environ.items() if not name.startswith("MAKE") and name != "MFLAGS"}


def buildable(folder: Path, way: str) -> bool:
    """Whether this machine builds programs in this way, and runs them."""
    trial = folder / "trial.c"
    trial.write_text('#include <stdio.h>\nint main(void) { return puts("") < 0; }\n')
    command = ["cc", *WAYS[way].split(), "-o", str(folder / "trial"), str(trial)]
    if subprocess.run(command, capture_output=True, check=False).returncode != 0:
        return False
    return subprocess.run([folder / "trial"], capture_output=True, check=False).returncode == 0


def workshop(folder: Path, *ways: str) -> Workshop:
    """A fresh one, in the first of these ways that this machine knows. Where it knows none the test is skipped; where
    it has no compiler at all, CI fails."""
    if shutil.which("cc") is None or shutil.which("make") is None:
        if os.environ.get("CI"):
            pytest.fail("CI has no C compiler, so nobody has tried clients/c: install gcc and make")
        pytest.skip("there is no C compiler here: install gcc and make to test clients/c")
    way = next((way for way in ways if buildable(folder, way)), None)
    if way is None:
        pytest.skip(f"this machine's cc builds nothing with {' or '.join(WAYS[way] for way in ways)}")
    made = Workshop(folder / "c", WAYS[way])
    shutil.copytree(CLIENTS, made.folder, ignore=shutil.ignore_patterns("*.o", "*.a"))
    made.make("libNclient.a")
    return made
