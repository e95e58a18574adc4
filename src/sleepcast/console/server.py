"""The web server: the page's files, the one WebSocket, who may open either, the port, and a clean end.

The printed address carries a token, which the page itself and its socket require; the other files hold no secret. The
page takes the token out of the browser's address bar; when it is loaded again, the browser has it (`static/token.js`).
A request must name the host that was asked for, and a socket must be opened by a page of this server: another site's
script in the same browser can neither connect nor read.
"""

from __future__ import annotations

import asyncio
import errno
import logging
import os
import re
import socket
import sys
import webbrowser
from collections.abc import Awaitable, Callable, Coroutine, Iterable, Sequence
from contextlib import AbstractContextManager, closing, nullcontext
from secrets import compare_digest, token_urlsafe
from typing import Any

import uvicorn
from starlette.applications import Starlette
from starlette.datastructures import MutableHeaders
from starlette.requests import HTTPConnection, Request
from starlette.responses import HTMLResponse, Response
from starlette.routing import Mount, Route, WebSocketRoute
from starlette.staticfiles import StaticFiles
from starlette.types import ASGIApp, Message, Receive, Scope, Send
from starlette.websockets import WebSocket

from sleepcast.console.backend import Backend
from sleepcast.console.driver import Driver
from sleepcast.console.incoming import MAX_BYTES
from sleepcast.console.joining import PageFiles, read, with_joined_styles
from sleepcast.console.lobby import Greeter, Lobby, LobbyServer, Quiet, protocol_in
from sleepcast.console.network import FleetOnAir, NetworkBackend
from sleepcast.console.page_parts import Parts, added_parts, with_parts
from sleepcast.console.past import Past
from sleepcast.console.renewal import RunSwitcher
from sleepcast.console.replay import ReplayBackend
from sleepcast.console.session import PageSession
from sleepcast.console.swarm_dialogue import SwarmDialogue
from sleepcast.console.view import PaceControl, SwarmView
from sleepcast.core.clock import Clock, WallClock
from sleepcast.core.doorkeeper import sentences_of
from sleepcast.core.errors import MisuseError, SleepcastError
from sleepcast.core.hosts import is_loopback
from sleepcast.core.records import dataclass
from sleepcast.station import Station
from sleepcast.station.network import NetworkStation

DEFAULT_PORT = 8317
"""The port unless another is wanted: always the same, so that the browser finds the history of last time."""
HIGHEST_PORT = 65_535
NAME = re.compile(r"[A-Za-z0-9._\[\]:-]{1,261}")
"""A host with or without a port, as browsers write it."""
ANY_ADDRESS = frozenset({"0.0.0.0", "::"})
"""Hosts that stand for every address of this machine; no browser can open them."""
FAREWELL = 1
"""Seconds that open connections get to end."""
QUIET = Quiet()
NOTHING = nullcontext()
"""Nothing that is to be begun with a page and ended with it."""


class PortError(SleepcastError):
    """The address cannot be listened on."""


@dataclass(frozen=True, slots=True)
class Address:
    """Where a page is served.

    host, port: 0 is any free port
    insecure: allow a host that others can reach, though nothing is encrypted
    browser: open the page there at once
    allow: extra allowed Host names, besides the addresses of this machine
    """

    host: str
    port: int
    insecure: bool
    browser: bool
    allow: tuple[str, ...] = ()


def serve(
    swarm: SwarmView,
    station: Station,
    pace: PaceControl,
    clock: Clock,
    *,
    address: Address,
    say: Callable[[str], None],
    past: Past | None = None,
    around: AbstractContextManager[object] = NOTHING,
) -> None:
    """Serve the page and let the swarm run until Ctrl-C, which is raised on as KeyboardInterrupt after a clean stop.

    past: see `Backend`. The rest is as for `serve_backend`.
    """
    desk = Backend(swarm, station, Driver(swarm, pace, clock), clock, past=past)
    serve_backend(desk, clock, address=address, say=say, around=around)


def serve_runs(runs: RunSwitcher, clock: Clock, *, address: Address, say: Callable[[str], None]) -> None:
    """The same for a run that others may follow.

    The rest is as for `serve_backend`.
    """
    application = _application(lambda: runs.desk, clock, say)
    asyncio.run(serve_pages(application, runs.live, address=address, say=say, around=runs))


def serve_fleet(
    fleet: FleetOnAir,
    station: NetworkStation,
    clock: Clock,
    began: float,
    *,
    address: Address,
    say: Callable[[str], None],
    alerts: Iterable[str] = (),
) -> None:
    """Serve the page of robots on the air until Ctrl-C. began: the station's time with which that of the page begins.
    alerts: tests that are watched from the start; their firings are told to the person at the terminal, too.

    The rest is as for `serve_backend`.
    """
    desk = NetworkBackend(fleet, station, clock, began)
    desk.alerts.watch(alerts, say)
    serve_backend(desk, clock, address=address, say=say)


