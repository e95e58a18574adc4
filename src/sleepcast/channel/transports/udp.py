"""Broadcast and multicast over UDP: the channel that needs no server.

    udp://GROUP_OR_BROADCAST_ADDRESS:PORT?interface=NAME

Every party has a socket that receives from the address and one that sends to it; several parties may live on one
machine. Where the system can filter kinds of messages (`bpf_filter`), STOPs have a receiving socket of their own, and
so have messages from robots to their operator: a flood of other kinds takes no room from them, nor they from others. No
call waits: the owner receives at each tick, or when `fileno` is readable.
"""

from __future__ import annotations

import errno
import select
import socket
import struct
import sys
from collections.abc import Iterable
from contextlib import ExitStack
from ipaddress import IPv4Address, IPv6Address, ip_address

import msgspec

from sleepcast.channel.envelope import MAX_DATAGRAM, kind_of
from sleepcast.channel.message import TO_OPERATOR, Kind
from sleepcast.channel.transports.address import EXAMPLE, AddressError, split_address
from sleepcast.channel.transports.arrival import StampedSocket
from sleepcast.channel.transports.bpf_filter import drop_kinds, keep_kinds
from sleepcast.channel.transports.transport import ReceivedDatagram
from sleepcast.core.clock import Clock
from sleepcast.core.errors import SleepcastError, did_you_mean
from sleepcast.core.records import NamedTuple

_MAX_AT_ONCE = 2_048
"""Datagrams received in one call: a flood costs a tick a few milliseconds."""
MAX_STOPS = 64
"""STOPs received in one call, before anything else: as many as are checked in ten milliseconds."""
_STOP_BUFFER = 64 * 1024
"""Receive buffer for STOPs, bytes: enough for a second without forgeries. In a flood a larger one is no use: the next
STOP is as good as one that waited."""
_BUFFER = 4 * 1024 * 1024
"""Receive buffer that the system is asked for, bytes; it may grant less."""
_HOPS = 1
"""Hops of multicast: it stays on its own network."""


class ReservedSocket(NamedTuple):
    """Kinds with a receiving socket of their own. most: datagrams received in one call; room: bytes of its buffer."""

    kinds: frozenset[Kind]
    most: int
    room: int


_RESERVED = (
    ReservedSocket(frozenset({Kind.STOP}), MAX_STOPS, _STOP_BUFFER),
    ReservedSocket(TO_OPERATOR, _MAX_AT_ONCE, _BUFFER),
)


class UdpError(SleepcastError):
    """The system refused a socket."""


class UdpAddress(msgspec.Struct, frozen=True):
    """A `udp://` address. interface: of the machine, "" for the system's choice."""

    host: IPv4Address | IPv6Address
    port: int
    interface: str

    @staticmethod
    def read(uri: str) -> UdpAddress:
        """The parsed address. Raises AddressError."""
        wanted = f"wanted udp://ADDRESS:PORT?interface=NAME, for instance {EXAMPLE}"
        address, options = split_address(uri, wanted, {"interface": ""})
        if address.scheme != "udp" or not address.port or address.path:
            raise AddressError(f"{uri!r} is not a channel address: {wanted}")
        try:
            host = ip_address(address.hostname or "")
        except ValueError as error:
            raise AddressError(f"{uri!r} is not a channel address: {error}; {wanted}") from None
        return UdpAddress(host, address.port, options["interface"])

    @property
    def link(self) -> int:
        """The number of the interface, 0 for whichever the system takes. Raises AddressError if there is none."""
        if not self.interface:
            return 0
        try:
            return socket.if_nametoindex(self.interface)
        except OSError:
            names = [name for _, name in socket.if_nameindex()]
            raise AddressError(
                f"this machine has no interface {self.interface!r}{did_you_mean(self.interface, names)}: "
                f"it has {', '.join(names)}"
            ) from None


