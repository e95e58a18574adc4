"""The radio and the clock of a small computer: UDP to a multicast group or a broadcast address, and Unix time."""

import gc
import socket
import struct
import time

from micropython import const

_MOST = const(1201)
"""Bytes read of a datagram: one more than are allowed."""
_REUSE = const(2)
_BROADCAST = const(6)
_MULTICAST_IF = const(32)
_JOIN = const(35)
_MADE = const(1767225600000)
"""2026-01-01: a clock that shows an earlier time was never set."""


class Radio:
    """A socket that receives from `address` and sends to it. interface: the address of the network card to use, "" for
    the system's choice."""

    def __init__(self, address, port, interface=""):
        self.socket = one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._to = socket.getaddrinfo(address, port)[0][-1]
        level = getattr(socket, "SOL_SOCKET", 1)
        one.setsockopt(level, getattr(socket, "SO_REUSEADDR", _REUSE), 1)
        first = int(address.split(".")[0])
        if 224 <= first < 240:
            one.bind(socket.getaddrinfo(address if hasattr(socket, "inet_pton") else "0.0.0.0", port)[0][-1])
            group, card = _packed(address), _packed(interface or "0.0.0.0")
            one.setsockopt(getattr(socket, "IPPROTO_IP", 0), getattr(socket, "IP_ADD_MEMBERSHIP", _JOIN), group + card)
            if interface:
                one.setsockopt(getattr(socket, "IPPROTO_IP", 0), _MULTICAST_IF, card)
        else:
            one.bind(socket.getaddrinfo("0.0.0.0", port)[0][-1])
            one.setsockopt(level, getattr(socket, "SO_BROADCAST", _BROADCAST), 1)
        one.setblocking(False)

    def receive(self):
        """A datagram that has come, None for none."""
        try:
            return self.socket.recvfrom(_MOST)[0]
        except OSError:
            return None
        except MemoryError:  # what is wanted is one piece: it is there once the garbage is gone
            gc.collect()
            return self.receive() if gc.mem_free() > 4 * _MOST else None

    def send(self, data):
        """Broadcast; a full queue of the system counts as a loss on the air."""
        try:
            self.socket.sendto(data, self._to)
        except OSError:
            pass


def _packed(address):
    return struct.pack("BBBB", *[int(each) for each in address.split(".")])


class Clock:
    """Milliseconds of Unix time. is_set: whether somebody has set this computer's clock."""

    def __init__(self):
        epoch = 946684800 if time.gmtime(0)[0] == 2000 else 0
        self._now = int((time.time() + epoch) * 1000)
        self._ticks = time.ticks_ms()
        self.is_set = self._now >= _MADE

    def now(self):
        ticks = time.ticks_ms()
        self._now += time.ticks_diff(ticks, self._ticks)
        self._ticks = ticks
        return self._now

    def set(self, now):
        self._now, self._ticks, self.is_set = now, time.ticks_ms(), True
