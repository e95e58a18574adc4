"""The programs in clients/python, as processes, against the real server and each other."""

from __future__ import annotations

import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path

import pytest

from nomad.serving import LONGEST, Served, empty_room, serving
from processes import running
from sleepcast.channel.plain_datagrams import Datagrams, send
from sleepcast.nomad.client.nomad import Nomad
from sleepcast.nomad.world.nomad_world import NomadWorld

PROGRAMS = Path(__file__).resolve().parent.parent.parent / "clients" / "python"
WALL = [(1.2, -1.0), (1.4, -1.0), (1.4, 1.0), (1.2, 1.0)]
START = "import runpy, signal, sys; signal.signal(signal.SIGINT, signal.default_int_handler); \
sys.argv.pop(0); sys.path.insert(0, {folder!r}); runpy.run_path(sys.argv[0], run_name='__main__')"
"""A program that hears Ctrl-C whatever its parent is told."""


@pytest.fixture
def world() -> NomadWorld:
    return empty_room()


@pytest.fixture
def served(world: NomadWorld) -> Iterator[Served]:
    with serving(world, lockstep=True, headless=True) as found:
        yield found


def started(program: str, *arguments: str | int, typed: bool = False) -> AbstractContextManager[subprocess.Popen[str]]:
    """A running program."""
    command = (sys.executable, "-c", START.format(folder=str(PROGRAMS)), PROGRAMS / f"{program}.py", *arguments)
    return running(*command, stdin=subprocess.PIPE if typed else subprocess.DEVNULL)


def ended(process: subprocess.Popen[str]) -> tuple[int, str, str]:
    out, err = process.communicate(timeout=LONGEST)
    assert "Traceback" not in err, err
    return process.returncode, out, err


def run(program: str, *arguments: str | int) -> tuple[int, str, str]:
    with started(program, *arguments) as process:
        return ended(process)


def line(stream: object) -> str:
    found: str = stream.readline()  # type: ignore[attr-defined]
    return found


def free_port() -> int:
    with Datagrams("127.0.0.1", 0) as ear:
        return ear.port


def until(true: Callable[[], object]) -> None:
    deadline = time.monotonic() + LONGEST
    while not true():
        assert time.monotonic() < deadline
        time.sleep(0.01)


def test_tune_up_goes_about_and_touches_nothing(served: Served, world: NomadWorld) -> None:
    with Nomad.connect("127.0.0.1", served.port) as nomad:
        nomad.put_up(WALL)
    status, out, err = run("tune_up", "-p", served.port, "-n", 60, "-w", 0)
    assert (status, err) == (0, "")
    assert re.fullmatch(r"robot 1 is at \d+, -?\d+; it touched something 0 times\n", out)
    commands = [text for _, text in served.nserver.windows.robots[0].commands]
    assert "vm(75, 75, 0)" in commands  # it was clear
    assert "vm(52, -22, 0)" in commands  # ... and then it was not
    assert commands[-1] == "st()"


def test_rob_stops_within_ten_inches_once_it_has_been_told(served: Served, world: NomadWorld) -> None:
    with Nomad.connect("127.0.0.1", served.port) as nomad:
        nomad.put_up(WALL)
    port = free_port()
    with started("rob", "-p", served.port, "-r", 1, "-d", port, "-w", 0, "-q") as process:
        assert line(process.stdout) == f"robot 1 wanders and listens at port {port}\n"
        until(lambda: world.time > 1.0)
        send((1.0, 2.0, 3.0), ("127.0.0.1", port))
        status, out, err = ended(process)
    assert (status, err) == (0, "")
    told, stopped = out.splitlines()
    assert told == "robot 1 was told 1.00 2.00 3.00"
    match = re.fullmatch(r"robot 1 stopped with (\d+) in ahead", stopped)
    assert match
    assert 6 <= int(match[1]) < 10
    assert world.observe(0).speeds[:2] == (0.0, 0.0)


def test_ctrl_c_leaves_a_robot_at_rest(world: NomadWorld) -> None:
    with serving(world, speed=1.0, headless=True) as served:
        with started("rob", "-p", served.port, "-d", free_port()) as process:
            until(lambda: world.observe(0).speeds[0] > 0.1)
            process.send_signal(signal.SIGINT)
            status, _, err = ended(process)
        assert (status, err) == (0, "")
        until(lambda: world.observe(0).speeds[:2] == (0.0, 0.0))


def test_numbers_go_from_program_to_program() -> None:
    port = free_port()
    with started("socket_read", port, 3) as reader:
        assert line(reader.stderr) == f"Listening at port {port}.\n"
        assert run("socket_send", "1.5", "-2", "3e2", "127.0.0.1", port) == (0, "", "")
        assert run("brdcst", 0, 0, 7, port, f"127.0.0.1:{port}") == (0, "", "")
        status, out, _ = ended(reader)
    broadcast = "        0.00         0.00         7.00\n"
    assert (status, out) == (0, "        1.50        -2.00       300.00\n" + 2 * broadcast)


def test_the_shell_sends_and_hears() -> None:
    own = free_port()
    with Datagrams("127.0.0.1", 0) as ear, started("socket_shell", "127.0.0.1", ear.port, own, typed=True) as shell:
        assert "Three numbers a line go to 127.0.0.1" in line(shell.stderr)
        send((7.0, 8.0, 9.0), ("127.0.0.1", own))
        assert line(shell.stdout).split() == ["7.00", "8.00", "9.00"]
        out, err = shell.communicate("1 2 3\n\n1 2\n1 2 three\n4 5 nan\n 4\t5 6", timeout=LONGEST)
        assert (shell.returncode, out) == (0, "")
        said = err.splitlines()
        assert (said[0], said[-1]) == ("sent", "sent")
        assert sum("datagram" in complaint for complaint in said) == 3
        assert len(said) == 5
        found: list[object] = []
        until(lambda: found.extend(ear.receive()) or len(found) == 2)
        assert found == [(1.0, 2.0, 3.0), (4.0, 5.0, 6.0)]


@pytest.mark.parametrize(
    ("program", "arguments", "status", "said"),
    [
        ("tune_up", ("-p", "1"), 1, "no server listens at 127.0.0.1:1"),
        ("rob", ("-p", "1", "-d", "0"), 2, "0 is no whole number from 1 to 65535"),
        ("socket_send", ("1", "2", "1e12"), 2, "three numbers, each smaller than"),
        ("socket_send", ("1", "2", "3", "no such host"), 1, "cannot send to no such host:5001"),
    ],
)
def test_what_is_wrong_is_said_in_a_sentence(program: str, arguments: tuple[str, ...], status: int, said: str) -> None:
    ended_with, out, err = run(program, *arguments)
    assert (ended_with, out) == (status, "")
    assert said in err


def test_a_port_that_somebody_has(served: Served) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", 0))
        status, _, err = run("rob", "-p", served.port, "-d", taken.getsockname()[1])
    assert status == 1
    assert "choose another port" in err
