"""What carries bytes from each to all others, by its address; what they mean is no matter of it."""

from __future__ import annotations

from typing import Protocol

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
