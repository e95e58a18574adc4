"""A BPF filter in the kernel drops kinds of messages that nobody here wants, before they wake this process.

When a thousand robots answer their operator, a thousand robots receive it and do not need it. The kind of a message
lies at a fixed offset, so a classic BPF program of a few instructions can tell (Linux, packet(7) and socket(7)). It
checks nothing else: all later checks are made as if it did not exist. In the same way a socket can receive nothing but
STOPs, so that they and the other messages never fill each other's buffer.
"""

from __future__ import annotations

import ctypes
import socket
import struct
import sys
from collections.abc import Iterable, Sequence

from sleepcast.channel.envelope import KIND_AT, NUMBER, STANDING
from sleepcast.channel.message import Kind

_UDP_HEADER = 8
"""Bytes of the UDP header, which the program sees before the datagram."""
_ATTACH, _DETACH = 26, 27
"""Socket options SO_ATTACH_FILTER and SO_DETACH_FILTER, which Python does not name."""
_LENGTH, _BYTE, _AT_LEAST, _EQUAL, _RETURN = 0x80, 0x30, 0x35, 0x15, 0x06
"""Opcodes: load the length, load a byte, jump if at least, jump if equal, return the number of bytes to keep."""
_ALL, NOTHING = 0xFFFF_FFFF, 0

Instruction = tuple[int, int, int, int]
"""Opcode, instructions to skip if true and if false, operand."""


def drop_kinds(receiving: socket.socket, unwanted: Iterable[Kind]) -> bool:
    """Let a socket drop these kinds from now on; whether the system can."""
    if sys.platform != "linux":
        return False
    numbers = _numbers(unwanted)
    try:
        if numbers:
            _attach(receiving, program(numbers))
        else:
            receiving.setsockopt(socket.SOL_SOCKET, _DETACH, 0)
    except OSError:  # there was no filter, or none is allowed: the receiver drops what it does not want
        return not numbers
    return True


def keep_kinds(receiving: socket.socket, wanted: Iterable[Kind]) -> bool:
    """Let a socket drop all but these kinds from now on; whether the system can."""
    if sys.platform != "linux":
        return False
    try:
        _attach(receiving, program(_numbers(wanted), these=_ALL, others=NOTHING))
    except OSError:
        return False
    return True


def program(numbers: Sequence[int], *, these: int = NOTHING, others: int = _ALL) -> list[Instruction]:
    """The program that keeps `these` bytes of datagrams of the kinds with these numbers, and `others` of all others."""
    kind_at, count = _UDP_HEADER + KIND_AT, len(numbers)
    tests = [(_EQUAL, count - i, 0, number) for i, number in enumerate(numbers)]
    return [
        (_LENGTH, 0, 0, 0),
        (_AT_LEAST, 0, count + 1, kind_at + 1),
        (_BYTE, 0, 0, kind_at),
        *tests,
        (_RETURN, 0, 0, others),
        (_RETURN, 0, 0, these),
    ]


def _numbers(kinds: Iterable[Kind]) -> list[int]:
    """The numbers of these kinds on the wire."""
    distinct = set(kinds)
    return sorted(NUMBER[kind] for kind in distinct) + [STANDING] * (Kind.COMMAND in distinct)


def _attach(receiving: socket.socket, instructions: Sequence[Instruction]) -> None:
    code = b"".join(struct.pack("=HBBI", *each) for each in instructions)
    room = ctypes.create_string_buffer(code, len(code))
    receiving.setsockopt(socket.SOL_SOCKET, _ATTACH, struct.pack("@HP", len(instructions), ctypes.addressof(room)))
