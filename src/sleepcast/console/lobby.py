"""Connections to a page's server: those of strangers, those that have shown the token, and open pages.

Strangers push out strangers, those with the token only each other, and an open page nobody (there are few of them
anyway). So whoever is in goes on, and who has the token comes in, however many others stand at the door.
"""

from __future__ import annotations

import asyncio
import logging
import socket
from collections.abc import Callable
from secrets import compare_digest, token_urlsafe

import uvicorn
from starlette.datastructures import MutableHeaders
from starlette.requests import HTTPConnection
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from uvicorn.protocols.http.h11_impl import H11Protocol

from sleepcast.core.clock import Clock
from sleepcast.core.doorkeeper import QUEUE, TURNS, Doorkeeper, room, stop_listening

MAX_CONNECTIONS = 128
"""Connections of strangers, and as many of those with the token: a browser opens six."""
PATIENCE = 20.0
"""Seconds for the head of a request and for its answer, of a stranger, who gets small files only."""
KNOWN_PATIENCE = 120.0
"""The same with the token: the page of a single run is started first."""
SWEEP = 1.0
"""Seconds between two looks for connections that take too long."""
COOKIE = "sleepcast-seen"
_TRANSPORT = "sleepcast.transport"


class Lobby:
    """See the module. at_once: connections that are taken in one turn of the loop."""

    def __init__(self, clock: Clock, say: Callable[[str], None]) -> None:
        most = room(MAX_CONNECTIONS)
        self.strangers = Doorkeeper(most, PATIENCE, clock, say)
        self.known = Doorkeeper(most, KNOWN_PATIENCE, clock, say)
        self.at_once = most // TURNS

    def know(self, transport: asyncio.Transport) -> None:
        """This one has the token."""
        if transport in self.known:
            self.known.touch(transport)
        else:
            self.strangers.leave(transport)
            self.known.enter(transport)

    def touch(self, transport: asyncio.Transport) -> None:
        """A request of it was answered."""
        self.strangers.touch(transport)
        self.known.touch(transport)

    def leave(self, transport: asyncio.Transport) -> None:
        """It is gone, or an open page."""
        self.strangers.leave(transport)
        self.known.leave(transport)

    async def sweep(self) -> None:
        """Close for ever what takes too long."""
        while True:
            await asyncio.sleep(SWEEP)
            self.strangers.sweep()
            self.known.sweep()


def protocol_in(lobby: Lobby) -> type[H11Protocol]:
    """What reads the requests of one connection, which is in this lobby from its first moment."""

    class LobbyProtocol(H11Protocol):
        """See `protocol_in`."""

        def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]  # as in the base
            self.app_state = {**self.app_state, _TRANSPORT: transport}
            lobby.strangers.enter(transport)
            super().connection_made(transport)

        def connection_lost(self, exc: Exception | None) -> None:
            lobby.leave(self.transport)
            super().connection_lost(exc)

        def on_response_complete(self) -> None:
            lobby.touch(self.transport)
            super().on_response_complete()

    return LobbyProtocol


class Greeter:
    """An application whose requests show who is known. knows: whether a request carries the token.

    A browser that has shown it gets a cookie, by which the page's other files come over connections that nobody pushes
    out. It opens nothing: cookies go to every port of a host, and other programs may listen there.
    """

    def __init__(self, app: ASGIApp, lobby: Lobby, knows: Callable[[HTTPConnection], bool]) -> None:
        self._app, self._lobby, self._knows = app, lobby, knows
        self._cookie = token_urlsafe(12)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Serve one request, or one open page."""
        transport: asyncio.Transport | None = scope.get("state", {}).get(_TRANSPORT)
        request = HTTPConnection(scope)
        shows, cookie = self._knows(request), request.cookies.get(COOKIE, "")
        if transport is not None and (shows or compare_digest(cookie.encode(), self._cookie.encode())):
            self._lobby.know(transport)

        async def send_on(message: Message) -> None:
            if transport is not None and message["type"] == "websocket.accept":
                self._lobby.leave(transport)
            if shows and message["type"] == "http.response.start":
                given = f"{COOKIE}={self._cookie}; Path=/; HttpOnly; SameSite=Strict"
                MutableHeaders(scope=message).append("Set-Cookie", given)
            await send(message)

        await self._app(scope, receive, send_on)


class LobbyServer(uvicorn.Server):
    """A server whose connections wait in the system, not in its loop."""

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        """Listen, and let many wait."""
        await super().startup(sockets)
        for listener in sockets or ():
            listener.listen(QUEUE)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        """Stop listening, let open connections end, and close those that do not."""
        await stop_listening(self.servers)
        await super().shutdown(sockets)
        for connection in list(self.server_state.connections):
            connection.transport.abort()


class Quiet(logging.Filter):
    """Leaves out that a connection is gone which is written to: who writes hears of it in another way."""

    def filter(self, record: logging.LogRecord) -> bool:
        """Whether it is to be printed."""
        return record.msg != "socket.send() raised exception."
