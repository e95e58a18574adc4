"""The Nomad wire: a server that programs of the Nomad's day run against.

units -> wire -> requests -> state -> records -> behaviour -> session -> line -> server

The wire is pure (bytes in, requests out; words in, bytes out) and so is a session with one client; sockets and time
come in with lines and the server. Lengths in inches live in `units` alone.
"""

from sleepcast.nomad.pace import Pace
from sleepcast.nomad.server import DEFAULT_PORT, Nserver, ServerError, commands, own_addresses
from sleepcast.nomad.windows import RobotWindow, Sketch, Windows

__all__ = [
    "DEFAULT_PORT",
    "Nserver",
    "Pace",
    "RobotWindow",
    "ServerError",
    "Sketch",
    "Windows",
    "commands",
    "own_addresses",
]
