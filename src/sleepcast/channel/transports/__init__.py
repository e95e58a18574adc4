"""Transports: they carry datagrams from each party to all others, and are chosen by the scheme of an address.

`transport` says what each of them promises; there are three: `memory`, `udp` and `zenoh`. Schemes are entry points in
the group `sleepcast.transports`, those of sleepcast itself and those that installed packages add alike: a scheme, and
what opens such an address, `open(uri, clock)`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from typing import cast

from sleepcast.channel.transports.address import EXAMPLE, AddressError
from sleepcast.channel.transports.transport import Transport
from sleepcast.core.clock import Clock, UnixClock
from sleepcast.core.errors import nearest
from sleepcast.core.extensions import TRANSPORTS, extensions, find_extension, load_extension

Opening = Callable[[str, Clock], Transport]
_PLAIN = re.compile(r"[\w.-]+:\d+(\?.*)?")


def open_transport(uri: str, clock: Clock | None = None) -> Transport:
    """The transport at an address. clock: s, for the delays of `memory:`; None for this computer's. Raises AddressError
    for an address that cannot be read, and the transport's own error where it cannot be opened."""
    scheme = uri.partition(":")[0]
    added = find_extension(TRANSPORTS, scheme)
    if added is None:
        schemes = tuple(extensions(TRANSPORTS))
        known = ", ".join(f"{each}:" for each in schemes)
        wanted = f"wanted one that begins with {known}, for instance {EXAMPLE}"
        raise AddressError(f"{uri[:80]!r} is not a channel address{_slip(scheme, uri, schemes)}: {wanted}")
    return cast(Opening, load_extension(added, "transport"))(uri, clock or UnixClock())


def _slip(scheme: str, uri: str, schemes: Sequence[str]) -> str:
    """What was probably meant: an address without its scheme, or with one of which it is a slip."""
    if "://" not in uri and _PLAIN.fullmatch(uri):
        return f" (did you mean udp://{uri[:80]}?)"
    written = scheme.casefold()
    near = (each for each in schemes if len(each) == len(written) and _letters_apart(each, written) < 2)
    meant = next(near, None) or nearest(scheme, schemes)
    return f" (did you mean {meant}{uri[len(scheme) : 80]}?)" if meant else ""


def _letters_apart(one: str, other: str) -> int:
    """How many letters differ; two that are exchanged count as none."""
    return 0 if sorted(one) == sorted(other) else sum(a != b for a, b in zip(one, other, strict=True))
