"""A multiplexer: one transport for many parties of one process. Each has a port, which is a transport for it.

Every datagram is read from the network once. What cannot be a message, and what no port wants (a thousand robots'
answers to their operator), is dropped here; the rest goes to every port that wants it. What one party sends goes to the
network and directly to the other ports, as the network returns nothing of our own.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

from sleepcast.channel.drops import DropCounter, DropReason
from sleepcast.channel.envelope import kind_of
from sleepcast.channel.message import Kind
from sleepcast.channel.transports.transport import Transport, listen_for

MAX_QUEUE = 8_192
"""Datagrams that wait at one port; beyond, the oldest are dropped. Ports share the bytes: ten megabytes for all."""


class Multiplexer:
    """See the module. drops: counts datagrams that are dropped here, with those that its parties drop."""

    def __init__(self, transport: Transport, drops: DropCounter) -> None:
        self.drops = drops
        self._transport = transport
        self._ports: list[Port] = []
        self._listening: list[Port] = []
        self._wanted: frozenset[Kind] = frozenset()

    def fileno(self) -> int:
        """A file descriptor that is readable when something was received from the network."""
        return self._transport.fileno()

    def port(self, wanted: Iterable[Kind]) -> Port:
        """The transport of one more party, which wants only these kinds."""
        found = Port(self, frozenset(wanted))
        self._ports.append(found)
        if found.wanted:  # most ports only send
            self._listening.append(found)
            self._listen()
        return found

    def gather(self) -> bool:
        """Distribute the datagrams received since the last call to the ports; whether there were any."""
        came = self._transport.receive()
        for datagram in came:
            self._distribute(datagram, None)
        return bool(came)

    def send(self, datagram: bytes, sender: Port) -> None:
        """Send a datagram of this port's party."""
        self._transport.send(datagram)
        self._distribute(datagram, sender)

    def leave(self, port: Port) -> None:
        """Remove a port; the last one closes the transport."""
        if port in self._ports:
            self._ports.remove(port)
            if not self._ports:
                self._transport.close()
            elif port in self._listening:
                self._listening.remove(port)
                self._listen()

    def _listen(self) -> None:
        """Let the transport drop the kinds that no port wants."""
        wanted = frozenset[Kind]().union(*(port.wanted for port in self._listening))
        if wanted != self._wanted:
            self._wanted = wanted
            listen_for(self._transport, wanted)

    def _distribute(self, datagram: bytes, sender: Port | None) -> None:
        kind = kind_of(datagram)
        if kind not in self._wanted:
            if sender is None:
                self.drops.add(DropReason.MALFORMED if kind is None else DropReason.NOT_FOR_US)
            return
        for port in self._listening:
            if port is not sender and kind in port.wanted:
                port.waiting.append(datagram)


class Port:
    """One party's transport on a multiplexer. wanted: kinds that it receives. waiting: datagrams not received yet."""

    def __init__(self, multiplexer: Multiplexer, wanted: frozenset[Kind]) -> None:
        self.wanted = wanted
        self.waiting: deque[bytes] = deque(maxlen=MAX_QUEUE)
        self._multiplexer = multiplexer

    def fileno(self) -> int:
        """Readable when something was received from the network; datagrams of other ports are here already."""
        return self._multiplexer.fileno()

    def send(self, datagram: bytes) -> None:
        """Broadcast."""
        self._multiplexer.send(datagram, self)

    def receive(self) -> list[bytes]:
        """The datagrams received since the last call, in order; none of our own."""
        self._multiplexer.gather()
        return self.drain()

    def drain(self) -> list[bytes]:
        """The datagrams that wait here, without reading from the network."""
        found = list(self.waiting)
        self.waiting.clear()
        return found

    def close(self) -> None:
        """Leave. Nothing can be sent or received afterwards."""
        self._multiplexer.leave(self)
