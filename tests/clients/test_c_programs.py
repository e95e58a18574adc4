"""The programs of clients/c, and programs as they were written in 1998, run against the server."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from queue import Empty, Queue
from threading import Thread

import pytest

from clients.compiling import SOURCES, Workshop, in_ways, workshop
from processes import running
from sleepcast.nomad.client.nomad import Nomad, Pose

INCH = 0.0254
LONGEST = 60.0
"""Seconds that a busy machine is given."""
OLD = "-std=gnu89 -w"
"""How programs of 1998 are built; what they were warned of then, they are warned of today."""
ROOM = """
    format = 1
    seed = 4

    [world]
    width = "144in"
    height = "120in"
    edge = "wall"

    [[world.polygons]]
    name = "a block"
    corners = [["84in", "48in"], ["108in", "48in"], ["108in", "72in"], ["84in", "72in"]]

    [[world.polygons]]
    name = "the wall of one box"
    corners = [["110in", "32in"], ["144in", "32in"], ["144in", "34in"], ["110in", "34in"]]

    [[world.polygons]]
    name = "the wall of another"
    corners = [["110in", "86in"], ["144in", "86in"], ["144in", "88in"], ["110in", "88in"]]

    [nomad]
    origin = ["36in", "36in"]

    [[nomad.starts]]
    x = "36in"
    y = "36in"

    [[nomad.starts]]
    x = "36in"
    y = "84in"
"""
UNKNOWN = "x" * 70
"""No machine's name can be as long as that, so that nobody has to be asked for it."""
BOXES = [(91 * INCH, -20 * INCH), (91 * INCH, 68 * INCH)]
"""In that room, places where a Scout has something within ten inches wherever it turns, as robots see them."""
DATAGRAM = b"        1.50        -2.00 123456789.13".ljust(128, b"\0")


started = partial(running, stdin=subprocess.PIPE)


def line_of(process: subprocess.Popen[str], *, error: bool = False) -> str:
    """The next line that it says."""
    lines: Queue[str] = Queue()
    stream = process.stderr if error else process.stdout
    assert stream is not None
    Thread(target=lambda: lines.put(stream.readline()), daemon=True).start()
    try:
        return lines.get(timeout=LONGEST)
    except Empty:
        pytest.fail(f"{process.args!r} said nothing for {LONGEST:g} s")


def rest_of(process: subprocess.Popen[str], typed: str = "") -> tuple[int, str, str]:
    """Status and the rest of what it says on its two streams, once it has ended by itself."""
    out, err = process.communicate(typed, LONGEST)
    return process.returncode, out, err


def free_port() -> int:
    """A port at which nobody listens for datagrams."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
    return port


@pytest.fixture(scope="module")
def port(tmp_path_factory: pytest.TempPathFactory) -> Iterator[int]:
    """Of a server with two Scouts in a room, which goes as fast as its programs. One for all tests: it takes longer to
    start than any of them; they find the robots wherever the one before has left them."""
    room = tmp_path_factory.mktemp("server") / "room.toml"
    room.write_text(ROOM)
    quick = ("--headless", "--lockstep", "--speed", "inf", "--port", "0", "--json")
    command = (sys.executable, "-m", "sleepcast", "nserver", room, *quick)
    with started(*command, stderr=subprocess.DEVNULL) as server:  # nobody reads them, so they must not pile up
        port: int = json.loads(line_of(server))["port"]
        yield port


@pytest.fixture(scope="module", params=in_ways("native", "32 bit"))
def old(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Workshop:
    return workshop(tmp_path_factory.mktemp("old"), request.param)


@pytest.fixture(scope="module")
def programs(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of the built programs, their use of memory watched where that is possible."""
    made = workshop(tmp_path_factory.mktemp("programs"), "watched", "native")
    made.make("programs")
    return made.folder / "programs"


# ---- as they were written in 1998


def run_old(old: Workshop, name: str, port: int) -> list[str]:
    with started(old.program(SOURCES / "of_1998" / f"{name}.c", OLD), port) as program:
        _, out, err = rest_of(program)
    assert err == ""
    return out.splitlines()


