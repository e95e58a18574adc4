"""The console: the operator's page, served by the program itself, and the one WebSocket behind it.

`server` owns the port, `app` the routes and who may use them, `session` one open page, `incoming` and `outgoing` what
all messages have in common. `features/` has a module for each thing that a page can ask, and `registry` collects them;
`backend` is the desk behind them (`replay`: for a recording, `network`: for robots on the air), `driver` lets swarm and
server take turns, `frames` draws the moving picture, `renewal` puts another run in the place of the one that is shown;
`static/` is the page, served as written. What is shown is a `view`; `adapters/` puts things into that shape. Pages
of packages, those of Nomads among them, use all of this.
"""

from sleepcast.console.network import SafetyOrder
from sleepcast.console.server import (
    DEFAULT_PORT,
    Address,
    PortError,
    serve,
    serve_backend,
    serve_fleet,
    serve_runs,
)
from sleepcast.console.view import KeptRule, MapLabel, MindView, NamedOutline, Outline, PaceControl, Scene, SwarmView

__all__ = [
    "DEFAULT_PORT",
    "Address",
    "KeptRule",
    "MapLabel",
    "MindView",
    "NamedOutline",
    "Outline",
    "PaceControl",
    "PortError",
    "SafetyOrder",
    "Scene",
    "SwarmView",
    "serve",
    "serve_backend",
    "serve_fleet",
    "serve_runs",
]
