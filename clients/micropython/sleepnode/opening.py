"""How a radio's socket is opened. Loaded once and let go again."""

import socket
import struct

from micropython import const

_REUSE = const(2)
_BROADCAST = const(6)
_MULTICAST_IF = const(32)
_JOIN = const(35)


def opened(address, port, interface):
    """A socket that receives from an address and a port, and where to send to reach all who do."""
    one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    to = socket.getaddrinfo(address, port)[0][-1]
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
    return one, to


def _packed(address):
    return struct.pack("BBBB", *[int(each) for each in address.split(".")])
