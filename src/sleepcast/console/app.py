"""The web application: the page's files, the one WebSocket, and who may open either.

The address that was printed carries a token. The page itself and its socket want it; the other files hold no secret.
A request must name the host that was asked for, and a socket must come from a page of this very server: another
site's script in the same browser can neither connect nor read.
"""

from __future__ import annotations

import re
from collections.abc import Awaitable, Callable, Iterable
from importlib.resources import files
from pathlib import Path
from secrets import compare_digest

from starlette.applications import Starlette
from starlette.datastructures import MutableHeaders
from starlette.requests import HTTPConnection, Request
from starlette.responses import PlainTextResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket

PORT = re.compile(r":\d+$")
"""What a host ends in that has a port of its own."""
MAX_PAGES = 16
"""Pages that may be open at one time; each gets its own frames."""
LOOPBACK = ("127.0.0.1", "localhost", "[::1]")
STATIC = Path(str(files("sleepcast.console"))) / "static"

REFUSED = (
    "This is sleepcast, but the address lacks the right token.\n"
    "Open the address that was printed where sleepcast was started; it changes with every start.\n"
)


class PageAccess:
    """Who may come in. hosts: names by which the server may be asked for, besides the address at which a request
    arrives; one that has no port of its own goes with `port`."""

    def __init__(self, token: str, hosts: Iterable[str], port: int) -> None:
        self._token, self._port = token, port
        self._hosts = frozenset(host if PORT.search(host) else f"{host}:{port}" for host in hosts)

    def knows(self, connection: HTTPConnection) -> bool:
        """Whether the address carries the token and names a host of ours."""
        host = connection.headers.get("host", "").casefold()
        given = connection.query_params.get("token", "")
        return self._names_us(host, connection) and compare_digest(given.encode(), self._token.encode())

    def _names_us(self, host: str, connection: HTTPConnection) -> bool:
        arrived = (connection.scope.get("server") or ("",))[0]
        here = f"[{arrived}]" if ":" in arrived else arrived
        return host in self._hosts or host == f"{here}:{self._port}"

    def trusts(self, socket: WebSocket) -> bool:
        """Whether, besides, the socket was opened by a page of this very server."""
        origin = socket.headers.get("origin", "")
        scheme = "https" if socket.url.scheme == "wss" else "http"
        return origin == f"{scheme}://{socket.headers.get('host', '')}" and self.knows(socket)


def make_app(page: str, door: PageAccess, attend: Callable[[WebSocket], Awaitable[None]]) -> Starlette:
    """The application. page: its file in `static/`. attend: serves one open page until it goes away; there are
    `MAX_PAGES` at most."""
    open_pages: set[WebSocket] = set()

    async def front(request: Request) -> Response:
        if not door.knows(request):
            return PlainTextResponse(REFUSED, 403)
        return Response((STATIC / page).read_bytes(), media_type="text/html")

    async def live(socket: WebSocket) -> None:
        if not door.trusts(socket) or len(open_pages) >= MAX_PAGES:
            await socket.close()  # before it was accepted: an HTTP answer 403
            return
        await socket.accept()
        open_pages.add(socket)
        try:
            await attend(socket)
        finally:
            open_pages.discard(socket)

    routes = [
        Route("/", front),
        WebSocketRoute("/live", live),
        Mount("/static", StaticFiles(directory=STATIC)),
    ]
    app = Starlette(routes=routes)
    app.add_middleware(Headers)
    return app


class Headers:
    """Adds to every answer what keeps a browser from doing more than it must."""

    def __init__(self, app: ASGIApp) -> None:
        self.app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def send_on(message: Message) -> None:
            if message["type"] == "http.response.start":
                headers = MutableHeaders(scope=message)
                host = HTTPConnection(scope).headers.get("host", "")
                headers["Content-Security-Policy"] = content_policy(host)
                headers["X-Content-Type-Options"] = "nosniff"
                headers["Referrer-Policy"] = "no-referrer"
                headers["Cross-Origin-Resource-Policy"] = "same-origin"
                headers["Cache-Control"] = "no-store"
            await send(message)

        await self.app(scope, receive, send_on if scope["type"] == "http" else send)


def content_policy(host: str) -> str:
    """What the page may load and to whom it may speak: this server, and nobody else."""
    socket = f" ws://{host}" if host and all(c.isalnum() or c in ".:-[]" for c in host) else ""
    return (
        f"default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'{socket}; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
