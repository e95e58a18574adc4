"""Parties on a transport that are as bare as can be, and places at which there is one."""

from __future__ import annotations

import select
import socket
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from os import urandom
from pathlib import Path

import msgspec
import pytest
from tests.channel_contract import Air

from sleepcast.channel import Message
from sleepcast.channel.admission import Admission
from sleepcast.channel.envelope import encode
from sleepcast.channel.keys import KeyPair, Trust
from sleepcast.channel.message import Role
from sleepcast.channel.transports import open_transport
from sleepcast.channel.transports.transport import Transport
from sleepcast.core.clock import ManualClock

DESK = KeyPair("desk", Role.COMMANDER, b"d" * 32)
ROBOTS = KeyPair("r*", Role.ROBOT, b"r" * 32)
TRUST = (DESK.public, ROBOTS.public)
PATIENCE = 60.0
MARKER = b"nothing after this has come before: "


def free_port(kind: socket.SocketKind = socket.SOCK_DGRAM) -> int:
    with socket.socket(socket.AF_INET, kind) as found:
        found.bind(("127.0.0.1", 0))
        port: int = found.getsockname()[1]
        return port


class Endpoint:
    """A channel as bare as can be: each message is signed and sent once, and heard if the door lets it in. markers:
    datagrams that came and only show that all before them have come, too."""

    def __init__(self, transport: Transport, key: KeyPair, admission: Admission) -> None:
        self.admission, self.transport = admission, transport
        self.markers: set[bytes] = set()
        self._key = key
        self._heard: list[Message] = []

    def send(self, sent: Message) -> None:
        for datagram in encode(sent, self.admission.fleet, self._key):
            self.transport.send(datagram)

    def receive(self) -> list[Message]:
        self.look()
        found, self._heard = self._heard, []
        return found

    def look(self) -> None:
        """Take in what has come, for whoever asks later."""
        for datagram in self.transport.receive():
            if datagram.startswith(MARKER):
                self.markers.add(datagram)
            elif entered := self.admission.enter(datagram):
                # Who has signed it is the door's affair: a transport is to bring what was said.
                self._heard.append(msgspec.structs.replace(entered.message, role="", key=""))

    def __enter__(self) -> Endpoint:
        return self

    def __exit__(self, *_: object) -> None:
        self.transport.close()


def endpoint(transport: Transport, key: KeyPair) -> Endpoint:
    # The contract's messages are of the beginning of time, and it sends more than a robot would look at in a second.
    return Endpoint(
        transport, key, Admission(Trust(TRUST), "lab", ManualClock(10.0), robot=key is ROBOTS, rate=10_000.0)
    )


def channel(uri: str, key: KeyPair) -> Endpoint:
    return endpoint(open_transport(uri), key)


def air_over(transports: Sequence[Transport]) -> Air:
    """An operator on the first of them, and robots on the others."""
    keys = (DESK, *[ROBOTS] * (len(transports) - 1))
    parties = [endpoint(transport, key) for transport, key in zip(transports, keys, strict=True)]

    def settle() -> None:
        """What one party says comes in its order: when all have all others' markers, nothing is on its way."""
        markers = [MARKER + urandom(8) for _ in parties]
        for party, marker in zip(parties, markers, strict=True):
            party.transport.send(marker)
        begin = time.monotonic()
        while not all({*markers} - {own} <= party.markers for party, own in zip(parties, markers, strict=True)):
            assert time.monotonic() - begin < PATIENCE, "somebody does not hear somebody else"
            select.select([party.transport for party in parties], [], [], 0.05)
            for party in parties:
                party.look()

    return Air(parties[0], parties[1:], settle)


def multicasting() -> str:
    """An interface to which the machine sends multicast of IPv6, "" if there is none; Linux only."""
    try:
        routes = [line.split() for line in Path("/proc/net/ipv6_route").read_text().splitlines()]
    except OSError:
        return ""
    return next((route[-1] for route in routes if route[0].startswith("ff00") and route[1] == "08"), "")


def heard_everywhere(parties: Sequence[Transport]) -> None:
    """Wait until everybody hears everybody else, as media need that find each other first. Fails if that never comes.
    Some of what was said meanwhile may still be on its way."""
    greetings = [b"here is %d" % number for number in range(len(parties))]
    heard: list[set[bytes]] = [{greeting} for greeting in greetings]
    begin = time.monotonic()
    while not all(each == {*greetings} for each in heard):
        assert time.monotonic() - begin < PATIENCE, "somebody does not hear somebody else"
        for party, greeting in zip(parties, greetings, strict=True):
            party.send(greeting)
        time.sleep(0.01)
        for party, each in zip(parties, heard, strict=True):
            each |= {*party.receive()} & {*greetings}


@contextmanager
def udp(template: str) -> Iterator[Callable[[], Transport]]:
    uri = template.format(free_port())
    if "[" in uri:
        interface = multicasting()
        if not interface:
            pytest.skip("no interface of this machine carries multicast of IPv6")
        uri += f"?interface={interface}"
    yield lambda: open_transport(uri)


@contextmanager
def memory(template: str) -> Iterator[Callable[[], Transport]]:
    yield lambda: open_transport(template)


@contextmanager
def zenoh(template: str) -> Iterator[Callable[[], Transport]]:
    """Parties at a router that one of them is (template ""), or at the routers of two sites that are linked ("two")."""
    pytest.importorskip("zenoh", reason="eclipse-zenoh is not installed here")
    first, second = (f"127.0.0.1:{free_port(socket.SOCK_STREAM)}" for _ in range(2))
    linked = f"zenoh://{second}?listen&connect={first}"
    places = [f"zenoh://{first}?listen", linked if template else f"zenoh://{first}"]
    opened = 0

    def party() -> Transport:
        nonlocal opened
        opened += 1
        return open_transport(places[opened - 1] if opened <= 2 else places[opened % 2].partition("?")[0])

    yield party


MEDIA = {
    "multicast": (udp, "udp://239.255.83.76:{}?interface=lo"),
    "broadcast": (udp, "udp://127.255.255.255:{}"),
    "multicast-v6": (udp, "udp://[ff12::5ca7]:{}"),
    "memory": (memory, "memory:contract"),
    "memory-slow": (memory, "memory:contract?delay=0.005"),
    "zenoh": (zenoh, ""),
    "zenoh-two-routers": (zenoh, "two"),
}
"""Every transport, by what it is called: who opens it, and with what."""


@contextmanager
def parties_of(medium: str, count: int) -> Iterator[list[Transport]]:
    """So many parties of a transport that hear each other."""
    opener, template = MEDIA[medium]
    with ExitStack() as stack:
        party = stack.enter_context(opener(template))
        found: list[Transport] = []
        for _ in range(count):
            found.append(party())
            stack.callback(found[-1].close)
        heard_everywhere(found)
        air_over(found).settle()
        yield found
