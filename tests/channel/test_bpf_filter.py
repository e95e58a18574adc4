"""Kinds that a socket leaves out: just those, whatever else comes."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterable, Iterator

import pytest

from channel.test_udp import free_port
from sleepcast.channel import Kind, Message
from sleepcast.channel.admission import ROBOT_KINDS
from sleepcast.channel.envelope import KINDS, LEAST, encode, kind_of
from sleepcast.channel.keys import KeyPair
from sleepcast.channel.message import TO_OPERATOR, Role
from sleepcast.channel.transports import open_transport
from sleepcast.channel.transports.transport import Transport, listen_for

DESK = KeyPair("desk", Role.COMMANDER, b"d" * 32)
PATIENCE = 60.0
pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only Linux has such filters")


@pytest.fixture(params=["239.255.83.79", "127.255.255.255"])
def pair(request: pytest.FixtureRequest) -> Iterator[tuple[Transport, Transport]]:
    uri = f"udp://{request.param}:{free_port()}?interface=lo"
    mouth, ears = open_transport(uri), open_transport(uri)
    yield mouth, ears
    mouth.close()
    ears.close()


def datagrams() -> list[bytes]:
    """One of each kind, a command that stands, and two that are no messages."""
    found = [encode(Message("desk", 1, 1, kind, 1.0, 2.0), "lab", DESK)[0] for kind in KINDS]
    found += encode(Message("desk", 1, 2, Kind.COMMAND, 1.0, standing=True), "lab", DESK)
    return [*found, b"", b"short", b"x" * LEAST]


def heard(mouth: Transport, ears: Transport, sent: Iterable[bytes]) -> list[bytes]:
    """What of this is heard before a last word that everybody hears."""
    last = b"the end"
    for each in (*sent, last):
        mouth.send(each)
    found: list[bytes] = []
    until = time.monotonic() + PATIENCE
    while last not in found and time.monotonic() < until:
        found += ears.receive()
        time.sleep(0.001)
    found.remove(last)
    return found


def in_order(sent: list[bytes]) -> list[bytes]:
    """As they are heard: STOPs overtake all else, and then what robots tell their operator."""
    lanes: list[frozenset[Kind | None]] = [frozenset({Kind.STOP}), frozenset(TO_OPERATOR)]
    return sorted(sent, key=lambda each: [kind_of(each) not in lane for lane in lanes])


@pytest.mark.parametrize(
    "wanted", [frozenset(Kind), ROBOT_KINDS, frozenset({Kind.STOP}), frozenset(Kind) - {Kind.COMMAND}]
)
def test_just_the_unwanted_kinds_are_left_out(pair: tuple[Transport, Transport], wanted: frozenset[Kind]) -> None:
    mouth, ears = pair
    listen_for(ears, wanted)
    sent = datagrams()
    kinds = [*KINDS, Kind.COMMAND, None, None, None]
    assert heard(mouth, ears, sent) == in_order(
        [each for each, kind in zip(sent, kinds, strict=True) if kind is None or kind in wanted]
    )


def test_what_is_wanted_again_comes_again(pair: tuple[Transport, Transport]) -> None:
    mouth, ears = pair
    listen_for(ears, frozenset())
    assert len(heard(mouth, ears, datagrams())) == 3
    listen_for(ears, Kind)
    assert heard(mouth, ears, datagrams()) == in_order(datagrams())
