"""UDP on this machine's own network: the contract of every channel, and what comes from strangers."""

from __future__ import annotations

import re
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path

import msgspec
import pytest
from tests.channel_contract import Air, ChannelContract, message

from sleepcast.channel import Kind, Message
from sleepcast.channel.door import Door, Drop
from sleepcast.channel.envelope import encode
from sleepcast.channel.keys import KeyPair, Role, Trust
from sleepcast.channel.transport import Transport, open_transport
from sleepcast.channel.udp import AddressError, UdpError
from sleepcast.clock import ManualClock

DESK = KeyPair("desk", Role.COMMANDER, b"d" * 32)
ROBOTS = KeyPair("r*", Role.ROBOT, b"r" * 32)
TRUST = (DESK.public, ROBOTS.public)
PATIENCE = 20.0
QUIET = 0.05


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as found:
        found.bind(("127.0.0.1", 0))
        port: int = found.getsockname()[1]
        return port


class Endpoint:
    """A channel as bare as can be: each message is signed and sent once, and heard if the door lets it in."""

    def __init__(self, transport: Transport, key: KeyPair, door: Door) -> None:
        self.door = door
        self._transport, self._key = transport, key

    def send(self, sent: Message) -> None:
        for datagram in encode(sent, self.door.fleet, self._key):
            self._transport.send(datagram)

    def receive(self) -> list[Message]:
        entered = map(self.door.enter, self._transport.receive())
        # Who has signed it is the door's affair: a transport is to bring what was said.
        return [msgspec.structs.replace(each.message, role="") for each in entered if each is not None]

    def __enter__(self) -> Endpoint:
        return self

    def __exit__(self, *_: object) -> None:
        self._transport.close()


@dataclass
class Listening:
    """A channel of which nothing that came in is lost while somebody waits for quiet."""

    channel: Endpoint
    heard: list[Message]

    def send(self, sent: Message) -> None:
        self.channel.send(sent)

    def receive(self) -> list[Message]:
        found, self.heard = self.heard, []
        return found

    def look(self) -> bool:
        found = self.channel.receive()
        self.heard += found
        return bool(found)


def channel(uri: str, key: KeyPair) -> Endpoint:
    # The contract's messages are of the beginning of time, and it sends more than a robot would look at in a second.
    door = Door(Trust(TRUST), "lab", ManualClock(10.0), robot=key is ROBOTS, rate=10_000.0)
    return Endpoint(open_transport(uri), key, door)


@pytest.fixture(params=["udp://239.255.83.76:{}?interface=lo", "udp://127.255.255.255:{}", "udp://[ff12::5ca7]:{}"])
def air(request: pytest.FixtureRequest) -> Iterator[Air]:
    uri = str(request.param).format(free_port())
    if "[" in uri:
        interface = multicasting()
        if not interface:
            pytest.skip("no interface of this machine carries multicast of IPv6")
        uri += f"?interface={interface}"
    with ExitStack() as stack:
        parties = [Listening(stack.enter_context(channel(uri, key)), []) for key in (DESK, *[ROBOTS] * 3)]

        def settle() -> None:
            quiet_since, begin = time.monotonic(), time.monotonic()
            while time.monotonic() - quiet_since < QUIET and time.monotonic() - begin < PATIENCE:
                if sum(party.look() for party in parties):  # each of them looks
                    quiet_since = time.monotonic()

        yield Air(parties[0], parties[1:], settle)


def multicasting() -> str:
    """An interface to which the machine sends multicast of IPv6, "" if there is none; Linux only."""
    try:
        routes = [line.split() for line in Path("/proc/net/ipv6_route").read_text().splitlines()]
    except OSError:
        return ""
    return next((route[-1] for route in routes if route[0].startswith("ff00") and route[1] == "08"), "")


class TestUdp(ChannelContract):
    pass


@pytest.mark.parametrize(
    ("uri", "complaint"),
    [
        ("", "begins with udp://"),
        ("udp://239.255.83.76", "wanted udp://ADDRESS:PORT"),
        ("udp://239.255.83.76:0", "wanted udp://ADDRESS:PORT"),
        ("udp://239.255.83.76:99999", "Port out of range"),
        ("udp://somewhere:47123", "does not appear to be an IPv4 or IPv6 address"),
        ("udp:239.255.83.76:47123", "begins with udp://"),
        ("udpp://239.255.83.76:47123", "did you mean udp"),
        ("udp://239.255.83.76:47123/path", "wanted udp://ADDRESS:PORT"),
        ("udp://239.255.83.76:47123?interfaces=lo", "did you mean interface"),
        ("udp://239.255.83.76:47123?interface=lp", "this machine has no interface 'lp'"),
    ],
)
def test_an_address_that_means_nothing_is_refused_with_what_was_wanted(uri: str, complaint: str) -> None:
    with pytest.raises(AddressError, match=re.escape(complaint)):
        channel(uri, DESK)


def test_strangers_are_counted_and_not_heard() -> None:
    uri = f"udp://239.255.83.76:{free_port()}?interface=lo"
    stranger = KeyPair("desk", Role.COMMANDER, b"s" * 32)
    with channel(uri, ROBOTS) as robot, channel(uri, stranger) as other, channel(uri, DESK) as desk:
        other.send(message(Kind.COMMAND))
        desk.send(message(Kind.COMMAND, sequence=2))
        heard: list[Message] = []
        begin = time.monotonic()
        while not heard and time.monotonic() - begin < PATIENCE:
            heard = robot.receive()
        assert [each.sequence for each in heard] == [2]
        assert robot.door.counts == {Drop.UNKNOWN_KEY: 1}


def test_a_port_that_somebody_has_for_himself_alone_is_named() -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as greedy:
        greedy.bind(("127.255.255.255", 0))
        uri = f"udp://127.255.255.255:{greedy.getsockname()[1]}"
        with pytest.raises(UdpError, match="take another port"):
            channel(uri, DESK)
