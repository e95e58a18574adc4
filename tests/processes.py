"""Programs under test, each in a process of its own."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

import forkserver

SLEEPCAST = ("env", "--default-signal=INT,TERM", sys.executable, "-m", "sleepcast")
"""The program as a shell starts it in the foreground: signals end it."""


def live_in(home: Path, patch: pytest.MonkeyPatch) -> None:
    """Keys, and what a desk remembers, lie in this folder: the home of a user who has none yet."""
    patch.setenv("HOME", str(home))
    for name in ("XDG_CONFIG_HOME", "XDG_DATA_HOME"):
        patch.delenv(name, raising=False)


def start(
    *command: object, stdin: int = subprocess.DEVNULL, stderr: int = subprocess.PIPE, **changes: str
) -> subprocess.Popen[str]:
    """A process whose output we read. changes: of its environment."""
    return forkserver.Popen(
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


TAK_SETTINGS = """
[taky]
hostname = localhost
bind_ip = 127.0.0.1
public_ip = 127.0.0.1
root_dir = {folder}
[cot_server]
port = {port}
[dp_server]
upload_path = {folder}
[ssl]
enabled = false
"""


@contextmanager
def tak_server(folder: Path, port: int) -> Iterator[subprocess.Popen[bytes]]:
    """A TAK server that takes connections."""
    (folder / "taky.conf").write_text(TAK_SETTINGS.format(folder=folder, port=port))
    command = (Path(sys.executable).with_name("taky"), "-c", folder / "taky.conf")
    with subprocess.Popen(command, stderr=subprocess.DEVNULL) as server:
        try:
            yield server
        finally:
            server.kill()
