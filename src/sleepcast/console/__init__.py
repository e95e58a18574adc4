"""The console: the operator's page, served by the program itself, and the one WebSocket behind it.

`server` owns the port, `app` the routes and who may use them, `session` one open page, `desk` what a page can ask and
is told, `driver` the turns of swarm and server, `frames` the moving picture, `replay` a recording in the place of a
living swarm, `air` robots on the air; `static/` is the page, served as written. The Nomads' page has the same server
and door: `nomad` says what it shows, `nomad_session` is one open page, `nomad_desk` what it can ask, `nomad_pictures`
what it lacks.
"""

from sleepcast.console.air import Order
from sleepcast.console.server import DEFAULT_PORT, Address, PortError, serve, serve_desk, serve_fleet, serve_nomads
from sleepcast.console.swarm import Outline, Pace, Place, ReadyCommand, RobotMind, Rule, Scene, Swarm

__all__ = [
    "DEFAULT_PORT",
    "Address",
    "Order",
    "Outline",
    "Pace",
    "Place",
    "PortError",
    "ReadyCommand",
    "RobotMind",
    "Rule",
    "Scene",
    "Swarm",
    "serve",
    "serve_desk",
    "serve_fleet",
    "serve_nomads",
]
