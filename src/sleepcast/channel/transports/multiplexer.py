"""A multiplexer: one transport for many parties of one process, each of which has a branch that is a transport for it.

Every datagram is taken from the network once. What cannot be a message, and what none of the parties has ears for (a
thousand robots' answers to their operator), ends here; the others go to every branch. What one party says goes on the
air, and to its neighbours without it: the network gives back nothing of our own.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

from sleepcast.channel.drops import DropCounter, DropReason
from sleepcast.channel.envelope import kind_of
from sleepcast.channel.message import Kind
from sleepcast.channel.transports.transport import Transport, listen_for

MAX_QUEUE = 8_192
"""Datagrams that wait for one party; the oldest make room, as in a receiver's buffer: ten megabytes for all of them,
as they share the bytes."""


class Multiplexer:
    """See the module. drops: what went no further than here is counted there, with what its parties drop."""

    def __init__(self, transport: Transport, drops: DropCounter) -> None:
        self.drops = drops
        self._transport = transport
        self._ports: list[Port] = []
        self._listening: list[Port] = []
        self._wanted: frozenset[Kind] = frozenset()

    def fileno(self) -> int:
        """What to wait on for news from the network."""
        return self._transport.fileno()

    def port(self, wanted: Iterable[Kind]) -> Port:
        """The transport of one more party, which has ears for these kinds only."""
        found = Port(self, frozenset(wanted))
        self._ports.append(found)
        if found.wanted:  # most of those that only speak want nothing
            self._listening.append(found)
            self._listen()
        return found

    def gather(self) -> bool:
        """Bring the branches what has come from the network since the last call; whether there was anything."""
        came = self._transport.receive()
        for datagram in came:
            self._distribute(datagram, None)
        return bool(came)

    def send(self, datagram: bytes, sender: Port) -> None:
        """Send what the party of this branch says."""
        self._transport.send(datagram)
        self._distribute(datagram, sender)

    def leave(self, port: Port) -> None:
        """This branch hears nothing any more; with the last one the transport is left."""
        if port in self._ports:
            self._ports.remove(port)
            if not self._ports:
                self._transport.close()
            elif port in self._listening:
                self._listening.remove(port)
                self._listen()

    def _listen(self) -> None:
        """Let the transport bring what any of the branches wants."""
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
    """One party's transport on a trunk. wanted: kinds that it has ears for. waiting: what it has not looked at yet."""

    def __init__(self, multiplexer: Multiplexer, wanted: frozenset[Kind]) -> None:
        self.wanted = wanted
        self.waiting: deque[bytes] = deque(maxlen=MAX_QUEUE)
        self._multiplexer = multiplexer

    def fileno(self) -> int:
        """What to wait on for news from the network; what a neighbour has said is there already."""
        return self._multiplexer.fileno()

    def send(self, datagram: bytes) -> None:
        """Broadcast."""
        self._multiplexer.send(datagram, self)

    def receive(self) -> list[bytes]:
        """What has come in since the last call, in the order in which it came; nothing of our own."""
        self._multiplexer.gather()
        return self.drain()

    def drain(self) -> list[bytes]:
        """What has been brought here and was not looked at yet, without a look at the network."""
        found = list(self.waiting)
        self.waiting.clear()
        return found

    def close(self) -> None:
        """Leave. Nothing can be sent or heard afterwards."""
        self._multiplexer.leave(self)