def test_a_square_of_1998(old: Workshop, port: int) -> None:
    poses = [line.split() for line in run_old(old, "square", port)]
    assert [words[0] for words in poses] == ["home:", *["corner:"] * 4, "home:"]
    corners = [(int(words[2]), int(words[4]), int(words[6])) for words in poses]
    wanted = [(0, 0, 0), (240, 0, 0), (240, 240, 900), (0, 240, 1800), (0, 0, 2700), (0, 0, 3600)]
    for found, place in zip(corners, wanted, strict=True):
        # a quarter turn is a little short: its way is a whole number of tenths of an inch
        assert found == pytest.approx(place, abs=30), corners


def test_a_program_without_a_header(old: Workshop, port: int) -> None:
    assert run_old(old, "bare", port) == [
        "connected 1",
        "again 1",
        "at -200 -100 2700",
        "told -7 -8 450",
        "sonars 1",
        "wall 1",
        "moved 1 4 140 -890 200 -890 200 910 140 910",
        "blocked 1 at 73 0 -3.14",
        "gone 1",
        "free 0",
        "drawn 2",
        "conf 1",
        "bumper 1 compass 1",
        "turning -40 40",
        "other 0 0",
    ]


def test_a_program_that_listens_to_everything(old: Workshop, port: int) -> None:
    attached, sonars, *rest = run_old(old, "listener", port)
    assert (attached, rest) == ("attached 6 mask 1 0", ["read at 1", "volts 1"])
    _, front, _, back, *nothing = sonars.split()
    assert nothing == ["bumped", "0", "error", "0"]
    # The wall of a box ahead and the edge behind, as they were up to 0.7 s before the robot came to rest.
    assert int(front) == pytest.approx(56, abs=4)
    assert int(back) == pytest.approx(40, abs=4)


def test_a_user_s_own_packets(old: Workshop, port: int) -> None:
    with started(old.program(SOURCES / "packets.c"), port) as program:
        status, out, err = rest_of(program)
    assert (status, err) == (0, "")
    assert out.splitlines() == [
        "4 5 7 11 12 14 18 26 26",
        "1a000763" + "85" + "2c81" + "70110180" + "fa" + "ffff" + "ffffffff" + "000000000000c4bf",
        "26 26 7 99 4 -5 -300 -70000 250 65535 4294967295 -0.15625 26",
        "0 0 7 0 0 0 22",
        "1 12 200 41 0 12345 12",
        "0 0 12345 0",
    ]


# ---- robots


def test_tune_up_goes_about_and_touches_nothing(programs: Path, port: int) -> None:
    with started(programs / "tune_up", "-h", "127.0.0.1", "-p", port, "-w", 0, "-n", 500) as program:
        status, out, err = rest_of(program)
    assert (status, err) == (0, "")
    assert out.endswith("it touched something 0 times\n")
    assert not out.startswith("robot 1 is at 0, 0;")


def test_two_robs_stop_near_something_as_soon_as_they_are_told(programs: Path, port: int) -> None:
    first, second = free_port(), free_port()
    to_server = ("-h", "127.0.0.1", "-p", port, "-w", 0)
    for number, (x, y) in enumerate(BOXES, 1):
        with Nomad.connect(port=port, robot=number) as nomad:
            nomad.place(Pose(x, y, 0.0, 0.0))
    with (
        started(programs / "rob1", *to_server, "-d", first, "-q", "-n", 5000) as rob1,
        started(programs / "rob2", *to_server, "-d", second, "-q", "-n", 5000) as rob2,
    ):
        assert line_of(rob1) == f"robot 1 wanders and listens at port {first}\n"
        assert line_of(rob2) == f"robot 2 wanders and listens at port {second}\n"
        with started(programs / "brdcst", 1, 2, 3, first, f"localhost:{second}") as sender:
            assert rest_of(sender) == (0, "", "")
        for number, rob in ((1, rob1), (2, rob2)):
            status, out, err = rest_of(rob)
            assert (status, err) == (0, "")
            told, stopped = out.splitlines()
            assert told == f"robot {number} was told 1.00 2.00 3.00"
            # Whoever is told while it turns away from something is as near to it as a wanderer comes.
            assert stopped in [f"robot {number} stopped with {inches} in ahead" for inches in (7, 8, 9, 10)]


def test_a_rob_that_is_told_nothing_never_stops(programs: Path, port: int) -> None:
    listening = free_port()
    with started(programs / "rob1", "-p", port, "-w", 0, "-d", listening, "-n", 500, "-f", 6, "-r", 2) as rob:
        status, out, err = rest_of(rob)
    assert (status, out, err) == (0, f"robot 2 wanders and listens at port {listening}\n", "")


