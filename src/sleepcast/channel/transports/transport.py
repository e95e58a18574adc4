"""A transport carries datagrams from each party to all others, regardless of their contents."""

from __future__ import annotations

import socket
from collections.abc import Iterable
from contextlib import suppress
from functools import lru_cache
from typing import Protocol, runtime_checkable

from sleepcast.channel.message import Kind
from sleepcast.core.clock import seconds_passed


class Transport(Protocol):
    """Carries datagrams from each party to all others, or loses them. No method waits."""

    def fileno(self) -> int:
        """A file descriptor that is readable when something was received."""

    def send(self, datagram: bytes) -> None: ...

    def receive(self) -> list[bytes]:
        """The datagrams received since the last call, in order; none of our own."""

    def receive_stops(self) -> list[bytes]:
        """Those of them that are STOPs, ahead of all others: `receive` gives the others later."""

    def close(self) -> None:
        """Leave. Nothing can be sent or received afterwards."""


@runtime_checkable
class KindFilter(Protocol):
    """A transport that can drop kinds of messages cheaply."""

    def ignore(self, kinds: Iterable[Kind]) -> None:
        """From now on drop messages of these kinds where possible, and no others."""


def listen_for(transport: Transport, wanted: Iterable[Kind]) -> None:
    """Let a transport drop all other kinds than these, if it can."""
    if isinstance(transport, KindFilter):
        transport.ignore(frozenset(Kind) - frozenset(wanted))


class ReceivedDatagram(bytes):
    """A received datagram. address: host and port that it came from; arrived: `seconds_passed` when it reached this
    computer; None where the transport does not know."""

    address: tuple[str, int] | None = None
    arrived: float | None = None


def waited(datagram: bytes) -> float:
    """For how many s a datagram has waited here to be read; 0 where nobody knows."""
    arrived = datagram.arrived if isinstance(datagram, ReceivedDatagram) else None
    return 0.0 if arrived is None else max(0.0, seconds_passed() - arrived)


def address_of(datagram: bytes) -> str:
    """Where a datagram came from, as HOST:PORT; "" where nobody knows."""
    address = datagram.address if isinstance(datagram, ReceivedDatagram) else None
    return "" if address is None else _written(*address)


@lru_cache(maxsize=1_024)
def _written(host: str, port: int) -> str:
    """An address in words; many robots of a process have one."""
    return f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


class WakeUp:
    """A file descriptor that is readable while there is something to receive, for transports without a socket of their
    own. It may be set from any thread."""

    def __init__(self) -> None:
        self._read_end, self._write_end = socket.socketpair()
        self._read_end.setblocking(False)
        self._write_end.setblocking(False)

    def fileno(self) -> int:
        """Readable from `set` until `clear`; -1 once it is closed."""
        return self._read_end.fileno()

    def set(self) -> None:
        """There is something to receive. If it is set already, or closed, nothing changes."""
        with suppress(OSError):
            self._write_end.send(b"!")

    def clear(self) -> None:
        """Call this before receiving, so that nothing is overlooked."""
        with suppress(OSError):
            while len(self._read_end.recv(4_096)) == 4_096:
                pass

    def close(self) -> None:
        """Release the file descriptors."""
        self._read_end.close()
        self._write_end.close()
