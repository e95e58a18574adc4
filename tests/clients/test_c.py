"""clients/c/Nclient.c against servers that do what each test wants: every byte that it sends, and what it makes of
every answer, right or wrong, in a program of 32 bits, in one of 64 and in one whose use of memory is watched."""

from __future__ import annotations

import random
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path
from threading import Event

import pytest

from clients.compiling import CLIENTS, SOURCES, WAYS, Workshop, in_ways, workshop
from clients.peer import Behaviour, Farewell, Peer, message

LONGEST = 60.0
"""Seconds that a program may take before it counts as hanging."""

STATE = tuple(
    [10]
    + [15] * 16
    + [0x49, 0x49, 0x3B, 0x2E, 0x2B, 0x2B, 0x2E, 0x23, 0x21, 0x21, 0x25, 0x33, 0x3F, 0x3F, 0x45, 0x4D]
    + [0, -100, -200, 0x330, 0x1C2, 52, -22, 0, 3, 0, 0, 0]
)
"""State[] of the captured session; its last word is left out of account."""
TAIL = (0x2266E1, 0xC8, 0xD2)
"""Clock and batteries of the captured session."""
CAPTURED = """
    0066 0002 00000009 PID
    0066 0002 00000001 PID
    0010 0007 000000ff 000000ff 000000ff 000000ff 000000ff 0000000e 00000000
    001a 0001 00000001
    0017 0011 00000001 00000000 00000001 00000002 00000003 00000004 00000005 00000006
              00000007 00000008 00000009 0000000a 0000000b 0000000c 0000000d 0000000e 0000000f
    0014 0000
    0027 0004 00000001 00000001 00000001 00000014
    0029 0004 ffffff9c ffffff38 00000384 000001c2
    000c 0003 00000034 ffffffea 00000000
    000f 0000
    0013 0002 6863754f 0000002e
    0067 0002 00000001 PID
"""
"""What a client of 1998 sent. Behind the text's end it left whatever was there; ours leaves zeros."""


@pytest.fixture(scope="module", params=in_ways(*WAYS))
def built(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Workshop]:
    folder = tmp_path_factory.mktemp("c")
    yield workshop(folder, request.param)
    shutil.rmtree(folder)


