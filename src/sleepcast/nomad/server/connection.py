"""One connection of the server. It moves bytes; `session` and `answers` decide what they mean.

Requests are answered in order, one at a time, a few in a turn of the loop, so that a client that sends many does not
keep others waiting. Memory is bounded: a client that does not read its answers is not read from, and what is too long
is read past.
"""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Sequence
from typing import Protocol

from sleepcast.core.errors import MisuseError, did_you_mean
from sleepcast.nomad.server.answers import answer, take
from sleepcast.nomad.server.session import ClientSession, Refusal, Service, Wait
from sleepcast.nomad.wire.encoding import CONNECTING, Parser, Request
from sleepcast.nomad.wire.requests import RequestType
from sleepcast.nomad.wire.units import GREATEST_WORD, LEAST_WORD

TURN = 4
"""Requests of one client that are answered before others get their turn."""
MAX_BUFFERED = 64 * 1024
"""Bytes of requests that wait, and of replies: beyond that no more is read."""
DOUBT = 0.25
"""Seconds after which a request that may be whole or half is taken for whole."""

SILENT, AGAIN, TRIES = 4, 1, 3
"""Seconds without a word after which a client's computer is asked whether it is there; between two such questions; and
how many stay without an answer until it counts as gone: cut off, or without current."""


class Host(Protocol):
    """What a connection needs of the server. room: where all connections read to, one after the other."""

    room: memoryview
    service: Service
    lines: set[ServerConnection]
    waiting: set[ServerConnection | ManualClient]

    def admit(self, line: ServerConnection) -> bool:
        """Take a new connection; False if there are too many."""

    def know(self, line: ServerConnection) -> None:
        """This connection asks something."""

    def news(self) -> None:
        """A connection has asked, got its answer, or gone."""


class ServerConnection(asyncio.BufferedProtocol):
    """See the module. wait: the reply that is still to come. asked: when the client last asked, on the loop's clock."""

    def __init__(self, host: Host) -> None:
        self.wait: Wait | None = None
        self.asked = 0.0
        self.session: ClientSession
        self._host = host
        self._parser = Parser()
        self._transport: asyncio.Transport
        self._loop = asyncio.get_running_loop()
        self._choked = self._turning = False

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        transport.set_write_buffer_limits(high=MAX_BUFFERED)
        _watch(transport.get_extra_info("socket"))
        name = transport.get_extra_info("peername")
        peer = f"{name[0]}:{name[1]}" if name else "somebody"
        self.session = ClientSession(self._host.service, peer, self._parser, self.look)
        self.asked = self._loop.time()
        if not self._host.admit(self):
            transport.abort()

    def get_buffer(self, sizehint: int) -> memoryview:
        return self._host.room

    def buffer_updated(self, nbytes: int) -> None:
        self._parser.feed(self._host.room[:nbytes])
        if not self._turning:
            self._serve()

    def connection_lost(self, error: Exception | None) -> None:
        self.session.lost()
        self.wait = None
        self._host.lines.discard(self)
        self._host.waiting.discard(self)
        self._host.news()

    def pause_writing(self) -> None:
        self._choked = True

    def resume_writing(self) -> None:
        self._choked = False
        self._turn()

    @property
    def kept(self) -> int:
        """Bytes that are kept for this client: requests that wait, and replies that it has not read."""
        return self._parser.buffered + self._transport.get_write_buffer_size()

    def look(self) -> None:
        """Send the reply that is waited for if it is time."""
        if self.wait is not None and not self.is_closing() and (reply := self.wait.ready()) is not None:
            self.wait = None
            self._host.waiting.discard(self)
            self._transport.write(reply)
            self._turn()

    def end(self) -> None:
        """The server ends."""
        self._transport.close()

    def is_closing(self) -> bool:
        """Whether it is closed, or about to be."""
        return self._transport.is_closing()

    def abort(self) -> None:
        """Close it at once."""
        self._transport.abort()

    def _serve(self) -> None:
        """Answer what has come, for one turn."""
        self._turning = False
        if self._transport.is_closing():
            return
        for _ in range(TURN):
            if self.wait is not None or self._choked:
                break
            request = self._parser.next()
            if request is None:
                break
            self.asked = self._loop.time()
            self._host.know(self)
            outcome = answer(self.session, request)
            if isinstance(outcome, bytes):
                self._transport.write(outcome)
            elif outcome is not None:
                self.wait = outcome
                self._host.waiting.add(self)
                self._host.news()
        else:
            self._turn()
        if self._parser.undecided:
            self._loop.call_later(DOUBT, self._decide)
        self._flow()

    def _turn(self) -> None:
        """Go on when the others have had their turn."""
        if not self._turning:
            self._turning = True
            self._loop.call_soon(self._serve)

    def _flow(self) -> None:
        """Read on only while there is room. A client that waits is read from all the same: it might hang up."""
        if self._choked or self._parser.buffered > MAX_BUFFERED:
            self._transport.pause_reading()
        else:
            self._transport.resume_reading()

    def _decide(self) -> None:
        self._parser.decide()
        self._turn()


def _watch(connection: socket.socket) -> None:
    """Have the system notice when the client's computer is gone, as far as this system can."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    gone = 1000 * (SILENT + TRIES * AGAIN)  # ms, also for what was sent and nobody has received
    wanted = {"TCP_KEEPIDLE": SILENT, "TCP_KEEPINTVL": AGAIN, "TCP_KEEPCNT": TRIES, "TCP_USER_TIMEOUT": gone}
    for name, value in wanted.items():
        if (option := getattr(socket, name, None)) is not None:
            connection.setsockopt(socket.IPPROTO_TCP, option, value)


# A person at the page, who commands a robot as a program would: a client without a socket.

NAMES = {kind.name.lower(): kind for kind in RequestType if kind not in CONNECTING}
"""What can be asked, as the functions of the C library are called."""
PAGE = "the page"
"""What a person there is called among those who drive a robot."""


class ManualClient:
    """A person at the page who commands one robot.

    wait: the reply that is still to come.
    reply: the last.
    turn: one request at a time.
    """

    def __init__(self, service: Service, robot: int) -> None:
        self.wait: Wait | None = None
        self.reply = b""
        self.session = ClientSession(service, PAGE, Parser(), self.look)
        self.session.robot, self.session.simulated_robot = robot, service.simulated_robots[robot]
        self.turn = asyncio.Lock()
        self._done = asyncio.Event()

    def ask(self, name: str, numbers: Sequence[int]) -> None:
        """Do what the request of this name does. `wait` is set if its reply is still to come. Raises MisuseError."""
        kind = NAMES.get(name)
        if kind is None:
            raise MisuseError(f"there is no request {name!r}{did_you_mean(name, NAMES)}")
        if not all(LEAST_WORD <= number <= GREATEST_WORD for number in numbers):
            raise MisuseError(f"{name}: each number must fit into 32 bits")
        try:
            answer = take(self.session, Request(kind, tuple(numbers), len(numbers)))
        except Refusal as refusal:
            raise MisuseError(refusal.text) from None
        if isinstance(answer, Wait):
            self.wait = answer
            self._done.clear()
        else:
            self.reply = answer or b""

    async def done(self) -> None:
        """Wait until what was asked is done."""
        if self.wait is not None:
            await self._done.wait()

    def look(self) -> None:
        """See whether it is done."""
        if self.wait is not None and (reply := self.wait.ready()) is not None:
            self.wait, self.reply = None, reply
            self._done.set()
