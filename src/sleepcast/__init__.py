"""sleepcast: one broadcast expression, and every robot decides for itself whether it is meant.

    import sleepcast as sc

    fleet = sc.open("bravo", seed=7)

The names of the front door (`sleepcast.api`) are loaded when they are first used, so that `import sleepcast.language`
stays light.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING

from sleepcast.core.version import VERSION

if TYPE_CHECKING:
    from sleepcast import language
    from sleepcast.api.commands import Fleet
    from sleepcast.api.connected import ConnectedFleet, connect
    from sleepcast.api.events import FleetEvent
    from sleepcast.api.fleet import SimulatedFleet, open, resume
    from sleepcast.api.history import History
    from sleepcast.api.mission import Mission
    from sleepcast.api.payload import SimulatedBody
    from sleepcast.api.results import CommandResult
    from sleepcast.api.table import DataTable
    from sleepcast.api.worlds import WorldHistory, WorldResults, Worlds, open_many
    from sleepcast.core import errors

__version__ = VERSION
__all__ = [
    "CommandResult",
    "ConnectedFleet",
    "DataTable",
    "Fleet",
    "FleetEvent",
    "History",
    "Mission",
    "SimulatedBody",
    "SimulatedFleet",
    "WorldHistory",
    "WorldResults",
    "Worlds",
    "connect",
    "errors",
    "language",
    "open",
    "open_many",
    "resume",
]

_PARTS = {"errors": "sleepcast.core.errors", "language": "sleepcast.language"}
"""Modules by their names here."""
_MODULES = {
    "CommandResult": "sleepcast.api.results",
    "Fleet": "sleepcast.api.commands",
    **dict.fromkeys(("ConnectedFleet", "connect"), "sleepcast.api.connected"),
    **dict.fromkeys(("SimulatedFleet", "open", "resume"), "sleepcast.api.fleet"),
    "DataTable": "sleepcast.api.table",
    "FleetEvent": "sleepcast.api.events",
    "History": "sleepcast.api.history",
    "Mission": "sleepcast.api.mission",
    "SimulatedBody": "sleepcast.api.payload",
    **dict.fromkeys(("WorldHistory", "WorldResults", "Worlds", "open_many"), "sleepcast.api.worlds"),
}
"""Where each other name is."""


def __getattr__(name: str) -> object:
    if name in _PARTS:
        named: object = import_module(_PARTS[name])
    elif name in _MODULES:
        named = getattr(import_module(_MODULES[name]), name)
    else:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    globals()[name] = named
    return named
