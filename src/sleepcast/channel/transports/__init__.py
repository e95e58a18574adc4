"""Transports: they carry datagrams from each party to all others, and are chosen by the scheme of an address.

`transport` says what each of them promises; there are three: `memory`, `udp` and `zenoh`.
"""

from __future__ import annotations

from collections.abc import Callable

from sleepcast.channel.transports.address import EXAMPLE, AddressError
from sleepcast.channel.transports.transport import Transport
from sleepcast.core.clock import Clock, UnixClock
from sleepcast.core.errors import did_you_mean


def open_transport(uri: str, clock: Clock | None = None) -> Transport:
    """The transport at an address. clock: s, for the delays of `memory:`; None for this computer's. Raises AddressError
    for an address that cannot be read, and the transport's own error where it cannot be opened."""
    scheme = uri.partition(":")[0]
    if scheme not in _SCHEMES:
        wanted = f"wanted one that begins with {', '.join(_SCHEMES)}:, for instance {EXAMPLE}"
        raise AddressError(f"{uri[:80]!r} is not a channel address{did_you_mean(scheme, _SCHEMES)}: {wanted}")
    return _SCHEMES[scheme](uri, clock or UnixClock())


def _udp(uri: str, clock: Clock) -> Transport:
    from sleepcast.channel.transports.udp import UdpTransport

    return UdpTransport(uri)


def _memory(uri: str, clock: Clock) -> Transport:
    from sleepcast.channel.transports.memory import MemoryTransport

    return MemoryTransport(uri, clock)


def _zenoh(uri: str, clock: Clock) -> Transport:
    from sleepcast.channel.transports.zenoh import ZenohTransport  # an optional library of megabytes

    return ZenohTransport(uri)


_SCHEMES: dict[str, Callable[[str, Clock], Transport]] = {"udp": _udp, "memory": _memory, "zenoh": _zenoh}
"""What opens an address, by its scheme."""
