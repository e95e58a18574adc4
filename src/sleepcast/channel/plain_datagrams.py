"""Plain datagrams, as programs of the Nomad's day send them: three numbers as text.

The text is 128 bytes; what follows a zero byte is ignored. Each number is printed to a width of 12 with two decimals.
Nothing tells who sent it, and nothing is signed. So a robot listens to them only on request, and by default only on
this computer. Any other datagram is dropped and counted.
"""

from __future__ import annotations

import re
import socket
from collections.abc import Sequence
from types import TracebackType
from typing import Self

from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.core.records import dataclass

MAX_BYTES = 128
"""Bytes of one datagram."""
LARGEST = 1e9
"""Bound of a number's size: what fits into a width of 12 with a sign and two decimals."""
MAX_AT_ONCE = 64
"""Datagrams read in one call, so that a flood costs a tick little time; the others wait in the system's buffer, which
drops what it has no room for."""
_NUMBER = re.compile(rb"[-+]?(\d{1,12}(\.\d{0,9})?|\.\d{1,9})")

Numbers = tuple[float, float, float]


class DatagramError(SleepcastError):
    """Listening on a port failed, or sending a datagram."""


def pack(numbers: Sequence[float]) -> bytes:
    """Three numbers as a datagram. Raises MisuseError for another count, or for numbers that do not fit."""
    if len(numbers) != 3 or not all(abs(number) < LARGEST for number in numbers):
        raise MisuseError(f"a datagram has three numbers, each smaller than {LARGEST:.0f}, not {list(numbers)!r:.80}")
    return " ".join(f"{number:12.2f}" for number in numbers).encode().ljust(MAX_BYTES, b"\0")


def unpack(data: bytes) -> Numbers | None:
    """The numbers in a datagram, None if they are not three."""
    fields = data.partition(b"\0")[0].split() if len(data) <= MAX_BYTES else []
    if len(fields) != 3 or not all(_NUMBER.fullmatch(field) for field in fields):
        return None
    first, second, third = map(float, fields)
    return (first, second, third) if max(abs(first), abs(second), abs(third)) < LARGEST else None


@dataclass(slots=True)
class Counts:
    """Datagrams received so far."""

    taken: int = 0
    dropped: int = 0


class Datagrams:
    """Listens for plain datagrams, without waiting. counts: what was received. Raises DatagramError if it cannot listen
    there."""

    def __init__(self, host: str, port: int) -> None:
        self.counts = Counts()
        try:
            family, kind, protocol, _, address = socket.getaddrinfo(host, port, type=socket.SOCK_DGRAM)[0]
            self._socket = socket.socket(family, kind, protocol)
        except (OSError, UnicodeError):
            raise DatagramError(f"{host!r:.80} is not an address to listen on; 127.0.0.1 is this computer's") from None
        try:
            self._socket.bind(address)
        except OSError as error:
            self._socket.close()
            raise DatagramError(
                f"cannot listen for datagrams at {host}:{port}: {error.strerror or error}; choose another port or host"
            ) from None
        self._socket.setblocking(False)

    @property
    def port(self) -> int:
        """The port it listens on."""
        port: int = self._socket.getsockname()[1]
        return port

    def fileno(self) -> int:
        """The file descriptor of its socket, for `select`."""
        return self._socket.fileno()

    def receive(self) -> list[Numbers]:
        """The numbers received since the last call, in order, from `MAX_AT_ONCE` datagrams at most."""
        received: list[Numbers] = []
        for _ in range(MAX_AT_ONCE):
            try:
                data = self._socket.recv(MAX_BYTES + 1)
            except (BlockingIOError, InterruptedError):
                break
            except OSError:  # an error about something sent earlier
                continue
            numbers = unpack(data)
            if numbers is None:
                self.counts.dropped += 1
            else:
                self.counts.taken += 1
                received.append(numbers)
        return received

    def close(self) -> None:
        """Stop listening."""
        self._socket.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: TracebackType | None) -> None:
        self.close()


def send(numbers: Sequence[float], *receivers: tuple[str, int]) -> None:
    """Send three numbers to each receiver (host and port). Raises DatagramError, MisuseError."""
    data = pack(numbers)
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        sender.setsockopt(socket.SOL_SOCKET, socket.SO_BROADCAST, 1)
        for host, port in receivers:
            try:
                sender.sendto(data, (host, port))
            except (OSError, UnicodeError) as error:
                raise DatagramError(
                    f"cannot send to {host}:{port}: {getattr(error, 'strerror', '') or error}"
                ) from None
