"""A process that is forked is like one that is started: what the system knows of it, what it says, and how it ends."""

from __future__ import annotations

import os
import resource
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import forkserver
from cli.calling import LONGEST
from processes import SLEEPCAST

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="processes are forked on Linux only")

Start = Callable[..., subprocess.Popen[str]]
TYPED = "(+ 1 2)\n(+ größe 1)\n(DRIVE\n"
SIGNALS = ("SigBlk", "SigIgn", "SigCgt")
STREAMS: dict[str, Any] = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE) | {"text": True}


def known(process: subprocess.Popen[str]) -> dict[str, object]:
    """What the system tells of a process that waits for input."""
    place = Path("/proc", str(process.pid))
    state, parent, group, session = place.joinpath("stat").read_text().rpartition(") ")[2].split()[:4]
    status = dict(line.split(":\t", 1) for line in place.joinpath("status").read_text().splitlines())
    return {
        "state": state,
        "parent": int(parent),
        "group": "its own" if int(group) == process.pid else int(group),
        "session": "its own" if int(session) == process.pid else int(session),
        "signals": [status[name] for name in SIGNALS],
        "folder": place.joinpath("cwd").readlink(),
        "limits": place.joinpath("limits").read_text(),
        "open": sorted(os.listdir(place / "fd")),
    }


def caught(process: subprocess.Popen[str]) -> set[int]:
    """The signals that a process minds."""
    mask = int(Path("/proc", str(process.pid), "status").read_text().partition("SigCgt:")[2].split()[0], 16)
    return {number for number in signal.valid_signals() if mask >> number - 1 & 1}


def waits(start: Start, **options: Any) -> dict[str, object]:
    """What is known of `sleepcast repl` when it waits for its second line."""
    with start([*SLEEPCAST, "repl"], **STREAMS, **options) as process:
        try:
            process.stdin.write("(+ 1 2)\n")
            process.stdin.flush()
            assert process.stdout.readline() == "3\n"
            while (found := known(process))["state"] != "S":
                pass
            return found
        finally:
            process.kill()


@pytest.mark.parametrize("session", [False, True])
def test_the_system_knows_the_same_of_both(session: bool, tmp_path: Path) -> None:
    before = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (100, before[1]))
    try:
        forked, started = (
            waits(start, cwd=tmp_path, start_new_session=session) for start in (forkserver.Popen, subprocess.Popen)
        )
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, before)
    assert forked == started
    assert forked["parent"] == os.getpid()
    assert forked["folder"] == tmp_path


@pytest.mark.parametrize(
    "words",
    [
        ["repl"],
        ["eval", "-"],
        ["eval", "(+ 1 2", "--json"],
        ["no-such-command"],
        ["run", "crowd", "--density", "0"],
        ["run", "--help"],
    ],
)
def test_both_say_the_same_and_end_alike(words: list[str], tmp_path: Path) -> None:
    command, surroundings = [sys.executable, "-m", "sleepcast", *words], {**os.environ, "HOME": str(tmp_path)}
    forked = forkserver.run(command, input=TYPED, capture_output=True, text=True, cwd=tmp_path, env=surroundings)
    started = subprocess.run(
        command, input=TYPED, capture_output=True, text=True, cwd=tmp_path, env=surroundings, check=False
    )
    assert (forked.returncode, forked.stdout, forked.stderr) == (started.returncode, started.stdout, started.stderr)


@pytest.mark.parametrize(("sign", "status"), [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGKILL, -9)])
def test_signals_end_it(sign: signal.Signals, status: int) -> None:
    with forkserver.Popen([*SLEEPCAST, "run", "flood", "--seconds", "100000", "--quiet"], **STREAMS) as process:
        while signal.SIGTERM not in caught(process):
            assert process.poll() is None
        process.send_signal(sign)
        _, err = process.communicate(timeout=LONGEST)
    assert process.returncode == status
    assert "Traceback" not in err


def test_what_is_read_before_a_program_begins_is_read(tmp_path: Path) -> None:
    """A variable for the interpreter, and another program, are none of the server's."""
    command = [sys.executable, "-m", "sleepcast", "eval", "1"]
    said = forkserver.run(
        command, env={**os.environ, "PYTHONVERBOSE": "1"}, capture_output=True, text=True, timeout=LONGEST
    )
    assert (said.returncode, said.stdout) == (0, "1\n")
    assert "import 'site'" in said.stderr
    assert forkserver.run([sys.executable, "-c", "print(2)"], capture_output=True, text=True).stdout == "2\n"


COMMAND = """
import sys, warnings, click
@click.command()
def hello():
    warnings.warn("which is not told")
    print(sys.path[:2], sys.warnoptions)
"""


def test_what_the_server_lacks_is_done_afterwards(tmp_path: Path) -> None:
    """A command of a package that lies in a folder of Python's path, with a filter for its warnings."""
    (tmp_path / "greeting.py").write_text(COMMAND)
    (tmp_path / "greeting-1.0.dist-info").mkdir()
    (tmp_path / "greeting-1.0.dist-info" / "METADATA").write_text(
        "Metadata-Version: 2.1\nName: greeting\nVersion: 1.0\n"
    )
    (tmp_path / "greeting-1.0.dist-info" / "entry_points.txt").write_text(
        "[sleepcast.commands]\nhello = greeting:hello\n"
    )
    surroundings = {**os.environ, "PYTHONPATH": str(tmp_path), "PYTHONWARNINGS": "ignore"}
    how: dict[str, Any] = {"env": surroundings, "cwd": tmp_path.parent, "capture_output": True, "text": True}
    assert forkserver.is_alike(surroundings)
    command = forkserver.in_shell("sleepcast hello")
    forked, started = forkserver.run(command, **how), subprocess.run(command, **how, check=False)
    assert str(tmp_path) in forked.stdout, forked.stderr
    assert (forked.returncode, forked.stdout, forked.stderr) == (started.returncode, started.stdout, started.stderr)


@pytest.mark.parametrize("line", ["sleepcast eval 1 | cat", "sleepcast eval 1 2>&1", "echo $(sleepcast eval 1)"])
def test_what_needs_a_shell_has_one(line: str) -> None:
    assert forkserver.in_shell(line)[-3:] == ["bash", "-c", line]
    surroundings = {**os.environ, "PATH": f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"}
    done = forkserver.run(forkserver.in_shell(line), capture_output=True, text=True, env=surroundings)
    assert (done.stdout, done.stderr) == ("1\n", "")


def test_a_program_that_fails_or_hangs_is_told_of() -> None:
    command = [sys.executable, "-m", "sleepcast", "eval", "(+ 1"]
    with pytest.raises(subprocess.CalledProcessError):
        forkserver.run(command, capture_output=True, check=True)
    with pytest.raises(subprocess.TimeoutExpired):
        forkserver.run([*command[:3], "run", "flood", "--seconds", "100000"], capture_output=True, timeout=0.2)
    with pytest.raises(FileNotFoundError, match="nowhere"):
        forkserver.run(command, cwd="/nowhere")
