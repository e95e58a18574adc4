"""Transports: they carry datagrams from each party to all others, and are chosen by the scheme of an address.

`transport` says what each of them promises; there are three: `memory`, `udp` and `zenoh`. Schemes are entry points in
the group `sleepcast.transports`, those of sleepcast itself and those that installed packages add alike: a scheme, and
what opens such an address, `open(uri, clock)`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

from sleepcast.channel.transports.address import EXAMPLE, AddressError
from sleepcast.channel.transports.transport import Transport
from sleepcast.core.clock import Clock, UnixClock
from sleepcast.core.errors import did_you_mean

Opening = Callable[[str, Clock], Transport]
TRANSPORTS = "sleepcast.transports"


def open_transport(uri: str, clock: Clock | None = None) -> Transport:
    """The transport at an address. clock: s, for the delays of `memory:`; None for this computer's. Raises AddressError
    for an address that cannot be read, and the transport's own error where it cannot be opened."""
    from sleepcast.core.extensions import extensions, find_extension, load_extension  # importing it takes time

    scheme = uri.partition(":")[0]
    found = find_extension(TRANSPORTS, scheme)
    if found is None:
        schemes = tuple(extensions(TRANSPORTS))
        wanted = f"wanted one that begins with {', '.join(schemes)}:, for instance {EXAMPLE}"
        raise AddressError(f"{uri[:80]!r} is not a channel address{did_you_mean(scheme, schemes)}: {wanted}")
    return cast(Opening, load_extension(found, "transport"))(uri, clock or UnixClock())
