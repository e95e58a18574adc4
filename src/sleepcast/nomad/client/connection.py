"""A program's TCP connection to a Nserver: one reply for each request.

Everything blocks, and everything has a deadline. A server that says something impossible, or nothing in time, costs the
connection, because from then on nobody knows which reply belongs to which request; the error says so, and every later
call says it again.
"""

from __future__ import annotations

import errno
import socket
import time
from collections.abc import Sequence

from sleepcast.core.errors import SleepcastError
from sleepcast.nomad.wire.encoding import MAX_WORDS, Layout, Parser, Request, encode_request

CONNECT_SECONDS = 10.0
"""For a connection to come about: a busy machine answers within that, a wrong address does not answer at all."""
PIECE = 65_536
"""Bytes taken from the socket at a time: more than the longest reply that is kept."""


class NomadError(SleepcastError):
    """Something went wrong between a program and its robot."""


class LostError(NomadError):
    """There is no connection to the server, or no longer one."""


class Connection:
    """See the module. Raises LostError if nobody answers there."""

    def __init__(self, host: str, port: int) -> None:
        self.host, self.port = host, port
        self.peer = f"{host}:{port}"
        self._gone = ""
        """Why there is no connection any more."""
        try:
            self._socket = socket.create_connection((host, port), timeout=CONNECT_SECONDS)
        except (OSError, UnicodeError) as error:  # the second for a host name that can be none
            raise LostError(_no_server(self.peer, error)) from None
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._parser = Parser()
        self._parser.layout = Layout.FOUR
        self._owed = 0
        """Replies still to come: more than one where a wait was broken off, as by Ctrl-C."""

    @property
    def open(self) -> bool:
        """Whether there is a connection, as far as anybody knows."""
        return not self._gone

    def send(self, kind: int, words: Sequence[int] = ()) -> None:
        """Send a request that has no reply. Raises LostError."""
        if self._gone:
            raise LostError(self._gone)
        try:
            self._socket.settimeout(CONNECT_SECONDS)
            self._socket.sendall(encode_request(Layout.FOUR, kind, words))
        except OSError as error:
            raise self._broken(error) from None

    def ask(self, kind: int, words: Sequence[int], seconds: float | None) -> Request:
        """Send a request and give its reply. seconds: to wait at most, None for as long as it takes. Raises
        LostError."""
        self.send(kind, words)
        self._owed += 1
        until = None if seconds is None else time.monotonic() + seconds
        while True:
            reply = self._parser.next()
            if reply is None:
                self._read_on(until, seconds)
                continue
            self._owed -= 1
            if not self._owed:
                break
        if reply.size > MAX_WORDS:
            raise self.distrust(f"it answered with {reply.size} words, and no answer has more than {MAX_WORDS}")
        if self._parser.buffered:
            raise self.distrust("it said more than it was asked for")
        return reply

    def _read_on(self, until: float | None, seconds: float | None) -> None:
        """Take in what the server has sent, once there is something."""
        try:
            self._socket.settimeout(None if until is None else max(until - time.monotonic(), 1e-6))
            piece = self._socket.recv(PIECE)
        except TimeoutError:
            raise self._lose(
                f"{self.peer} did not answer within {seconds:g} s, so the connection was closed; see whether it is "
                "still running, or wait longer with timeout="
            ) from None
        except OSError as error:
            raise self._broken(error) from None
        if not piece:
            raise self._lose(f"{self.peer} has closed the connection; see whether it is still running")
        self._parser.feed(piece)

    def distrust(self, said: str) -> LostError:
        """The error to raise where the server `said` something that makes no sense; the connection is closed."""
        return self._lose(f"{self.peer} is no Nserver, or one that speaks otherwise: {said}; the connection was closed")

    def _broken(self, error: OSError) -> LostError:
        return self._lose(
            f"the connection to {self.peer} broke ({error.strerror or error}); see whether it is still running"
        )

    def _lose(self, why: str) -> LostError:
        self._gone = why
        self._socket.close()
        return LostError(why)

    def close(self) -> None:
        """Hang up."""
        self._gone = self._gone or f"the connection to {self.peer} has been closed; connect anew"
        self._socket.close()


def _no_server(peer: str, error: OSError | UnicodeError) -> str:
    if isinstance(error, socket.gaierror | UnicodeError):
        return f"there is no host of the name in {peer}; give its address, such as 127.0.0.1"
    if isinstance(error, TimeoutError):
        return f"{peer} does not answer; see whether the address is right and nothing in between keeps you out"
    if error.errno == errno.ECONNREFUSED:
        return f"no server listens at {peer}; start one with: sleepcast nserver --port {peer.rpartition(':')[2]}"
    return f"cannot connect to {peer}: {error.strerror or error}"
