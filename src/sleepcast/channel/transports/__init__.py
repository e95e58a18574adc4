"""Transports: they carry datagrams from each party to all others, and are chosen by the scheme of an address.

`transport` says what each of them promises; there are three: `memory`, `udp` and `zenoh`. A package adds others with
entry points in the group `sleepcast.transports`: a scheme, and what opens such an address, `open(uri, clock)`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

from sleepcast.channel.transports.address import EXAMPLE, AddressError
from sleepcast.channel.transports.transport import Transport
from sleepcast.core.clock import Clock, UnixClock
from sleepcast.core.errors import did_you_mean

Opening = Callable[[str, Clock], Transport]
ADDED = "sleepcast.transports"


def open_transport(uri: str, clock: Clock | None = None) -> Transport:
    """The transport at an address. clock: s, for the delays of `memory:`; None for this computer's. Raises AddressError
    for an address that cannot be read, and the transport's own error where it cannot be opened."""
    scheme = uri.partition(":")[0]
    opening = _SCHEMES.get(scheme) or _added(uri, scheme)
    return opening(uri, clock or UnixClock())


def _added(uri: str, scheme: str) -> Opening:
    """What opens an address whose scheme an installed package adds. Raises AddressError."""
    from sleepcast.core.extensions import extensions, load_extension  # importing it takes time

    added = extensions(ADDED)
    if scheme not in added:
        schemes = (*_SCHEMES, *added)
        wanted = f"wanted one that begins with {', '.join(schemes)}:, for instance {EXAMPLE}"
        raise AddressError(f"{uri[:80]!r} is not a channel address{did_you_mean(scheme, schemes)}: {wanted}")
    return cast(Opening, load_extension(added[scheme], "transport"))


def _udp(uri: str, clock: Clock) -> Transport:
    from sleepcast.channel.transports.udp import UdpTransport

    return UdpTransport(uri)


def _memory(uri: str, clock: Clock) -> Transport:
    from sleepcast.channel.transports.memory import MemoryTransport

    return MemoryTransport(uri, clock)


def _zenoh(uri: str, clock: Clock) -> Transport:
    from sleepcast.channel.transports.zenoh import ZenohTransport  # an optional library of megabytes

    return ZenohTransport(uri)


_SCHEMES: dict[str, Opening] = {"udp": _udp, "memory": _memory, "zenoh": _zenoh}
"""What opens an address, by its scheme."""
