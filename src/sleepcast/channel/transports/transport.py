"""What carries bytes from each to all others, by its address; what they mean is no matter of it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Protocol, runtime_checkable

from sleepcast.channel.message import Kind
from sleepcast.channel.transports.address import AddressError
from sleepcast.channel.transports.memory import MemoryTransport
from sleepcast.channel.transports.udp import EXAMPLE, UdpTransport
from sleepcast.core.clock import Clock, UnixClock
from sleepcast.core.errors import did_you_mean


class Transport(Protocol):
    """Carries datagrams from each to all others, or loses them. Nothing here waits."""

    def fileno(self) -> int:
        """What to wait on for news."""

    def send(self, datagram: bytes) -> None: ...

    def receive(self) -> list[bytes]:
        """What has come in since the last call, in the order in which it came; nothing of our own."""

    def close(self) -> None:
        """Leave. Nothing can be sent or heard afterwards."""


@runtime_checkable
class KindFilter(Protocol):
    """A transport that can leave out kinds of messages before they cost anybody anything."""

    def ignore(self, kinds: Iterable[Kind]) -> None:
        """These kinds need not be brought here any more, all others do. It may bring them all the same."""


def listen_for(transport: Transport, wanted: Iterable[Kind]) -> None:
    """Only these kinds are wanted of a transport, if it can tell them from others."""
    if isinstance(transport, KindFilter):
        transport.ignore(frozenset(Kind) - frozenset(wanted))


def open_transport(uri: str, clock: Clock | None = None) -> Transport:
    """The transport at an address. clock: s; of a medium that exists only here, and whose delays are ours; None for
    this computer's. Raises AddressError for an address that means nothing, and what the transport raises where it
    cannot be had."""
    scheme = uri.partition(":")[0]
    if scheme not in SCHEMES:
        wanted = f"wanted one that begins with {', '.join(SCHEMES)}:, for instance {EXAMPLE}"
        raise AddressError(f"{uri[:80]!r} is no address of a channel{did_you_mean(scheme, SCHEMES)}: {wanted}")
    return SCHEMES[scheme](uri, clock or UnixClock())


def _udp(uri: str, clock: Clock) -> Transport:
    return UdpTransport(uri)


def _zenoh(uri: str, clock: Clock) -> Transport:
    from sleepcast.channel.transports.zenoh import (
        ZenohTransport,  # a library of megabytes, for those who have and want it
    )

    return ZenohTransport(uri)


SCHEMES: dict[str, Callable[[str, Clock], Transport]] = {"udp": _udp, "memory": MemoryTransport, "zenoh": _zenoh}
"""What carries bytes, by the first word of its addresses."""
