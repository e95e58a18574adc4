"""A server of the Nomad's wire that does what a test wants: a listening socket and a thread.

A `Behaviour` is asked for each request (its type, its words as bytes, the number of its connection from 0) and gives
the bytes to answer: None to hang up instead, a `Farewell` to hang up after them. `requests` holds everything that came,
as it came; `left` is set as soon as a farewell has been said.
"""

from __future__ import annotations

import socket
import struct
import threading
from collections.abc import Callable
from contextlib import suppress
from types import TracebackType

LONGEST = 60.0
"""Seconds that a peer waits for the next byte."""

Behaviour = Callable[[int, bytes, int], bytes | None]


class Farewell(bytes):
    """The last that a server says on a connection. It leaves as rudely as can be: who writes there afterwards without
    care is killed for it."""


def message(type_: int, *numbers: int) -> bytes:
    """A message of four-byte words."""
    return struct.pack(f">HH{len(numbers)}I", type_, len(numbers), *(number & 0xFFFFFFFF for number in numbers))


class Peer:
    """Up while it is entered; `port` is where."""

    def __init__(self, behave: Behaviour) -> None:
        self.requests: list[bytes] = []
        self.left = threading.Event()
        self._behave = behave
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port: int = self._listening.getsockname()[1]
        self._thread = threading.Thread(target=self._serve)

    def __enter__(self) -> Peer:
        self._thread.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._listening.shutdown(socket.SHUT_RDWR)
        self._listening.close()
        self._thread.join(LONGEST)
        assert not self._thread.is_alive()

    def _serve(self) -> None:
        number = 0
        while True:
            try:
                connection, _ = self._listening.accept()
            except OSError:  # closed by __exit__
                return
            connection.settimeout(LONGEST)
            rude = False
            with connection, suppress(ConnectionError):  # the program may hang up whenever it wants
                rude = self._converse(connection, number)
                if rude:
                    connection.shutdown(socket.SHUT_WR)
                    connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            if rude:
                self.left.set()
            number += 1

    def _converse(self, connection: socket.socket, number: int) -> bool:
        """Answer until one side hangs up; whether it was this one, after a farewell."""
        while head := receive(connection, 4):
            type_, words = struct.unpack(">HH", head)
            body = receive(connection, 4 * words)
            self.requests.append(head + body)
            answer = self._behave(type_, body, number)
            if answer is None:
                return False
            connection.sendall(answer)
            if isinstance(answer, Farewell):
                return True
        return False


def receive(connection: socket.socket, length: int) -> bytes:
    """So many bytes, or nothing if the other side has hung up."""
    got = b""
    while len(got) < length:
        more = connection.recv(length - len(got))
        if not more:
            return b""
        got += more
    return got
