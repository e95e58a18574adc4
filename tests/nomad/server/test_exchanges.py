"""What the original C client says and hears, byte for byte, as it was captured from it."""

from __future__ import annotations

from math import pi

import pytest

from nomad.programs import bench
from sleepcast.nomad.wire.encoding import HEADER, Layout, encode
from sleepcast.nomad.wire.requests import Reply
from sleepcast.nomad.wire.state import Mask, state_of, tail
from sleepcast.nomad.wire.units import INCH, TENTH
from sleepcast.robot import Axes, Condition, Pose

CONNECT = "0066 0002 00000001 00005a5e"
ACCEPTED = "0066 0001 00001e5b"
SIMPLE = "0052 0000"
ORDER = "".join(f"{sonar:08x}" for sonar in range(16))


def raw(text: str) -> bytes:
    return bytes.fromhex(text)


def test_connecting_and_being_refused() -> None:
    program = bench().program(None)
    assert program.exchange(raw("0066 0002 00000009 00005a5e")) == raw("0066 0001 00000000")
    refused = program.exchange(raw("000f 0000"))  # a program that does not look goes on to command
    assert refused[:4] == raw("005b 0001")
    assert any(refused[4:])
    assert program.exchange(raw(CONNECT)) == raw(ACCEPTED)


@pytest.mark.parametrize(
    "request_",
    [
        "0010 0007 000000ff 000000ff 000000ff 000000ff 000000ff 0000000e 00000000",
        "001a 0001 00000001",
        f"0017 0011 00000001 {ORDER}",
        "0014 0000",
        "0027 0004 00000001 00000001 00000001 00000014",
        "000c 0003 00000034 ffffffea 00000000",
        "000f 0000",
    ],
)
def test_requests_that_get_the_state(request_: str) -> None:
    program = bench().program(None)
    program.exchange(raw(CONNECT))
    reply = program.exchange(raw(request_))
    assert (reply[:4], len(reply)) == (raw("0050 0031"), 200)


def test_requests_that_get_a_simple_reply() -> None:
    made = bench()
    program = made.program(None)
    program.exchange(raw(CONNECT))
    assert program.exchange(raw("0029 0004 ffffff9c ffffff38 00000384 000001c2")) == raw(SIMPLE)
    assert program.exchange(raw("0013 0002 6863754f d8ff002e")) == raw(SIMPLE)
    assert [text for _, text in made.windows.robots[0].said] == ["Ouch."]
    assert program.state(15)[34:37] == (-100, -200, 900)


def test_disconnecting_gets_no_reply() -> None:
    program = bench().program(None)
    program.exchange(raw(CONNECT))
    assert program.send(raw("0067 0002 00000001 00005a5e")) is None
    assert program.wait is None
    assert program.send(raw("000f 0000"))[:4] == raw("005b 0001")  # type: ignore[index]


def test_a_state_reply_byte_for_byte() -> None:
    inches = (73, 73, 59, 46, 43, 43, 46, 35, 33, 33, 37, 51, 63, 63, 69, 77)
    pose = Pose(-100 * TENTH, -200 * TENTH, 816 * pi / 1800, 450 * pi / 1800)
    seen = Condition(
        time=2254.561,
        believed=pose,
        real=Pose(0.0, 0.0, 0.0, 0.0),
        speeds=Axes(52 * TENTH, -22 * TENTH, 0.0),
        moving=(True, True, False),
        sonars=tuple(reading * INCH for reading in inches),
        infrared=(),
        touched=(),
        battery=200 / 255,
    )
    words = [*Mask().sift(state_of(seen, steers=False, speed=1.0, compass=False)), 0, *tail(seen)]
    captured = (
        "0050 0031 0000000a" + 16 * "0000000f" + "".join(f"{reading:08x}" for reading in inches) + "00000000"
        "ffffff9c ffffff38 00000330 000001c2 00000034 ffffffea 00000000 00000003 00000000 00000000 00000000"
        "00000000 002266e1 000000c8"
    )
    reply = encode(Layout.FOUR, Reply.STATE, words)
    assert reply[:-4] == raw(captured)
    assert reply[-4:] == raw("000000c8")  # both batteries are as full as each other


@pytest.mark.parametrize(
    ("connect", "accepted"),
    [
        ("0066 0002 00000000 00000001 00000000 00001f21", "0066 0001 00001e5b 00000000"),
        ("0066 0002 00000001 00000000 00004f37 00000000", "0066 0001 00001e5b 00000000"),
    ],
)
def test_64_bit_clients(connect: str, accepted: str) -> None:
    program = bench().program(None)
    assert program.exchange(raw(connect)) == raw(accepted)
    reply = program.exchange(raw("000f 0000"))
    assert (HEADER.unpack_from(reply), len(reply)) == ((80, 49), 4 + 8 * 49)


def test_what_64_bit_clients_lose_of_their_texts() -> None:
    made = bench()
    program = made.program(None)
    program.exchange(raw("0066 0002 00000000 00000001 00000000 00001f21"))
    sent = "hello, world\0"
    words = [sent[place : place + 4].encode()[::-1] for place in (0, 8)]  # the others do not leave the client
    program.exchange(raw("0013 0002") + b"".join(bytes(4) + word.rjust(4, b"\0") for word in words))
    assert made.windows.robots[0].said[-1][1] == "hellorld"
