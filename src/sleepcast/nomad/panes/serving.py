"""The page of Nomads, served until they have ended."""

from __future__ import annotations

from collections.abc import Callable
from importlib.resources import files
from pathlib import Path

from starlette.applications import Starlette

from sleepcast.console.page_parts import PagePart, whole_page
from sleepcast.console.server import Address, PageAccess, make_app, serve_pages
from sleepcast.console.session import PageSession
from sleepcast.core.clock import Clock
from sleepcast.nomad.panes import features
from sleepcast.nomad.panes.backend import NomadsBackend
from sleepcast.nomad.panes.dialogue import NomadDialogue
from sleepcast.nomad.panes.view import Nomads

NAME = "nomads"
"""Of their page among those that packages add."""
PAGE = PagePart(
    Path(str(files("sleepcast.nomad.panes"))) / "static",
    "nomadpanes.js",
    style="nomads.css",
    pieces="pieces.html",
    features=features,
    whole=True,
)


async def serve_nomads(
    nomads: Nomads,
    clock: Clock,
    *,
    address: Address,
    say: Callable[[str], None],
    port_option: str = "--port",
) -> None:
    """Serve the page of Nomads until Ctrl-C, or until they have ended.

    The rest is as for `serve_pages`.
    """
    parts = whole_page(NAME)
    desk = NomadsBackend(nomads, clock)

    def app(door: PageAccess) -> Starlette:
        return make_app(
            "index.html", door, lambda socket: PageSession(socket, NomadDialogue(desk), clock).run(), parts=parts
        )

    await serve_pages(
        app,
        desk.live,
        address=address,
        say=say,
        port_option=port_option,
    )