class UdpTransport:
    """One party's sockets on the network at `uri`.

    lost: datagrams that the system would not take. Raises AddressError for the address, UdpError where the system
    refuses.
    """

    def __init__(self, uri: str) -> None:
        self.address = UdpAddress.read(uri)
        self.lost = 0
        self._early: list[bytes] = []
        """What came with the STOPs and was left for `receive`, where they have no socket of their own."""
        link = self.address.link
        self._family = socket.AF_INET6 if self.address.host.version == 6 else socket.AF_INET
        with ExitStack() as opened:
            try:
                self._receiving = self._receiving_socket(opened, link, _BUFFER)
                self._sending = self._sending_socket(opened, link)
                self._readable: socket.socket | select.epoll = self._receiving
                self._reserved = self._reserve(opened, link)
                if self._reserved:
                    self._readable = opened.enter_context(select.epoll())
                    for receiving in (self._receiving, *self._reserved):
                        self._readable.register(receiving, select.EPOLLIN)
            except OSError as error:
                raise UdpError(f"{uri}: the system refuses: {error.strerror or error}{_hint(error)}") from None
            self._opened = opened.pop_all()
        self._own = self._sending.getsockname()[:2]
        self._stamped = {each: StampedSocket(each) for each in (self._receiving, *self._reserved)}

    def fileno(self) -> int:
        """What to wait on for news."""
        return self._readable.fileno()

    def send(self, datagram: bytes) -> None:
        """Broadcast."""
        try:
            self._sending.send(datagram)
        except OSError:  # no route, or a full queue: as if lost on the way
            self.lost += 1

    def receive(self) -> list[bytes]:
        """The datagrams received since the last call: STOPs first, then messages to the operator, then others in order;
        none of our own."""
        datagrams, self._early = self._early, []
        for receiving, reserved in self._reserved.items():
            datagrams += self._received(receiving, reserved.most)
        return datagrams + self._received(self._receiving, _MAX_AT_ONCE)

    def receive_stops(self) -> list[bytes]:
        """See `Transport.receive_stops`. Where the system cannot filter kinds, all that has come is looked through."""
        for receiving, reserved in self._reserved.items():
            if Kind.STOP in reserved.kinds:
                return self._received(receiving, reserved.most)
        came = self._received(self._receiving, _MAX_AT_ONCE) if len(self._early) < _MAX_AT_ONCE else []
        self._early += (datagram for datagram in came if kind_of(datagram) is not Kind.STOP)
        return [datagram for datagram in came if kind_of(datagram) is Kind.STOP]

    def _received(self, receiving: socket.socket, most: int) -> list[bytes]:
        datagrams: list[bytes] = []
        stamped = self._stamped[receiving]
        stamped.compare()
        for _ in range(most):
            try:
                datagram, sender, arrived = stamped.receive(MAX_DATAGRAM + 1)
            except BlockingIOError:
                break
            except OSError:  # an error about datagrams sent earlier
                continue
            if sender[:2] != self._own:
                received = ReceivedDatagram(datagram)
                received.address, received.arrived = sender[:2], arrived
                datagrams.append(received)
        return datagrams

    def ignore(self, kinds: Iterable[Kind]) -> None:
        """From now on drop messages of these kinds, and no others."""
        unwanted = {*kinds}
        for receiving, reserved in self._reserved.items():
            keep_kinds(receiving, reserved.kinds - unwanted)
        drop_kinds(self._receiving, unwanted.union(*(reserved.kinds for reserved in self._reserved.values())))

    def close(self) -> None:
        """See `Transport.close`."""
        self._opened.close()
        self._readable = self._receiving

    def _reserve(self, opened: ExitStack, link: int) -> dict[socket.socket, ReservedSocket]:
        """A socket for each of `_RESERVED`, whose kinds the main socket then drops; none where the system cannot."""
        sockets = {
            self._receiving_socket(opened, link, reserved.room): reserved
            for reserved in _RESERVED
            if sys.platform == "linux"
        }
        kinds = {kind for reserved in _RESERVED for kind in reserved.kinds}
        if all(keep_kinds(receiving, reserved.kinds) for receiving, reserved in sockets.items()) and drop_kinds(
            self._receiving, kinds
        ):
            return sockets
        for receiving in sockets:
            receiving.close()
        return {}

    def _receiving_socket(self, opened: ExitStack, link: int, room: int) -> socket.socket:
        """A socket that receives from the address. room: bytes of its buffer."""
        receiving, host = opened.enter_context(socket.socket(self._family, socket.SOCK_DGRAM)), self.address.host
        receiving.setblocking(False)
        receiving.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        if sys.platform != "linux":  # on Linux the option above is enough, and this one works for one user only
            receiving.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
        receiving.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, room)
        receiving.bind(self._socket_address(link))
        if not host.is_multicast:
            return receiving
        if host.version == 6:
            receiving.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_JOIN_GROUP, host.packed + struct.pack("@I", link))
        else:
            receiving.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, _membership(host, link))
        return receiving

    def _sending_socket(self, opened: ExitStack, link: int) -> socket.socket:
        """A socket that sends to the address."""
        sending, host = opened.enter_context(socket.socket(self._family, socket.SOCK_DGRAM)), self.address.host
        sending.setblocking(False)
        sending.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, _BUFFER)
        if not host.is_multicast:
            sending.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        elif host.version == 6:
            sending.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_MULTICAST_IF, link)
            sending.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_MULTICAST_HOPS, _HOPS)
        else:
            sending.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_IF, _membership(host, link))
            sending.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_TTL, _HOPS)
        sending.connect(self._socket_address(link))  # gives it an address and a port of its own
        return sending

    def _socket_address(self, link: int) -> tuple[str, int] | tuple[str, int, int, int]:
        """The address in the socket's form; for IPv6 with the interface, as addresses may exist on several."""
        host = str(self.address.host)
        return (host, self.address.port) if self.address.host.version == 4 else (host, self.address.port, 0, link)


def _membership(group: IPv4Address, link: int) -> bytes:
    """A multicast group on an interface: the `ip_mreqn` of Linux and the BSDs."""
    return group.packed + b"\0" * 4 + struct.pack("@i", link)


def _hint(error: OSError) -> str:
    """What to do about it."""
    if error.errno == errno.EADDRINUSE:
        return "; another program has the port for itself alone: take another port"
    if error.errno in (errno.ENODEV, errno.ENETUNREACH, errno.EADDRNOTAVAIL):
        return "; this machine has no way there: name an interface with ?interface=NAME"
    return ""


def open_udp(uri: str, clock: Clock) -> UdpTransport:
    """The entry point of `udp:`, which has no use for a clock."""
    return UdpTransport(uri)
