"""Whole numbers in as few bytes as they need, seven bits a byte, the lowest first: as protobuf writes them."""

from __future__ import annotations


def varint(value: int) -> bytes:
    """The bytes of a number from 0."""
    data = bytearray()
    while value > 0x7F:
        data.append(value & 0x7F | 0x80)
        value >>= 7
    data.append(value)
    return bytes(data)


def read_varint(data: bytes, at: int) -> tuple[int, int]:
    """An integer at this position, and the position after it. Raises IndexError at the end of the data."""
    value = shift = 0
    while data[at] > 0x7F:
        value |= (data[at] & 0x7F) << shift
        at, shift = at + 1, shift + 7
    return value | data[at] << shift, at + 1
