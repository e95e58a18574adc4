"""Parties on a transport that are as bare as can be, and places at which there is one."""

from __future__ import annotations

import socket
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path

import msgspec
import pytest
from tests.channel_contract import Air

from sleepcast.channel import Message
from sleepcast.channel.door import Door
from sleepcast.channel.envelope import encode
from sleepcast.channel.keys import KeyPair, Role, Trust
from sleepcast.channel.transport import Transport, open_transport
from sleepcast.clock import ManualClock

DESK = KeyPair("desk", Role.COMMANDER, b"d" * 32)
ROBOTS = KeyPair("r*", Role.ROBOT, b"r" * 32)
TRUST = (DESK.public, ROBOTS.public)
PATIENCE = 20.0
QUIET = 0.05


def free_port(kind: socket.SocketKind = socket.SOCK_DGRAM) -> int:
    with socket.socket(socket.AF_INET, kind) as found:
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


def endpoint(transport: Transport, key: KeyPair) -> Endpoint:
    # The contract's messages are of the beginning of time, and it sends more than a robot would look at in a second.
    return Endpoint(transport, key, Door(Trust(TRUST), "lab", ManualClock(10.0), robot=key is ROBOTS, rate=10_000.0))


def channel(uri: str, key: KeyPair) -> Endpoint:
    return endpoint(open_transport(uri), key)


def air_over(transports: Sequence[Transport]) -> Air:
    """An operator on the first of them, and robots on the others."""
    keys = (DESK, *[ROBOTS] * (len(transports) - 1))
    parties = [Listening(endpoint(transport, key), []) for transport, key in zip(transports, keys, strict=True)]

    def settle() -> None:
        quiet_since, begin = time.monotonic(), time.monotonic()
        while time.monotonic() - quiet_since < QUIET and time.monotonic() - begin < PATIENCE:
            if sum(party.look() for party in parties):  # each of them looks
                quiet_since = time.monotonic()

    return Air(parties[0], parties[1:], settle)


def multicasting() -> str:
    """An interface to which the machine sends multicast of IPv6, "" if there is none; Linux only."""
    try:
        routes = [line.split() for line in Path("/proc/net/ipv6_route").read_text().splitlines()]
    except OSError:
        return ""
    return next((route[-1] for route in routes if route[0].startswith("ff00") and route[1] == "08"), "")


def heard_everywhere(parties: Sequence[Transport]) -> None:
    """Wait until the last of these hears the first, as media need that find each other first; then until all is
    quiet. Fails if that never comes."""
    begin = time.monotonic()
    while not parties[-1].receive():
        assert time.monotonic() - begin < PATIENCE, "nobody hears anybody"
        parties[0].send(b"is anybody there?")
        time.sleep(0.01)
    time.sleep(QUIET)
    for party in parties:
        party.receive()


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
    """Parties at a router. template: "" for one of its own; `?listen` where the first party is the router; two for a
    router at each of two sites, where every second party is at the other one."""
    pytest.importorskip("zenoh", reason="eclipse-zenoh is not installed here")
    first, second = (f"127.0.0.1:{free_port(socket.SOCK_STREAM)}" for _ in range(2))
    with ExitStack() as stack:
        routers = [f"zenoh://{first}?listen", f"zenoh://{second}?listen&connect={first}"]
        for uri in routers[: {"": 1, "?listen": 0, "two": 2}[template]]:
            stack.callback(open_transport(uri).close)
        sites = [f"zenoh://{first}", f"zenoh://{second}" if template == "two" else f"zenoh://{first}"]
        opened = 0

        def party() -> Transport:
            nonlocal opened
            opened += 1
            return open_transport(routers[0] if template == "?listen" and opened == 1 else sites[opened % 2])

        yield party


MEDIA = {
    "multicast": (udp, "udp://239.255.83.76:{}?interface=lo"),
    "broadcast": (udp, "udp://127.255.255.255:{}"),
    "multicast-v6": (udp, "udp://[ff12::5ca7]:{}"),
    "memory": (memory, "memory:contract"),
    "memory-slow": (memory, "memory:contract?delay=0.005"),
    "zenoh": (zenoh, ""),
    "zenoh-own-router": (zenoh, "?listen"),
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
        yield found
