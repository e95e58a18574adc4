"""CBOR (RFC 8949), as far as messages need it: whole numbers, floats, texts, bytes, lists, maps, true, false, null."""

import struct

from micropython import const

_MAX_DEPTH = const(6)


class Malformed(Exception):
    """Bytes that are no such data."""


def decode(data, at=0, depth=_MAX_DEPTH, view=False):
    """The value that begins at a place, and where the next one does. view: whether bytes are to be a view of the data.
    Raises Malformed."""
    if at >= len(data) or not depth:
        raise Malformed
    major, small = data[at] >> 5, data[at] & 31
    at += 1
    size = (1, 2, 4, 8)[small - 24] if 24 <= small <= 27 else 0
    if small > 27 or at + size > len(data):
        raise Malformed
    raw = data[at : at + size]
    count = int.from_bytes(raw, "big") if size else small
    at += size
    if major == 7:
        if size > 2:
            return struct.unpack(">f" if size == 4 else ">d", raw)[0], at
        if size == 2:
            return _half(count), at
        if small not in (20, 21, 22):
            raise Malformed
        return (False, True, None)[small - 20], at
    if major < 2:
        return (-1 - count if major else count), at
    if major < 4:
        if at + count > len(data):
            raise Malformed
        piece = data[at : at + count]
        if major == 3:
            try:
                piece = str(piece, "utf-8")
            except UnicodeError:
                raise Malformed
        elif not view:
            piece = bytes(piece)
        return piece, at + count
    if major == 6 or count > len(data):
        raise Malformed
    items = []
    for _ in range(count * (major - 3)):
        item, at = decode(data, at, depth - 1)
        items.append(item)
    if major == 4:
        return items, at
    table = {}
    for each in range(0, len(items), 2):
        if not isinstance(items[each], str):
            raise Malformed
        table[items[each]] = items[each + 1]
    return table, at


def _half(n):
    """A float of two bytes, in which whole numbers often come."""
    exponent, fraction = n >> 10 & 31, n & 1023
    value = fraction * 2.0**-24 if exponent == 0 else (1 + fraction / 1024) * 2.0 ** (exponent - 15)
    if exponent == 31:
        raise Malformed  # neither an infinity nor NaN is a value of ours
    return -value if n >> 15 else value


def encode(value):
    """A value as bytes."""
    if value is None or value is True or value is False:
        return b"\xf6" if value is None else b"\xf5" if value else b"\xf4"
    if isinstance(value, int):
        return _head(0, value) if value >= 0 else _head(1, -1 - value)
    if isinstance(value, float):
        return b"\xfb" + struct.pack(">d", value)
    if isinstance(value, str):
        value = value.encode()
        return _head(3, len(value)) + value
    if isinstance(value, (bytes, bytearray)):
        return _head(2, len(value)) + value
    if isinstance(value, dict):
        return _head(5, len(value)) + b"".join([encode(k) + encode(v) for k, v in value.items()])
    return _head(4, len(value)) + b"".join([encode(each) for each in value])


def _head(kind, count):
    if count < 24:
        return bytes((kind << 5 | count,))
    size = 1 if count < 1 << 8 else 2 if count < 1 << 16 else 4 if count < 1 << 32 else 8
    return bytes((kind << 5 | 24 + (1, 2, 4, 8).index(size),)) + count.to_bytes(size, "big")
