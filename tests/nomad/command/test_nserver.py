"""`sleepcast nserver` as a person starts it: where it listens, how it ends, and what it says when it cannot begin."""

from __future__ import annotations

import json
import signal
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from benchmarks.channel.lab import why_not

import forkserver
from cli.calling import LONGEST, called, called_here
from sleepcast.nomad import listening_places, own_addresses
from sleepcast.nomad.wire.encoding import HEADER, Layout, decode, encode_request

GS, QUIT, GET_ROBOT_CONF = 15, 70, 200


class Started:
    """The command, which has said where it listens."""

    def __init__(self, *arguments: str | Path) -> None:
        command = [sys.executable, "-m", "sleepcast", "nserver", "--headless", "--port", "0", "--json"]
        self.process = forkserver.Popen(
            [*command, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        assert self.process.stdout is not None
        line = self.process.stdout.readline()
        self.where = json.loads(line) if line else {}

    def ask(self, host: str, *requests: tuple[int, ...]) -> list[tuple[int, ...]]:
        """The words of the replies to these requests, on a connection of their own."""
        found = []
        with socket.create_connection((host, self.where["port"]), LONGEST) as connection:
            source = connection.makefile("rb")
            for kind, *words in requests:
                connection.sendall(encode_request(Layout.FOUR, kind, words))
                _, size = HEADER.unpack(source.read(4))
                found.append(decode(source.read(4 * size)))
        return found

    def end(self) -> tuple[int, str]:
        """Press Ctrl-C; gives the exit status and what was said on standard error."""
        self.process.send_signal(signal.SIGINT)
        _, err = self.process.communicate(timeout=LONGEST)
        return self.process.returncode, err


@contextmanager
def started(*arguments: str | Path) -> Iterator[Started]:
    made = Started(*arguments)
    try:
        yield made
    finally:
        made.process.kill()
        made.process.communicate()


def test_it_serves_on_this_machine_s_addresses_until_ctrl_c(tmp_path: Path) -> None:
    world = tmp_path / "lab.world"
    world.write_text("4 1000 -200 1100 -200 1100 200 1000 200\n")
    with started(world, "--robots", "3", "--seed", "7", "--speed", "inf", "--host", "127.0.0.9") as made:
        assert made.where["hosts"] == [*own_addresses(), "127.0.0.9"]
        assert made.where["robots"] == 3
        for host in made.where["hosts"]:
            accepted, state, conf = made.ask(host, (102, 3, 1), (GS,), (GET_ROBOT_CONF,))
            assert (accepted, len(state), state[0]) == ((made.where["port"],), 49, 2**31 - 1)
            assert conf[2] == state[36]
        status, err = made.end()
    assert status == 130
    assert "has connected to robot 3" in err
    assert "Traceback" not in err


def test_a_program_may_end_it_where_a_setup_file_of_1998_permits_that(tmp_path: Path) -> None:
    (tmp_path / "lab.txt").write_text("4 1000 -200 1100 -200 1100 200 1000 200\n")
    world, robot = tmp_path / "world.setup", tmp_path / "robot.setup"
    world.write_text("[server]\nport = 7771\nquit_server = yes\nmap = lab.txt\nrobots = 2\nwindow = big\n")
    robot.write_text("[sonar]\nrate = 6\noverlap = 0.5\n")
    with started(world, "--setup", robot, "--lockstep", "--host", "0.0.0.0") as made:
        assert (made.where["hosts"], made.where["robots"]) == (["0.0.0.0"], 2)
        assert made.where["port"] != 7771, "an option comes first"
        assert made.ask("127.0.0.1", (102, 1, 1), (GS,), (QUIT,))[1][0] == 10
        out, err = made.process.communicate(timeout=LONGEST)
        assert (made.process.returncode, out) == (0, ""), err
        assert "whoever can reach 0.0.0.0 can drive these robots" in err
        assert f"{world}:6: ignored: window = big\n{robot}:3: ignored: overlap = 0.5\n" in err


def test_a_port_that_is_taken_is_one_sentence_and_a_failure() -> None:
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        port = taken.getsockname()[1]
        outcome = called("nserver", "--headless", "--port", str(port))
    assert (outcome.status, outcome.out) == (1, "")
    assert outcome.err.startswith(f"port {port} of 127.0.0.1 is in use")
    assert outcome.err.count("\n") == 1


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["nowhere.toml"], "nowhere.toml"),
        (["nowhere.setup"], "nowhere.setup: cannot be read"),
        (["--setup", "nomad2000"], "nomad2000"),
        (["--real", "2=nomad://127.0.0.1:7019#1"], "--real wants the number of a robot, 1 to 1"),
        (["--robots", "100000"], "100000 robots"),
        (["--speed", "0"], "--speed"),
        (["--speed", "2", "--lockstep"], "leave out either --lockstep or --speed"),
        (["--tk-order", "middle"], "'middle'"),
    ],
)
def test_what_cannot_be_is_misuse(
    arguments: list[str],
    said: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    outcome = called_here(capsys, "nserver", "--headless", "--port", "0", *arguments)
    assert (outcome.status, outcome.out) == (2, "")
    assert said in outcome.err


def test_programs_that_name_no_server_find_it_where_their_machine_s_name_leads(monkeypatch: pytest.MonkeyPatch) -> None:
    def found(*_: object) -> list[tuple[int, int, int, str, tuple[str, int]]]:
        return [(2, 1, 6, "", (host, 0)) for host in ("127.0.1.1", "192.0.2.7", "127.0.0.1", "127.0.1.1")]

    monkeypatch.setattr(socket, "getaddrinfo", found)
    assert own_addresses() == ["127.0.0.1", "127.0.1.1"]
    assert listening_places(["::1", "127.0.1.1"]) == ["127.0.0.1", "127.0.1.1", "::1"]
    assert listening_places(["192.0.2.7", "0.0.0.0", "::1"]) == ["0.0.0.0", "::1"]
    assert listening_places(["::", "::1"]) == ["127.0.0.1", "127.0.1.1", "::"]

    def nobody(*_: object) -> None:
        raise socket.gaierror

    monkeypatch.setattr(socket, "getaddrinfo", nobody)
    assert own_addresses() == ["127.0.0.1"]


REASON = why_not()
ELSEWHERE = """
"$4" -c 'import socket, sys; socket.sethostname(sys.argv[1])' "$1"
ip link set lo up
ip address add 192.0.2.7/32 dev lo
printf '127.0.0.1 localhost\\n%s\\n' "$2" > "$3"
mount --bind "$3" /etc/hosts
exec "$4" -c "$5"
"""
"""On a machine of this name, with these addresses in its own file of hosts: run that."""
DIAL = """
import socket, struct, subprocess, sys
command = [sys.executable, "-m", "sleepcast", "nserver", "--headless", "--port", "7771"]
server = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
print(server.stdout.readline(), end="")
try:  # as a program of 1998 that is told of no machine
    with socket.create_connection((socket.gethostbyname(socket.gethostname()), 7771)) as program:
        program.sendall(struct.pack(">HHii", 102, 2, 1, 1998))
        print("answered", struct.unpack(">HHi", program.recv(8))[2])
except (OSError, UnicodeError):
    print("not answered")
server.terminate()
print(server.communicate()[1])
"""


@pytest.mark.skipif(bool(REASON), reason=f"no machines of our own here: {REASON}")
@pytest.mark.parametrize(
    ("name", "hosts", "found", "told"),
    [
        ("lab", "127.0.1.1 lab", ["127.0.0.1 port 7771, 127.0.1.1 port 7771.", "answered 7771"], ""),
        (
            "lab",
            "192.0.2.7 lab",
            ["127.0.0.1 port 7771.", "not answered"],
            "look for lab, this machine, at 192.0.2.7, and nobody listens there: name 127.0.0.1 in them, or start",
        ),
        (
            "no..name",
            "",
            ["127.0.0.1 port 7771.", "not answered"],
            "for no..name, this machine, which has no address",
        ),
    ],
)
def test_a_program_that_names_no_server(name: str, hosts: str, found: list[str], told: str, tmp_path: Path) -> None:
    run = ["unshare", "--user", "--map-root-user", "--mount", "--uts", "--net", "sh", "-ec", ELSEWHERE, "sh"]
    given = [name, hosts, tmp_path / "hosts", sys.executable, DIAL]
    done = subprocess.run([*run, *given], capture_output=True, text=True, timeout=LONGEST, check=False)
    assert done.returncode == 0, done.stderr
    for said in found:
        assert said in done.stdout
    assert told in done.stdout
    assert ("programs that name no server" in done.stdout) == bool(told)
    assert "Traceback" not in done.stdout