def run(program: Path, *arguments: object, typed: str = "", after: Event | None = None) -> tuple[int, str, str, int]:
    """Status, what it said on its two streams, and its process number. typed: what it can read, once `after` is set."""
    command = [program, *map(str, arguments)]
    with subprocess.Popen(
        command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            assert after is None or after.wait(LONGEST)
            out, err = process.communicate(typed, LONGEST)
        finally:
            process.kill()
    return process.returncode, out, err, process.pid


def places(which: int) -> tuple[int, ...]:
    """The PosData records of these sensors: numbers that tell one from the other."""
    count = sum(many for bit, many in ((1, 16), (2, 16), (4, 1), (8, 1), (16, 1)) if which & bit)
    return tuple(range(-5, 9 * count - 5))


def truthful() -> Behaviour:
    """A server that gives every request its right answer."""
    attached = 0

    def answer(type_: int, body: bytes, number: int) -> bytes | None:
        nonlocal attached
        numbers = [int.from_bytes(body[i : i + 4], "big", signed=True) for i in range(0, len(body), 4)]
        if type_ == 16:
            attached = numbers[6]
        match type_:
            case 101 | 102:
                attached = 0
                return message(type_, 0 if numbers[0] == 9 else 7771)
            case 103:
                return None
            case 27:
                return message(83, *range(16), *places(attached & 1), 5)
            case 28:
                return message(84, *range(16, 32), *places(attached & 2), 6)
            case 29:
                return message(88, -1, -2, 3, 4)
            case 30 | 31:
                return message(89, type_, -type_, 0)
            case 32:
                return message(86, 1234, *places(attached & 16), 7)
            case 33:
                return message(85, 2, -3, 4, 5, -6, *places(attached & 8), 8)
            case 35:
                return message(87, 0x800001, *places(attached & 4), 9)
            case 37:
                return message(85, 1, 10, 20, 30, 40, *places(attached & 8), 10)
            case 42:
                return message(82, 0, *range(100, 132), *([77] * 11), 1, -8, 9)
            case 52:
                moved = [value + (5 if i % 2 == 0 else -6) for i, value in enumerate(numbers[1:-2])]
                return message(82, numbers[0], *moved)
            case 75:
                return message(76, 2, 1, -2, 3, 4, 5, 6)
            case 200:
                return message(200, 1, -2, 3, -4)
            case 300:
                length, kind = numbers[0], numbers[3]
                result = (0x39, 0x30, 0, 0x80) if kind == 40 else (1, 2, 0, 0)
                return message(300, length, 0, 0, kind, *result, *(3, 1, 0, 0x80))
            case 400:
                return message(400, numbers[0], 100, -250, 1570796) if numbers[0] == 0 else message(400, 1, -1, 2, -3)
            case 19 | 41 | 50 | 51 | 53 | 60 | 61 | 62 | 70 | 71 | 74 | 150 | 151 | 152 | 153 | 154:
                return message(82)
            case 155 | 156 | 157 | 158 | 159:
                return message(82, 1, 2, 3)
        return message(80, *STATE[:44], 99, 0, *places(attached), *TAIL)

    return answer


def test_a_session_of_1998_byte_for_byte(built: Workshop) -> None:
    with Peer(truthful()) as peer:
        status, out, err, pid = run(built.program(SOURCES / "captured.c"), peer.port)
    assert (status, err) == (0, "")
    wanted = bytes.fromhex(CAPTURED.replace("PID", f"{pid:08x}"))
    assert b"".join(peer.requests).hex(" ", 4) == wanted.hex(" ", 4)
    assert out.split() == [
        *("0", "7771", "1", "1", "1", "1", "1", "1", "1", "1"),
        *map(str, STATE),
        *("0", "2254561", "10.447", "11.489", "1"),
    ]


OFF, LAST = [255] * 16, 0xFFFFFFFF
CALLS: list[tuple[int, list[int]]] = [
    (10, [1, -2, 3]),
    (11, [4, 5, -6]),
    (12, [-7, 8, 9]),
    (13, [-10, 11, 12]),
    (43, [1, -13, 2, 14, 0, 15]),
    (17, []),
    (18, []),
    (20, []),
    (39, [1, 0, 1, 44]),
    (21, [-16, 17]),
    (38, [18, -19]),
    (41, [20, -21, 22, 23]),
    (26, [255]),
    (19, [0]),
    (19, [0x72756F66, 0]),
    (19, [0x6C6C6568, 0x77202C6F, 0x646C726F, 0]),
    (15, []),
    (101, [2, -1]),
    (22, [5, 3, 2, -1, *OFF[:13]]),
    (23, [15, 0, 2, 15, 1, 14, 3, 13, 4, 12, 5, 11, 6, 10, 7, 9, 8]),
    (23, [0, *OFF]),
    (24, [2]),
    (25, [51, 1, 2, 3, 4]),
    (36, [5, 6, 7]),
    (16, [0xFE, 0xFF, 0xFF, 0x7F, 0xFE, 0x06, 0]),
    (16, [0xFE, 0xFF, 0xFF, 0x7F, 0xFE, 0x07, 22]),
    *((type_, []) for type_ in (27, 28, 35, 32, 29, 30, 31, 33, 37)),
    (16, [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x0E, 0]),
    (50, [4, *range(-1, -9, -1)]),
    (52, [4, *range(-1, -9, -1), 5, -6]),
    (51, [4, 4, -8, 2, -10, 0, -12, -2, -14]),
    (53, []),
    (200, []),
    (75, []),
    (42, [-1, 2, 3, 4]),
    (400, [0, 129, -200, 325, 400, 0, 0, 0]),
    (400, [1, 100, -200, -500000, 3141593, 5000, 700, 800]),
    (60, [-1, 2, 3, 4, 5]),
    (61, [-1, 2, -3, 4, 6]),
    (62, [-1, 2, 3, 4, 5, 6, 7]),
    (300, [8, 0, 1, 99, 200, 100, 50, 25]),
    (300, [6, 0, 0, 40, 2, 0x80]),
    (300, [12, 0, 0, 41, 1, 0, 0, 0, 0x70, 0x11, 0x01, 0x80]),
    (300, [20, 0, 0, 42, 1, 0, 0, 0, 0x2C, 0x01, 0, 0x80, 2, 0, 0, 0, 0x90, 0x01, 0, 0]),
    (102, [1, -1]),
    (16, [0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0x0E, 0]),
    *((type_, []) for type_ in (*range(150, 160), 71, 74, 70)),
    (103, [1, -1]),
]
"""What the round of calls.c sends after it has connected; -1 where an enrolment carries the process number."""


def test_every_call_sends_what_the_wire_wants_and_gives_what_came(built: Workshop) -> None:
    with Peer(truthful()) as peer:
        status, out, err, pid = run(built.program(SOURCES / "calls.c"), peer.port, 1)
    assert (status, err) == (0, "")
    wanted = [message(t, *(pid if t in (101, 102, 103) and n == -1 else n for n in words)) for t, words in CALLS]
    assert [sent.hex(" ", 4) for sent in peer.requests[2:]] == [sent.hex(" ", 4) for sent in wanted]
    said = out.splitlines()
    failed = [line for line in said if line.split()[1] == "0"]
    assert failed == [
        "pa 0 0",
        "mv 0 22",
        "posDataRequest 0 22",
        "posSonarGet 0 22",
        "connect_robot 0 22",
        "add_Obs 0 22",
        "motion_check 0 0",
    ]
    for line in (
        "get_sn 1 0",
        "place 130 136 138",
        "moved to 4 4 -8 2 -10 0 -12 -2 -14",
        "conf 1 -2 3 -4",
        "robots 2 1 -2 3 4 5 6",
        "predicted 100 131 0 1 -8",
        "hit 0.00 0.00 0.000000",
        "motion_check 1 0",
        "packet 99 1",
        "arm_zero -12345 0",
        "arm_ws 513 0",
        "left -259",
        "arm_mv 513 0",
    ):
        assert line in said


GARBAGE = 300
"""Different answers that a hostile server has up its sleeve."""


def hostile(seed: int) -> Behaviour:
    """A server that mostly lies: answers cut short, blown up, with impossible counts in them, or nothing but noise."""
    chance = random.Random(seed)
    right = truthful()
    sleeve = [chance.randbytes(4 * chance.choice([0, 1, 3, 4, 21, 46, 49, 400])) for _ in range(GARBAGE)]

    def answer(type_: int, body: bytes, number: int) -> bytes | None:
        honest = right(type_, body, number)
        if honest is None or (type_ in (101, 102) and chance.random() < 0.7):
            return honest
        match chance.randrange(12):
            case 0 | 1:
                return honest
            case 2 | 3:  # whole, but short
                words = chance.randrange(len(honest) // 4)
                return honest[:2] + words.to_bytes(2, "big") + honest[4 : 4 + 4 * words]
            case 4 | 5 | 6:  # one number of it is a lie, the laser's count above all
                if len(honest) == 4:
                    return honest
                lie = chance.choice([4, 4 + 4 * 44, 4 + 4 * 45, 4 * chance.randrange(1, len(honest) // 4)])
                number_ = chance.choice([b"\xff\xff\xff\xff", b"\x7f\xff\xff\xff", b"\0\0\1\xe3", b"\0\0\0\1"])
                return (honest[:lie] + number_ + honest[lie + 4 :])[: len(honest)]
            case 7:
                noise = chance.choice(sleeve)
                return honest[:2] + (len(noise) // 4).to_bytes(2, "big") + noise
            case 8:
                return message(91, *([chance.choice([0, 5, -1])] if chance.random() < 0.8 else []))
            case 9:  # as long as can be said
                return honest[:2] + b"\xff\xff" + chance.randbytes(4) * 65535 if chance.random() < 0.1 else honest
            case 10:  # breaks off in the midst
                return Farewell(honest[: chance.randrange(len(honest))]) if chance.random() < 0.3 else honest
            case _:
                return Farewell(b"\xff\xff\0\0") if chance.random() < 0.3 else honest

    return answer


@pytest.mark.parametrize("seed", range(3))
def test_no_answer_of_a_hostile_server_harms_the_program(built: Workshop, seed: int) -> None:
    with Peer(hostile(seed)) as peer:
        status, out, err, _ = run(built.program(SOURCES / "calls.c"), peer.port, 20)
    assert status == 0, out[-500:] + err
    assert "Sanitizer" not in err
    errors = {line.split()[2] for line in out.splitlines() if line.split()[1] == "0" and len(line.split()) == 3}
    assert {"4", "5", "-1", "22", "111"} <= errors  # it met every sort of trouble
    assert len(peer.requests) > 500


@pytest.mark.parametrize(
    ("count", "each", "fits"),
    [
        *((482, 2, True), (241, 4, True), (964, 1, True)),
        *((483, 2, False), (242, 4, False), (965, 1, False), (16000, 4, False), (100, 3, False), (-1, 4, False)),
    ],
)
def test_a_laser_has_as_many_numbers_as_its_array_holds(built: Workshop, count: int, each: int, fits: bool) -> None:
    right = truthful()
    block = [count, *range(1, abs(count) * each), -7]

    def answer(type_: int, body: bytes, number: int) -> bytes | None:
        match type_:
            case 15:
                return message(80, *STATE, *block, *TAIL)
            case 33 | 37:
                return message(85, *block, 5)
            case 42:
                return message(82, *STATE[:44], *block)
        return right(type_, body, number)

    with Peer(answer) as peer:
        status, out, err, _ = run(built.program(SOURCES / "laser.c"), peer.port)
    assert (status, err) == (0, "")
    if fits:
        assert out.splitlines() == [*[f"1 0 {count} -7"] * 4, f"0 0 {count} -7"]
    else:
        assert out.splitlines() == [*["0 4 0 0"] * 5]


def test_a_lost_server_is_an_error_and_can_be_found_again(built: Workshop) -> None:
    right = truthful()

    def leaving(type_: int, body: bytes, number: int) -> bytes | None:
        honest = right(type_, body, number)
        leaves = honest is not None and (type_, number) in ((16, 0), (15, 1))
        return Farewell(honest) if leaves and honest is not None else honest

    with Peer(leaving) as peer:
        status, out, err, _ = run(
            built.program(SOURCES / "hangup.c"), peer.port, "127.0.0.1", typed="\nkept\n", after=peer.left
        )
    assert status == 0, "killed by its own writing"
    assert out.splitlines() == [
        "0 111 0",  # never connected
        "7771 0 -100",
        "0 111 -100",  # the server has gone while a long text was on its way
        "0 111 -100",
        "7771 0 -100",
        "1 0 -100",
        "7771 0 -100",  # gone once more, and back
        "1 0 -100",
        "1 0 -100",
        "kept",
    ]
    assert err.count("the connection to the server is lost") == 2


@pytest.mark.parametrize(("host", "port"), [("x" * 70, 7019), ("127.0.0.1", 0), ("127.0.0.1", 65536)])
def test_a_server_that_cannot_be_reached_is_an_error_that_says_where(built: Workshop, host: str, port: int) -> None:
    status, out, err, _ = run(built.program(SOURCES / "hangup.c"), port, host, typed="\nnot for a robot\n")
    assert status == 0
    assert out.splitlines() == [*["0 111 0"] * 9, "not for a robot"]
    assert err.startswith(f"Nclient: no server at {host}, port {port}: ")


def test_nobody_at_the_port_is_an_error(built: Workshop) -> None:
    with Peer(truthful()) as peer:
        pass
    status, out, err, _ = run(built.program(SOURCES / "hangup.c"), peer.port, "localhost", typed="\n")
    assert (status, out.splitlines()) == (0, ["0 111 0"] * 9)
    assert f"no server at localhost, port {peer.port}: Connection refused." in err


def test_no_name_means_this_machine(built: Workshop) -> None:
    with Peer(truthful()) as peer:
        status, out, _, _ = run(built.program(SOURCES / "hangup.c"), peer.port, "", typed="\n")
    assert status == 0
    assert out.splitlines()[1] == "7771 0 -100"


def test_the_library_builds_without_a_warning_and_cleans_up(built: Workshop) -> None:
    built.make("clean")
    left = {path.name for path in built.folder.iterdir()} - {"built"}
    assert left == {path.name for path in CLIENTS.iterdir() if path.suffix not in (".o", ".a")}
    built.make("libNclient.a", "-O0 -std=c89 -pedantic -Wall -Wextra -Wshadow -Wconversion -Werror")
