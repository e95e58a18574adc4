"""The server of an experiment's page: it lives in a thread beside the sweep, and ends with it.

The sweep keeps the main thread, so that Ctrl-C does there what it always does. Only this machine can reach the page, by
the token in its address; the same token opens a run: `/run?token=...&number=7` starts the page of that run and leads to
it.
"""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from threading import Event, Thread

from starlette.applications import Starlette
from starlette.requests import Request
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.routing import Route
from starlette.websockets import WebSocket

from sleepcast.console.server import REFUSED, Address, PageAccess, make_app, serve_pages
from sleepcast.core.clock import WallClock
from sleepcast.core.errors import SleepcastError
from sleepcast.experiment_page.opened import OpenedRuns
from sleepcast.experiment_page.session import ExperimentSession
from sleepcast.experiments.findings import SweepFindings

NUMBER = re.compile(r"[0-9]{1,9}")
"""Of a run; there are no more than a million."""


@contextmanager
def experiment_page(
    findings: SweepFindings, folder: Path, *, address: Address, say: Callable[[str], None]
) -> Iterator[None]:
    """Serve the page of an experiment for as long as this is entered. Raises what `serve_pages` raises.

    folder: of its results.
    say: tells the person at the terminal where the page is.
    """
    page = _Page(findings, folder, address, say)
    page.start()
    try:
        yield
    finally:
        page.end()


class _Page:
    """The thread of the server."""

    def __init__(self, findings: SweepFindings, folder: Path, address: Address, say: Callable[[str], None]) -> None:
        self._findings, self._folder, self._address, self._say = findings, str(folder), address, say
        self._runs = OpenedRuns(findings.experiment)
        self._begun = Event()
        self._failed: BaseException | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._over = asyncio.Event()
        self._thread = Thread(target=self._serve, name="page", daemon=True)

    def start(self) -> None:
        """Return as soon as the page is served."""
        self._thread.start()
        self._begun.wait()
        if self._failed is not None:
            raise self._failed

    def end(self) -> None:
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._over.set)
        self._thread.join()
        self._runs.end()

    def _serve(self) -> None:
        try:
            asyncio.run(serve_pages(self._app, self._live, address=self._address, say=self._say))
        except BaseException as error:  # it belongs to the thread that waits for it
            self._failed = error
        finally:
            self._begun.set()

    async def _live(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._begun.set()
        await self._over.wait()

    def _app(self, door: PageAccess) -> Starlette:
        clock = WallClock()

        async def open_run(request: Request) -> Response:
            if not door.knows(request):
                return PlainTextResponse(REFUSED, 403)
            number = request.query_params.get("number", "")
            run = self._findings.run(int(number)) if NUMBER.fullmatch(number) else None
            if run is None:
                return PlainTextResponse(f"There is no finished run of the number {number:.20}.\n", 404)
            try:
                return RedirectResponse(await asyncio.to_thread(self._runs.address_of, run), 303)
            except SleepcastError as error:
                return PlainTextResponse(f"{error}\n", 500)

        async def attend(socket: WebSocket) -> None:
            await ExperimentSession(socket, self._findings, self._folder, clock).run()

        return make_app("experiment/index.html", door, attend, [Route("/run", open_run)])
