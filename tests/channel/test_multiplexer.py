"""Many parties of one process on one transport: what reaches whom, and what is worked out once."""

from __future__ import annotations

import sys
import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass

import pytest

from channel.test_udp import free_port
from sleepcast.channel import Kind, Message
from sleepcast.channel.admission import ROBOT_KINDS
from sleepcast.channel.drops import DropCounter, DropReason
from sleepcast.channel.envelope import encode
from sleepcast.channel.keys import KeyPair
from sleepcast.channel.message import Role
from sleepcast.channel.session import MAX_QUEUE, Multiplexer, Port
from sleepcast.channel.transports import open_transport
from sleepcast.channel.transports.transport import Transport
from sleepcast.core.clock import WallClock

DESK = KeyPair("desk", Role.OPERATOR, b"d" * 32)
ROBOTS = KeyPair("r*", Role.ROBOT, b"r" * 32)
NOW = 1_000.0
PATIENCE = 60.0


@dataclass
class Place:
    """A multiplexer with three robots, and somebody else on the same network."""

    multiplexer: Multiplexer
    ports: list[Port]
    outside: Transport

    def heard(self, count: int) -> list[list[bytes]]:
        """What each branch hears, once there is something for so many of them."""
        found: list[list[bytes]] = [[] for _ in self.ports]
        until = time.monotonic() + PATIENCE
        while sum(map(bool, found)) < count and time.monotonic() < until:
            for each, port in zip(found, self.ports, strict=True):
                each += port.receive()
            time.sleep(0.001)
        return found

    def outside_hears(self) -> list[bytes]:
        until = time.monotonic() + PATIENCE
        while not (found := self.outside.receive()) and time.monotonic() < until:
            time.sleep(0.001)
        return found


@pytest.fixture
def place() -> Iterator[Place]:
    uri = f"udp://239.255.83.78:{free_port()}?interface=lo"
    with ExitStack() as stack:
        multiplexer = Multiplexer(open_transport(uri), DropCounter(WallClock()))
        ports = [multiplexer.port(ROBOT_KINDS) for _ in range(3)]
        outside = open_transport(uri)
        stack.callback(outside.close)
        for port in ports:
            stack.callback(port.close)
        yield Place(multiplexer, ports, outside)


def datagram(kind: Kind = Kind.COMMAND, sequence: int = 1, key: KeyPair = DESK, sender: str = "desk") -> bytes:
    return encode(Message(sender, 1, sequence, kind, NOW, NOW + 5.0, "(ST)"), "lab", key)[0]


def test_what_comes_from_outside_reaches_every_branch_once(place: Place) -> None:
    first, second = datagram(), datagram(sequence=2)
    place.outside.send(first)
    place.outside.send(second)
    heard = place.heard(3)
    until = time.monotonic() + PATIENCE
    while len(heard[0]) < 2 and time.monotonic() < until:
        for each, more in zip(heard, place.heard(1), strict=True):
            each += more
    assert heard == [[first, second]] * 3
    assert [port.receive() for port in place.ports] == [[], [], []]


def test_neighbours_and_the_network_hear_what_one_of_them_says_and_he_does_not(place: Place) -> None:
    said = datagram(Kind.REQUEST, key=ROBOTS, sender="r1")
    place.ports[0].send(said)
    assert place.heard(2) == [[], [said], [said]]
    assert place.outside_hears() == [said]


def test_what_nobody_has_ears_for_ends_at_the_trunk(place: Place) -> None:
    answer = datagram(Kind.ANSWER, key=ROBOTS, sender="r9")
    place.ports[0].send(answer)
    assert place.outside_hears() == [answer], "the operator is to hear it"
    place.outside.send(answer)
    place.outside.send(b"nonsense")
    place.outside.send(datagram())
    assert place.heard(3) == [[datagram()]] * 3
    assert place.multiplexer.drops.counts[DropReason.MALFORMED] == 1
    assert place.multiplexer.drops.counts[DropReason.NOT_FOR_US] == (0 if sys.platform == "linux" else 1), (
        "the filter drops it first"
    )


def test_an_operator_among_them_hears_answers(place: Place) -> None:
    desk = place.multiplexer.port(Kind)
    answer = datagram(Kind.ANSWER, key=ROBOTS, sender="r1")
    place.ports[0].send(answer)
    assert desk.receive() == [answer]
    desk.close()
    place.ports[0].send(answer)
    assert desk.receive() == []


def test_a_party_that_does_not_look_keeps_the_latest_only(place: Place) -> None:
    talker, listener, _ = place.ports
    for sequence in range(1, 6):
        talker.send(datagram(sequence=sequence))
    listener.waiting.clear()
    listener.waiting.extend([b""] * MAX_QUEUE)
    talker.send(datagram(sequence=9))
    assert len(listener.waiting) == MAX_QUEUE
    assert listener.receive()[-1] == datagram(sequence=9)


def test_the_last_one_to_leave_closes_the_transport(place: Place) -> None:
    for port in place.ports:
        assert place.multiplexer.fileno() >= 0
        port.close()
    assert place.multiplexer.fileno() == -1