def serve_backend(
    desk: Backend | ReplayBackend,
    clock: Clock,
    *,
    address: Address,
    say: Callable[[str], None],
    around: AbstractContextManager[object] = NOTHING,
) -> None:
    """Serve the page of a desk until Ctrl-C.

    The rest is as for `serve_pages`.
    """
    application = _application(lambda: desk, clock, say)
    asyncio.run(serve_pages(application, desk.live, address=address, say=say, around=around))


def _application(
    desk: Callable[[], Backend | ReplayBackend], clock: Clock, say: Callable[[str], None]
) -> Callable[[PageAccess], Starlette]:
    """The application of a swarm's page, for the door that it is given. desk: that of a page which is opened now."""
    return lambda door: make_app(
        "index.html",
        door,
        lambda socket: PageSession(socket, SwarmDialogue(desk()), clock).run(),
        parts=added_parts(say),
    )


async def serve_pages(
    make: Callable[[PageAccess], Starlette],
    live: Callable[[], Coroutine[Any, Any, None]],
    *,
    address: Address,
    say: Callable[[str], None],
    port_option: str = "--port",
    around: AbstractContextManager[object] = NOTHING,
) -> None:
    """Serve an application until Ctrl-C, or until what it shows has ended.

    make: gives the application that this door is for
    live: lets what is shown live
    address: where
    say: tells the person at the terminal what is going on
    port_option: the option for the port
    around: entered once there is a port, before anybody hears of it, and left when all has ended

    Raises MisuseError for a host that others can reach, PortError for a port that is taken or forbidden.
    """
    _check_host(address.host, address.insecure)
    hosts = hosts_of(address.host, address.allow)
    listener = listen(address.host, address.port, port_option)
    token = token_urlsafe(16)
    taken: int = listener.getsockname()[1]
    url = f"http://{_in_url(_reachable(address.host))}:{taken}/?token={token}"
    door, lobby = PageAccess(token, hosts, taken), Lobby(WallClock(), say)
    config = uvicorn.Config(
        Greeter(make(door), lobby, door.knows),
        http=protocol_in(lobby),
        backlog=lobby.at_once,
        log_level="error",
        access_log=False,
        ws_max_size=MAX_BYTES,
        ws_per_message_deflate=False,
        timeout_graceful_shutdown=FAREWELL,
        server_header=False,
        lifespan="off",
    )
    with closing(listener), around:
        say(_invitation(url, address.browser))  # from here on Ctrl-C ends the loop in good order
        asyncio.get_running_loop().set_exception_handler(sentences_of(say))
        logging.getLogger("asyncio").addFilter(QUIET)
        await _run(LobbyServer(config), live, lobby, listener)


async def _run(
    server: uvicorn.Server, live: Callable[[], Coroutine[Any, Any, None]], lobby: Lobby, listener: socket.socket
) -> None:
    """Serve while that runs; what ends it ends the server and is raised."""
    running, sweeping = asyncio.create_task(live()), asyncio.create_task(lobby.sweep())
    running.add_done_callback(lambda _: setattr(server, "should_exit", True))
    try:
        await server.serve(sockets=[listener])
    finally:
        running.cancel()
        sweeping.cancel()
        await asyncio.wait({running, sweeping})
    if not running.cancelled():
        running.result()


def listen(host: str, port: int, option: str = "--port") -> socket.socket:
    """A socket that listens. Raises PortError, with a sentence that names the port and offers another by `option`."""
    family = socket.AF_INET6 if ":" in host else socket.AF_INET
    listener = socket.socket(family, socket.SOCK_STREAM)
    listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listener.bind((host, port))
        listener.listen()
    except OSError as error:
        listener.close()
        raise PortError(_why_not(host, port, error, option)) from None
    return listener


def _why_not(host: str, port: int, error: OSError, option: str = "--port") -> str:
    if error.errno == errno.EADDRINUSE:
        other = port + 1 if port < HIGHEST_PORT else DEFAULT_PORT
        return (
            f"port {port} of {host} is in use, perhaps by another sleepcast: "
            f"stop that one, or take another port with {option} {other} ({option} 0 finds a free one)"
        )
    if error.errno == errno.EACCES:
        return f"port {port} needs more rights than you have: take one above 1023, such as {option} {DEFAULT_PORT}"
    return f"cannot listen on {host} port {port}: {error.strerror or error}"


def _check_host(host: str, insecure: bool) -> None:
    if not is_loopback(host) and not insecure:
        raise MisuseError(
            f"{host} can be reached by others, and what goes between the page and sleepcast is not encrypted: "
            "anybody who reads it can command the robots. Use 127.0.0.1, or add --insecure on a network of your own"
        )


