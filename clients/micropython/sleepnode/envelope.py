"""The envelope: what stands where in a datagram (docs/wire.md). Times are microseconds of Unix time."""

import struct

from micropython import const

from sleepnode.cbor import Malformed, decode, encode

_STANDING = const(9)
_NEVER = const((1 << 63) - 1)
_MAX_DATAGRAM = const(1200)
_MAX_PARTS = const(96)
_HEAD = const(b"\xd2\x84\x43\xa1\x01\x27\xa1\x04\x48")
_SIGNED = const(b"\x84\x6aSignature1\x43\xa1\x01\x27\x40\x59")
_FIXED = const(">BBBBQBQBQBQBBBB")


def look(data):
    """The fields of a datagram that can be read before its signature is checked: key, kind, epoch, number, issued,
    deadline, number of this part, parts, payload, signature. Raises Malformed."""
    end = len(data) - 66
    if not 132 <= len(data) <= _MAX_DATAGRAM or data[:9] != _HEAD:
        raise Malformed
    if data[17:20] != b"\x59" + (end - 20).to_bytes(2, "big") or data[end : end + 2] != b"\x58\x40":
        raise Malformed
    f = struct.unpack(_FIXED, data[20:63])
    if (f[0], f[1], f[3], f[5], f[7], f[9], f[11], f[13]) != (0x8B, 1, 0x1B, 0x1B, 0x1B, 0x1B, 0x18, 0x18):
        raise Malformed
    if f[2] > _STANDING or max(f[4], f[6], f[8], f[10]) > _NEVER or not f[12] < f[14] <= _MAX_PARTS:
        raise Malformed
    return data[9:17], f[2], f[4], f[6], f[8], f[10], f[12], f[14], data[20:end], data[end + 2 :]


def signed(payload):
    """The bytes that a signature covers, in two pieces."""
    return _SIGNED + len(payload).to_bytes(2, "big"), payload


def names(payload):
    """Fleet, sender and the piece of the content, a view of the payload. Raises Malformed."""
    fleet, at = decode(payload, 43)
    sender, at = decode(payload, at)
    piece, at = decode(memoryview(payload), at, view=True)
    if at != len(payload) or not (isinstance(fleet, str) and isinstance(sender, str) and isinstance(piece, memoryview)):
        raise Malformed
    if not 0 < len(sender) <= 64:
        raise Malformed
    return fleet, sender, piece


def content(data):
    """Text and body of a whole message. Raises Malformed."""
    items, at = decode(data)
    if at != len(data) or not isinstance(items, list) or len(items) != 2:
        raise Malformed
    if not isinstance(items[0], str) or not isinstance(items[1], dict):
        raise Malformed
    return items


def payload(kind, numbers, fleet, name, text, body):
    """What is to be signed; None if it does not fit into one datagram. numbers: epoch, number, issued, deadline. body:
    encoded."""
    fixed = struct.pack(
        _FIXED,
        *(0x8B, 1, kind, 0x1B, numbers[0], 0x1B, numbers[1], 0x1B, numbers[2], 0x1B, numbers[3], 0x18, 0, 0x18, 1),
    )
    data = fixed + encode(fleet) + encode(name) + encode(b"\x82" + encode(text) + body)
    return data if len(data) + 86 <= _MAX_DATAGRAM else None


def sealed(key, data, signature):
    """The datagram of a payload."""
    return _HEAD + key + b"\x59" + len(data).to_bytes(2, "big") + data + b"\x58\x40" + signature
