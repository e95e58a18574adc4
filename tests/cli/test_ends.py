"""How commands end that are ended from outside, or cannot begin: SIGTERM as Ctrl-C, and too few files in a sentence."""

from __future__ import annotations

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from cli.calling import LONGEST
from cli.test_swarm import channel, swarm
from processes import SLEEPCAST, start

__all__ = ["channel"]


def ended(process: subprocess.Popen[str], sign: signal.Signals) -> tuple[int, str]:
    """The exit status after a signal, and what was said on standard error."""
    process.send_signal(sign)
    try:
        _, err = process.communicate(timeout=LONGEST)
    finally:
        process.kill()
    assert "Traceback" not in err
    return process.returncode, err


@pytest.mark.parametrize(("sign", "status"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
def test_a_swarm_tells_that_its_bodies_were_stopped(channel: str, sign: signal.Signals, status: int) -> None:
    with swarm(2, channel) as process:
        found, said = ended(process, sign)
    assert (found, "their bodies have been stopped" in said) == (status, True)


@pytest.mark.parametrize(
    ("arguments", "up", "said"),
    [
        (("node", "--body", "sim"), "is up", "its body has been stopped"),
        (("nserver", "--port", "0", "--headless"), "Ctrl-C ends it", ""),
        (("demo", "--no-browser", "--port", "0"), "Ctrl-C ends it", ""),
        (("console", "--no-browser", "--port", "0"), "Ctrl-C ends it", ""),
        (("stop", "--expect", "3"), "", "not confirmed by 3 of 3 robots"),
    ],
)
def test_sigterm_ends_a_command_as_ctrl_c_does(arguments: tuple[str, ...], up: str, said: str, channel: str) -> None:
    on_air = ("--channel", channel) if arguments[0] in ("console", "stop") else ()
    process = start(*SLEEPCAST, *arguments, *on_air)
    assert process.stdout is not None
    assert process.stderr is not None
    if up:
        while up not in (line := process.stdout.readline()):
            assert line, process.communicate()
    else:
        while "STOP goes out" not in (line := process.stderr.readline()):
            assert line
    status, err = ended(process, signal.SIGTERM)
    assert (status, said in err) == (143 if up else 1, True)


@pytest.mark.parametrize(
    "arguments",
    [
        ("node", "--body", "sim"),
        ("send", "--all", "(MARK)"),
        ("stop", "--timeout", "1"),
        ("watch", "--once"),
        ("console", "--no-browser", "--port", "0"),
        ("swarm", "2", "--seconds", "1"),
        ("demo", "--no-browser", "--port", "0"),
        ("nserver", "--port", "0", "--headless"),
    ],
)
def test_too_few_files_are_told_in_a_sentence(arguments: tuple[str, ...], channel: str, tmp_path: Path) -> None:
    on_air = () if arguments[0] in ("demo", "nserver") else ("--channel", channel)
    command = [sys.executable, "-m", "sleepcast", *arguments, *on_air]
    for most in (5, 8):
        done = (
            subprocess.run(
                ["sh", "-c", f'ulimit -n {most}; exec "$@"', "sh", *command],
                stdin=subprocess.DEVNULL,
                capture_output=True,
                text=True,
                timeout=LONGEST,
                check=False,
            )
            if most == 5 or arguments[0] in ("node", "send", "stop", "watch", "console")
            else None
        )
        if done is None or done.returncode == 0:  # some need no more than that
            continue
        assert done.returncode == 1, done.stderr
        assert "this process may open too few files and sockets at once" in done.stderr
        assert "Traceback" not in done.stderr
