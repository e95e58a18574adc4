"""A sieve in the system's own network code: kinds that nobody here has ears for never wake this process.

A thousand robots that answer their operator are heard by a thousand robots, whom it does not concern. The kind of a
message lies at a fixed place, so a classic BPF program of a few instructions (Linux, packet(7) and socket(7)) can tell.
It looks at nothing else: whatever it lets through is looked at as if it were not there. In the same way a socket can be
had that brings STOPs and nothing else, so that neither they nor all the others can crowd each other out.
"""

from __future__ import annotations

import ctypes
import socket
import struct
import sys
from collections.abc import Iterable, Sequence

from sleepcast.channel.envelope import KIND_AT, NUMBER, STANDING
from sleepcast.channel.message import Kind

UDP_HEADER = 8
"""Bytes before a datagram's own, as the program sees it."""
ATTACH, DETACH = 26, 27
"""Options SO_ATTACH_FILTER and SO_DETACH_FILTER, which Python has no names for."""
LENGTH, BYTE, AT_LEAST, EQUAL, RETURN = 0x80, 0x30, 0x35, 0x15, 0x06
"""Codes: load the length, load a byte, jump if at least, jump if equal, give the number of bytes to keep."""
ALL, NOTHING = 0xFFFF_FFFF, 0

Instruction = tuple[int, int, int, int]
"""Code, instructions to jump over if true and if not, operand."""


def drop_kinds(receiving: socket.socket, unwanted: Iterable[Kind]) -> bool:
    """Leave out what these ears need not hear from now on; whether the system can."""
    if sys.platform != "linux":
        return False
    numbers = _numbers(unwanted)
    try:
        if numbers:
            _attach(receiving, program(numbers))
        else:
            receiving.setsockopt(socket.SOL_SOCKET, DETACH, 0)
    except OSError:  # no sieve was there, or none may be: whoever reads drops what is not for him
        return not numbers
    return True


def keep_kinds(receiving: socket.socket, wanted: Iterable[Kind]) -> bool:
    """Leave out all but messages of these kinds from now on; whether the system can."""
    if sys.platform != "linux":
        return False
    try:
        _attach(receiving, program(_numbers(wanted), found=ALL, others=NOTHING))
    except OSError:
        return False
    return True


def program(numbers: Sequence[int], *, found: int = NOTHING, others: int = ALL) -> list[Instruction]:
    """What keeps so many bytes of datagrams of the kinds with these numbers, and so many of all others."""
    place, count = UDP_HEADER + KIND_AT, len(numbers)
    tests = [(EQUAL, count - i, 0, number) for i, number in enumerate(numbers)]
    return [
        (LENGTH, 0, 0, 0),
        (AT_LEAST, 0, count + 1, place + 1),
        (BYTE, 0, 0, place),
        *tests,
        (RETURN, 0, 0, others),
        (RETURN, 0, 0, found),
    ]


def _numbers(kinds: Iterable[Kind]) -> list[int]:
    """Those of these kinds on the air."""
    found = set(kinds)
    return sorted(NUMBER[kind] for kind in found) + [STANDING] * (Kind.COMMAND in found)


def _attach(receiving: socket.socket, instructions: Sequence[Instruction]) -> None:
    code = b"".join(struct.pack("=HBBI", *each) for each in instructions)
    room = ctypes.create_string_buffer(code, len(code))
    receiving.setsockopt(socket.SOL_SOCKET, ATTACH, struct.pack("@HP", len(instructions), ctypes.addressof(room)))
