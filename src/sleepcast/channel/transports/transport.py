"""A transport: what carries datagrams from each party to all others, whatever is in them."""

from __future__ import annotations

import socket
from collections.abc import Iterable
from contextlib import suppress
from typing import Protocol, runtime_checkable

from sleepcast.channel.message import Kind


class Transport(Protocol):
    """Carries datagrams from each to all others, or loses them. Nothing here waits."""

    def fileno(self) -> int:
        """What to wait on for news."""

    def send(self, datagram: bytes) -> None: ...

    def receive(self) -> list[bytes]:
        """What has come in since the last call, in the order in which it came; nothing of our own."""

    def close(self) -> None:
        """Leave. Nothing can be sent or heard afterwards."""


@runtime_checkable
class KindFilter(Protocol):
    """A transport that can leave out kinds of messages before they cost anybody anything."""

    def ignore(self, kinds: Iterable[Kind]) -> None:
        """These kinds need not be brought here any more, all others do. It may bring them all the same."""


def listen_for(transport: Transport, wanted: Iterable[Kind]) -> None:
    """Only these kinds are wanted of a transport, if it can tell them from others."""
    if isinstance(transport, KindFilter):
        transport.ignore(frozenset(Kind) - frozenset(wanted))


class WakeUp:
    """A file descriptor that is readable while there is something to receive, for transports without a socket of their
    own. It may be rung from any thread."""

    def __init__(self) -> None:
        self._read_end, self._write_end = socket.socketpair()
        self._read_end.setblocking(False)
        self._write_end.setblocking(False)

    def fileno(self) -> int:
        """Readable from `ring` on until `quiet`; -1 once it is closed."""
        return self._read_end.fileno()

    def set(self) -> None:
        """There is news. A bell that rings already, or is closed, stays as it is."""
        with suppress(OSError):
            self._write_end.send(b"!")

    def clear(self) -> None:
        """The news have been taken; to be called before they are taken, so that none is overlooked."""
        with suppress(OSError):
            while len(self._read_end.recv(4_096)) == 4_096:
                pass

    def close(self) -> None:
        """Ring no more."""
        self._read_end.close()
        self._write_end.close()
