"""One party's end of a channel that carries bytes: it signs what goes out, and its door decides what comes in.

What carries the bytes is a `Transport`; `open_transport` makes one from an address.
"""

from __future__ import annotations

from typing import Protocol

from sleepcast.channel.door import Door
from sleepcast.channel.envelope import encode
from sleepcast.channel.keys import KeyPair
from sleepcast.channel.message import Message
from sleepcast.channel.udp import EXAMPLE, AddressError, Udp
from sleepcast.errors import did_you_mean

SCHEMES = {"udp": Udp}
"""What carries bytes, by the first word of its addresses."""


class Transport(Protocol):
    """Carries datagrams from each to all others, or loses them. Nothing here waits."""

    def fileno(self) -> int:
        """What to wait on for news."""

    def send(self, datagram: bytes) -> None: ...

    def receive(self) -> list[bytes]:
        """What has come in since the last call, in the order in which it came; nothing of our own."""

    def close(self) -> None: ...


def open_transport(uri: str) -> Transport:
    """Raises AddressError for an address that means nothing, and what the transport raises where it cannot be had."""
    scheme = uri.partition("://")[0]
    if scheme not in SCHEMES:
        wanted = f"wanted one that begins with {' or '.join(SCHEMES)}://, for instance {EXAMPLE}"
        raise AddressError(f"{uri!r} is no address of a channel{did_you_mean(scheme, SCHEMES)}: {wanted}")
    return SCHEMES[scheme](uri)


class Endpoint:
    """A `Channel` over a transport. key: signs what is sent; door: decides what is heard."""

    def __init__(self, transport: Transport, key: KeyPair, door: Door) -> None:
        self.door = door
        self._transport, self._key = transport, key

    def fileno(self) -> int:
        """What to wait on for news."""
        return self._transport.fileno()

    def send(self, message: Message) -> None:
        """Broadcast. Raises MessageError for what is too long to be sent."""
        for datagram in encode(message, self.door.fleet, self._key):
            self._transport.send(datagram)

    def receive(self) -> list[Message]:
        """What has come in since the last call, in the order in which it came."""
        entered = map(self.door.enter, self._transport.receive())
        return [each.message for each in entered if each is not None]

    def close(self) -> None:
        """Leave. Nothing can be sent or heard afterwards."""
        self._transport.close()

    def __enter__(self) -> Endpoint:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()