def test_a_robot_that_there_is_not(programs: Path, port: int) -> None:
    with started(programs / "tune_up", "-h", "127.0.0.1", "-p", port, "-r", 7) as program:
        assert rest_of(program) == (1, "", "The server has no robot 7 for us.\n")


# ---- datagrams


def test_socket_send_sends_three_fields_in_128_bytes(programs: Path) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as hearing:
        hearing.bind(("127.0.0.1", 0))
        hearing.settimeout(LONGEST)
        place = ("localhost", hearing.getsockname()[1])
        with started(programs / "socket_send", "1.5", "-2", "123456789.126", *place) as program:
            assert rest_of(program) == (0, "", "")
        assert hearing.recv(1000) == DATAGRAM


def test_socket_read_prints_what_is_three_numbers(programs: Path) -> None:
    port = free_port()
    with (
        started(programs / "socket_read", port, 2) as program,
        socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sending,
    ):
        assert line_of(program, error=True) == f"Listening at port {port}.\n"
        for text in (DATAGRAM, b"", b"1 2", b"x" * 60000, b"\0" * 128, b" 7 8 9e1 and more"):
            sending.sendto(text, ("127.0.0.1", port))
        status, out, err = rest_of(program)
    assert status == 0
    assert out.splitlines() == [DATAGRAM.rstrip(b"\0").decode(), "        7.00         8.00        90.00"]
    assert err.splitlines() == ["A datagram came without three numbers."] * 4


def test_socket_shell_sends_what_is_typed_and_prints_what_comes(programs: Path) -> None:
    own = free_port()
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as other:
        other.bind(("127.0.0.1", 0))
        other.settimeout(LONGEST)
        port = other.getsockname()[1]
        with started(programs / "socket_shell", "127.0.0.1", port, own) as shell:
            assert line_of(shell, error=True).endswith(f"what comes to port {own} is printed.\n")
            other.sendto(b"5 6 7", ("127.0.0.1", own))
            assert line_of(shell) == "        5.00         6.00         7.00\n"
            typed = "1.5 -2 123456789.126\n\n1 2\n1 2 3 4\n1 2 1e9\n" + "9" * 1000 + "\n 4 5 6"
            status, out, err = rest_of(shell, typed)
        assert (status, out) == (0, "")
        assert other.recv(1000) == DATAGRAM
        assert other.recv(1000).split(b"\0")[0] == b"        4.00         5.00         6.00"
    for complaint in ("Three numbers make a datagram.", "1e9 is no number from", "That line is too long."):
        assert complaint in err


MISUSES = """
    socket_send
    socket_send 1 2 x
    socket_send 1 2 nan
    socket_send 1 2 1e10
    socket_send 1 2 3 localhost 65536
    brdcst 1
    brdcst 1 2 3 localhost:
    socket_read 0
    socket_read 1 2 127.0.0.1 4
    socket_read -?
    socket_shell -?
    socket_shell localhost x
    tune_up -z
    tune_up 1
    tune_up -p 7019x
    rob1 -d 0
    rob2 -q -n
"""


@pytest.mark.parametrize("command", [line.strip() for line in MISUSES.strip().splitlines()])
def test_misuse_is_a_sentence_and_status_2(programs: Path, command: str) -> None:
    name, *arguments = command.split()
    with started(programs / name, *arguments) as program:
        status, out, err = rest_of(program)
    assert (status, out) == (2, "")
    assert "usage: " in err or " is no number from " in err or " is no whole number from " in err


def test_an_unknown_machine_is_said_to_be_unknown(programs: Path) -> None:
    with started(programs / "socket_send", "1", "2", "3", UNKNOWN) as program:
        status, _, err = rest_of(program)
    assert status == 1
    assert err.startswith(f"No machine {UNKNOWN}: ")


@pytest.mark.parametrize(
    "command", ["rob1 -l 192.0.2.1", "socket_read 4000 0 192.0.2.1", f"socket_shell localhost 1 4000 {UNKNOWN}"]
)
def test_an_address_that_is_not_this_machines_is_refused(programs: Path, command: str) -> None:
    name, *arguments = command.split()
    with started(programs / name, *arguments) as program:
        status, out, err = rest_of(program)
    assert (status, out) == (1, "")
    assert err.startswith(("Cannot listen at 192.0.2.1, port ", f"No machine {UNKNOWN}: "))
