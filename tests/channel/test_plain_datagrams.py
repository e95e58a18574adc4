"""Plain datagrams: what programs of the Nomad's day send is understood, and nothing else gets in."""

from __future__ import annotations

import random
import socket
import time

import pytest

from sleepcast.channel.plain_datagrams import (
    LARGEST,
    MAX_AT_ONCE,
    MAX_BYTES,
    DatagramError,
    Datagrams,
    pack,
    send,
    unpack,
)
from sleepcast.core.errors import MisuseError

LONGEST = 60.0


def test_three_fields_of_width_twelve_with_two_decimals() -> None:
    data = pack((1.0, -2.5, 1234567.891))
    assert len(data) == MAX_BYTES == 128
    assert data.rstrip(b"\0") == b"        1.00        -2.50   1234567.89"
    assert unpack(data) == (1.0, -2.5, 1234567.89)


@pytest.mark.parametrize(
    ("data", "numbers"),
    [
        (b"        1.20        2.40        3.60\0" + bytes(range(1, 92)), (1.2, 2.4, 3.6)),
        (b"1 2 3", (1.0, 2.0, 3.0)),
        (b"-.5 +7. 0\n", (-0.5, 7.0, 0.0)),
        (b"", None),
        (b"\0" * 128, None),
        (b"1 2", None),
        (b"1 2 3 4", None),
        (b"1 2 three", None),
        (b"1 2 nan", None),
        (b"1 2 inf", None),
        (b"1 2 1e9", None),
        (b"1 2 1_000", None),
        (b"1 2 0x10", None),
        (b"1 2 " + b"9" * 100, None),
        (b"1 2 9999999999", None),
        ("1 2 ٣".encode(), None),
        (b"1 2 3".ljust(129, b"\0"), None),
    ],
)
def test_what_is_understood(data: bytes, numbers: tuple[float, float, float] | None) -> None:
    assert unpack(data) == numbers


def test_no_bytes_do_harm() -> None:
    chance = random.Random(7)
    good = pack((1.0, 2.0, 3.0))
    for _ in range(20_000):
        data = bytearray(good)
        for _ in range(chance.randrange(4)):
            data[chance.randrange(40)] = chance.randrange(256)
        found = unpack(bytes(data))
        assert found is None or all(abs(number) < LARGEST for number in found)


@pytest.mark.parametrize("numbers", [(1.0, 2.0), (1.0, 2.0, 3.0, 4.0), (1.0, 2.0, 1e9), (float("nan"), 0.0, 0.0)])
def test_only_three_numbers_that_fit_can_be_sent(numbers: tuple[float, ...]) -> None:
    with pytest.raises(MisuseError, match="three numbers, each smaller than"):
        pack(numbers)


def test_they_come_in_order_and_what_is_none_is_counted() -> None:
    with Datagrams("127.0.0.1", 0) as listener, socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        assert listener.receive() == []
        send((1.0, 2.0, 3.0), ("127.0.0.1", listener.port))
        for data in (b"", b"(ST)", b"x" * 5000):
            sender.sendto(data, ("127.0.0.1", listener.port))
        send((4.0, 5.0, 6.0), ("127.0.0.1", listener.port))
        found, deadline = [], time.monotonic() + LONGEST
        while len(found) < 2:
            assert time.monotonic() < deadline
            found += listener.receive()
        assert found == [(1.0, 2.0, 3.0), (4.0, 5.0, 6.0)]
        assert (listener.counts.taken, listener.counts.dropped) == (2, 3)


def test_a_flood_costs_a_call_no_more_than_a_bound() -> None:
    with Datagrams("127.0.0.1", 0) as listener:
        send((1.0, 2.0, 3.0), *[("127.0.0.1", listener.port)] * 100)
        assert len(listener.receive()) == MAX_AT_ONCE
        assert len(listener.receive()) == 100 - MAX_AT_ONCE


def test_what_cannot_be_listened_to_or_sent_says_why() -> None:
    with Datagrams("127.0.0.1", 0) as listener, pytest.raises(DatagramError, match="choose another port"):
        Datagrams("127.0.0.1", listener.port)
    with pytest.raises(DatagramError, match="is not an address to listen on"):
        Datagrams("no host has this name", 0)
    with pytest.raises(DatagramError, match="cannot send to"):
        send((1.0, 2.0, 3.0), ("a" * 70, 5001))
