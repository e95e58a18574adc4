"""Channel addresses: `SCHEME:...?OPTION=VALUE&...`. An error says what was wanted."""

from __future__ import annotations

from collections.abc import Mapping
from math import inf
from urllib.parse import SplitResult, parse_qsl, urlsplit

from sleepcast.core.errors import MisuseError, decimal_comma, did_you_mean

EXAMPLE = "udp://239.255.83.76:47123?interface=lo"
"""An address for error messages: multicast that stays on this machine."""
MAX_URI = 1_000
"""Characters of an address: more than names, options and their values need."""


class AddressError(MisuseError):
    """An address that cannot be read."""


def split_address(uri: str, wanted: str, options: Mapping[str, str]) -> tuple[SplitResult, dict[str, str]]:
    """An address and its options. wanted: for error messages, what was wanted; options: the known options by name, with
    their defaults. Raises AddressError."""
    if len(uri) > MAX_URI or not uri.isprintable():
        raise AddressError(f"{uri!r:.80}... is not a channel address: {wanted}")
    try:
        address = urlsplit(uri)
        _ = address.port
        given = parse_qsl(address.query, keep_blank_values=True, max_num_fields=64)
    except ValueError as error:
        raise AddressError(f"{uri!r} is not a channel address: {error}; {wanted}") from None
    if address.username is not None or address.fragment or uri.endswith("#"):
        raise AddressError(f"{uri!r} is not a channel address: {wanted}")
    known = dict(options)
    for name, value in given:
        if name not in options:
            raise AddressError(f"{uri!r}: unknown option {name!r}{did_you_mean(name, options)}; {wanted}")
        known[name] = value
    if len(given) > len({name for name, _ in given}):
        raise AddressError(f"{uri!r} has an option twice: {wanted}")
    return address, known


def number_option(uri: str, option: str, value: str, most: float = inf) -> float:
    """The value of an option that is a number from 0 to `most`. Raises AddressError."""
    try:
        number = float(value)
    except ValueError:
        number = -1.0
    if not 0.0 <= number <= most:
        bounds = f"from 0 to {most:g}" if most < inf else "from 0"
        raise AddressError(f"{uri!r}: {option} must be a number {bounds}, not {value!r}{decimal_comma(value)}")
    return number
