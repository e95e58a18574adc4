"""The Nomad wire: a server that programs of the Nomad's day run against.

units -> wire -> requests -> state -> simulated_robot -> session -> answers -> server_connection -> server

The wire is pure (bytes in, requests out; words in, bytes out) and so is a session with one client; sockets and time
come in with connections and the server. Lengths in inches live in `units` alone.
"""

from sleepcast.nomad.relay import RealAddress, real_robot
from sleepcast.nomad.server import (
    DEFAULT_PORT,
    Nserver,
    ServerError,
    ServerPace,
    listening_places,
    own_addresses,
    unheard,
)
from sleepcast.nomad.simulated_robot import SimulatedRobot
from sleepcast.nomad.windows import RobotWindow, Sketch, Windows

__all__ = [
    "DEFAULT_PORT",
    "Nserver",
    "RealAddress",
    "RobotWindow",
    "ServerError",
    "ServerPace",
    "SimulatedRobot",
    "Sketch",
    "Windows",
    "listening_places",
    "own_addresses",
    "real_robot",
    "unheard",
]
