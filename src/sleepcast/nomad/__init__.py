"""Nomads, the robots of 1998, as a plug-in: everything that only they need stands here, and nobody else imports it.

    wire      bytes and words of their protocol, pure: units -> encoding -> requests -> state
    client    a robot behind a server, for Python programs (`sleepcast.nomad.client.Nomad`)
    bridge    such a robot as a body for a mind: `nomad://HOST:PORT#1`
    server    the server that programs of their day run against: simulated_robot -> session -> answers -> nserver
    world     simulated Nomads, in worlds from files
    panes     their page
    command   `sleepcast nserver`

sleepcast finds all of it by entry points (`core/extensions.py`), as it finds what other packages add.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sleepcast.nomad.server.nserver import (
        DEFAULT_PORT,
        Nserver,
        ServerError,
        ServerPace,
        listening_places,
        own_addresses,
        unheard,
    )
    from sleepcast.nomad.server.relay import RealAddress, real_robot
    from sleepcast.nomad.server.simulated_robot import SimulatedRobot
    from sleepcast.nomad.server.windows import RobotWindow, Sketch, Windows

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

_MODULES = {
    **dict.fromkeys(("RealAddress", "real_robot"), "relay"),
    "SimulatedRobot": "simulated_robot",
    **dict.fromkeys(("RobotWindow", "Sketch", "Windows"), "windows"),
}
"""Where in `server` a name is that is not in `nserver`."""


def __getattr__(name: str) -> object:
    if name not in __all__:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value: object = getattr(import_module(f"{__name__}.server.{_MODULES.get(name, 'nserver')}"), name)
    globals()[name] = value
    return value
