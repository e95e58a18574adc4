"""User packets: bytes, one in each word, that Nserver passes on to what is built upon a robot.

A packet has its length (low byte first, all bytes counted), a serial number, a type, and data. Those of the arm are
answered as by an arm that has nothing to do and is done at once; nobody answers others.
"""

from __future__ import annotations

from collections.abc import Sequence
from struct import Struct

from sleepcast.nomad.session import Refusal

HEAD = Struct("<HBB")
ZERO, WAIT, MOVE = 40, 41, 42
"""Types of the arm's packets."""
DATA = {ZERO: 2, WAIT: 8, MOVE: 16}
"""Bytes of their data: a mode; two flags and a time to wait; four numbers."""
WAIT_TIME = slice(4, 8)
DONE = bytes(4)
"""The result: no fault."""


def packet_reply(words: Sequence[int]) -> bytes:
    """The packet that answers a packet, a byte for each word. Raises Refusal if nobody understands it."""
    if not all(0 <= word <= 0xFF for word in words):
        raise Refusal("a user packet has one byte in each word")
    packet = bytes(words)
    length, serial, kind = HEAD.unpack_from(packet)
    data = packet[HEAD.size :]
    if length != len(packet):
        raise Refusal(f"a user packet says that it has {length} bytes, and has {len(packet)}")
    if len(data) != DATA.get(kind):
        raise Refusal(f"nobody here understands a user packet of type {kind} with {len(data)} bytes of data")
    answer = DONE + data[WAIT_TIME] if kind == WAIT else DONE
    return HEAD.pack(HEAD.size + len(answer), serial, kind) + answer