def hosts_of(host: str, allow: Sequence[str]) -> frozenset[str]:
    """The names by which a page that is served at `host` may be asked for, besides the address at which a request
    arrives: a page that lets another name point here (DNS rebinding) reaches nothing. allow: names that a person adds.
    Raises MisuseError for what is no name."""
    for name in allow:
        if not NAME.fullmatch(name):
            raise MisuseError(f"--allow-host {name!r:.100}: wanted a name, as robots.local or robots.local:8317")
    return frozenset(_in_url(name).casefold() for name in (*LOOPBACK, *([] if host in ANY_ADDRESS else [host]), *allow))


def _reachable(host: str) -> str:
    """An address that can be opened: where `host` stands for all of this machine's, the one by which it reaches others.
    Nothing is sent to find that out."""
    if host not in ANY_ADDRESS:
        return host
    family, somewhere = (socket.AF_INET6, "2001:db8::1") if ":" in host else (socket.AF_INET, "192.0.2.1")
    with socket.socket(family, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect((somewhere, 9))
            return str(probe.getsockname()[0])
        except OSError:  # this machine is on no network
            return "::1" if ":" in host else "127.0.0.1"


def _in_url(host: str) -> str:
    """A host as it stands in an address."""
    return f"[{host}]" if ":" in host and not host.startswith("[") and host.count(":") > 1 else host


def _invitation(address: str, open_browser: bool) -> str:
    """What to say at the start. The browser is only asked to open the page: the server answers a moment later. Without
    a screen a text browser could take over this terminal."""
    screen = sys.platform == "darwin" or bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
    try:
        opened = open_browser and screen and webbrowser.open(address)
    except (webbrowser.Error, OSError):
        opened = False
    what = "Opened in your browser" if opened else "Open this address in a browser on this machine"
    return f"{what}:\n  {address}\nCtrl-C ends it."


# ---- the web application

PORT = re.compile(r":\d+$")
"""What a host ends in that has a port of its own."""
MAX_PAGES = 16
"""Pages that may be open at one time; each gets its own frames."""
LOOPBACK = ("127.0.0.1", "localhost", "[::1]")

REFUSED = (
    "This is sleepcast, but the address lacks the right token.\n"
    "Open the address that was printed where sleepcast was started; it changes with every start.\n"
)
ENTRANCE = f"""<!doctype html>
<html lang="en">
<meta charset="utf-8">
<meta name="viewport" content="width=device-width">
<meta name="color-scheme" content="light dark">
<title>sleepcast</title>
<link rel="icon" href="static/icon.svg">
<p hidden>{REFUSED.replace(chr(10), " ").strip()}</p>
<noscript>{REFUSED.replace(chr(10), " ").strip()}</noscript>
<script type="module" src="static/enter.js"></script>
</html>
"""
"""What is served in place of the page without the token: a browser that was here before finds it again. An address that
carries none is no error yet, or each time that a page is loaded again would look like one."""


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

    def is_foreign(self, connection: HTTPConnection) -> bool:
        """Whether it names a host of somebody else's."""
        return not self._names_us(connection.headers.get("host", "").casefold(), connection)

    def _names_us(self, host: str, connection: HTTPConnection) -> bool:
        arrived = (connection.scope.get("server") or ("",))[0]
        here = f"[{arrived}]" if ":" in arrived else arrived
        return host in self._hosts or host == f"{here}:{self._port}"

    def trusts(self, socket: WebSocket) -> bool:
        """Whether, besides, the socket was opened by a page of this very server."""
        origin = socket.headers.get("origin", "")
        scheme = "https" if socket.url.scheme == "wss" else "http"
        return origin == f"{scheme}://{socket.headers.get('host', '')}" and self.knows(socket)


def make_app(
    page: str,
    door: PageAccess,
    attend: Callable[[WebSocket], Awaitable[None]],
    more: Sequence[Route] = (),
    parts: Parts = (),
) -> Starlette:
    """The application.

    page: its file in `static/`.
    door: who may come in.
    attend: serves one open page until it goes away; there are `MAX_PAGES` at most.
    more: routes of this page alone.
    parts: what packages add to it.
    """
    open_pages: set[WebSocket] = set()

    async def front(request: Request) -> Response:
        if not door.knows(request):
            return HTMLResponse(ENTRANCE, 403 if door.is_foreign(request) or "token" in request.query_params else 200)
        text = with_parts(with_joined_styles(read(page)), parts)
        return Response(text, media_type="text/html")

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
        *(Mount(f"/static/{name}", StaticFiles(directory=part.static)) for name, part in parts),
        Mount("/static", PageFiles()),
        *more,
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
    """What the page may load and connect to: this server only."""
    socket = f" ws://{host}" if host and all(c.isalnum() or c in ".:-[]" for c in host) else ""
    return (
        f"default-src 'none'; script-src 'self'; style-src 'self'; img-src 'self'; connect-src 'self'{socket}; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    )
